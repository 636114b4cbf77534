/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Attitude and heading reference of an inertial sensor: a complementary filter on the special
 * orthogonal group (Mahony, Hamel, Pflimlin, IEEE Transactions on Automatic Control 53(5), 2008).
 * Its inputs are the sensor's own readings. It integrates
 *
 *   R' = R [w - b + kp (a x v) - km s v],   b' = -ki ((a x v) - s v)
 *
 * w is the gyro's rate. a is the direction of the specific force. v is the estimated vertical of
 * the world in the sensor's axes. s is the sine of the angle between magnetic north and the
 * estimated horizontal field. The world's x points to magnetic north. Magnetic disturbances do not
 * tilt the attitude. However, a tilt about north changes the heading, by the tilt times the tangent
 * of the field's dip.
 *
 * The filter uses the specific force as the vertical, so it has the errors of real filters. Under a
 * constant horizontal acceleration, the attitude tilts to atan(acceleration / g). The tangent of
 * half the remaining angle decays as exp(-kp t). With ki = 0, a gyro bias tilts the attitude by
 * asin(bias / kp).
 *
 * Units: SI, rad. RT-safe.
 */
#ifndef BOARDS_SENSING_AHRS_H
#define BOARDS_SENSING_AHRS_H

#include <stdbool.h>

struct ahrs_config {
    bool on;
    double accel_per_s;    /* kp, gain of the accelerometer */
    double magnetic_per_s; /* km, gain of the magnetometer; 0 = heading only from the gyro */
    double bias_per_s2;    /* ki, gain of the bias estimate; 0 = no estimate */
};

struct ahrs {
    double quaternion[4]; /* wxyz, from sensor to world */
    double bias_rad_s[3];
    double rate_rad_s[3]; /* gyro reading at the last step */
};

/* Aligns the filter at rest with the specific force and the magnetic field. Without a field, the
 * heading is towards the world's x. */
void ahrs_align(struct ahrs *ahrs, const double accel_m_s2[3], const double magnetic_t[3],
                const double gyro_rad_s[3]);

/* Advances the filter by dt_s. The readings are from the end of the step. A specific force or a
 * field of 0 gives no correction. If a reading overflows, the filter stays unchanged. */
void ahrs_update(struct ahrs *ahrs, const struct ahrs_config *config, const double gyro_rad_s[3],
                 const double accel_m_s2[3], const double magnetic_t[3], double dt_s);

#endif
