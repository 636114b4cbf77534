/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Spatial (6-D) vectors and inertias for the rigid-body algorithms (Featherstone, Rigid Body
 * Dynamics Algorithms, 2008, chapter 2). Matrices are laid out as in base/vec3.h; SI units, in any
 * frame. The caller owns all memory. No errors. RT-safe.
 */
#ifndef MODEL_SPATIAL_H
#define MODEL_SPATIAL_H

#include "base/vec3.h"

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

/* Returns the motion x of a body at a point displaced by arm. */
static inline struct spatial spatial_motion_at(const struct spatial *x, const double arm[3])
{
    struct spatial y = *x;

    vec3_add_cross(x->a, arm, y.l);
    return y;
}

/* Adds scale times the wrench f, moved from a point at arm to the origin. */
static inline void spatial_add_wrench(double scale, const struct spatial *f, const double arm[3],
                                      struct spatial *sum)
{
    double moment[3] = {f->a[0], f->a[1], f->a[2]};

    vec3_add_cross(arm, f->l, moment);
    for (int i = 0; i < 3; i++) {
        sum->l[i] += scale * f->l[i];
        sum->a[i] += scale * moment[i];
    }
}

/* Rotate both parts of x: spatial_turn returns R x, spatial_turn_back returns R^T x. */
static inline struct spatial spatial_turn(const double R[9], const struct spatial *x)
{
    struct spatial y;

    mat3_apply(R, x->l, y.l);
    mat3_apply(R, x->a, y.a);
    return y;
}

static inline struct spatial spatial_turn_back(const double R[9], const struct spatial *x)
{
    struct spatial y;

    mat3_apply_transposed(R, x->l, y.l);
    mat3_apply_transposed(R, x->a, y.a);
    return y;
}

/* Convert from and to the layout of struct added_inertia and struct contact_tangent: upper triangle
 * by rows, linear part first. */
static inline void spatial_inertia_unpack(const double S[21], struct spatial_inertia *A)
{
    const double M[6] = {S[0], S[1], S[2], S[6], S[7], S[11]};
    const double H[9] = {S[3], S[8], S[12], S[4], S[9], S[13], S[5], S[10], S[14]};

    memcpy(A->M, M, sizeof M);
    memcpy(A->H, H, sizeof H);
    memcpy(A->J, S + 15, sizeof A->J);
}

static inline void spatial_inertia_pack(const struct spatial_inertia *A, double S[21])
{
    const double *M = A->M, *H = A->H;
    const double upper[15] = {M[0], M[1], M[2], H[0], H[3], H[6], M[3], M[4],
                              H[1], H[4], H[7], M[5], H[2], H[5], H[8]};

    memcpy(S, upper, sizeof upper);
    memcpy(S + 15, A->J, sizeof A->J);
}

/* Computes the 6x6 inertia of a mass about a body's origin. I is the tensor about its center of
 * mass com. */
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

/* Moves the reference point of A by -r, from a frame at r to the origin; the axes do not change. H'
 * = H + [r] M and J' = J - H [r] + [r] H'^T, with the cross-product matrix [r]. */
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

/* Rotates an inertia: A <- R A R^T, every block. */
static inline void spatial_inertia_rotate(const double R[9], struct spatial_inertia *A)
{
    double T[9], Rt[9];

    sym3_rotate(R, A->J);
    sym3_rotate(R, A->M);
    mat3_mul(R, A->H, T);
    mat3_transpose(R, Rt);
    mat3_mul(T, Rt, A->H);
}

/* Computes f = A v. */
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

/* Solves A v = f, A positive definite: Cholesky factorization A = L L^T in the order angular,
 * linear. */
static inline void spatial_inertia_solve(const struct spatial_inertia *A, const struct spatial *f,
                                         struct spatial *v)
{
    double L[6][6], inverse[6], x[6];

    /* Copy the matrix and the right-hand side to one array */
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            L[row][column] = A->J[sym3_index[row][column]];
            L[row + 3][column] = A->H[3 * column + row];
            L[row + 3][column + 3] = A->M[sym3_index[row][column]];
        }
        x[row] = f->a[row];
        x[row + 3] = f->l[row];
    }

    /* Compute L, column by column */
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

    /* Solve L y = f, then L^T v = y */
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
