/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Linearly implicit Euler for the plant. With the accelerations a = (v+ - v)/h as the unknowns,
 * every stiff force is taken at the end of the step and linearized there:
 *
 *   drives      the three linear equations of a drive are eliminated; an inertia on its joint and a
 *               torque remain (model/actuator.h, struct sea_step); parallel springs likewise;
 *   contact     a pair with the tangents K and D has, at its center, the wrench
 *               F - h K V - h (D + h K) A with the relative velocity V and acceleration A;
 *               this adds A_b = h (D + h K) to the inertias of its bodies.
 *
 * So the system is (Mass + E + sum Jb^T A_b Jb) a = right-hand side, which dynamics_ops.implicit
 * solves in one pass over the tree. Free bodies are 6x6 systems of their own. A pair between two
 * moving bodies couples them beyond the tree's structure: C holds those blocks, and conjugate
 * gradients with the uncoupled system P as preconditioner solve (P + C) a = rhs. Both are positive
 * definite, and so is P - C, hence P^-1 C has its eigenvalues within (-1, 1), no more than 12 of
 * them other than zero for each such pair.
 *
 * The wrench at a step's end is thus F - h K V - h (D + h K) A. It is kept for the sensors, with the
 * accelerations: the law of contact itself, evaluated at the state that the step led to, would turn
 * each error e of a velocity into a force D e, with D up to 1e5 N s/m, that has moved nothing.
 *
 * Positions follow with the new velocities: q+ = q + h v+, rotations by the exponential.
 *
 * What is explicit: gravity, velocity products, pushes, and the difference between contact and its
 * tangent. Velocity products make what tumbles freely gain energy in proportion to h: a box at
 * 10 rad/s and 1 ms a quarter of a percent a second. The scheme is consistent, of first order, for
 * any tangent; for stability a tangent may be too large at will, but not less than half of the true
 * one.
 */
#include "model/implicit.h"

#include "model/spatial.h"

#include <math.h>
#include <string.h>

/* Bounds of the conjugate gradients: steps, and the share of the first residual that is left
 * (squared, in the norm of P^-1). */
enum { COUPLING_STEPS = 16 };
#define COUPLING_LEFT 1e-8

static const char crowded[] = "contact: more pairs are in touch than the implicit integrator takes";

/* One pair in touch; bodies as contact motions, -1 = the world. World frame, about center. */
struct touch {
    int body[2];
    double center[3];
    struct spatial_inertia A; /* h (D + h K) */
    int pair;
    struct spatial less; /* by which the wrench on b there falls in the step; at first its h K V */
};

struct implicit {
    struct sea_step *drive;
    double *extra, *torque; /* by joint */
    size_t nobserved;
    size_t *number;                /* by contact motion: that of its body among the observed ones */
    struct added_inertia *added;   /* by observed body */
    struct spatial_inertia *solid; /* by contact motion: A_b, in the world, about its origin */
    size_t ntouch;
    struct contact_tangent *tangent;
    struct touch *touch;
    struct contact_wrench *wrench; /* by contact motion, at the end of the step */
    bool coupled;                  /* some pair is between two bodies that move */
    struct spatial_inertia *own;   /* by free body: inertia with A_b, body frame, center of mass */
    struct spatial *load;          /* by free body: force on it, body frame, center of mass */

    /* accelerations: nv of the robot, then 6 of each free body (linear, angular; in its frame) */
    size_t na;
    double *a, *uncoupled, *z, *p;
    /* by contact motion, world frame, about the body's origin: accelerations and wrenches */
    struct spatial *twist_p, *twist_z, *r, *s, *w;
    struct wrench *ext;         /* by body of the robot */
    struct body_motion *motion; /* by body of the robot */
};

/* ---- small algebra ---- */

static void full(const double S[21], struct spatial_inertia *A)
{
    const double M[6] = {S[0], S[1], S[2], S[6], S[7], S[11]};
    const double H[9] = {S[3], S[8], S[12], S[4], S[9], S[13], S[5], S[10], S[14]};

    memcpy(A->M, M, sizeof M);
    memcpy(A->H, H, sizeof H);
    memcpy(A->J, S + 15, sizeof A->J);
}

static void pack(const struct spatial_inertia *A, double S[21])
{
    const double *M = A->M, *H = A->H;
    const double upper[15] = {M[0], M[1], M[2], H[0], H[3], H[6], M[3], M[4],
                              H[1], H[4], H[7], M[5], H[2], H[5], H[8]};

    memcpy(S, upper, sizeof upper);
    memcpy(S + 15, A->J, sizeof A->J);
}

/* the motion at a point at arm from where x is the motion */
static struct spatial move_motion(const struct spatial *x, const double arm[3])
{
    struct spatial y = *x;

    vec3_add_cross(x->a, arm, y.l);
    return y;
}

/* sum += scale times the wrench f, moved to where it is at arm from */
static void add_wrench(double scale, const struct spatial *f, const double arm[3],
                       struct spatial *sum)
{
    double moment[3] = {f->a[0], f->a[1], f->a[2]};

    vec3_add_cross(arm, f->l, moment);
    for (int i = 0; i < 3; i++) {
        sum->l[i] += scale * f->l[i];
        sum->a[i] += scale * moment[i];
    }
}

static struct spatial turn(const double R[9], const struct spatial *x)
{
    struct spatial y;

    mat3_apply(R, x->l, y.l);
    mat3_apply(R, x->a, y.a);
    return y;
}

static struct spatial turn_back(const double R[9], const struct spatial *x)
{
    struct spatial y;

    mat3_apply_transposed(R, x->l, y.l);
    mat3_apply_transposed(R, x->a, y.a);
    return y;
}

static double inner(const struct spatial *f, const struct spatial *x, size_t count)
{
    double sum = 0.0;

    for (size_t i = 0; i < count; i++) {
        sum += vec3_dot(f[i].l, x[i].l) + vec3_dot(f[i].a, x[i].a);
    }
    return sum;
}

/* y = x + scale * y */
static void scale_and_add(double scale, const struct spatial *x, struct spatial *y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            y[i].a[k] = x[i].a[k] + scale * y[i].a[k];
            y[i].l[k] = x[i].l[k] + scale * y[i].l[k];
        }
    }
}

/* y += scale * x */
static void add_scaled(double scale, const double *x, double *y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] += scale * x[i];
    }
}

/* ---- bodies ---- */

static const struct body_motion *motion_of(const struct plant *plant, int contact)
{
    return &plant->motion[plant->config.contact_body[contact]];
}

static bool is_free(const struct plant *plant, int contact)
{
    return (size_t)plant->config.contact_body[contact] >= plant->config.robot->nbody;
}

/* A contact body that its forces can move. */
static bool moves(const struct plant *plant, int contact)
{
    return contact >= 0 && (!plant->clamped || is_free(plant, contact));
}

static void arm_to(const struct plant *plant, int contact, const double center[3], double arm[3])
{
    for (int i = 0; i < 3; i++) {
        arm[i] = center[i] - motion_of(plant, contact)->p[i];
    }
}

/* x += what body number side of the pair does at the center, when y is its motion */
static void add_relative(const struct plant *plant, const struct touch *touch, int side,
                         const struct spatial *y, struct spatial *x)
{
    struct spatial at;
    double arm[3];

    arm_to(plant, touch->body[side], touch->center, arm);
    at = move_motion(y, arm);
    for (int i = 0; i < 3; i++) {
        x->a[i] += side == 1 ? at.a[i] : -at.a[i];
        x->l[i] += side == 1 ? at.l[i] : -at.l[i];
    }
}

/* b's velocity at the center less a's */
static struct spatial relative_velocity(const struct plant *plant, const struct touch *touch)
{
    struct spatial V = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};

    for (int side = 0; side < 2; side++) {
        if (touch->body[side] >= 0) {
            const struct body_motion *motion = motion_of(plant, touch->body[side]);
            struct spatial x;

            memcpy(x.a, motion->w, sizeof x.a);
            memcpy(x.l, motion->v, sizeof x.l);
            add_relative(plant, touch, side, &x, &V);
        }
    }
    return V;
}

/* ---- the system of a step ---- */

/* torques and extra inertias of drives and parallel springs on the joints */
static void begin_actuators(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;

    memset(im->extra, 0, robot->njoint * sizeof *im->extra);
    memset(im->torque, 0, robot->njoint * sizeof *im->torque);
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        struct sea_state drive = plant_drive_state(plant, plant->state, d);

        sea_step_begin(&plant->sea[d], &drive, plant_joint_position(plant, plant->state, j),
                       plant_joint_rate(plant, plant->state, j), plant->voltage[d],
                       plant->bridge_on[d], h, &im->drive[d]);
        im->torque[j] += im->drive[d].torque;
        im->extra[j] += im->drive[d].extra;
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        double torque, extra;

        parallel_spring_step(&robot->joint[j].spring, plant->state[plant->at.pretension + s],
                             plant->pretension_rate[s],
                             plant_joint_position(plant, plant->state, j),
                             plant_joint_rate(plant, plant->state, j), h, &torque, &extra);
        im->torque[j] += torque;
        im->extra[j] += extra;
    }
}

/* adds a world-frame wrench to what acts on a body */
static void add_external(struct plant *plant, int contact, const struct spatial *f,
                         struct wrench *ext)
{
    struct spatial own = turn_back(motion_of(plant, contact)->R, f);

    for (int i = 0; i < 3; i++) {
        ext->force[i] += own.l[i];
        ext->moment[i] += own.a[i];
    }
}

/* one pair: its matrix to both bodies, and -h K V to what acts on them */
static void begin_touch(struct plant *plant, const struct contact_tangent *tangent, double h,
                        struct touch *touch)
{
    struct implicit *im = plant->implicit;
    struct spatial_inertia K;
    struct spatial V;
    double A[21];

    touch->pair = tangent->pair;
    touch->body[0] = tangent->body_a;
    touch->body[1] = tangent->body_b;
    memcpy(touch->center, tangent->center, sizeof touch->center);
    for (int i = 0; i < 21; i++) {
        A[i] = h * (tangent->D[i] + h * tangent->K[i]);
    }
    full(A, &touch->A);
    full(tangent->K, &K);
    V = relative_velocity(plant, touch);
    for (int i = 0; i < 3; i++) {
        V.a[i] *= h;
        V.l[i] *= h;
    }
    spatial_inertia_apply(&K, &V, &touch->less);
    for (int side = 0; side < 2; side++) {
        int contact = touch->body[side];

        if (moves(plant, contact)) {
            struct spatial f = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
            struct spatial_inertia own = touch->A;
            double arm[3];

            arm_to(plant, contact, touch->center, arm);
            add_wrench(side == 1 ? -1.0 : 1.0, &touch->less, arm, &f);
            add_external(plant, contact, &f, &plant->ext[plant->config.contact_body[contact]]);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->solid[contact]);
        }
    }
    im->coupled |= moves(plant, touch->body[0]) && moves(plant, touch->body[1]);
}

/* the contact bodies' added inertias in the form that the dynamics take them */
static void add_to_observed(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    memset(im->added, 0, im->nobserved * sizeof *im->added);
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        if (!is_free(plant, (int)c)) {
            struct spatial_inertia own = im->solid[c];
            double back[9], S[21];

            mat3_transpose(motion_of(plant, (int)c)->R, back);
            spatial_inertia_rotate(back, &own);
            pack(&own, S);
            add_scaled(1.0, S, im->added[im->number[c]].A, 21);
        }
    }
}

/* the free bodies' own systems, in their frames about their centers of mass */
static void begin_free(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    static const double origin[3] = {0.0, 0.0, 0.0};

    for (size_t b = 0; b < plant->config.nfree; b++) {
        const struct robot_inertia *inertia = &plant->config.free[b].inertia;
        const struct wrench *ext = &plant->ext[robot->nbody + b];
        const double *w = plant->state + plant->at.free + PLANT_FREE_STATE * b + PLANT_FREE_SPIN;
        struct spatial *load = &im->load[b];
        double weight[3], spin[3];

        spatial_inertia_rigid(inertia->mass, origin, inertia->I, &im->own[b]);
        mat3_apply_transposed(plant->motion[robot->nbody + b].R, robot->gravity, weight);
        for (int i = 0; i < 3; i++) {
            load->l[i] = ext->force[i] + inertia->mass * weight[i];
            load->a[i] = ext->moment[i];
        }
        vec3_add_cross(ext->force, inertia->com, load->a);
        sym3_apply(inertia->I, w, spin);
        vec3_add_cross(spin, w, load->a);
    }
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        if (is_free(plant, (int)c)) {
            size_t b = (size_t)plant->config.contact_body[c] - robot->nbody;
            const double *com = plant->config.free[b].inertia.com;
            const double arm[3] = {-com[0], -com[1], -com[2]};
            struct spatial_inertia own = im->solid[c];
            double back[9];

            mat3_transpose(motion_of(plant, (int)c)->R, back);
            spatial_inertia_rotate(back, &own);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->own[b]);
        }
    }
}

static enum error_code begin_contact(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;

    im->coupled = false;
    im->ntouch = 0;
    memset(im->solid, 0, plant->config.ncontact * sizeof *im->solid);
    if (!plant->config.contact || (plant->clamped && plant->config.nfree == 0)) {
        return ERROR_NONE;
    }
    im->ntouch = plant_contact_tangents(plant, im->tangent, IMPLICIT_TANGENTS);
    if (im->ntouch > IMPLICIT_TANGENTS) {
        plant->failure = crowded;
        return ERROR_INPUT;
    }
    for (size_t t = 0; t < im->ntouch; t++) {
        begin_touch(plant, &im->tangent[t], h, &im->touch[t]);
    }
    return ERROR_NONE;
}

/* ---- solving it ---- */

/* a = P^-1 (right-hand side + w), with wrenches w on the contact bodies, NULL = none */
static void solve_uncoupled(struct plant *plant, const struct spatial *w, double *a)
{
    struct implicit *im = plant->implicit;
    const struct dynamics *dynamics = plant->config.dynamics;
    size_t nbody = plant->config.robot->nbody, nv = plant->config.robot->nv;
    const double *v = plant->state + plant->at.v;

    memcpy(im->ext, plant->ext, nbody * sizeof *im->ext);
    for (size_t c = 0; w && c < plant->config.ncontact; c++) {
        if (!is_free(plant, (int)c)) {
            add_external(plant, (int)c, &w[c], &im->ext[plant->config.contact_body[c]]);
        }
    }
    if (plant->clamped) {
        memset(a, 0, nv * sizeof *a);
    } else {
        dynamics->ops->implicit(dynamics, plant->q, v, im->torque, im->ext, im->extra, im->added,
                                a);
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const double *com = plant->config.free[b].inertia.com;
        const double arm[3] = {-com[0], -com[1], -com[2]};
        struct spatial f = im->load[b], x;

        for (size_t c = 0; w && c < plant->config.ncontact; c++) {
            if ((size_t)plant->config.contact_body[c] == nbody + b) {
                struct spatial own = turn_back(motion_of(plant, (int)c)->R, &w[c]);

                add_wrench(1.0, &own, arm, &f);
            }
        }
        spatial_inertia_solve(&im->own[b], &f, &x);
        memcpy(a + nv + 6 * b, x.l, sizeof x.l);
        memcpy(a + nv + 6 * b + 3, x.a, sizeof x.a);
    }
}

/* what accelerations a mean at the contact bodies' origins, world frame */
static void map_to_contact(struct plant *plant, const double *a, struct spatial *twist)
{
    struct implicit *im = plant->implicit;
    const struct dynamics *dynamics = plant->config.dynamics;
    size_t nbody = plant->config.robot->nbody, nv = plant->config.robot->nv;

    dynamics->ops->kinematics(dynamics, plant->q, a, im->motion);
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        size_t body = (size_t)plant->config.contact_body[c];

        if (body < nbody) {
            memcpy(twist[c].l, im->motion[body].v, sizeof twist[c].l);
            memcpy(twist[c].a, im->motion[body].w, sizeof twist[c].a);
        } else {
            const double *own = a + nv + 6 * (body - nbody);
            const double *com = plant->config.free[body - nbody].inertia.com;
            const double arm[3] = {-com[0], -com[1], -com[2]};
            struct spatial x, at;

            memcpy(x.l, own, sizeof x.l);
            memcpy(x.a, own + 3, sizeof x.a);
            at = move_motion(&x, arm);
            twist[c] = turn(motion_of(plant, (int)c)->R, &at);
        }
    }
}

/* w += scale * C a, given a at the contact bodies */
static void add_coupling(struct plant *plant, double scale, const struct spatial *twist,
                         struct spatial *w)
{
    struct implicit *im = plant->implicit;

    for (size_t t = 0; t < im->ntouch; t++) {
        const struct touch *touch = &im->touch[t];

        if (!moves(plant, touch->body[0]) || !moves(plant, touch->body[1])) {
            continue;
        }
        for (int side = 0; side < 2; side++) {
            int self = touch->body[side], other = touch->body[1 - side];
            struct spatial at, f;
            double arm[3];

            arm_to(plant, other, touch->center, arm);
            at = move_motion(&twist[other], arm);
            spatial_inertia_apply(&touch->A, &at, &f);
            arm_to(plant, self, touch->center, arm);
            add_wrench(-scale, &f, arm, &w[self]);
        }
    }
}

/* z = P^-1 r, also as accelerations of the contact bodies; returns their product with r */
static double precondition(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    /* what P^-1 makes of the right-hand side alone comes off again */
    solve_uncoupled(plant, im->r, im->z);
    add_scaled(-1.0, im->uncoupled, im->z, im->na);
    map_to_contact(plant, im->z, im->twist_z);
    return inner(im->r, im->twist_z, plant->config.ncontact);
}

/* im->a from the solution of P to that of P + C, by conjugate gradients. Residuals are wrenches on
 * the contact bodies, as C makes nothing else; so is s = P p, and w = (P + C) p. */
static void solve_coupled(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    size_t ncontact = plant->config.ncontact, bytes = ncontact * sizeof *im->r;
    double first, rz;

    memcpy(im->uncoupled, im->a, im->na * sizeof *im->a);
    map_to_contact(plant, im->a, im->twist_z);
    memset(im->r, 0, bytes);
    add_coupling(plant, -1.0, im->twist_z, im->r);
    first = rz = precondition(plant);
    memcpy(im->p, im->z, im->na * sizeof *im->p);
    memcpy(im->twist_p, im->twist_z, bytes);
    memcpy(im->s, im->r, bytes);
    for (int step = 0; step < COUPLING_STEPS && rz > COUPLING_LEFT * first; step++) {
        double length, last = rz;

        memcpy(im->w, im->s, bytes);
        add_coupling(plant, 1.0, im->twist_p, im->w);
        length = rz / inner(im->w, im->twist_p, ncontact);
        add_scaled(length, im->p, im->a, im->na);
        for (size_t c = 0; c < ncontact; c++) {
            for (int k = 0; k < 3; k++) {
                im->r[c].a[k] -= length * im->w[c].a[k];
                im->r[c].l[k] -= length * im->w[c].l[k];
            }
        }
        rz = precondition(plant);
        for (size_t i = 0; i < im->na; i++) {
            im->p[i] = im->z[i] + rz / last * im->p[i];
        }
        scale_and_add(rz / last, im->twist_z, im->twist_p, ncontact);
        scale_and_add(rz / last, im->r, im->s, ncontact);
    }
}

/* ---- taking the step ---- */

/* the wrenches at the end of the step, from those at its begin */
static void end_contact(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    memcpy(im->wrench, plant->contact_wrench, plant->config.ncontact * sizeof *im->wrench);
    if (im->ntouch > 0) {
        map_to_contact(plant, im->a, im->twist_z);
    }
    for (size_t t = 0; t < im->ntouch; t++) {
        struct touch *touch = &im->touch[t];
        struct spatial A = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, f;

        for (int side = 0; side < 2; side++) {
            if (touch->body[side] >= 0) {
                add_relative(plant, touch, side, &im->twist_z[touch->body[side]], &A);
            }
        }
        spatial_inertia_apply(&touch->A, &A, &f);
        add_scaled(1.0, f.l, touch->less.l, 3);
        add_scaled(1.0, f.a, touch->less.a, 3);
        for (int side = 0; side < 2; side++) {
            if (touch->body[side] >= 0) {
                struct contact_wrench *wrench = &im->wrench[touch->body[side]];
                struct spatial sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
                double arm[3];

                arm_to(plant, touch->body[side], touch->center, arm);
                add_wrench(side == 1 ? -1.0 : 1.0, &touch->less, arm, &sum);
                add_scaled(1.0, sum.l, wrench->force, 3);
                add_scaled(1.0, sum.a, wrench->moment, 3);
            }
        }
    }
}

void implicit_recall(struct plant *plant)
{
    const struct implicit *im = plant->implicit;

    memcpy(plant->vdot, im->a, plant->config.robot->nv * sizeof *plant->vdot);
    memcpy(plant->contact_wrench, im->wrench,
           plant->config.ncontact * sizeof *plant->contact_wrench);
}

void implicit_patches(const struct plant *plant, struct contact_patch *patch, size_t count)
{
    const struct implicit *im = plant->implicit;

    for (size_t t = 0; t < im->ntouch; t++) {
        const struct touch *touch = &im->touch[t];

        for (size_t i = 0; i < count; i++) {
            if (patch[i].pair == touch->pair) {
                struct spatial sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
                double arm[3];

                for (int k = 0; k < 3; k++) {
                    arm[k] = touch->center[k] - patch[i].center[k];
                }
                add_wrench(-1.0, &touch->less, arm, &sum);
                add_scaled(1.0, sum.l, patch[i].force, 3);
                add_scaled(1.0, sum.a, patch[i].moment, 3);
                break;
            }
        }
    }
}

/* quaternion <- quaternion * exp(h w / 2), w in the body frame */
static void turn_quaternion(const double w[3], double h, double quaternion[4])
{
    double angle = h * sqrt(vec3_dot(w, w));
    double sinc = angle > 1e-4 ? sin(0.5 * angle) / angle : 0.5 - angle * angle / 48.0;
    double c = cos(0.5 * angle);
    double x[3] = {h * sinc * w[0], h * sinc * w[1], h * sinc * w[2]};
    double scalar = quaternion[0], vector[3] = {quaternion[1], quaternion[2], quaternion[3]};

    quaternion[0] = scalar * c - vec3_dot(vector, x);
    vec3_cross(vector, x, quaternion + 1);
    for (int i = 0; i < 3; i++) {
        quaternion[1 + i] += scalar * x[i] + c * vector[i];
    }
}

static void move_robot(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;
    double *q = plant->state, *v = q + plant->at.v;
    size_t first = robot->nq - robot->njoint;

    add_scaled(h, plant->implicit->a, v, robot->nv);
    if (robot->floating) {
        double R[9], velocity[3];

        turn_quaternion(v + 3, h, q + 3);
        mat3_from_quaternion(q + 3, R);
        mat3_apply(R, v, velocity);
        add_scaled(h, velocity, q, 3);
    }
    add_scaled(h, v + robot->nv - robot->njoint, q + first, robot->njoint);
}

static void move_free(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;

    for (size_t b = 0; b < plant->config.nfree; b++) {
        const double *a = plant->implicit->a + robot->nv + 6 * b;
        double *y = plant->state + plant->at.free + PLANT_FREE_STATE * b;
        double linear[3];

        mat3_apply(plant->motion[robot->nbody + b].R, a, linear);
        add_scaled(h, linear, y + PLANT_FREE_VELOCITY, 3);
        add_scaled(h, a + 3, y + PLANT_FREE_SPIN, 3);
        add_scaled(h, y + PLANT_FREE_VELOCITY, y, 3);
        turn_quaternion(y + PLANT_FREE_SPIN, h, y + PLANT_FREE_QUATERNION);
    }
}

/* drives and springs to the end of the step, and where their power there goes */
static void move_actuators(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;
    double *work = plant->config.account_energy ? plant->state + plant->at.work : NULL;

    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        double *y = plant->state + plant->at.drive + 3 * d;
        double qd = plant_joint_rate(plant, plant->state, j);
        struct sea_state drive = plant_drive_state(plant, plant->state, d);

        sea_step_end(&plant->implicit->drive[d], qd, h, &drive);
        y[0] = drive.qm;
        y[1] = drive.qmd;
        y[2] = drive.I;
        if (work) {
            struct sea_power power;

            sea_power(&plant->sea[d], &drive, qd, plant->voltage[d], &power);
            work[WORK_ELECTRICAL] += h * power.electrical;
            work[WORK_JOULE] += h * power.joule;
            work[WORK_FRICTION] += h * power.friction;
            work[WORK_SPRING_DAMPING] += h * power.spring_damping;
        }
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        const struct robot_parallel_spring *spring = &robot->joint[j].spring;
        double q = plant_joint_position(plant, plant->state, j);
        double qd = plant_joint_rate(plant, plant->state, j), pd = plant->pretension_rate[s];
        double *p = &plant->state[plant->at.pretension + s];

        *p += h * pd;
        if (work) {
            work[WORK_PRETENSION] += h * pd * parallel_spring_force(spring, *p, pd, q, qd);
            work[WORK_PARALLEL_DAMPING] += h * parallel_spring_damping(spring, *p, pd, q, qd);
        }
    }
}

enum error_code implicit_step(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    struct plant_load load;
    enum error_code code = plant_load_bodies(plant, plant->state, &load);

    if (code == ERROR_NONE) {
        code = begin_contact(plant, h);
    }
    if (code != ERROR_NONE) {
        return code;
    }
    begin_actuators(plant, h);
    add_to_observed(plant);
    begin_free(plant);
    solve_uncoupled(plant, NULL, im->a);
    if (im->coupled) {
        solve_coupled(plant);
    }
    if (!plant->clamped) {
        end_contact(plant);
    }
    move_robot(plant, h);
    move_free(plant, h);
    move_actuators(plant, h);
    if (plant->config.account_energy) {
        plant->state[plant->at.work + WORK_CONTACT] += h * load.contact;
        plant->state[plant->at.work + WORK_PUSH] += h * load.push;
    }
    return ERROR_NONE;
}

/* ---- memory ---- */

#define TAKE(pointer, count)                                                                       \
    do {                                                                                           \
        (pointer) = arena_alloc(arena, (count), sizeof *(pointer));                                \
        ok = ok && (pointer);                                                                      \
    } while (0)

struct implicit *implicit_create(const struct plant *plant, struct arena *arena)
{
    const struct robot *robot = plant->config.robot;
    size_t ncontact = plant->config.ncontact, nfree = plant->config.nfree;
    size_t pairs = ncontact > 0 ? IMPLICIT_TANGENTS : 0;
    struct implicit *im;
    bool ok = true;

    TAKE(im, 1);
    if (!im) {
        return NULL;
    }
    im->na = robot->nv + 6 * nfree;
    for (size_t b = 0; b < robot->nbody; b++) {
        im->nobserved += robot->body[b].observed;
    }
    TAKE(im->drive, plant->ndrive);
    TAKE(im->extra, robot->njoint);
    TAKE(im->torque, robot->njoint);
    TAKE(im->added, im->nobserved);
    TAKE(im->number, ncontact);
    TAKE(im->solid, ncontact);
    TAKE(im->tangent, pairs);
    TAKE(im->touch, pairs);
    TAKE(im->wrench, ncontact);
    TAKE(im->own, nfree);
    TAKE(im->load, nfree);
    TAKE(im->a, im->na);
    TAKE(im->uncoupled, im->na);
    TAKE(im->z, im->na);
    TAKE(im->p, im->na);
    TAKE(im->twist_p, ncontact);
    TAKE(im->twist_z, ncontact);
    TAKE(im->r, ncontact);
    TAKE(im->s, ncontact);
    TAKE(im->w, ncontact);
    TAKE(im->ext, robot->nbody);
    TAKE(im->motion, robot->nbody);
    for (size_t c = 0; ok && c < ncontact; c++) {
        for (size_t b = 0; b < robot->nbody && (int)b < plant->config.contact_body[c]; b++) {
            im->number[c] += robot->body[b].observed;
        }
    }
    return ok ? im : NULL;
}
