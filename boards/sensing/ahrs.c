/* SPDX-License-Identifier: Apache-2.0 */
/* Attitude filter of an inertial sensor; boards/sensing/ahrs.h has its equations. */
#include "boards/sensing/ahrs.h"

#include "base/portable_math.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

void ahrs_align(struct ahrs *ahrs, const double accel_m_s2[3], const double magnetic_t[3],
                const double gyro_rad_s[3])
{
    double norm = vec3_norm(accel_m_s2), length, R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    /* rows of R: axes of the world, in axes of the sensor */
    double *north = R, *west = R + 3, *up = R + 6;

    memset(ahrs, 0, sizeof *ahrs);
    memcpy(ahrs->rate_rad_s, gyro_rad_s, sizeof ahrs->rate_rad_s);
    for (int k = 0; k < 3 && norm > 0.0; k++) {
        up[k] = accel_m_s2[k] / norm;
    }
    vec3_cross(up, magnetic_t, west);
    length = vec3_norm(west);
    if (!(length > 0.0)) {
        /* Without a field, north is the sensor's x axis, or its z axis if x is almost vertical */
        const double axis[3] = {fabs(up[0]) < 0.9, 0.0, fabs(up[0]) >= 0.9};

        vec3_cross(up, axis, west);
        length = vec3_norm(west);
    }
    for (int k = 0; k < 3; k++) {
        west[k] /= length;
    }
    vec3_cross(west, up, north);
    quaternion_from_mat3(R, ahrs->quaternion);
    if (!isfinite(ahrs->quaternion[0] + ahrs->quaternion[1] + ahrs->quaternion[2] +
                  ahrs->quaternion[3])) {
        memcpy(ahrs->quaternion, (const double[4]){1, 0, 0, 0}, sizeof ahrs->quaternion);
    }
}

/* Rotates a unit quaternion by a rotation vector in its own frame. */
static void ahrs_turn(double q[4], const double turn[3])
{
    double angle = vec3_norm(turn), sine, cosine, k, x, y, z, norm;
    const double w0 = q[0], x0 = q[1], y0 = q[2], z0 = q[3];

    portable_sincos(0.5 * angle, &sine, &cosine);
    k = angle > 0.0 ? sine / angle : 0.0;
    x = k * turn[0];
    y = k * turn[1];
    z = k * turn[2];
    q[0] = w0 * cosine - x0 * x - y0 * y - z0 * z;
    q[1] = w0 * x + x0 * cosine + y0 * z - z0 * y;
    q[2] = w0 * y - x0 * z + y0 * cosine + z0 * x;
    q[3] = w0 * z + x0 * y - y0 * x + z0 * cosine;
    norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) {
        q[i] /= norm;
    }
}

void ahrs_update(struct ahrs *ahrs, const struct ahrs_config *config, const double gyro_rad_s[3],
                 const double accel_m_s2[3], const double magnetic_t[3], double dt_s)
{
    const struct ahrs before = *ahrs;
    double R[9], tilt[3], heading[3], turn[3], sum = 0.0;

    mat3_from_quaternion(ahrs->quaternion, R);

    /* Compute the corrections of the rate, before multiplication by their gains. The first
     * correction rotates the estimated vertical towards the specific force, about horizontal axes.
     * The second rotates the estimated field towards magnetic north, about the vertical. */
    const double *up = R + 6;
    double force = vec3_norm(accel_m_s2), field[3], level;

    vec3_cross(accel_m_s2, up, tilt);
    mat3_apply(R, magnetic_t, field);
    level = sqrt(field[0] * field[0] + field[1] * field[1]);
    for (int k = 0; k < 3; k++) {
        tilt[k] = force > 0.0 ? tilt[k] / force : 0.0;
        heading[k] = level > 0.0 ? -field[1] / level * up[k] : 0.0;
    }
    for (int k = 0; k < 3; k++) {
        /* Average the rates at both ends of the step */
        double rate = 0.5 * (gyro_rad_s[k] + ahrs->rate_rad_s[k]) - ahrs->bias_rad_s[k];

        turn[k] =
            dt_s * (rate + config->accel_per_s * tilt[k] + config->magnetic_per_s * heading[k]);
        ahrs->bias_rad_s[k] -= dt_s * config->bias_per_s2 *
                               (tilt[k] + (config->magnetic_per_s > 0.0 ? heading[k] : 0.0));
        ahrs->rate_rad_s[k] = gyro_rad_s[k];
        sum += ahrs->bias_rad_s[k];
    }
    ahrs_turn(ahrs->quaternion, turn);

    /* Keep the old attitude if the readings overflow, for example under a fault */
    for (int i = 0; i < 4; i++) {
        sum += ahrs->quaternion[i];
    }
    if (!isfinite(sum)) {
        *ahrs = before;
    }
}
