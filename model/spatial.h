/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Small vectors, rotations and spatial inertias for the rigid-body algorithms. Matrices are
 * row-major; symmetric ones are stored as xx xy xz yy yz zz. All functions are RT-safe.
 */
#ifndef MODEL_SPATIAL_H
#define MODEL_SPATIAL_H

#include <math.h>
#include <string.h>

/* Index of element (row, column) of a symmetric matrix. */
static const unsigned char spatial_sym[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* A motion (angular, linear velocity of the origin) or a force (moment about it, force). */
struct spatial {
    double a[3]; /* angular velocity or acceleration; moment */
    double l[3]; /* linear velocity or acceleration; force */
};

/* A symmetric 6x6 inertia: moment = J w + H v, force = H^T w + M v. */
struct spatial_inertia {
    double J[6];
    double H[9];
    double M[6];
};

static inline double vec3_dot(const double x[3], const double y[3])
{
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

/* z = x cross y; z is none of them */
static inline void vec3_cross(const double x[3], const double y[3], double z[3])
{
    z[0] = x[1] * y[2] - x[2] * y[1];
    z[1] = x[2] * y[0] - x[0] * y[2];
    z[2] = x[0] * y[1] - x[1] * y[0];
}

/* z += x cross y; z is none of them */
static inline void vec3_add_cross(const double x[3], const double y[3], double z[3])
{
    z[0] += x[1] * y[2] - x[2] * y[1];
    z[1] += x[2] * y[0] - x[0] * y[2];
    z[2] += x[0] * y[1] - x[1] * y[0];
}

/* y = A x; y is not x */
static inline void mat3_apply(const double A[9], const double x[3], double y[3])
{
    for (int i = 0; i < 3; i++) {
        y[i] = A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
    }
}

/* y = A^T x; y is not x */
static inline void mat3_apply_transposed(const double A[9], const double x[3], double y[3])
{
    for (int i = 0; i < 3; i++) {
        y[i] = A[i] * x[0] + A[3 + i] * x[1] + A[6 + i] * x[2];
    }
}

/* C = A B; C is none of them */
static inline void mat3_mul(const double A[9], const double B[9], double C[9])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
        }
    }
}

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

/* y = S x, S symmetric; y is not x */
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
            T[3 * i + j] = R[3 * i] * S[spatial_sym[0][j]] + R[3 * i + 1] * S[spatial_sym[1][j]] +
                           R[3 * i + 2] * S[spatial_sym[2][j]];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            S[spatial_sym[i][j]] = vec3_dot(T + 3 * i, R + 3 * j);
        }
    }
}

/* Rotation by angle about a unit axis (Rodrigues). */
static inline void mat3_about_axis(const double axis[3], double angle, double R[9])
{
    double s = sin(angle), c = cos(angle), t = 1.0 - c;
    double x = axis[0], y = axis[1], z = axis[2];
    const double value[9] = {t * x * x + c,     t * x * y - s * z, t * x * z + s * y,
                             t * x * y + s * z, t * y * y + c,     t * y * z - s * x,
                             t * x * z - s * y, t * y * z + s * x, t * z * z + c};

    memcpy(R, value, sizeof value);
}

/* Fixed-axis roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll). */
static inline void mat3_from_rpy(const double rpy[3], double R[9])
{
    double cr = cos(rpy[0]), sr = sin(rpy[0]), cp = cos(rpy[1]), sp = sin(rpy[1]);
    double cy = cos(rpy[2]), sy = sin(rpy[2]);
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

/* Body-to-world rotation of a quaternion wxyz of any non-zero length. */
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

/* The 6x6 inertia about a body's origin of a mass whose tensor I is about its centre com. */
static inline void spatial_inertia_rigid(double mass, const double com[3], const double I[6],
                                         struct spatial_inertia *A)
{
    double h[3] = {mass * com[0], mass * com[1], mass * com[2]};

    A->J[0] = I[0] + h[1] * com[1] + h[2] * com[2];
    A->J[1] = I[1] - h[0] * com[1];
    A->J[2] = I[2] - h[0] * com[2];
    A->J[3] = I[3] + h[0] * com[0] + h[2] * com[2];
    A->J[4] = I[4] - h[1] * com[2];
    A->J[5] = I[5] + h[0] * com[0] + h[1] * com[1];
    const double H[9] = {0.0, -h[2], h[1], h[2], 0.0, -h[0], -h[1], h[0], 0.0};
    const double M[6] = {mass, 0.0, 0.0, mass, 0.0, mass};
    memcpy(A->H, H, sizeof H);
    memcpy(A->M, M, sizeof M);
}

/* A's reference point moves by -r: from a frame at r to the origin (axes unchanged).
 * H' = H + [r] M and J' = J - H [r] + [r] H'^T with [r] the cross-product matrix. */
static inline void spatial_inertia_shift(const double r[3], struct spatial_inertia *A)
{
    double H[9];
    double x = r[0], y = r[1], z = r[2];
    const double *M = A->M, *h = A->H;

    H[0] = h[0] + (y * M[2] - z * M[1]);
    H[1] = h[1] + (y * M[4] - z * M[3]);
    H[2] = h[2] + (y * M[5] - z * M[4]);
    H[3] = h[3] + (z * M[0] - x * M[2]);
    H[4] = h[4] + (z * M[1] - x * M[4]);
    H[5] = h[5] + (z * M[2] - x * M[5]);
    H[6] = h[6] + (x * M[1] - y * M[0]);
    H[7] = h[7] + (x * M[3] - y * M[1]);
    H[8] = h[8] + (x * M[4] - y * M[2]);
    A->J[0] += (y * h[2] - z * h[1]) + (y * H[2] - z * H[1]);
    A->J[1] += (z * h[0] - x * h[2]) + (y * H[5] - z * H[4]);
    A->J[2] += (x * h[1] - y * h[0]) + (y * H[8] - z * H[7]);
    A->J[3] += (z * h[3] - x * h[5]) + (z * H[3] - x * H[5]);
    A->J[4] += (x * h[4] - y * h[3]) + (z * H[6] - x * H[8]);
    A->J[5] += (x * h[7] - y * h[6]) + (x * H[7] - y * H[6]);
    memcpy(A->H, H, sizeof H);
}

/* A <- R A R^T, every block. */
static inline void spatial_inertia_rotate(const double R[9], struct spatial_inertia *A)
{
    double T[9], Rt[9];

    sym3_rotate(R, A->J);
    sym3_rotate(R, A->M);
    mat3_mul(R, A->H, T);
    mat3_transpose(R, Rt);
    mat3_mul(T, Rt, A->H);
}

/* f = A v */
static inline void spatial_inertia_apply(const struct spatial_inertia *A, const struct spatial *v,
                                         struct spatial *f)
{
    double l[3];

    sym3_apply(A->J, v->a, f->a);
    mat3_apply(A->H, v->l, l);
    for (int i = 0; i < 3; i++) {
        f->a[i] += l[i];
    }
    mat3_apply_transposed(A->H, v->a, f->l);
    sym3_apply(A->M, v->l, l);
    for (int i = 0; i < 3; i++) {
        f->l[i] += l[i];
    }
}

/* v = A^-1 f, A positive definite: Cholesky factorization A = L L^T in the order angular, linear */
static inline void spatial_inertia_solve(const struct spatial_inertia *A, const struct spatial *f,
                                         struct spatial *v)
{
    double L[6][6], inverse[6], x[6];

    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            L[row][column] = A->J[spatial_sym[row][column]];
            L[row + 3][column] = A->H[3 * column + row];
            L[row + 3][column + 3] = A->M[spatial_sym[row][column]];
        }
        x[row] = f->a[row];
        x[row + 3] = f->l[row];
    }
    for (int column = 0; column < 6; column++) {
        for (int m = 0; m < column; m++) {
            for (int row = column; row < 6; row++) {
                L[row][column] -= L[row][m] * L[column][m];
            }
        }
        inverse[column] = 1.0 / sqrt(L[column][column]);
        for (int row = column; row < 6; row++) {
            L[row][column] *= inverse[column];
        }
    }
    for (int row = 0; row < 6; row++) {
        for (int m = 0; m < row; m++) {
            x[row] -= L[row][m] * x[m];
        }
        x[row] *= inverse[row];
    }
    for (int row = 5; row >= 0; row--) {
        for (int m = row + 1; m < 6; m++) {
            x[row] -= L[m][row] * x[m];
        }
        x[row] *= inverse[row];
    }
    memcpy(v->a, x, sizeof v->a);
    memcpy(v->l, x + 3, sizeof v->l);
}

static inline void spatial_inertia_add(const struct spatial_inertia *A, struct spatial_inertia *sum)
{
    for (int i = 0; i < 6; i++) {
        sum->J[i] += A->J[i];
        sum->M[i] += A->M[i];
    }
    for (int i = 0; i < 9; i++) {
        sum->H[i] += A->H[i];
    }
}

#endif
