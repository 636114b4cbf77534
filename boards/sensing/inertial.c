/* SPDX-License-Identifier: Apache-2.0 */
/* Computes Euler angles, gravity and linear acceleration from the sensors' readings. */
#include "boards/sensing/inertial.h"

#include "base/portable_math.h"
#include "base/vec3.h"
#include "boards/axis.h"

#include <string.h>

static const double GRAVITY_M_S2 = 9.81; /* assumed (D): the constant of the sensor */

void inertial_derive(const struct imu_sense *sense, bool fused, struct inertial_values *values)
{
    const double *q = sense->quaternion;
    double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    double R[9], k;

    *values = (struct inertial_values){.oriented = fused && isfinite(square) && square > 0.25};
    memcpy(values->acceleration_m_s2, sense->accel_m_s2, sizeof values->acceleration_m_s2);
    memcpy(values->magnetic_t, sense->magnetic_t, sizeof values->magnetic_t);
    memcpy(values->rate_rad_s, sense->gyro_rad_s, sizeof values->rate_rad_s);
    if (!values->oriented) {
        return;
    }
    /* Normalize the quaternion and make w not negative */
    k = (q[0] < 0.0 ? -1.0 : 1.0) / sqrt(square);
    for (int i = 0; i < 4; i++) {
        values->quaternion[i] = k * q[i];
    }
    mat3_from_quaternion(values->quaternion, R);
    /* Compute roll, pitch and yaw of R = Rz Ry Rx. The last row of R is up in the sensor's axes */
    values->euler_rad[0] = portable_atan2(R[7], R[8]);
    values->euler_rad[1] = -portable_asin(fmax(-1.0, fmin(1.0, R[6])));
    values->euler_rad[2] = portable_atan2(R[3], R[0]);
    for (int i = 0; i < 3; i++) {
        values->gravity_m_s2[i] = GRAVITY_M_S2 * R[6 + i];
        values->linear_m_s2[i] = values->acceleration_m_s2[i] - values->gravity_m_s2[i];
    }
}

bool inertial_quantize(double value, double worth, int64_t *counts, bool *bad)
{
    int32_t all;

    if (!control_quantize(value / worth, &all)) {
        *bad = true;
        return true;
    }
    *counts = control_clamp(all, INT16_MIN, INT16_MAX);
    return all == *counts;
}
