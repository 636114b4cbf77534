/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Conversions of inertial boards, whatever they speak: from what was measured
 * (boards/sensing/sensing.h) to what they tell. RT-safe.
 *
 * The orientation is the sensor's own as measured: the true attitude, or that of the filter which
 * the rig's key `ahrs` asks for, with the errors of the key `orientation`. No filter runs here;
 * everything derived follows from it:
 *
 * Euler angles: roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll), R from the sensor's axes to
 * the world's, z up; pitch within +-90 degrees, the others within +-180.
 *
 * Gravity: what an accelerometer at rest reads, 9.81 m/s2 along up, in the sensor's axes.
 *
 * Linear acceleration: acceleration less gravity, 0 at rest, 9.81 m/s2 down in free fall.
 *
 * Units: SI, rad.
 */
#ifndef BOARDS_SENSING_INERTIAL_H
#define BOARDS_SENSING_INERTIAL_H

#include "model/plant_io.h"

struct inertial_values {
    double acceleration_m_s2[3]; /* specific force, as measured */
    double magnetic_t[3];
    double rate_rad_s[3];
    double euler_rad[3];  /* roll, pitch, yaw */
    double quaternion[4]; /* wxyz, sensor to world, w not negative */
    double linear_m_s2[3];
    double gravity_m_s2[3];
    bool oriented; /* false: no orientation was measured, and all that needs it is 0 */
};

/* fused false: as if no orientation was measured. */
void inertial_derive(const struct imu_sense *sense, bool fused, struct inertial_values *values);

/* Converts to counts = value / worth, within an i16. Returns false when it had to be cut; what
 * is no number leaves counts alone and sets *bad. */
bool inertial_quantize(double value, double worth, int64_t *counts, bool *bad);

#endif
