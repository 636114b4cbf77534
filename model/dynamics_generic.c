/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numeric rigid-body algorithms for any tree: articulated-body forward dynamics, Newton-Euler
 * inverse dynamics, kinematics and energy (Featherstone, Rigid Body Dynamics Algorithms, 2008,
 * tables 5.1, 7.1 and section 9.4), all in body coordinates.
 *
 * Every joint is reduced at creation to "a fixed rotation, then a turn about or a slide along one
 * coordinate axis": a body whose joint axis is +x, +y or +z keeps its frame, any other gets an
 * inner frame with the joint axis as z. What is done about an axis is written once with the axis
 * number k as a parameter and inlined for k = 0, 1, 2, so that a turn costs a rotation in a plane
 * and not a 3x3 product. Index k is the joint axis, i and j are the two after it in cyclic order.
 *
 * Gravity enters as an upward acceleration of the base.
 */
#include "model/dynamics.h"
#include "model/spatial.h"

#define INLINE static inline __attribute__((always_inline))

/* What is fixed about a body and the joint that moves it. All in the body's inner frame, origin
 * and fixed in the parent's. */
struct link {
    int parent;
    enum joint_type type;
    int axis;         /* k: the coordinate axis of the inner frame that is the joint axis */
    bool turned;      /* fixed is not the identity */
    bool offset;      /* origin is not zero, or moves (prismatic) */
    bool inner;       /* the inner frame is not the body's frame */
    double origin[3]; /* of the body at q = 0 */
    double fixed[9];  /* rotation, this to parent, at q = 0 */
    double align[9];  /* rotation, inner to body frame */
    double slide[3];  /* direction of a prismatic joint, in the parent's frame */
    double mass;      /* kg */
    double moment[3]; /* mass times centre of mass, kg m */
    double I[6];      /* inertia about the body's origin, kg m2 */
    struct spatial_inertia rigid;
};

/* What one evaluation computes for a body. */
struct link_state {
    double c, s; /* cosine and sine of a revolute joint's angle */
    double r[3]; /* origin in the parent's frame */
    struct spatial v;
    struct spatial bias;  /* velocity-product acceleration */
    struct spatial drift; /* acceleration at vdot = 0, gravity's included */
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
};

/* Calls kernel(type, axis, ...) with both as constants. */
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

/* y = x seen from the body, x in the parent's axes */
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

/* y = x seen from the parent, x in the body's axes */
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

/* child = the parent's motion seen by the body */
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

/* parent += the body's force as it acts on the parent */
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

/* S <- Rot S Rot^T for a turn about axis k; plane: row k of S is zero */
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

/* H <- Rot H Rot^T for a turn about axis k; plane: row k of H is zero */
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

/* f = I v for the rigid body alone */
static inline void rigid_apply(const struct link *link, const struct spatial *v, struct spatial *f)
{
    sym3_apply(link->I, v->a, f->a);
    vec3_add_cross(link->moment, v->l, f->a);
    for (int m = 0; m < 3; m++) {
        f->l[m] = link->mass * v->l[m];
    }
    vec3_add_cross(v->a, link->moment, f->l);
}

/* p = v x* (I v): the force that the rigid body needs at zero acceleration */
static inline void rigid_bias(const struct link *link, const struct spatial *v, struct spatial *p)
{
    struct spatial h;

    rigid_apply(link, v, &h);
    vec3_cross(v->a, h.a, p->a);
    vec3_add_cross(v->l, h.l, p->a);
    vec3_cross(v->a, h.l, p->l);
}

/* p -= the external wrench on the body */
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

/* the joint's transform and what it makes of the parent's velocity */
INLINE void outward_velocity(enum joint_type type, int k, const struct link *link,
                             const struct link_state *parent, double q, double qd,
                             struct link_state *state)
{
    int i = (k + 1) % 3, j = (k + 2) % 3;

    if (type == JOINT_REVOLUTE) {
        state->c = cos(q);
        state->s = sin(q);
        motion_down(k, link, state, &parent->v, &state->v);
        state->v.a[k] += qd;
        state->bias.a[k] = 0.0;
        state->bias.a[i] = state->v.a[j] * qd;
        state->bias.a[j] = -state->v.a[i] * qd;
        state->bias.l[k] = 0.0;
        state->bias.l[i] = state->v.l[j] * qd;
        state->bias.l[j] = -state->v.l[i] * qd;
    } else {
        state->c = 1.0;
        state->s = 0.0;
        for (int m = 0; m < 3; m++) {
            state->r[m] = link->origin[m] + link->slide[m] * q;
        }
        motion_down(k, link, state, &parent->v, &state->v);
        state->v.l[k] += qd;
        memset(&state->bias, 0, sizeof state->bias);
        state->bias.l[i] = state->v.a[j] * qd;
        state->bias.l[j] = -state->v.a[i] * qd;
    }
}

/* A <- A - U U^T / d: what is left of A when the joint gives way. A turning joint without extra
 * inertia (plain) passes on no moment about its axis: row k of J and H becomes zero, and is set so.
 */
INLINE void remove_motion(enum joint_type type, int k, bool plain, const struct spatial *U,
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

/* p += A bias; the bias has no part along axis k, and no angular part behind a sliding joint */
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

/* takes the joint's own motion out of the articulated inertia and hands the rest to the parent;
 * extra inertia resists the joint's motion unless plain */
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
    remove_motion(type, k, plain, &U, inverse_d, &A);
    add_bias(type, k, &A, &state->bias, &p);
    for (int m = 0; m < 3; m++) {
        p.a[m] += U.a[m] * (u * inverse_d);
        p.l[m] += U.l[m] * (u * inverse_d);
    }
    force_up(k, link, state, &p, &parent->p);

    /* to the parent's axes and origin */
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

/* a joint's acceleration from its parent's, and the body's from both */
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

/* the body's acceleration when the joint's is given */
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

/* the joint's share of the force across it; the rest goes to the parent */
INLINE void inward_force(enum joint_type type, int k, const struct link *link,
                         const struct link_state *state, struct link_state *parent, double *tau)
{
    *tau = type == JOINT_REVOLUTE ? state->p.a[k] : state->p.l[k];
    force_up(k, link, state, &state->p, &parent->p);
}

/* the body's place in the world from its parent's */
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

static void base_rotation(const struct dynamics *d, const double *q, double R[9])
{
    if (d->robot->floating) {
        mat3_from_quaternion(q + 3, R);
    } else {
        mat3_identity(R);
    }
}

/* velocities and bias accelerations of all bodies */
static void sweep_velocity(const struct dynamics *d, const double *q, const double *v)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    memset(&state[0].v, 0, sizeof state[0].v);
    if (d->robot->floating) {
        memcpy(state[0].v.l, v, 3 * sizeof *v);
        memcpy(state[0].v.a, v + 3, 3 * sizeof *v);
    }
    q += d->robot->nq - d->robot->njoint;
    v += g->first;
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_velocity, link, &state[link->parent], q[b - 1], v[b - 1], &state[b]);
    }
}

/* accelerations of all bodies from vdot, with up added to that of the base */
static void sweep_acceleration(const struct dynamics *d, const double *vdot, const double up[3])
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    memset(&state[0].a, 0, sizeof state[0].a);
    if (d->robot->floating) {
        memcpy(state[0].a.l, vdot, 3 * sizeof *vdot);
        memcpy(state[0].a.a, vdot + 3, 3 * sizeof *vdot);
    }
    for (int m = 0; m < 3; m++) {
        state[0].a.l[m] += up[m];
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_given, link, &state[link->parent], vdot[g->first + b - 1],
                 &state[b]);
    }
}

/* rotations and positions of all bodies; the joints' transforms are known */
static void sweep_place(const struct dynamics *d, const double *q)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    base_rotation(d, q, state[0].R);
    memset(state[0].position, 0, sizeof state[0].position);
    if (d->robot->floating) {
        memcpy(state[0].position, q, 3 * sizeof *q);
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_place, link, &state[link->parent], &state[b]);
    }
}

/* the upward acceleration of the base that stands for gravity, in the base frame */
static void gravity_up(const struct dynamics *d, const double *q, double up[3])
{
    const double *g = d->robot->gravity, minus[3] = {-g[0], -g[1], -g[2]};
    double R[9];

    base_rotation(d, q, R);
    mat3_apply_transposed(R, minus, up);
}

/* the body's acceleration at vdot = 0 */
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

/* the matrix as an inertia in the body's inner frame */
static void inner_inertia(const struct link *link, const struct added_inertia *added,
                          struct spatial_inertia *A)
{
    const double *a = added->A;
    const double M[6] = {a[0], a[1], a[2], a[6], a[7], a[11]};
    const double H[9] = {a[3], a[8], a[12], a[4], a[9], a[13], a[5], a[10], a[14]};

    memcpy(A->M, M, sizeof M);
    memcpy(A->H, H, sizeof H);
    memcpy(A->J, a + 15, sizeof A->J);
    if (link->inner) {
        double body_to_inner[9];

        mat3_transpose(link->align, body_to_inner);
        spatial_inertia_rotate(body_to_inner, A);
    }
}

/* Adds the given inertia to the observed bodies. It resists what vdot makes of their accelerations
 * and not their drift. */
static void add_inertia(const struct dynamics *d, const double up[3],
                        const struct added_inertia *added)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    memset(&state[0].drift, 0, sizeof state[0].drift);
    memcpy(state[0].drift.l, up, sizeof state[0].drift.l);
    for (size_t b = 0; b < g->nbody; b++) {
        const struct link *link = &g->link[b];
        struct spatial_inertia A;
        struct spatial f;

        if (b > 0) {
            BY_JOINT(link, outward_drift, link, &state[link->parent], &state[b]);
        }
        if (!d->robot->body[b].observed) {
            continue;
        }
        inner_inertia(link, added++, &A);
        spatial_inertia_add(&A, &state[b].A);
        spatial_inertia_apply(&A, &state[b].drift, &f);
        for (int m = 0; m < 3; m++) {
            state[b].p.a[m] -= f.a[m];
            state[b].p.l[m] -= f.l[m];
        }
    }
}

/* Forward dynamics; plain: without extra and added inertia, which are then not read. */
INLINE void articulated_body(const struct dynamics *d, bool plain, const double *q, const double *v,
                             const double *tau, const struct wrench *ext, const double *extra,
                             const struct added_inertia *added, double *vdot)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;
    double up[3];

    /* outward: velocities, then each body's own inertia and bias force */
    sweep_velocity(d, q, v);
    for (size_t b = 0; b < g->nbody; b++) {
        state[b].A = g->link[b].rigid;
        rigid_bias(&g->link[b], &state[b].v, &state[b].p);
        if (ext) {
            subtract_wrench(&g->link[b], &ext[b], &state[b].p);
        }
    }
    gravity_up(d, q, up);
    if (!plain) {
        add_inertia(d, up, added);
    }

    /* inward: articulated inertias and bias forces */
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, inward_articulated, plain, link, tau[b - 1], plain ? 0.0 : extra[b - 1],
                 &state[b], &state[link->parent]);
    }

    /* outward: accelerations, which count gravity as the base's until the end */
    if (d->robot->floating) {
        for (int m = 0; m < 3; m++) {
            state[0].p.a[m] = -state[0].p.a[m];
            state[0].p.l[m] = -state[0].p.l[m];
        }
        spatial_inertia_solve(&state[0].A, &state[0].p, &state[0].a);
        for (int m = 0; m < 3; m++) {
            vdot[m] = state[0].a.l[m] - up[m];
            vdot[m + 3] = state[0].a.a[m];
        }
    } else {
        memset(&state[0].a, 0, sizeof state[0].a);
        memcpy(state[0].a.l, up, sizeof up);
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_acceleration, link, &state[link->parent], &state[b],
                 &vdot[g->first + b - 1]);
    }
}

static void generic_forward(const struct dynamics *d, const double *q, const double *v,
                            const double *tau, const struct wrench *ext, double *vdot)
{
    articulated_body(d, true, q, v, tau, ext, NULL, NULL, vdot);
}

static void generic_implicit(const struct dynamics *d, const double *q, const double *v,
                             const double *tau, const struct wrench *ext, const double *extra,
                             const struct added_inertia *added, double *vdot)
{
    articulated_body(d, false, q, v, tau, ext, extra, added, vdot);
}

static void generic_inverse(const struct dynamics *d, const double *q, const double *v,
                            const double *vdot, const struct wrench *ext, double *f)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;
    double up[3];

    gravity_up(d, q, up);
    sweep_velocity(d, q, v);
    sweep_acceleration(d, vdot, up);
    for (size_t b = 0; b < g->nbody; b++) {
        struct spatial inertial;

        rigid_bias(&g->link[b], &state[b].v, &state[b].p);
        rigid_apply(&g->link[b], &state[b].a, &inertial);
        for (int m = 0; m < 3; m++) {
            state[b].p.a[m] += inertial.a[m];
            state[b].p.l[m] += inertial.l[m];
        }
        if (ext) {
            subtract_wrench(&g->link[b], &ext[b], &state[b].p);
        }
    }
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, inward_force, link, &state[b], &state[link->parent], &f[g->first + b - 1]);
    }
    if (d->robot->floating) {
        memcpy(f, state[0].p.l, sizeof state[0].p.l);
        memcpy(f + 3, state[0].p.a, sizeof state[0].p.a);
    }
}

static void generic_kinematics(const struct dynamics *d, const double *q, const double *v,
                               struct body_motion *motion)
{
    const struct generic *g = d->work;

    sweep_velocity(d, q, v);
    sweep_place(d, q);
    for (size_t b = 0; b < g->nbody; b++) {
        const struct link *link = &g->link[b];
        const struct link_state *state = &g->state[b];

        if (link->inner) {
            double body_to_inner[9];

            mat3_transpose(link->align, body_to_inner);
            mat3_mul(state->R, body_to_inner, motion[b].R);
        } else {
            memcpy(motion[b].R, state->R, sizeof state->R);
        }
        memcpy(motion[b].p, state->position, sizeof state->position);
        mat3_apply(state->R, state->v.a, motion[b].w);
        mat3_apply(state->R, state->v.l, motion[b].v);
    }
}

static void generic_acceleration(const struct dynamics *d, const double *q, const double *v,
                                 const double *vdot, struct body_acceleration *acceleration)
{
    static const double no_gravity[3] = {0.0, 0.0, 0.0};
    const struct generic *g = d->work;

    sweep_velocity(d, q, v);
    sweep_place(d, q);
    sweep_acceleration(d, vdot, no_gravity);
    for (size_t b = 0; b < g->nbody; b++) {
        const struct link_state *state = &g->state[b];
        double a[3] = {state->a.l[0], state->a.l[1], state->a.l[2]};

        /* the components' derivative and the turning of the frame that they are taken in */
        vec3_add_cross(state->v.a, state->v.l, a);
        mat3_apply(state->R, state->a.a, acceleration[b].alpha);
        mat3_apply(state->R, a, acceleration[b].a);
    }
}

static void generic_energy(const struct dynamics *d, const double *q, const double *v,
                           double *kinetic, double *potential)
{
    const struct generic *g = d->work;
    double twice = 0.0, height = 0.0;

    sweep_velocity(d, q, v);
    sweep_place(d, q);
    for (size_t b = 0; b < g->nbody; b++) {
        const struct link_state *state = &g->state[b];
        struct spatial momentum;
        double offset[3];

        rigid_apply(&g->link[b], &state->v, &momentum);
        twice += vec3_dot(momentum.a, state->v.a) + vec3_dot(momentum.l, state->v.l);
        mat3_apply(state->R, g->link[b].moment, offset);
        height -= vec3_dot(d->robot->gravity, offset) +
                  g->link[b].mass * vec3_dot(d->robot->gravity, state->position);
    }
    *kinetic = 0.5 * twice;
    *potential = height;
}

/* The coordinate axis that a unit vector is, or -1. */
static int axis_number(const double axis[3])
{
    for (int k = 0; k < 3; k++) {
        if (axis[k] == 1.0 && axis[(k + 1) % 3] == 0.0 && axis[(k + 2) % 3] == 0.0) {
            return k;
        }
    }
    return -1;
}

/* A rotation whose third column is the unit vector axis. */
static void rotation_to_axis(const double axis[3], double R[9])
{
    double x[3] = {0.0, 0.0, 0.0}, y[3], norm;
    int least = 0;

    for (int m = 1; m < 3; m++) {
        if (fabs(axis[m]) < fabs(axis[least])) {
            least = m;
        }
    }
    x[least] = 1.0;
    vec3_cross(axis, x, y);
    norm = sqrt(vec3_dot(y, y));
    for (int m = 0; m < 3; m++) {
        y[m] /= norm;
    }
    vec3_cross(y, axis, x);
    for (int m = 0; m < 3; m++) {
        R[3 * m] = x[m];
        R[3 * m + 1] = y[m];
        R[3 * m + 2] = axis[m];
    }
}

static bool is_identity(const double R[9])
{
    double identity[9];

    mat3_identity(identity);
    for (int m = 0; m < 9; m++) {
        if (R[m] != identity[m]) {
            return false;
        }
    }
    return true;
}

/* inertia of a body in its inner frame */
static void prepare_inertia(const struct robot_inertia *inertia, struct link *link)
{
    double I[6], com[3], body_to_inner[9];

    memcpy(I, inertia->I, sizeof I);
    mat3_transpose(link->align, body_to_inner);
    mat3_apply(body_to_inner, inertia->com, com);
    if (link->inner) {
        sym3_rotate(body_to_inner, I);
    }
    link->mass = inertia->mass;
    for (int m = 0; m < 3; m++) {
        link->moment[m] = inertia->mass * com[m];
    }
    spatial_inertia_rigid(inertia->mass, com, I, &link->rigid);
    memcpy(link->I, link->rigid.J, sizeof link->I);
}

/* joint of a body as a fixed rotation and a coordinate axis */
static void prepare_joint(const struct robot_joint *joint, const struct link *parent,
                          struct link *link)
{
    double parent_to_inner[9], turned[9];
    int k = axis_number(joint->axis);

    link->type = joint->type;
    link->inner = k < 0;
    link->axis = link->inner ? 2 : k;
    if (link->inner) {
        rotation_to_axis(joint->axis, link->align);
    } else {
        mat3_identity(link->align);
    }
    mat3_transpose(parent->align, parent_to_inner);
    mat3_mul(parent_to_inner, joint->rotation, turned);
    mat3_mul(turned, link->align, link->fixed);
    link->turned = !is_identity(link->fixed);
    mat3_apply(parent_to_inner, joint->origin, link->origin);
    for (int m = 0; m < 3; m++) {
        link->slide[m] = link->fixed[3 * m + link->axis];
    }
    link->offset = joint->type == JOINT_PRISMATIC || vec3_dot(link->origin, link->origin) > 0.0;
}

enum error_code dynamics_generic(const struct robot *robot, struct arena *arena,
                                 struct dynamics *out, struct error *error)
{
    static const struct dynamics_ops ops = {
        .name = "generic",
        .forward = generic_forward,
        .implicit = generic_implicit,
        .inverse = generic_inverse,
        .kinematics = generic_kinematics,
        .acceleration = generic_acceleration,
        .energy = generic_energy,
    };
    struct generic *g = arena_alloc(arena, 1, sizeof *g);
    struct link *link = arena_alloc(arena, robot->nbody, sizeof *link);
    struct link_state *state = arena_alloc(arena, robot->nbody, sizeof *state);

    if (!g || !link || !state) {
        return error_set(error, ERROR_MEMORY, "no memory for the dynamics of %s", robot->name);
    }
    for (size_t b = 0; b < robot->nbody; b++) {
        link[b].parent = robot->body[b].parent;
        if (b == 0) {
            mat3_identity(link[b].align);
        } else {
            prepare_joint(&robot->joint[b - 1], &link[link[b].parent], &link[b]);
        }
        prepare_inertia(&robot->body[b].inertia, &link[b]);
        memcpy(state[b].r, link[b].origin, sizeof state[b].r);
    }
    *g = (struct generic){
        .nbody = robot->nbody, .first = robot->nv - robot->njoint, .link = link, .state = state};
    *out = (struct dynamics){.ops = &ops, .robot = robot, .work = g};
    return ERROR_NONE;
}

void dynamics_qdot(const struct robot *robot, const double *q, const double *v, double *qdot)
{
    size_t nq0 = robot->nq - robot->njoint, nv0 = robot->nv - robot->njoint;

    if (robot->floating) {
        double R[9];
        const double *e = q + 3, *w = v + 3;

        mat3_from_quaternion(e, R);
        mat3_apply(R, v, qdot);
        qdot[3] = 0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]);
        qdot[4] = 0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]);
        qdot[5] = 0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]);
        qdot[6] = 0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        qdot[nq0 + j] = v[nv0 + j];
    }
}
