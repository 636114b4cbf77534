/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numeric rigid-body algorithms for any tree, paper eq. (1): articulated-body forward dynamics,
 * Newton-Euler inverse dynamics, kinematics and energy (Featherstone, Rigid Body Dynamics
 * Algorithms, 2008, tables 5.1, 7.1 and section 9.4). Each is a sweep over the links.
 * dynamics_kernels.h has the steps at one joint, dynamics_prepare.c computes the links.
 *
 * An upward acceleration of the base represents gravity.
 */
#include "model/dynamics_kernels.h"

/* Computes the rotation of the base to world. */
static void base_rotation(const struct dynamics *d, const double *q, double R[9])
{
    if (d->robot->floating) {
        mat3_from_quaternion(q + BASE_Q_QUATERNION, R);
    } else {
        mat3_identity(R);
    }
}

/* Computes the velocities and bias accelerations of all bodies, outward. */
static void sweep_velocity(const struct dynamics *d, const double *q, const double *v)
{
    struct generic *g = d->work;
    struct link_state *state = g->state;

    /* Compute the joints' transforms. A stage of an integrator needs motions, accelerations and
     * velocities at one q, so results for an equal q are reused. */
    const size_t first = d->robot->nq - d->robot->njoint;

    if (!g->turned_known || memcmp(g->q, q, d->robot->nq * sizeof *q) != 0) {
        memcpy(g->q, q, d->robot->nq * sizeof *q);
        g->turned_known = true;
        g->moving_known = false;
        g->place_known = false;
        for (size_t b = 1; b < g->nbody; b++) {
            joint_transform(&g->link[b], q[first + b - 1], &g->state[b]);
        }
    }

    if (g->moving_known && memcmp(g->v, v, d->robot->nv * sizeof *v) == 0) {
        return;
    }
    memcpy(g->v, v, d->robot->nv * sizeof *v);
    g->moving_known = true;
    memset(&state[0].v, 0, sizeof state[0].v);
    if (d->robot->floating) {
        memcpy(state[0].v.l, v + BASE_V_LINEAR, sizeof state[0].v.l);
        memcpy(state[0].v.a, v + BASE_V_ANGULAR, sizeof state[0].v.a);
    }
    v += g->first;
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_velocity, link, &state[link->parent], v[b - 1], &state[b]);
    }
}

/* Computes the accelerations of all bodies from vdot. Adds `up` to the base's acceleration. */
static void sweep_acceleration(const struct dynamics *d, const double *vdot, const double up[3])
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    memset(&state[0].a, 0, sizeof state[0].a);
    if (d->robot->floating) {
        memcpy(state[0].a.l, vdot + BASE_V_LINEAR, sizeof state[0].a.l);
        memcpy(state[0].a.a, vdot + BASE_V_ANGULAR, sizeof state[0].a.a);
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

/* Computes the rotations and positions of all bodies; the joints' transforms must be known. */
static void sweep_place(const struct dynamics *d, const double *q)
{
    struct generic *g = d->work;
    struct link_state *state = g->state;

    if (g->place_known) {
        return;
    }
    g->place_known = true;
    base_rotation(d, q, state[0].R);
    memset(state[0].position, 0, sizeof state[0].position);
    if (d->robot->floating) {
        memcpy(state[0].position, q + BASE_Q_POSITION, sizeof state[0].position);
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, outward_place, link, &state[link->parent], &state[b]);
    }
}

/* Computes the upward acceleration of the base that represents gravity, in the base frame. */
static void gravity_up(const struct dynamics *d, const double *q, double up[3])
{
    const double *g = d->robot->gravity, minus[3] = {-g[0], -g[1], -g[2]};
    double R[9];

    base_rotation(d, q, R);
    mat3_apply_transposed(R, minus, up);
}

/* Adds the given inertia to the observed bodies. The added inertia resists the accelerations due to
 * vdot, but not the accelerations at vdot = 0. */
static void add_observed_inertia(const struct dynamics *d, const double up[3],
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

        /* Unpack the added inertia and rotate it into the body's inner frame */
        spatial_inertia_unpack((added++)->A, &A);
        if (link->inner) {
            double body_to_inner[9];

            mat3_transpose(link->align, body_to_inner);
            spatial_inertia_rotate(body_to_inner, &A);
        }
        spatial_inertia_add(&A, &state[b].A);
        spatial_inertia_apply(&A, &state[b].drift, &f);
        for (int m = 0; m < 3; m++) {
            state[b].p.a[m] -= f.a[m];
            state[b].p.l[m] -= f.l[m];
        }
    }
}

/* Computes the forward dynamics by the articulated-body algorithm. plain: without extra and added
 * inertia; these arguments are not read. */
INLINE void articulated_body(const struct dynamics *d, bool plain, const double *q, const double *v,
                             const double *tau, const struct wrench *ext, const double *extra,
                             const struct added_inertia *added, double *vdot)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;
    double up[3];

    /* Outward: velocities, then each body's own inertia and bias force */
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
        add_observed_inertia(d, up, added);
    }

    /* Inward: articulated inertias and bias forces */
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, inward_articulated, plain, link, tau[b - 1], plain ? 0.0 : extra[b - 1],
                 &state[b], &state[link->parent]);
    }

    /* Outward: accelerations. Gravity is an acceleration of the base that is removed at the end */
    if (d->robot->floating) {
        for (int m = 0; m < 3; m++) {
            state[0].p.a[m] = -state[0].p.a[m];
            state[0].p.l[m] = -state[0].p.l[m];
        }
        spatial_inertia_solve(&state[0].A, &state[0].p, &state[0].a);
        for (int m = 0; m < 3; m++) {
            vdot[BASE_V_LINEAR + m] = state[0].a.l[m] - up[m];
            vdot[BASE_V_ANGULAR + m] = state[0].a.a[m];
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

/* Computes accelerations by torques alone (struct dynamics_ops). Only the ways from the torques to
 * the base are walked inward, and outward only what they move. */
static void generic_respond(const struct dynamics *d, const double *tau, double *vdot)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;

    memset(vdot, 0, d->robot->nv * sizeof *vdot);
    memset(g->moved, 0, g->nbody * sizeof *g->moved);
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const double own = tau[b - 1];
        struct link_state *parent = &state[g->parent[b]];

        if (!g->moved[b] && own != 0.0) {
            memset(&state[b].p, 0, sizeof state[b].p);
            g->moved[b] = true;
        }
        if (g->moved[b]) {
            if (!g->moved[g->parent[b]]) {
                memset(&parent->p, 0, sizeof parent->p);
                g->moved[g->parent[b]] = true;
            }
            BY_JOINT(&g->link[b], inward_response, &g->link[b], own, &state[b], parent);
        }
    }
    memset(&state[0].a, 0, sizeof state[0].a);
    if (g->moved[0] && d->robot->floating) {
        spatial_inertia_solve(&state[0].A, &state[0].p, &state[0].a);
        for (int m = 0; m < 3; m++) {
            vdot[BASE_V_LINEAR + m] = state[0].a.l[m] = -state[0].a.l[m];
            vdot[BASE_V_ANGULAR + m] = state[0].a.a[m] = -state[0].a.a[m];
        }
    } else {
        g->moved[0] = false;
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct link_state *parent = &state[g->parent[b]];

        if (!g->moved[b] && g->moved[g->parent[b]]) {
            state[b].u = 0.0;
            g->moved[b] = true;
        }
        if (g->moved[b]) {
            BY_JOINT(&g->link[b], outward_response, &g->link[b], parent, &state[b],
                     &vdot[g->first + b - 1]);
        }
    }
}

/* Computes the inverse dynamics by the recursive Newton-Euler algorithm (struct dynamics_ops). */
static void generic_inverse(const struct dynamics *d, const double *q, const double *v,
                            const double *vdot, const struct wrench *ext, double *f)
{
    const struct generic *g = d->work;
    struct link_state *state = g->state;
    double up[3];

    /* Outward: compute velocities and accelerations, then the force that each body's motion
     * needs */
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

    /* Inward: each joint's component of the force */
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const struct link *link = &g->link[b];

        BY_JOINT(link, inward_force, link, &state[b], &state[link->parent], &f[g->first + b - 1]);
    }
    if (d->robot->floating) {
        memcpy(f + BASE_V_LINEAR, state[0].p.l, sizeof state[0].p.l);
        memcpy(f + BASE_V_ANGULAR, state[0].p.a, sizeof state[0].p.a);
    }
}

/* Computes poses and velocities of the frames of all bodies (struct dynamics_ops). */
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

/* Computes the classical accelerations of all bodies in the world frame (struct dynamics_ops). */
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

        /* The derivative of the components, plus the effect of the rotating frame */
        vec3_add_cross(state->v.a, state->v.l, a);
        mat3_apply(state->R, state->a.a, acceleration[b].alpha);
        mat3_apply(state->R, a, acceleration[b].a);
    }
}

/* Computes kinetic and potential energy (struct dynamics_ops). */
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

enum error_code dynamics_generic(const struct robot *robot, struct arena *arena,
                                 struct dynamics *out, struct error *error)
{
    static const struct dynamics_ops ops = {
        .name = "generic",
        .forward = generic_forward,
        .implicit = generic_implicit,
        .respond = generic_respond,
        .inverse = generic_inverse,
        .kinematics = generic_kinematics,
        .velocities = generic_kinematics,
        .acceleration = generic_acceleration,
        .energy = generic_energy,
    };
    struct generic *g = arena_alloc(arena, 1, sizeof *g);
    struct link *link = arena_alloc(arena, robot->nbody, sizeof *link);
    struct link_state *state = arena_alloc(arena, robot->nbody, sizeof *state);
    double *q = arena_alloc(arena, robot->nq, sizeof *q);
    double *v = arena_alloc(arena, robot->nv, sizeof *v);
    int *parent = arena_alloc(arena, robot->nbody, sizeof *parent);
    bool *moved = arena_alloc(arena, robot->nbody, sizeof *moved);

    if (!g || !link || !state || !q || !v || !parent || !moved) {
        return error_set(error, ERROR_MEMORY, "no memory for the dynamics of %s", robot->name);
    }

    /* Prepare the links from the base outward. The origins of revolute joints are constant */
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_body *body = &robot->body[b];

        generic_prepare_link(body, b > 0 ? &robot->joint[b - 1] : NULL,
                             b > 0 ? &link[body->parent] : NULL, &link[b]);
        memcpy(state[b].r, link[b].origin, sizeof state[b].r);
        parent[b] = body->parent;
    }
    *g = (struct generic){.nbody = robot->nbody,
                          .first = robot->nv - robot->njoint,
                          .link = link,
                          .state = state,
                          .parent = parent,
                          .moved = moved,
                          .q = q,
                          .v = v};
    *out = (struct dynamics){.ops = &ops, .robot = robot, .work = g};
    return ERROR_NONE;
}

/* ---- common to all implementations ---- */

void dynamics_qdot(const struct robot *robot, const double *q, const double *v, double *qdot)
{
    size_t nq0 = robot->nq - robot->njoint, nv0 = robot->nv - robot->njoint;

    if (robot->floating) {
        double R[9];
        const double *e = q + BASE_Q_QUATERNION, *w = v + BASE_V_ANGULAR;
        double *rate = qdot + BASE_Q_QUATERNION;

        /* The base: rotate the velocity to the world's axes. The quaternion's rate is half its
         * product with (0, w) */
        mat3_from_quaternion(e, R);
        mat3_apply(R, v + BASE_V_LINEAR, qdot + BASE_Q_POSITION);
        rate[0] = 0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]);
        rate[1] = 0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]);
        rate[2] = 0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]);
        rate[3] = 0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        qdot[nq0 + j] = v[nv0 + j];
    }
}
