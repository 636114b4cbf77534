/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Conversions for inertial boards of any protocol, from readings (boards/sensing/sensing.h) to
 * reported values. RT-safe.
 *
 * The orientation is the sensor's reading: the true attitude, or the output of the filter that the
 * rig's key `ahrs` selects, with the errors of the key `orientation`. The values below are computed
 * from the orientation, without another filter:
 *
 * Euler angles: roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll). R rotates from the
 * sensor's axes to the world's, z up. Pitch is within +-90 degrees, roll and yaw within +-180.
 *
 * Gravity: the reading of an accelerometer at rest, 9.81 m/s2 upwards, in the sensor's axes.
 *
 * Linear acceleration: acceleration minus gravity; 0 at rest, 9.81 m/s2 downwards in free fall.
 *
 * Units: SI, rad.
 */
#ifndef BOARDS_SENSING_INERTIAL_H
#define BOARDS_SENSING_INERTIAL_H

#include "model/plant_io.h"

struct inertial_values {
    double acceleration_m_s2[3]; /* measured specific force */
    double magnetic_t[3];
    double rate_rad_s[3];
    double euler_rad[3];  /* roll, pitch, yaw */
    double quaternion[4]; /* wxyz, from sensor to world, w >= 0 */
    double linear_m_s2[3];
    double gravity_m_s2[3];
    bool oriented; /* false = without an orientation; all values that need it are 0 */
};

/* Derives all values from the readings. fused false: derives them without an orientation. */
void inertial_derive(const struct imu_sense *sense, bool fused, struct inertial_values *values);

/* Converts a value to counts: value / worth, where worth is the value of one count. Returns false
 * if the counts saturate to an i16. For a value that is not finite, keeps *counts and sets *bad. */
bool inertial_quantize(double value, double worth, int64_t *counts, bool *bad);

#endif
