/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Attitude and heading reference of an inertial sensor: a complementary filter on the special
 * orthogonal group (Mahony, Hamel, Pflimlin, IEEE Transactions on Automatic Control 53(5), 2008),
 * fed by the sensor's own readings. It integrates
 *
 *   R' = R [w - b + kp (a x v) - km s v],   b' = -ki ((a x v) - s v)
 *
 * w is the gyro's rate, a the direction of the specific force, v the world's vertical in the
 * sensor's axes as estimated, s the sine of the angle between magnetic north and the horizontal
 * field as estimated: magnetic disturbances do not tilt it, but a tilt about north turns it by the
 * tangent of the field's dip. The world's x points to magnetic north.
 *
 * What it takes for the vertical is the specific force, so that it errs as real ones do: under a
 * steady horizontal acceleration it tilts by atan(a / g), with tan(half the way left) falling as
 * exp(-kp t); a gyro's bias tilts it by asin(bias / kp) where ki is 0.
 *
 * Units: SI, rad. RT-safe.
 */
#ifndef BOARDS_SENSING_AHRS_H
#define BOARDS_SENSING_AHRS_H

#include <stdbool.h>

struct ahrs_config {
    bool on;
    double accel_per_s;    /* kp */
    double magnetic_per_s; /* km; 0 = the heading is the gyro's alone */
    double bias_per_s2;    /* ki; 0 = no estimation of the gyro's bias */
};

struct ahrs {
    double quaternion[4]; /* wxyz, sensor to world */
    double bias_rad_s[3];
    double rate_rad_s[3]; /* gyro of the last step */
};

/* Aligns it by the specific force and the magnetic field, as at rest; without a field it heads to
 * the world's x. */
void ahrs_align(struct ahrs *ahrs, const double accel_m_s2[3], const double magnetic_t[3],
                const double gyro_rad_s[3]);

/* Updates it by one step of dt_s at whose end the readings were taken; a specific force or field
 * of 0 corrects nothing, and readings too large to compute with leave it as it was. */
void ahrs_update(struct ahrs *ahrs, const struct ahrs_config *config, const double gyro_rad_s[3],
                 const double accel_m_s2[3], const double magnetic_t[3], double dt_s);

#endif
