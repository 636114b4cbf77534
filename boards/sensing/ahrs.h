/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Attitude and heading reference of an inertial sensor: a complementary filter on the special
 * orthogonal group (Mahony, Hamel, Pflimlin, IEEE Transactions on Automatic Control 53(5), 2008).
 * Its inputs are the sensor's own readings. It integrates
 *
 *   R' = R [w - b + kp (a x v) - km s v],   b' = -ki ((a x v) - s v)
 *
 * w is the gyro's rate, a the direction of the specific force, v the estimated vertical of the
 * world in the sensor's axes. s is the sine of the angle between magnetic north and the estimated
 * horizontal field. Magnetic disturbances do not tilt the attitude, but a tilt about north turns
 * the heading by the tangent of the field's dip. The world's x points to magnetic north.
 *
 * The filter takes the specific force as the vertical, so it has the errors of real filters. Under
 * a constant horizontal acceleration it tilts to atan(a / g); the tangent of half the remaining
 * angle decays as exp(-kp t). A gyro bias tilts it by asin(bias / kp) if ki is 0.
 *
 * Units: SI, rad. RT-safe.
 */
#ifndef BOARDS_SENSING_AHRS_H
#define BOARDS_SENSING_AHRS_H

#include <stdbool.h>

struct ahrs_config {
    bool on;
    double accel_per_s;    /* kp, gain of the accelerometer */
    double magnetic_per_s; /* km, gain of the magnetometer; 0 = heading from the gyro alone */
    double bias_per_s2;    /* ki, gain of the bias estimate; 0 = no estimate */
};

struct ahrs {
    double quaternion[4]; /* wxyz, from sensor to world */
    double bias_rad_s[3];
    double rate_rad_s[3]; /* gyro reading of the last step */
};

/* Aligns the filter at rest by the specific force and the magnetic field. Without a field, the
 * heading is the world's x. */
void ahrs_align(struct ahrs *ahrs, const double accel_m_s2[3], const double magnetic_t[3],
                const double gyro_rad_s[3]);

/* Advances the filter by dt_s, with readings taken at the end of the step. A specific force or
 * field of 0 gives no correction. Readings that overflow leave the filter unchanged. */
void ahrs_update(struct ahrs *ahrs, const struct ahrs_config *config, const double gyro_rad_s[3],
                 const double accel_m_s2[3], const double magnetic_t[3], double dt_s);

#endif
