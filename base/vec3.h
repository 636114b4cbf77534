/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Arithmetic of 3-vectors, 3x3 matrices and rotations, in C and C++. The model and the contact
 * engines share it.
 *
 * Shapes: vectors double[3]; matrices double[9], row-major; symmetric matrices double[6] as xx xy
 * xz yy yz zz; quaternions double[4] as wxyz. The caller chooses the units; angles are in rad. A
 * result must not overlap an argument, unless the comment permits it ("S <- ..."). The order of
 * operations is part of the contract, because runs of the simulator are compared bit by bit. The
 * functions allocate no memory and cannot fail. RT-safe.
 */
#ifndef BASE_VEC3_H
#define BASE_VEC3_H

#include "base/portable_math.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* ---- vectors ---- */

static inline double vec3_dot(const double x[3], const double y[3])
{
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

static inline double vec3_norm(const double x[3])
{
    return sqrt(vec3_dot(x, x));
}

/* z = x - y; z may be x or y */
static inline void vec3_sub(const double x[3], const double y[3], double z[3])
{
    z[0] = x[0] - y[0];
    z[1] = x[1] - y[1];
    z[2] = x[2] - y[2];
}

/* z = x + s y; z may be x or y */
static inline void vec3_add_scaled(const double x[3], double s, const double y[3], double z[3])
{
    z[0] = x[0] + s * y[0];
    z[1] = x[1] + s * y[1];
    z[2] = x[2] + s * y[2];
}

/* z = x cross y */
static inline void vec3_cross(const double x[3], const double y[3], double z[3])
{
    z[0] = x[1] * y[2] - x[2] * y[1];
    z[1] = x[2] * y[0] - x[0] * y[2];
    z[2] = x[0] * y[1] - x[1] * y[0];
}

/* z += x cross y */
static inline void vec3_add_cross(const double x[3], const double y[3], double z[3])
{
    z[0] += x[1] * y[2] - x[2] * y[1];
    z[1] += x[2] * y[0] - x[0] * y[2];
    z[2] += x[0] * y[1] - x[1] * y[0];
}

/* ---- matrices ---- */

/* y = A x */
static inline void mat3_apply(const double A[9], const double x[3], double y[3])
{
    y[0] = A[0] * x[0] + A[1] * x[1] + A[2] * x[2];
    y[1] = A[3] * x[0] + A[4] * x[1] + A[5] * x[2];
    y[2] = A[6] * x[0] + A[7] * x[1] + A[8] * x[2];
}

/* y = A^T x */
static inline void mat3_apply_transposed(const double A[9], const double x[3], double y[3])
{
    y[0] = A[0] * x[0] + A[3] * x[1] + A[6] * x[2];
    y[1] = A[1] * x[0] + A[4] * x[1] + A[7] * x[2];
    y[2] = A[2] * x[0] + A[5] * x[1] + A[8] * x[2];
}

/* C = A B */
static inline void mat3_mul(const double A[9], const double B[9], double C[9])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
        }
    }
}

/* B = A^T */
static inline void mat3_transpose(const double A[9], double B[9])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            B[3 * i + j] = A[3 * j + i];
        }
    }
}

static inline void mat3_identity(double A[9])
{
    for (int i = 0; i < 9; i++) {
        A[i] = i % 4 == 0 ? 1.0 : 0.0;
    }
}

/* Checks whether A is exactly the identity matrix. */
static inline bool mat3_is_identity(const double A[9])
{
    for (int i = 0; i < 9; i++) {
        if (A[i] != (i % 4 == 0 ? 1.0 : 0.0)) {
            return false;
        }
    }
    return true;
}

/* ---- symmetric matrices ---- */

/* Gives the index of element [row][column] of a symmetric matrix. */
static const unsigned char sym3_index[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* y = S x, S symmetric */
static inline void sym3_apply(const double S[6], const double x[3], double y[3])
{
    y[0] = S[0] * x[0] + S[1] * x[1] + S[2] * x[2];
    y[1] = S[1] * x[0] + S[3] * x[1] + S[4] * x[2];
    y[2] = S[2] * x[0] + S[4] * x[1] + S[5] * x[2];
}

/* S <- R S R^T */
static inline void sym3_rotate(const double R[9], double S[6])
{
    double T[9]; /* R S */

    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            T[3 * i + j] = R[3 * i] * S[sym3_index[0][j]] + R[3 * i + 1] * S[sym3_index[1][j]] +
                           R[3 * i + 2] * S[sym3_index[2][j]];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            S[sym3_index[i][j]] = vec3_dot(T + 3 * i, R + 3 * j);
        }
    }
}

/* ---- rotations ---- */

/* Computes the rotation by an angle about a unit axis (Rodrigues). */
static inline void mat3_about_axis(const double axis[3], double angle, double R[9])
{
    double s = portable_sin(angle), c = portable_cos(angle), t = 1.0 - c;
    double x = axis[0], y = axis[1], z = axis[2];
    const double value[9] = {t * x * x + c,     t * x * y - s * z, t * x * z + s * y,
                             t * x * y + s * z, t * y * y + c,     t * y * z - s * x,
                             t * x * z - s * y, t * y * z + s * x, t * z * z + c};

    memcpy(R, value, sizeof value);
}

/* Computes the rotation of fixed-axis roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll). */
static inline void mat3_from_rpy(const double rpy[3], double R[9])
{
    double cr = portable_cos(rpy[0]), sr = portable_sin(rpy[0]), cp = portable_cos(rpy[1]),
           sp = portable_sin(rpy[1]);
    double cy = portable_cos(rpy[2]), sy = portable_sin(rpy[2]);
    const double value[9] = {cy * cp,
                             cy * sp * sr - sy * cr,
                             cy * sp * cr + sy * sr,
                             sy * cp,
                             sy * sp * sr + cy * cr,
                             sy * sp * cr - cy * sr,
                             -sp,
                             cp * sr,
                             cp * cr};

    memcpy(R, value, sizeof value);
}

/* Computes the quaternion wxyz of Rz(yaw) Ry(pitch) Rx(roll). */
static inline void quaternion_from_rpy(const double rpy[3], double q[4])
{
    double cr = portable_cos(0.5 * rpy[0]), sr = portable_sin(0.5 * rpy[0]);
    double cp = portable_cos(0.5 * rpy[1]), sp = portable_sin(0.5 * rpy[1]);
    double cy = portable_cos(0.5 * rpy[2]), sy = portable_sin(0.5 * rpy[2]);

    q[0] = cy * cp * cr + sy * sp * sr;
    q[1] = cy * cp * sr - sy * sp * cr;
    q[2] = cy * sp * cr + sy * cp * sr;
    q[3] = sy * cp * cr - cy * sp * sr;
}

/* Computes the body-to-world rotation from a quaternion (wxyz). The quaternion may have any
 * non-zero length. */
static inline void mat3_from_quaternion(const double quaternion[4], double R[9])
{
    double w = quaternion[0], x = quaternion[1], y = quaternion[2], z = quaternion[3];
    double k = 2.0 / (w * w + x * x + y * y + z * z);
    double xx = k * x * x, yy = k * y * y, zz = k * z * z;
    double xy = k * x * y, xz = k * x * z, yz = k * y * z;
    double wx = k * w * x, wy = k * w * y, wz = k * w * z;
    const double value[9] = {1.0 - yy - zz, xy - wz, xz + wy, xy + wz,      1.0 - xx - zz,
                             yz - wx,       xz - wy, yz + wx, 1.0 - xx - yy};

    memcpy(R, value, sizeof value);
}

/* Computes the unit quaternion (wxyz) of a rotation, with w >= 0. It derives the other components
 * from the largest one, which avoids a loss of digits (Shepperd, J. Guidance and Control 1(3),
 * 1978). */
static inline void quaternion_from_mat3(const double R[9], double quaternion[4])
{
    const double square[4] = {1.0 + R[0] + R[4] + R[8], 1.0 + R[0] - R[4] - R[8],
                              1.0 - R[0] + R[4] - R[8], 1.0 - R[0] - R[4] + R[8]};
    const double product[4][4] = {
        {square[0], R[7] - R[5], R[2] - R[6], R[3] - R[1]},
        {R[7] - R[5], square[1], R[1] + R[3], R[2] + R[6]},
        {R[2] - R[6], R[1] + R[3], square[2], R[5] + R[7]},
        {R[3] - R[1], R[2] + R[6], R[5] + R[7], square[3]},
    };
    int largest = 0;
    double half;

    for (int i = 1; i < 4; i++) {
        largest = square[i] > square[largest] ? i : largest;
    }
    half = 0.5 / sqrt(square[largest]);
    half = product[largest][0] < 0.0 ? -half : half;
    for (int i = 0; i < 4; i++) {
        quaternion[i] = half * product[largest][i];
    }
}

#endif
