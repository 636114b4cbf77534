/* SPDX-License-Identifier: Apache-2.0 */
/* Vectors of three and row-major matrices of nine for the contact engine. RT-safe. */
#ifndef CONTACT_VEC_H
#define CONTACT_VEC_H

#include <math.h>

static inline double vec_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void vec_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void vec_sub(const double a[3], const double b[3], double out[3])
{
    out[0] = a[0] - b[0];
    out[1] = a[1] - b[1];
    out[2] = a[2] - b[2];
}

/* out = a + s b */
static inline void vec_madd(const double a[3], double s, const double b[3], double out[3])
{
    out[0] = a[0] + s * b[0];
    out[1] = a[1] + s * b[1];
    out[2] = a[2] + s * b[2];
}

static inline double vec_norm(const double a[3])
{
    return sqrt(vec_dot(a, a));
}

/* out = M v */
static inline void mat_apply(const double M[9], const double v[3], double out[3])
{
    out[0] = vec_dot(M, v);
    out[1] = vec_dot(M + 3, v);
    out[2] = vec_dot(M + 6, v);
}

/* out = transposed M v */
static inline void mat_apply_t(const double M[9], const double v[3], double out[3])
{
    out[0] = M[0] * v[0] + M[3] * v[1] + M[6] * v[2];
    out[1] = M[1] * v[0] + M[4] * v[1] + M[7] * v[2];
    out[2] = M[2] * v[0] + M[5] * v[1] + M[8] * v[2];
}

#endif
