/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steps of the numeric rigid-body algorithms at one joint, for dynamics_generic.c: transforms
 * between a body and its parent, and the joint's part of the outward and inward sweeps
 * (Featherstone, Rigid Body Dynamics Algorithms, 2008, tables 5.1 and 7.1). All in body
 * coordinates; SI units.
 *
 * Code for a joint axis is written once with the axis number k as a parameter and inlined for k =
 * 0, 1, 2 (BY_JOINT). So a rotation costs a rotation in a plane, not a 3x3 product. Index k is the
 * joint axis, i and j follow it in cyclic order. No memory, no errors. RT-safe.
 */
#ifndef MODEL_DYNAMICS_KERNELS_H
#define MODEL_DYNAMICS_KERNELS_H

#include "base/portable_math.h"
#include "model/dynamics.h"
#include "model/spatial.h"

#define INLINE static inline __attribute__((always_inline))

/* Constants of a body and the joint that moves it. All in the body's inner frame, except origin
 * and fixed, which are in the parent's frame. */
struct link {
    int parent;
    enum joint_type type;
    int axis;         /* k: the coordinate axis of the inner frame that is the joint axis */
    bool turned;      /* true: fixed is not the identity */
    bool offset;      /* true: origin is not zero, or moves (prismatic) */
    bool inner;       /* true: the inner frame differs from the body's frame */
    double origin[3]; /* origin of the body at q = 0 */
    double fixed[9];  /* rotation, this frame to parent, at q = 0 */
    double align[9];  /* rotation, inner to body frame */
    double slide[3];  /* direction of a prismatic joint, in the parent's frame */
    double mass;      /* kg */
    double moment[3]; /* mass times center of mass, kg m */
    double I[6];      /* inertia about the body's origin, kg m2 */
    struct spatial_inertia rigid;
};

/* Results of one evaluation for a body. */
struct link_state {
    double c, s; /* cosine and sine of a revolute joint's angle */
    double r[3]; /* origin in the parent's frame */
    struct spatial v;
    struct spatial bias;  /* velocity-product acceleration */
    struct spatial drift; /* acceleration at vdot = 0, gravity included */
    struct spatial p;     /* bias force; in inverse dynamics the force across the joint */
    struct spatial a;
    struct spatial_inertia A; /* articulated inertia */
    struct spatial U;         /* A times the joint's axis */
    double inverse_d, u;
    double R[9], position[3]; /* inner frame to world */
};

struct generic {
    size_t nbody;
    size_t first; /* index in q and v of the first joint */
    struct link *link;
    struct link_state *state;
    /* for respond, by body: its parent, and whether the torques move it. Apart from the links,
     * which are too large to be visited without need */
    int *parent;
    bool *moved;
    /* arguments of the stored results; equal arguments reuse the results */
    double *q, *v;
    bool turned_known; /* c, s and r are valid for q */
    bool moving_known; /* v and bias are valid for q and v */
    bool place_known;  /* R and position are valid for q */
};

/* Calls kernel(type, axis, ...) with type and axis as constants. */
#define BY_JOINT(link, kernel, ...)                                                                \
    do {                                                                                           \
        if ((link)->type == JOINT_REVOLUTE) {                                                      \
            if ((link)->axis == 0) {                                                               \
                kernel(JOINT_REVOLUTE, 0, __VA_ARGS__);                                            \
            } else if ((link)->axis == 1) {                                                        \
                kernel(JOINT_REVOLUTE, 1, __VA_ARGS__);                                            \
            } else {                                                                               \
                kernel(JOINT_REVOLUTE, 2, __VA_ARGS__);                                            \
            }                                                                                      \
        } else if ((link)->axis == 0) {                                                            \
            kernel(JOINT_PRISMATIC, 0, __VA_ARGS__);                                               \
        } else if ((link)->axis == 1) {                                                            \
            kernel(JOINT_PRISMATIC, 1, __VA_ARGS__);                                               \
        } else {                                                                                   \
            kernel(JOINT_PRISMATIC, 2, __VA_ARGS__);                                               \
        }                                                                                          \
    } while (0)

/* Rotates x from the parent's axes to the body's axes, y. */
INLINE void turn_down(int k, const struct link *link, const struct link_state *state,
                      const double x[3], double y[3])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double t[3] = {x[0], x[1], x[2]};

    if (link->turned) {
        mat3_apply_transposed(link->fixed, x, t);
    }
    y[k] = t[k];
    y[i] = state->c * t[i] + state->s * t[j];
    y[j] = state->c * t[j] - state->s * t[i];
}

/* Rotates x from the body's axes to the parent's axes, y. */
INLINE void turn_up(int k, const struct link *link, const struct link_state *state,
                    const double x[3], double y[3])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double t[3];

    t[k] = x[k];
    t[i] = state->c * x[i] - state->s * x[j];
    t[j] = state->s * x[i] + state->c * x[j];
    if (link->turned) {
        mat3_apply(link->fixed, t, y);
    } else {
        memcpy(y, t, sizeof t);
    }
}

/* Computes the parent's motion at the body's origin, in the body's axes. */
INLINE void motion_down(int k, const struct link *link, const struct link_state *state,
                        const struct spatial *parent, struct spatial *child)
{
    double l[3] = {parent->l[0], parent->l[1], parent->l[2]};

    if (link->offset) {
        vec3_add_cross(parent->a, state->r, l);
    }
    turn_down(k, link, state, parent->a, child->a);
    turn_down(k, link, state, l, child->l);
}

/* Adds the body's force to the parent's force, at the parent's origin and in its axes. */
INLINE void force_up(int k, const struct link *link, const struct link_state *state,
                     const struct spatial *child, struct spatial *parent)
{
    double f[3], n[3];

    turn_up(k, link, state, child->l, f);
    turn_up(k, link, state, child->a, n);
    if (link->offset) {
        vec3_add_cross(state->r, f, n);
    }
    for (int m = 0; m < 3; m++) {
        parent->a[m] += n[m];
        parent->l[m] += f[m];
    }
}

/* Rotates a symmetric matrix about axis k: S <- Rot S Rot^T. plane: row k of S is zero. */
INLINE void sym3_turn(int k, bool plane, double c, double s, double S[6])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    int ii = sym3_index[i][i], ij = sym3_index[i][j], jj = sym3_index[j][j];
    int ik = sym3_index[i][k], jk = sym3_index[j][k];
    double a = c * S[ii] - s * S[ij], b = c * S[ij] - s * S[jj];
    double d = s * S[ii] + c * S[ij], e = s * S[ij] + c * S[jj];

    S[ii] = c * a - s * b;
    S[ij] = s * a + c * b;
    S[jj] = s * d + c * e;
    if (!plane) {
        double x = S[ik], y = S[jk];

        S[ik] = c * x - s * y;
        S[jk] = s * x + c * y;
    }
}

/* Rotates a matrix about axis k: H <- Rot H Rot^T. plane: row k of H is zero. */
INLINE void mat3_turn(int k, bool plane, double c, double s, double H[9])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;

    for (int column = 0; column < 3; column++) {
        double x = H[3 * i + column], y = H[3 * j + column];

        H[3 * i + column] = c * x - s * y;
        H[3 * j + column] = s * x + c * y;
    }
    for (int row = 0; row < 3; row++) {
        if (plane && row == k) {
            continue;
        }
        double x = H[3 * row + i], y = H[3 * row + j];

        H[3 * row + i] = c * x - s * y;
        H[3 * row + j] = s * x + c * y;
    }
}

/* Computes f = I v for the rigid body alone. */
static inline void rigid_apply(const struct link *link, const struct spatial *v, struct spatial *f)
{
    sym3_apply(link->I, v->a, f->a);
    vec3_add_cross(link->moment, v->l, f->a);
    for (int m = 0; m < 3; m++) {
        f->l[m] = link->mass * v->l[m];
    }
    vec3_add_cross(v->a, link->moment, f->l);
}

/* Computes p = v x* (I v), the force that the rigid body needs at zero acceleration. */
static inline void rigid_bias(const struct link *link, const struct spatial *v, struct spatial *p)
{
    struct spatial h;

    rigid_apply(link, v, &h);
    vec3_cross(v->a, h.a, p->a);
    vec3_add_cross(v->l, h.l, p->a);
    vec3_cross(v->a, h.l, p->l);
}

/* Subtracts the external wrench on the body from p. */
static inline void subtract_wrench(const struct link *link, const struct wrench *ext,
                                   struct spatial *p)
{
    double n[3] = {ext->moment[0], ext->moment[1], ext->moment[2]};
    double f[3] = {ext->force[0], ext->force[1], ext->force[2]};

    if (link->inner) {
        mat3_apply_transposed(link->align, ext->moment, n);
        mat3_apply_transposed(link->align, ext->force, f);
    }
    for (int m = 0; m < 3; m++) {
        p->a[m] -= n[m];
        p->l[m] -= f[m];
    }
}

/* Computes the joint's transform from q. */
INLINE void joint_transform(const struct link *link, double q, struct link_state *state)
{
    if (link->type == JOINT_REVOLUTE) {
        portable_sincos(q, &state->s, &state->c);
        return;
    }
    state->c = 1.0;
    state->s = 0.0;
    for (int m = 0; m < 3; m++) {
        state->r[m] = link->origin[m] + link->slide[m] * q;
    }
}

/* Computes the body's velocity from the parent's velocity. */
INLINE void outward_velocity(enum joint_type type, int k, const struct link *link,
                             const struct link_state *parent, double qd, struct link_state *state)
{
    int i = (k + 1) % 3, j = (k + 2) % 3;

    /* Bias acceleration from the joint's own motion: v x (axis qd) */
    if (type == JOINT_REVOLUTE) {
        motion_down(k, link, state, &parent->v, &state->v);
        state->v.a[k] += qd;
        state->bias.a[k] = 0.0;
        state->bias.a[i] = state->v.a[j] * qd;
        state->bias.a[j] = -state->v.a[i] * qd;
        state->bias.l[k] = 0.0;
        state->bias.l[i] = state->v.l[j] * qd;
        state->bias.l[j] = -state->v.l[i] * qd;
    } else {
        motion_down(k, link, state, &parent->v, &state->v);
        state->v.l[k] += qd;
        memset(&state->bias, 0, sizeof state->bias);
        state->bias.l[i] = state->v.a[j] * qd;
        state->bias.l[j] = -state->v.a[i] * qd;
    }
}

/* Removes the joint's free motion from the inertia: A <- A - U U^T / d. A revolute joint without
 * extra inertia (plain) transmits no moment about its axis, so row k of J and H becomes zero. */
INLINE void remove_joint_motion(enum joint_type type, int k, bool plain, const struct spatial *U,
                                double inverse_d, struct spatial_inertia *A)
{
    bool free = plain && type == JOINT_REVOLUTE;

    for (int row = 0; row < 3; row++) {
        double a = U->a[row] * inverse_d, l = U->l[row] * inverse_d;
        bool gone = free && row == k;

        for (int column = 0; column < 3; column++) {
            A->H[3 * row + column] = gone ? 0.0 : A->H[3 * row + column] - a * U->l[column];
        }
        for (int column = row; column < 3; column++) {
            double *J = &A->J[sym3_index[row][column]];

            *J = gone || (free && column == k) ? 0.0 : *J - a * U->a[column];
            A->M[sym3_index[row][column]] -= l * U->l[column];
        }
    }
}

/* Adds A bias to p. The bias has no component along axis k. For a prismatic joint it has no angular
 * part. */
INLINE void add_bias(enum joint_type type, int k, const struct spatial_inertia *A,
                     const struct spatial *bias, struct spatial *p)
{
    int i = (k + 1) % 3, j = (k + 2) % 3;

    for (int m = 0; m < 3; m++) {
        p->a[m] += A->H[3 * m + i] * bias->l[i] + A->H[3 * m + j] * bias->l[j];
        p->l[m] += A->M[sym3_index[m][i]] * bias->l[i] + A->M[sym3_index[m][j]] * bias->l[j];
        if (type == JOINT_REVOLUTE) {
            p->a[m] += A->J[sym3_index[m][i]] * bias->a[i] + A->J[sym3_index[m][j]] * bias->a[j];
            p->l[m] += A->H[3 * i + m] * bias->a[i] + A->H[3 * j + m] * bias->a[j];
        }
    }
}

/* Removes the joint's own motion from the articulated inertia and adds the remainder to the parent.
 * Unless plain, extra inertia resists the joint's motion. */
INLINE void inward_articulated(enum joint_type type, int k, bool plain, const struct link *link,
                               double tau, double extra, struct link_state *state,
                               struct link_state *parent)
{
    bool turns = type == JOINT_REVOLUTE;
    struct spatial_inertia A = state->A;
    struct spatial U, p = state->p;
    double u, inverse_d;

    /* U = A S, d = S^T U + extra, u = tau - S^T p */
    for (int m = 0; m < 3; m++) {
        U.a[m] = turns ? A.J[sym3_index[k][m]] : A.H[3 * m + k];
        U.l[m] = turns ? A.H[3 * k + m] : A.M[sym3_index[k][m]];
    }
    inverse_d = 1.0 / ((turns ? U.a[k] : U.l[k]) + (plain ? 0.0 : extra));
    u = tau - (turns ? p.a[k] : p.l[k]);
    state->U = U;
    state->inverse_d = inverse_d;
    state->u = u;

    /* A <- A - U U^T / d, p <- p + A bias + U u / d */
    remove_joint_motion(type, k, plain, &U, inverse_d, &A);
    add_bias(type, k, &A, &state->bias, &p);
    for (int m = 0; m < 3; m++) {
        p.a[m] += U.a[m] * (u * inverse_d);
        p.l[m] += U.l[m] * (u * inverse_d);
    }
    force_up(k, link, state, &p, &parent->p);

    /* Transforms to the parent's axes and origin */
    if (turns) {
        sym3_turn(k, plain, state->c, state->s, A.J);
        sym3_turn(k, false, state->c, state->s, A.M);
        mat3_turn(k, plain, state->c, state->s, A.H);
    }
    if (link->turned) {
        spatial_inertia_rotate(link->fixed, &A);
    }
    if (link->offset) {
        spatial_inertia_shift(state->r, &A);
    }
    spatial_inertia_add(&A, &parent->A);
}

/* Computes the joint's acceleration from the parent's acceleration, and the body's acceleration
 * from both. */
INLINE void outward_acceleration(enum joint_type type, int k, const struct link *link,
                                 const struct link_state *parent, struct link_state *state,
                                 double *qdd)
{
    motion_down(k, link, state, &parent->a, &state->a);
    for (int m = 0; m < 3; m++) {
        state->a.a[m] += state->bias.a[m];
        state->a.l[m] += state->bias.l[m];
    }
    *qdd = (state->u - vec3_dot(state->U.a, state->a.a) - vec3_dot(state->U.l, state->a.l)) *
           state->inverse_d;
    if (type == JOINT_REVOLUTE) {
        state->a.a[k] += *qdd;
    } else {
        state->a.l[k] += *qdd;
    }
}

/* Adds the force that the joint transmits to the parent's, for torques alone and with the inertias
 * of inward_articulated. */
INLINE void inward_response(enum joint_type type, int k, const struct link *link, double tau,
                            struct link_state *state, struct link_state *parent)
{
    struct spatial p = state->p;

    state->u = tau - (type == JOINT_REVOLUTE ? p.a[k] : p.l[k]);
    for (int m = 0; m < 3; m++) {
        p.a[m] += state->U.a[m] * (state->u * state->inverse_d);
        p.l[m] += state->U.l[m] * (state->u * state->inverse_d);
    }
    force_up(k, link, state, &p, &parent->p);
}

/* Computes the accelerations that these forces cause. */
INLINE void outward_response(enum joint_type type, int k, const struct link *link,
                             const struct link_state *parent, struct link_state *state, double *qdd)
{
    motion_down(k, link, state, &parent->a, &state->a);
    *qdd = (state->u - vec3_dot(state->U.a, state->a.a) - vec3_dot(state->U.l, state->a.l)) *
           state->inverse_d;
    *(type == JOINT_REVOLUTE ? &state->a.a[k] : &state->a.l[k]) += *qdd;
}

/* Computes the body's acceleration from a given joint acceleration. */
INLINE void outward_given(enum joint_type type, int k, const struct link *link,
                          const struct link_state *parent, double qdd, struct link_state *state)
{
    motion_down(k, link, state, &parent->a, &state->a);
    for (int m = 0; m < 3; m++) {
        state->a.a[m] += state->bias.a[m];
        state->a.l[m] += state->bias.l[m];
    }
    if (type == JOINT_REVOLUTE) {
        state->a.a[k] += qdd;
    } else {
        state->a.l[k] += qdd;
    }
}

/* Returns the component of the joint's force along its axis. Adds the force to the parent's
 * force. */
INLINE void inward_force(enum joint_type type, int k, const struct link *link,
                         const struct link_state *state, struct link_state *parent, double *tau)
{
    *tau = type == JOINT_REVOLUTE ? state->p.a[k] : state->p.l[k];
    force_up(k, link, state, &state->p, &parent->p);
}

/* Computes the body's pose in the world from its parent's pose. */
INLINE void outward_place(enum joint_type type, int k, const struct link *link,
                          const struct link_state *parent, struct link_state *state)
{
    double r[3];

    (void)type;
    mat3_apply(parent->R, state->r, r);
    for (int row = 0; row < 3; row++) {
        state->position[row] = parent->position[row] + r[row];
        turn_down(k, link, state, parent->R + 3 * row, state->R + 3 * row);
    }
}

/* Computes the body's acceleration at vdot = 0 */
INLINE void outward_drift(enum joint_type type, int k, const struct link *link,
                          const struct link_state *parent, struct link_state *state)
{
    (void)type;
    motion_down(k, link, state, &parent->drift, &state->drift);
    for (int m = 0; m < 3; m++) {
        state->drift.a[m] += state->bias.a[m];
        state->drift.l[m] += state->bias.l[m];
    }
}

/* Converts a body and the joint that moves it to a link. parent belongs to the parent body. joint
 * and parent are NULL for the base. */
void generic_prepare_link(const struct robot_body *body, const struct robot_joint *joint,
                          const struct link *parent, struct link *link);

#endif
