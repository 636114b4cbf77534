/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tangents of the native engine from the moments of spring weights: in the world's directions,
 * about the tangent's center, stored as in struct contact_tangent. SI units. The caller owns all
 * memory; nothing fails; all is RT-safe.
 */
#ifndef CONTACT_NATIVE_MOMENTS_H
#define CONTACT_NATIVE_MOMENTS_H

#include "contact/contact.h"
#include "base/vec3.h"

#include <string.h>

/* Moments of a weight w over springs at r: sums of w, w r and w r r. */
struct moments {
    double zeroth, first[3], second[6]; /* xx xy xz yy yz zz */
};

/* Computes the second moments about c from the moments about the origin. */
static inline void moments_shift_second(const struct moments *m, const double c[3],
                                        double second[6])
{
    const double w = m->zeroth, *s = m->first;
    /* first moment about c */
    const double rest[3] = {s[0] - w * c[0], s[1] - w * c[1], s[2] - w * c[2]};

    second[0] = m->second[0] - c[0] * (s[0] + rest[0]);
    second[1] = m->second[1] - c[0] * s[1] - c[1] * rest[0];
    second[2] = m->second[2] - c[0] * s[2] - c[2] * rest[0];
    second[3] = m->second[3] - c[1] * (s[1] + rest[1]);
    second[4] = m->second[4] - c[1] * s[2] - c[2] * rest[1];
    second[5] = m->second[5] - c[2] * (s[2] + rest[2]);
}

/* Computes y = A x for a symmetric matrix A = xx xy xz yy yz zz. */
static inline void moments_apply_second(const double A[6], const double x[3], double y[3])
{
    y[0] = A[0] * x[0] + A[1] * x[1] + A[2] * x[2];
    y[1] = A[1] * x[0] + A[3] * x[1] + A[4] * x[2];
    y[2] = A[2] * x[0] + A[4] * x[1] + A[5] * x[2];
}

/* Adds to T an isotropic resistance against the velocity v + w x r at r: T += scale sum w [I, -[r];
 * [r], r^2 I - r r']. */
static inline void tangent_add_across(double scale, const struct moments *m,
                                      double T[CONTACT_TANGENT_SIZE])
{
    const double s = m->zeroth, x = m->first[0], y = m->first[1], z = m->first[2];
    const double xx = m->second[0], xy = m->second[1], xz = m->second[2];
    const double yy = m->second[3], yz = m->second[4], zz = m->second[5];
    const double across[CONTACT_TANGENT_SIZE] = {
        s, 0, 0, 0, z, -y, s, 0, -z, 0, x, s, y, -x, 0, yy + zz, -xy, -xz, xx + zz, -yz, xx + yy};

    for (int at = 0; at < CONTACT_TANGENT_SIZE; at++) {
        T[at] += scale * across[at];
    }
}

/* T += sum w J'J with J = [d, r x d]: a resistance along the direction d. zeroth, arm and outer
 * are the sums of w, w r x d and w (r x d)(r x d)'. */
static inline void tangent_add_directions(double zeroth, const double arm[3],
                                          const double second[6], const double d[3],
                                          double T[CONTACT_TANGENT_SIZE])
{
    int at = 0;

    for (int i = 0; i < 3; i++) {
        const double along = zeroth * d[i];

        for (int j = i; j < 3; j++, at++) {
            T[CONTACT_TANGENT_AT(i, j)] += along * d[j];
            T[CONTACT_TANGENT_AT(CONTACT_TURN_X + i, CONTACT_TURN_X + j)] += second[at];
        }
        for (int j = 0; j < 3; j++) {
            T[CONTACT_TANGENT_AT(i, CONTACT_TURN_X + j)] += d[i] * arm[j];
        }
    }
}

/* T += scale sum w J'J with J = [d, r x d], from the moments of w. All springs have the same d. */
static inline void tangent_add_along(double scale, const struct moments *m, const double d[3],
                                     double T[CONTACT_TANGENT_SIZE])
{
    const double *s = m->second;
    const double cross[9] = {0, d[2], -d[1], -d[2], 0,
                             /* matrix of r -> r x d */
                             d[0], d[1], -d[0], 0};
    const double S[9] = {s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5]};
    double turn[3], half[9];

    vec3_cross(m->first, d, turn);
    mat3_mul(cross, S, half);
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            T[CONTACT_TANGENT_AT(i, j)] += scale * (m->zeroth * d[i] * d[j]);
            T[CONTACT_TANGENT_AT(CONTACT_TURN_X + i, CONTACT_TURN_X + j)] +=
                scale * vec3_dot(half + 3 * i, cross + 3 * j);
        }
        for (int j = 0; j < 3; j++) {
            T[CONTACT_TANGENT_AT(i, CONTACT_TURN_X + j)] += scale * (d[i] * turn[j]);
        }
    }
}

#endif
