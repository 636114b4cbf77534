/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numeric rigid-body algorithms for any tree, paper eq. (1): articulated-body forward dynamics,
 * Newton-Euler inverse dynamics, kinematics and energy (Featherstone, Rigid Body Dynamics
 * Algorithms, 2008, tables 5.1, 7.1 and section 9.4). Each algorithm sweeps over groups of bodies.
 * dynamics_kernels.h has the steps for one group; dynamics_prepare.c makes the groups. This file is
 * compiled once per instruction set; SWEEPS_OPS is the name of its function table.
 *
 * An upward acceleration of the base represents gravity.
 */
#include "model/dynamics_kernels.h"

#ifndef SWEEPS_OPS
#define SWEEPS_OPS generic_ops
#endif

/* Loads values of joints into the lanes of their bodies. Other lanes receive 0. */
INLINE lanes load_joints(const struct group *group, const double *x)
{
    const int *joint = group->joint;

    return (lanes){x[joint[0]], x[joint[1]], x[joint[2]], x[joint[3]]} * (1.0 - group->idle);
}

/* Stores the values in the lanes of bodies as values of their joints. */
INLINE void store_joints(const struct group *group, lanes x, double *stored)
{
    for (int i = 0; i < GROUP; i++) {
        if (group->body[i] >= 0) {
            stored[group->joint[i]] = x[i];
        }
    }
}

/* Rotates a lane of x to the base frame and stores it as the base's part of an acceleration or a
 * force. */
static void store_base(const struct generic *g, const struct spatial_lanes *x, int lane, double *v)
{
    const lanes *R = g->group[0].R;

    for (int m = 0; m < 3; m++) {
        v[BASE_V_LINEAR + m] = v[BASE_V_ANGULAR + m] = 0.0;
        for (int n = 0; n < 3; n++) {
            v[BASE_V_LINEAR + m] += R[3 * n + m][0] * x->l[n][lane];
            v[BASE_V_ANGULAR + m] += R[3 * n + m][0] * x->a[n][lane];
        }
    }
}

/* Reads the articulated inertia of the base. */
static void read_base_inertia(const struct generic *g, struct spatial_inertia *A)
{
    const struct inertia_lanes *from = &g->group[0].A;

    for (int k = 0; k < 9; k++) {
        A->H[k] = from->H[k][0];
    }
    for (int k = 0; k < 6; k++) {
        A->J[k] = from->J[k][0];
        A->M[k] = from->M[k][0];
    }
}

/* Solves A a = -p for the acceleration a of a free base, in one lane of p and a. A: articulated
 * inertia. Also writes the base's part of vdot. */
static void accelerate_base(const struct generic *g, const struct spatial_inertia *A,
                            const struct spatial_lanes *p, int lane, struct spatial_lanes *a,
                            double *vdot)
{
    struct spatial f, x;

    for (int m = 0; m < 3; m++) {
        f.a[m] = p->a[m][lane];
        f.l[m] = p->l[m][lane];
    }
    spatial_inertia_solve(A, &f, &x);
    for (int m = 0; m < 3; m++) {
        a->a[m][lane] = -x.a[m];
        a->l[m][lane] = -x.l[m];
    }
    store_base(g, a, lane, vdot);
}

/* Sets the spatial motion x of the base from the base's part of v, a velocity or an acceleration. A
 * fixed base gets 0. */
static void set_base(const struct dynamics *d, const double *v, struct spatial_lanes *x)
{
    const struct generic *g = d->work;
    const lanes *R = g->group[0].R;

    memset(x, 0, sizeof *x);
    for (int m = 0; m < 3; m++) {
        for (int n = 0; d->robot->floating && n < 3; n++) {
            x->l[m][0] += R[3 * m + n][0] * v[BASE_V_LINEAR + n];
            x->a[m][0] += R[3 * m + n][0] * v[BASE_V_ANGULAR + n];
        }
    }
}

/* Computes sines and cosines of angles of at most 1e5 rad in lanes, as portable_sincos does. */
INLINE void lanes_sincos(lanes x, lanes *sine, lanes *cosine)
{
    const lanes shifted = x * 0.6366197723675814 + 0x1.8p52, n = shifted - 0x1.8p52;
    const lanes y = x - n * 1.5707963267341256, r = y - n * 6.077100506303966e-11;
    const lanes e = ((y - r) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;
    const lanes z = r * r, half = 0.5 * z, w = 1.0 - half;
    const lanes_bits k = (lanes_bits)shifted, odd = -(k & 1);
    lanes s = z * 2.8114572543455206e-15 - 7.647163731819816e-13;
    lanes c = z * 4.779477332387385e-14 - 1.1470745597729725e-11;

    s = z * s + 1.6059043836821613e-10;
    c = z * c + 2.08767569878681e-09;
    s = z * s - 2.505210838544172e-08;
    c = z * c - 2.755731922398589e-07;
    s = z * s + 2.7557319223985893e-06;
    c = z * c + 2.4801587301587302e-05;
    s = z * s - 0.00019841269841269841;
    c = z * c - 0.0013888888888888889;
    s = z * s + 0.0083333333333333332;
    c = z * c + 0.041666666666666664;
    s = z * s - 0.16666666666666666;
    s = r + (z * (r * s - 0.5 * e) + e);
    c = w + (((1.0 - w) - half) + (z * (z * c) - r * e));
    *sine = (lanes)((((lanes_bits)s & ~odd) | ((lanes_bits)c & odd)) ^ (k & 2) << 62);
    *cosine = (lanes)((((lanes_bits)c & ~odd) | ((lanes_bits)s & odd)) ^ ((k + 1) & 2) << 62);
}

/* Computes the sines and cosines of all joints' positions. */
static void find_sines(const struct generic *g, const double *q)
{
    const size_t njoint = g->nbody - 1;

    for (size_t j = 0; j < njoint; j += GROUP) {
        const size_t count = njoint - j < GROUP ? njoint - j : GROUP;
        lanes x = {0.0};

        memcpy(&x, q + j, count * sizeof *q);
        lanes_sincos(x, &g->sine[j / GROUP], &g->cosine[j / GROUP]);
        for (size_t i = 0; i < count; i++) {
            if (!(fabs(x[i]) <= 1e5)) {
                double sine, cosine;

                portable_sincos(x[i], &sine, &cosine);
                g->sine[j / GROUP][i] = sine;
                g->cosine[j / GROUP][i] = cosine;
            }
        }
    }
}

/* Computes the poses of a group from the parents' poses and the joints' positions. */
INLINE void place_group(const struct generic *g, struct group *group, const double *q)
{
    const lanes slides = 1.0 - group->turns;
    const lanes c = load_joints(group, (const double *)g->cosine) * group->turns + slides;
    const lanes s = load_joints(group, (const double *)g->sine) * group->turns;
    const lanes slide = load_joints(group, q) * slides;
    lanes gathered[12], turn[9], origin[3];
    const lanes *parent = from_parents(g, group, offsetof(struct group, R), 12, gathered);

    for (int row = 0; row < 9; row += 3) {
        const lanes *fixed = group->fixed + row;

        turn[row] = c * fixed[0] + s * fixed[1];
        turn[row + 1] = c * fixed[1] - s * fixed[0];
        turn[row + 2] = fixed[2];
        origin[row / 3] = group->origin[row / 3] + fixed[2] * slide;
    }
    lanes_mul(parent, turn, group->R);
    lanes_apply(parent, origin, group->r);
    for (int m = 0; m < 3; m++) {
        group->position[m] = parent[9 + m] + group->r[m];
    }
}

/* Computes the poses of all bodies, outward. A stage of an integrator needs motions, accelerations
 * and velocities at one q, so results for an equal q are reused. */
static void sweep_place(const struct dynamics *d, const double *q)
{
    struct generic *g = d->work;
    struct group *base = &g->group[0];

    if (g->place_known && memcmp(g->q, q, d->robot->nq * sizeof *q) == 0) {
        return;
    }
    memcpy(g->q, q, d->robot->nq * sizeof *q);
    g->place_known = true;
    g->moving_known = false;
    if (d->robot->floating) {
        double R[9];

        mat3_from_quaternion(q + BASE_Q_QUATERNION, R);
        for (int k = 0; k < 9; k++) {
            base->R[k][0] = R[k];
        }
        for (int m = 0; m < 3; m++) {
            base->position[m][0] = q[BASE_Q_POSITION + m];
        }
    }
    q += d->robot->nq - d->robot->njoint;
    find_sines(g, q);
    for (size_t i = 1; i < g->ngroup; i++) {
        place_group(g, &g->group[i], q);
    }
}

/* Computes the poses, velocities and bias accelerations of all bodies, outward. */
static void sweep_velocity(const struct dynamics *d, const double *q, const double *v)
{
    struct generic *g = d->work;

    sweep_place(d, q);
    if (g->moving_known && memcmp(g->v, v, d->robot->nv * sizeof *v) == 0) {
        return;
    }
    memcpy(g->v, v, d->robot->nv * sizeof *v);
    g->moving_known = true;
    set_base(d, v, &g->group[0].v);
    for (size_t i = 1; i < g->ngroup; i++) {
        outward_velocity(g, &g->group[i], load_joints(&g->group[i], v + g->first));
    }
}

/* Computes the accelerations of all bodies from vdot (NULL: zero). lifts: adds the upward
 * acceleration of the base that represents gravity. */
static void sweep_acceleration(const struct dynamics *d, const double *vdot, bool lifts)
{
    const struct generic *g = d->work;
    struct spatial_lanes *base = &g->group[0].a;

    memset(base, 0, sizeof *base);
    if (vdot) {
        set_base(d, vdot, base);
    }
    for (int m = 0; lifts && m < 3; m++) {
        base->l[m][0] -= d->robot->gravity[m];
    }
    for (size_t i = 1; i < g->ngroup; i++) {
        struct group *group = &g->group[i];

        motion_out(g, group, offsetof(struct group, a), &group->a);
        add_bias(group, &group->a);
        if (vdot) {
            add_joint_motion(group, load_joints(group, vdot + g->first), &group->a);
        }
    }
}

/* Computes the rotation of a body's own frame to world. */
static void body_rotation(const struct group *group, int lane, double R[9])
{
    double inner[9], align[9], back[9];

    for (int k = 0; k < 9; k++) {
        inner[k] = group->R[k][lane];
        align[k] = group->align[k][lane];
    }
    mat3_transpose(align, back);
    mat3_mul(inner, back, R);
}

/* Adds the given inertia to the observed bodies. */
static void add_observed_inertia(const struct dynamics *d, const struct added_inertia *added)
{
    const struct generic *g = d->work;

    for (size_t b = 0; added && b < g->nbody; b++) {
        struct inertia_lanes *sum = &g->group[g->home[b]].A;
        const int lane = g->lane[b];
        struct spatial_inertia A;
        double R[9];

        /* Usual case: no inertia. Its diagonal is then zero, and only then */
        const double *S = d->robot->body[b].observed ? (added++)->A : NULL;

        if (!S || S[0] + S[6] + S[11] + S[15] + S[18] + S[20] == 0.0) {
            continue;
        }

        /* Unpack the added inertia and rotate it to world axes */
        spatial_inertia_unpack(S, &A);
        body_rotation(&g->group[g->home[b]], lane, R);
        spatial_inertia_rotate(R, &A);
        for (int k = 0; k < 9; k++) {
            sum->H[k][lane] += A.H[k];
        }
        for (int k = 0; k < 6; k++) {
            sum->J[k][lane] += A.J[k];
            sum->M[k][lane] += A.M[k];
        }
    }
}

/* Subtracts the external wrenches on the bodies from p. */
static void subtract_wrenches(const struct generic *g, const struct wrench *ext)
{
    static const struct wrench none;

    for (size_t b = 0; ext && b < g->nbody; b++) {
        struct group *group = &g->group[g->home[b]];
        double R[9], f[3], n[3];

        /* Usual case: no wrench */
        if (memcmp(&ext[b], &none, sizeof none) == 0) {
            continue;
        }
        body_rotation(group, g->lane[b], R);
        mat3_apply(R, ext[b].moment, n);
        mat3_apply(R, ext[b].force, f);
        for (int m = 0; m < 3; m++) {
            group->p.a[m][g->lane[b]] -= n[m];
            group->p.l[m][g->lane[b]] -= f[m];
        }
    }
}

/* Computes the forces that the bodies' motions need at vdot (NULL: zero), minus the external
 * wrenches. */
static void sweep_forces(const struct dynamics *d, const double *q, const double *v,
                         const double *vdot, const struct wrench *ext)
{
    const struct generic *g = d->work;

    sweep_velocity(d, q, v);
    sweep_acceleration(d, vdot, true);
    for (size_t i = 0; i < g->ngroup; i++) {
        find_rigid_force(&g->group[i]);
    }
    subtract_wrenches(g, ext);
}

/* Computes the forward dynamics by the articulated-body algorithm, with added inertia (struct
 * dynamics_ops). extra and added may be NULL. */
static void sweeps_implicit(const struct dynamics *d, const double *q, const double *v,
                            const double *tau, const struct wrench *ext, const double *extra,
                            const struct added_inertia *added, double *vdot)
{
    const struct generic *g = d->work;
    struct group *base = &g->group[0];

    /* Outward: velocities, then each body's own inertia and its force at vdot = 0 */
    sweep_forces(d, q, v, NULL, ext);
    add_observed_inertia(d, added);

    /* Inward: articulated inertias and bias forces */
    for (size_t i = g->ngroup - 1; i > 0; i--) {
        struct group *group = &g->group[i];

        inward_articulated(g, group, load_joints(group, tau),
                           extra ? load_joints(group, extra) + group->idle : group->idle);
    }

    /* Outward: accelerations, without their part at vdot = 0 */
    memset(&base->a, 0, sizeof base->a);
    if (d->robot->floating) {
        struct spatial_inertia A;

        read_base_inertia(g, &A);
        accelerate_base(g, &A, &base->p, 0, &base->a, vdot);
    }
    for (size_t i = 1; i < g->ngroup; i++) {
        store_joints(&g->group[i], outward_acceleration(g, &g->group[i]), vdot + g->first);
    }
}

static void sweeps_forward(const struct dynamics *d, const double *q, const double *v,
                           const double *tau, const struct wrench *ext, double *vdot)
{
    sweeps_implicit(d, q, v, tau, ext, NULL, NULL, vdot);
}

/* ---- responses ---- */

/* Computes up to GROUP responses side by side, one per lane (struct dynamics_ops). The inward sweep
 * visits only bodies between the torques and the base. The outward sweep visits only bodies that
 * the torques move. */
static void respond_side_by_side(const struct dynamics *d, int count, const double *tau,
                                 double *vdot)
{
    const struct generic *g = d->work;
    const size_t njoint = d->robot->njoint, nv = d->robot->nv;
    const lanes zero = {0.0};

    for (size_t b = 0; b < g->nbody; b++) {
        g->response[b].moved = false;
    }
    for (size_t b = g->nbody - 1; b > 0; b--) {
        const struct group *group = &g->group[g->home[b]];
        const int lane = g->lane[b];
        struct response *own = &g->response[b], *up = &g->response[d->robot->body[b].parent];
        const bool turns = group->turns[lane] != 0.0;
        struct spatial_lanes p;
        lanes torque = zero;
        bool acts = own->moved;

        for (int i = 0; i < count; i++) {
            torque[i] = tau[(size_t)i * njoint + b - 1];
            acts = acts || torque[i] != 0.0;
        }
        if (!acts) {
            continue;
        }
        if (!own->moved) {
            memset(&own->p, 0, sizeof own->p);
            own->moved = true;
        }
        if (!up->moved) {
            memset(&up->p, 0, sizeof up->p);
            up->moved = true;
        }
        own->u = torque;
        for (int m = 0; m < 3; m++) {
            own->u -= group->R[3 * m + 2][lane] * (turns ? own->p.a[m] : own->p.l[m]);
        }
        for (int m = 0; m < 3; m++) {
            p.a[m] = own->p.a[m] + own->u * (group->U.a[m][lane] * group->inverse_d[lane]);
            p.l[m] = own->p.l[m] + own->u * (group->U.l[m][lane] * group->inverse_d[lane]);
        }
        for (int m = 0; m < 3; m++) {
            const int i = (m + 1) % 3, j = (m + 2) % 3;

            up->p.a[m] += p.a[m] + (group->r[i][lane] * p.l[j] - group->r[j][lane] * p.l[i]);
            up->p.l[m] += p.l[m];
        }
    }

    /* Outward: the base, then all bodies that move */
    struct response *base = &g->response[0];

    memset(&base->a, 0, sizeof base->a);
    memset(vdot, 0, (size_t)count * nv * sizeof *vdot);
    base->moved = base->moved && d->robot->floating;
    if (base->moved) {
        struct spatial_inertia A;

        read_base_inertia(g, &A);
        for (int i = 0; i < count; i++) {
            accelerate_base(g, &A, &base->p, i, &base->a, vdot + (size_t)i * nv);
        }
    }
    for (size_t b = 1; b < g->nbody; b++) {
        const struct group *group = &g->group[g->home[b]];
        const int lane = g->lane[b];
        struct response *own = &g->response[b];
        const struct response *up = &g->response[d->robot->body[b].parent];
        lanes qdd = own->moved ? own->u : zero;

        own->moved = own->moved || up->moved;
        if (!own->moved) {
            continue;
        }
        memset(&own->a, 0, sizeof own->a);
        for (int m = 0; up->moved && m < 3; m++) {
            const int i = (m + 1) % 3, j = (m + 2) % 3;

            own->a.a[m] = up->a.a[m];
            own->a.l[m] =
                up->a.l[m] + (up->a.a[i] * group->r[j][lane] - up->a.a[j] * group->r[i][lane]);
        }
        for (int m = 0; m < 3; m++) {
            qdd -= group->U.a[m][lane] * own->a.a[m] + group->U.l[m][lane] * own->a.l[m];
        }
        qdd *= group->inverse_d[lane];
        for (int m = 0; m < 3; m++) {
            *(group->turns[lane] != 0.0 ? &own->a.a[m] : &own->a.l[m]) +=
                group->R[3 * m + 2][lane] * qdd;
        }
        for (int i = 0; i < count; i++) {
            vdot[(size_t)i * nv + g->first + b - 1] = qdd[i];
        }
    }
}

static void sweeps_respond(const struct dynamics *d, size_t count, const double *tau, double *vdot)
{
    for (size_t i = 0; i < count; i += GROUP) {
        respond_side_by_side(d, count - i < GROUP ? (int)(count - i) : GROUP,
                             tau + i * d->robot->njoint, vdot + i * d->robot->nv);
    }
}

/* ---- other algorithms ---- */

/* Computes the inverse dynamics by the recursive Newton-Euler algorithm (struct dynamics_ops). */
static void sweeps_inverse(const struct dynamics *d, const double *q, const double *v,
                           const double *vdot, const struct wrench *ext, double *f)
{
    const struct generic *g = d->work;

    /* Outward: compute velocities and accelerations, then the force that each body's motion
     * needs */
    sweep_forces(d, q, v, vdot, ext);

    /* Inward: each joint's component of the force */
    for (size_t i = g->ngroup - 1; i > 0; i--) {
        store_joints(&g->group[i], along_axis(&g->group[i], &g->group[i].p), f + g->first);
        force_in(g, &g->group[i], &g->group[i].p);
    }
    if (d->robot->floating) {
        store_base(g, &g->group[0].p, 0, f);
    }
}

/* Computes velocities of the frames of all bodies (struct dynamics_ops). It stores them in
 * group->a, so that the known velocities in group->v stay valid. */
static void sweeps_velocities(const struct dynamics *d, const double *q, const double *v,
                              struct body_motion *motion)
{
    const struct generic *g = d->work;

    sweep_place(d, q);
    set_base(d, v, &g->group[0].a);
    for (size_t n = 0; n < g->ngroup; n++) {
        struct group *group = &g->group[n];

        if (n > 0) {
            motion_out(g, group, offsetof(struct group, a), &group->a);
            add_joint_motion(group, load_joints(group, v + g->first), &group->a);
        }
        for (int i = 0; i < GROUP; i++) {
            for (int m = 0; group->body[i] >= 0 && m < 3; m++) {
                motion[group->body[i]].w[m] = group->a.a[m][i];
                motion[group->body[i]].v[m] = group->a.l[m][i];
            }
        }
    }
}

/* Computes poses and velocities of the frames of all bodies (struct dynamics_ops). */
static void sweeps_kinematics(const struct dynamics *d, const double *q, const double *v,
                              struct body_motion *motion)
{
    const struct generic *g = d->work;

    sweep_velocity(d, q, v);
    for (size_t n = 0; n < g->ngroup; n++) {
        const struct group *group = &g->group[n];
        lanes R[9];

        for (int k = 0; k < 9; k++) {
            R[k] = lanes_row_product(group->R, group->align, k / 3, k % 3);
        }
        for (int i = 0; i < GROUP; i++) {
            struct body_motion *own = &motion[group->body[i] < 0 ? 0 : group->body[i]];

            for (int k = 0; group->body[i] >= 0 && k < 9; k++) {
                own->R[k] = R[k][i];
            }
            for (int m = 0; group->body[i] >= 0 && m < 3; m++) {
                own->p[m] = group->position[m][i];
                own->w[m] = group->v.a[m][i];
                own->v[m] = group->v.l[m][i];
            }
        }
    }
}

/* Computes the classical accelerations of all bodies in the world frame (struct dynamics_ops). */
static void sweeps_acceleration(const struct dynamics *d, const double *q, const double *v,
                                const double *vdot, struct body_acceleration *acceleration)
{
    const struct generic *g = d->work;

    sweep_velocity(d, q, v);
    sweep_acceleration(d, vdot, false);
    for (size_t n = 0; n < g->ngroup; n++) {
        const struct group *group = &g->group[n];
        lanes a[3] = {group->a.l[0], group->a.l[1], group->a.l[2]};

        /* The derivative of the components, plus the effect of the rotating frame */
        lanes_add_cross(group->v.a, group->v.l, a);
        for (int i = 0; i < GROUP; i++) {
            for (int m = 0; group->body[i] >= 0 && m < 3; m++) {
                acceleration[group->body[i]].alpha[m] = group->a.a[m][i];
                acceleration[group->body[i]].a[m] = a[m][i];
            }
        }
    }
}

/* Computes kinetic and potential energy (struct dynamics_ops). */
static void sweeps_energy(const struct dynamics *d, const double *q, const double *v,
                          double *kinetic, double *potential)
{
    const struct generic *g = d->work;
    double twice = 0.0, height = 0.0;

    sweep_velocity(d, q, v);
    for (size_t n = 0; n < g->ngroup; n++) {
        struct group *group = &g->group[n];
        struct spatial_lanes momentum;

        place_inertia(group);
        rigid_apply(group, &group->v, &momentum);
        for (int m = 0; m < 3; m++) {
            const lanes share = momentum.a[m] * group->v.a[m] + momentum.l[m] * group->v.l[m];
            const lanes fall = group->moment[m] + group->mass * group->position[m];

            for (int i = 0; i < GROUP; i++) {
                twice += share[i];
                height -= d->robot->gravity[m] * fall[i];
            }
        }
    }
    *kinetic = 0.5 * twice;
    *potential = height;
}

const struct dynamics_ops SWEEPS_OPS = {
    .name = "generic",
    .forward = sweeps_forward,
    .implicit = sweeps_implicit,
    .respond = sweeps_respond,
    .inverse = sweeps_inverse,
    .kinematics = sweeps_kinematics,
    .velocities = sweeps_velocities,
    .acceleration = sweeps_acceleration,
    .energy = sweeps_energy,
};
