/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steps of the numeric rigid-body algorithms, for dynamics_sweeps.c (Featherstone, Rigid Body
 * Dynamics Algorithms, 2008, tables 5.1 and 7.1). Bodies at the same distance from the base are
 * independent of each other. So a group of up to four of them is computed side by side, one body
 * per lane. A limb keeps its lane from the base to the tip, so that a parent is in the lane of its
 * child. Values move between lanes only where a limb begins.
 *
 * Spatial quantities have world axes and refer to the body's origin, so that no rotation is needed
 * between bodies. Each body has an inner frame whose z axis is the joint axis. SI units. A lane
 * without a body has no mass, and its joint has the inertia 1. The order of operations is the same
 * for each instruction set. The functions allocate no memory and return no errors. RT-safe.
 */
#ifndef MODEL_DYNAMICS_KERNELS_H
#define MODEL_DYNAMICS_KERNELS_H

#include "base/portable_math.h"
#include "model/dynamics.h"
#include "model/spatial.h"

#define INLINE static inline __attribute__((always_inline))

/* Number of bodies in a group. */
#define GROUP 4

typedef double lanes __attribute__((vector_size(GROUP * sizeof(double))));
typedef long long lanes_bits __attribute__((vector_size(GROUP * sizeof(long long))));

/* struct spatial and struct spatial_inertia of the bodies of a group. */
struct spatial_lanes {
    lanes a[3], l[3];
};

struct inertia_lanes {
    lanes J[6], H[9], M[6];
};

/* Bodies, the joints that move them, and results of one evaluation. */
struct group {
    int body[GROUP];   /* index of the body; -1 = no body */
    int joint[GROUP];  /* index of its joint; 0 in a lane without a joint */
    int parent[GROUP]; /* group of its parent */
    int lane[GROUP];   /* lane of its parent */
    bool aligned;      /* all parents are in one group, in the lanes of their children */
    bool slides;       /* at least one joint is prismatic */
    lanes turns;       /* 1: revolute, 0: prismatic */
    lanes idle;        /* 1 = no body */
    lanes origin[3];   /* origin of the body at q = 0, in the parent's frame */
    lanes fixed[9];    /* rotation, this frame to parent, at q = 0 */
    lanes align[9];    /* rotation, inner to body frame */
    lanes mass;        /* kg */
    lanes center[3];   /* mass times center of mass, kg m, inner frame */
    lanes inertia[6];  /* about the body's origin, kg m2, inner frame */

    lanes R[9], position[3];   /* inner frame to world */
    lanes r[3];                /* origin, from the parent's origin */
    struct spatial_lanes v;    /* velocity */
    struct spatial_lanes bias; /* velocity-product acceleration */
    struct spatial_lanes a;
    struct spatial_lanes p; /* bias force; in inverse dynamics the force across the joint */
    struct inertia_lanes A; /* articulated inertia */
    lanes moment[3];        /* mass times center of mass, world axes */
    struct spatial_lanes U; /* A times the joint's axis */
    lanes inverse_d, u;
};

/* Response of a body to joint torques. */
struct response {
    struct spatial_lanes p, a; /* one response per lane */
    lanes u;
    bool moved;
};

struct generic {
    size_t nbody, ngroup;
    size_t first;        /* index in q and v of the first joint */
    struct group *group; /* in order of distance from the base; group 0 has only the base */
    /* by body */
    int *home, *lane; /* its group, its lane */
    struct response *response;
    lanes *sine, *cosine; /* of the joints' positions, by joint */
    /* arguments of the stored results; equal arguments reuse the results */
    double *q, *v;
    bool place_known;  /* R, position and r are valid for q */
    bool moving_known; /* v and bias are valid for q and v */
};

/* z += x cross y */
INLINE void lanes_add_cross(const lanes x[3], const lanes y[3], lanes z[3])
{
    z[0] += x[1] * y[2] - x[2] * y[1];
    z[1] += x[2] * y[0] - x[0] * y[2];
    z[2] += x[0] * y[1] - x[1] * y[0];
}

/* Returns the dot product. */
INLINE lanes lanes_dot(const lanes x[3], const lanes y[3])
{
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

/* y = A x */
INLINE void lanes_apply(const lanes A[9], const lanes x[3], lanes y[3])
{
    for (int i = 0; i < 3; i++) {
        y[i] = A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
    }
}

/* y = S x, S symmetric */
INLINE void lanes_apply_sym(const lanes S[6], const lanes x[3], lanes y[3])
{
    for (int i = 0; i < 3; i++) {
        y[i] = S[sym3_index[i][0]] * x[0] + S[sym3_index[i][1]] * x[1] + S[sym3_index[i][2]] * x[2];
    }
}

/* C = A B */
INLINE void lanes_mul(const lanes A[9], const lanes B[9], lanes C[9])
{
    for (int i = 0; i < 9; i++) {
        const lanes *row = A + i / 3 * 3;

        C[i] = row[0] * B[i % 3] + row[1] * B[3 + i % 3] + row[2] * B[6 + i % 3];
    }
}

/* Returns an element of the product T R^T. */
INLINE lanes lanes_row_product(const lanes T[9], const lanes R[9], int row, int column)
{
    const lanes *x = T + 3 * row, *y = R + 3 * column;

    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

/* S <- R S R^T, S symmetric */
INLINE void lanes_rotate_sym(const lanes R[9], lanes S[6])
{
    lanes T[9];

    for (int i = 0; i < 3; i++) {
        lanes_apply_sym(S, R + 3 * i, T + 3 * i);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            S[sym3_index[i][j]] = lanes_row_product(T, R, i, j);
        }
    }
}

/* Returns `count` values of the parents, each in the lane of its child. at: offset of the values in
 * struct group, bytes. gathered: memory for values that change their lane. */
INLINE const lanes *from_parents(const struct generic *g, const struct group *child, size_t at,
                                 int count, lanes *gathered)
{
    const double *from[GROUP];

    for (int i = 0; i < GROUP; i++) {
        from[i] = (const double *)((const char *)&g->group[child->parent[i]] + at);
    }
    if (child->aligned) {
        return (const lanes *)from[0];
    }
    for (int i = 0; i < GROUP; i++) {
        from[i] += child->lane[i];
    }
    for (int m = 0; m < count * GROUP; m += GROUP) {
        gathered[m / GROUP] = (lanes){from[0][m], from[1][m], from[2][m], from[3][m]};
    }
    return gathered;
}

/* Adds `count` values of each body to the values of its parent. at: offset of the parent's values
 * in struct group, bytes. */
INLINE void add_to_parents(const struct generic *g, const struct group *child, size_t at,
                           const lanes *x, int count)
{
    for (int i = 0; i < (child->aligned ? 1 : GROUP); i++) {
        lanes *sum = (lanes *)((char *)&g->group[child->parent[i]] + at);

        for (int m = 0; m < count; m++) {
            if (child->aligned) {
                sum[m] += x[m];
            } else if (child->body[i] >= 0) {
                sum[m][child->lane[i]] += x[m][i];
            }
        }
    }
}

/* Computes the parents' motions at the bodies' origins. at: offset of the motion in struct group,
 * bytes. */
INLINE void motion_out(const struct generic *g, const struct group *group, size_t at,
                       struct spatial_lanes *child)
{
    lanes gathered[6];
    const lanes *parent = from_parents(g, group, at, 6, gathered);

    for (int m = 0; m < 3; m++) {
        child->a[m] = parent[m];
        child->l[m] = parent[3 + m];
    }
    lanes_add_cross(parent, group->r, child->l);
}

/* Adds the bodies' forces to the parents' forces, at the parents' origins. */
INLINE void force_in(const struct generic *g, const struct group *group,
                     const struct spatial_lanes *child)
{
    struct spatial_lanes f = *child;

    lanes_add_cross(group->r, f.l, f.a);
    add_to_parents(g, group, offsetof(struct group, p), f.a, 6);
}

/* Computes group->moment and, as group->A, the inertia of the rigid bodies, in world axes. */
INLINE void place_inertia(struct group *group)
{
    const lanes *h = group->moment, zero = {0.0}, mass = group->mass;
    struct inertia_lanes *A = &group->A;

    lanes_apply(group->R, group->center, group->moment);
    for (int k = 0; k < 6; k++) {
        A->J[k] = group->inertia[k];
        A->M[k] = k == 0 || k == 3 || k == 5 ? mass : zero;
    }
    lanes_rotate_sym(group->R, A->J);
    A->H[0] = A->H[4] = A->H[8] = zero;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;

        A->H[3 * i + j] = -h[k];
        A->H[3 * i + k] = h[j];
    }
}

/* Computes f = I v for the rigid bodies alone, after place_inertia. */
INLINE void rigid_apply(const struct group *group, const struct spatial_lanes *v,
                        struct spatial_lanes *f)
{
    lanes_apply_sym(group->A.J, v->a, f->a);
    lanes_add_cross(group->moment, v->l, f->a);
    for (int m = 0; m < 3; m++) {
        f->l[m] = group->mass * v->l[m];
    }
    lanes_add_cross(v->a, group->moment, f->l);
}

/* Computes p = I a + v x* (I v), the force that the rigid bodies need. */
INLINE void find_rigid_force(struct group *group)
{
    struct spatial_lanes h, *p = &group->p;

    place_inertia(group);
    rigid_apply(group, &group->v, &h);
    rigid_apply(group, &group->a, p);
    lanes_add_cross(group->v.a, h.a, p->a);
    lanes_add_cross(group->v.l, h.l, p->a);
    lanes_add_cross(group->v.a, h.l, p->l);
}

/* Adds the velocity-product accelerations. */
INLINE void add_bias(const struct group *group, struct spatial_lanes *a)
{
    for (int m = 0; m < 3; m++) {
        a->a[m] += group->bias.a[m];
        a->l[m] += group->bias.l[m];
    }
}

/* Adds the joints' own motion to the bodies' motions. */
INLINE void add_joint_motion(const struct group *group, lanes qd, struct spatial_lanes *x)
{
    const lanes turning = group->turns * qd;

    for (int m = 0; m < 3; m++) {
        x->a[m] += group->R[3 * m + 2] * turning;
        if (group->slides) {
            x->l[m] += group->R[3 * m + 2] * (qd - turning);
        }
    }
}

/* Returns the components of forces along the joints' axes. */
INLINE lanes along_axis(const struct group *group, const struct spatial_lanes *f)
{
    const lanes axis[3] = {group->R[2], group->R[5], group->R[8]};
    const lanes moment = lanes_dot(axis, f->a);

    return group->slides ? group->turns * moment + (1.0 - group->turns) * lanes_dot(axis, f->l)
                         : moment;
}

/* Computes the bodies' velocities from the parents' velocities, and the bias accelerations v x
 * (axis qd). */
INLINE void outward_velocity(const struct generic *g, struct group *group, lanes qd)
{
    const lanes turning = group->turns * qd, sliding = qd - turning;
    lanes turn[3], slide[3];

    motion_out(g, group, offsetof(struct group, v), &group->v);
    add_joint_motion(group, qd, &group->v);
    for (int m = 0; m < 3; m++) {
        turn[m] = group->R[3 * m + 2] * turning;
        slide[m] = group->R[3 * m + 2] * sliding;
    }
    memset(&group->bias, 0, sizeof group->bias);
    lanes_add_cross(group->v.a, turn, group->bias.a);
    lanes_add_cross(group->v.l, turn, group->bias.l);
    if (group->slides) {
        lanes_add_cross(group->v.a, slide, group->bias.l);
    }
}

/* Computes U = A S of the joints' axes S. */
INLINE void project_inertia(const struct group *group, const struct inertia_lanes *A,
                            struct spatial_lanes *U)
{
    const lanes turns = group->turns, slides = 1.0 - turns, *R = group->R;
    const lanes axis[3] = {R[2], R[5], R[8]};
    lanes a[3], l[3];

    lanes_apply_sym(A->J, axis, U->a);
    for (int m = 0; m < 3; m++) {
        U->l[m] = A->H[m] * axis[0] + A->H[3 + m] * axis[1] + A->H[6 + m] * axis[2];
    }
    if (group->slides) {
        lanes_apply(A->H, axis, a);
        lanes_apply_sym(A->M, axis, l);
        for (int m = 0; m < 3; m++) {
            U->a[m] = turns * U->a[m] + slides * a[m];
            U->l[m] = turns * U->l[m] + slides * l[m];
        }
    }
}

/* Removes the joints' own motion from the articulated inertias and bias forces, and adds the
 * remainder to the parents. extra: inertia added to the joints. */
INLINE void inward_articulated(const struct generic *g, struct group *group, lanes tau, lanes extra)
{
    struct inertia_lanes A = group->A;
    struct spatial_lanes U, p = group->p;
    const lanes *r = group->r;
    lanes inverse_d, u, H[9];

    /* d = S^T U + extra, u = tau - S^T p */
    project_inertia(group, &A, &U);
    inverse_d = 1.0 / (along_axis(group, &U) + extra);
    u = tau - along_axis(group, &p);
    group->U = U;
    group->inverse_d = inverse_d;
    group->u = u;

    /* A <- A - U U^T / d */
    for (int row = 0; row < 3; row++) {
        const lanes a = U.a[row] * inverse_d, l = U.l[row] * inverse_d;

        for (int column = 0; column < 3; column++) {
            A.H[3 * row + column] -= a * U.l[column];
        }
        for (int column = row; column < 3; column++) {
            A.J[sym3_index[row][column]] -= a * U.a[column];
            A.M[sym3_index[row][column]] -= l * U.l[column];
        }
    }

    /* p <- p + U u / d */
    for (int m = 0; m < 3; m++) {
        p.a[m] += U.a[m] * (u * inverse_d);
        p.l[m] += U.l[m] * (u * inverse_d);
    }
    force_in(g, group, &p);

    /* Shift A to the parents' origins: H' = H + [r] M, J' = J - H [r] + [r] H'^T, with the
     * cross-product matrix [r] */
    for (int row = 0; row < 3; row++) {
        const int i = (row + 1) % 3, j = (row + 2) % 3;

        for (int column = 0; column < 3; column++) {
            H[3 * row + column] = A.H[3 * row + column] + (r[i] * A.M[sym3_index[j][column]] -
                                                           r[j] * A.M[sym3_index[i][column]]);
        }
    }
    for (int row = 0; row < 3; row++) {
        const int i = (row + 1) % 3, j = (row + 2) % 3;

        for (int column = row; column < 3; column++) {
            const int m = (column + 1) % 3, n = (column + 2) % 3;

            A.J[sym3_index[row][column]] += (r[m] * A.H[3 * row + n] - r[n] * A.H[3 * row + m]) +
                                            (r[i] * H[3 * column + j] - r[j] * H[3 * column + i]);
        }
    }
    memcpy(A.H, H, sizeof A.H);
    add_to_parents(g, group, offsetof(struct group, A), A.J, 21);
}

/* Returns the joints' accelerations, computed from the parents' accelerations. Also computes the
 * bodies' accelerations, without their part at vdot = 0. */
INLINE lanes outward_acceleration(const struct generic *g, struct group *group)
{
    struct spatial_lanes *a = &group->a;
    lanes qdd;

    motion_out(g, group, offsetof(struct group, a), a);
    qdd = (group->u - lanes_dot(group->U.a, a->a) - lanes_dot(group->U.l, a->l)) * group->inverse_d;
    add_joint_motion(group, qdd, a);
    return qdd;
}

#endif
