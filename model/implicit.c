/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Linearly implicit Euler for the plant. With the accelerations a = (v+ - v)/h as the unknowns,
 * every stiff force is taken at the end of the step and linearized there:
 *
 *   drives      the three linear equations of a drive are eliminated; an inertia on its joint and a
 *               torque remain (model/actuator.h, struct sea_step); parallel springs likewise;
 *   end stops   likewise, those that the joints press at the end of the step; where one turns out
 *               to pull, or to be missing, the step is solved again without it or with it;
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
 * The wrench at a step's end is thus F - h K V - h (D + h K) A. It is kept for the sensors, with
 * the accelerations: the law of contact itself, evaluated at the state that the step led to, would
 * turn each error e of a velocity into a force D e, with D up to 1e5 N s/m, that has moved nothing.
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

#include "model/implicit_private.h"

#include <math.h>
#include <string.h>

/* The end stops that the joints press in this step. */
static void linearize_stops(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        stop_step_begin(&joint->stop, joint->lower, joint->upper,
                        plant_joint_position(plant, plant->state, j),
                        plant_joint_rate(plant, plant->state, j), h, &im->stop[j]);
        if (im->stop[j].side != 0) {
            im->torque[j] += im->stop[j].torque;
            im->extra[j] += im->stop[j].extra;
        }
    }
}

/* Takes away the stops that pull with the accelerations found, and adds those that joints are
 * thrown past; true when there are some. */
static bool revise_stops(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double *a = im->a + robot->nv - robot->njoint;
    bool revised = false;

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        struct stop_step before = im->stop[j];

        if (stop_step_revise(&joint->stop, joint->lower, joint->upper,
                             plant_joint_position(plant, plant->state, j),
                             plant_joint_rate(plant, plant->state, j), h, a[j], &im->stop[j])) {
            im->torque[j] += im->stop[j].torque - before.torque;
            im->extra[j] += im->stop[j].extra - before.extra;
            revised = true;
        }
    }
    return revised;
}

/* Torques and extra inertias on the joints of drives, eqs (2) to (4), and springs, eq. (5). */
static void linearize_actuators(struct plant *plant, double h)
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
    linearize_stops(plant, h);
}

/* quaternion <- quaternion exp(h w / 2), w in the body frame. */
static void turn_quaternion_in_body(const double w[3], double h, double quaternion[4])
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

/* Velocities by the accelerations, then positions by the new velocities. */
static void advance_robot(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;
    double *q = plant->state, *v = q + plant->at.v;
    size_t first = robot->nq - robot->njoint;

    add_scaled(h, plant->implicit->a, v, robot->nv);
    if (robot->floating) {
        double R[9], velocity[3];

        turn_quaternion_in_body(v + BASE_V_ANGULAR, h, q + BASE_Q_QUATERNION);
        mat3_from_quaternion(q + BASE_Q_QUATERNION, R);
        mat3_apply(R, v + BASE_V_LINEAR, velocity);
        add_scaled(h, velocity, q + BASE_Q_POSITION, 3);
    }
    add_scaled(h, v + robot->nv - robot->njoint, q + first, robot->njoint);
}

static void advance_free_bodies(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;

    for (size_t b = 0; b < plant->config.nfree; b++) {
        const double *a = plant->implicit->a + robot->nv + FREE_ACCELERATIONS * b;
        double *y = plant->state + plant->at.free + PLANT_FREE_STATE * b;
        double linear[3];

        mat3_apply(plant->motion[robot->nbody + b].R, a + FREE_LINEAR, linear);
        add_scaled(h, linear, y + PLANT_FREE_VELOCITY, 3);
        add_scaled(h, a + FREE_ANGULAR, y + PLANT_FREE_SPIN, 3);
        add_scaled(h, y + PLANT_FREE_VELOCITY, y + PLANT_FREE_POSITION, 3);
        turn_quaternion_in_body(y + PLANT_FREE_SPIN, h, y + PLANT_FREE_QUATERNION);
    }
}

/* Takes drives and springs to the end of the step, and accounts for their power and that of the
 * stops there. */
static void advance_actuators(struct plant *plant, double h)
{
    const struct robot *robot = plant->config.robot;
    double *work = plant->config.account_energy ? plant->state + plant->at.work : NULL;

    /* Drives: eqs (2) to (4) with the joint's rate at the end of the step */
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        double *y = plant->state + plant_drive_offset(plant, d);
        double q = plant_joint_position(plant, plant->state, j);
        double qd = plant_joint_rate(plant, plant->state, j);
        struct sea_state drive = plant_drive_state(plant, plant->state, d);

        sea_step_end(&plant->implicit->drive[d], qd, h, &drive);
        y[DRIVE_MOTOR_POSITION] = drive.qm;
        y[DRIVE_MOTOR_SPEED] = drive.qmd;
        y[DRIVE_CURRENT] = drive.I;
        if (work) {
            struct sea_power power;

            sea_power(&plant->sea[d], &drive, q, qd, plant->voltage[d], &power);
            work[WORK_ELECTRICAL] += h * power.electrical;
            work[WORK_JOULE] += h * power.joule;
            work[WORK_FRICTION] += h * power.friction;
            work[WORK_SPRING_DAMPING] += h * power.spring_damping;
        }
    }

    /* Pretensions of the parallel springs, eq. (5) */
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
    if (work && !plant->clamped) {
        work[WORK_STOPS] += h * plant_stop_loss(plant, plant->state);
    }
}

enum error_code implicit_step(struct plant *plant, double h)
{
    struct plant_load load;
    enum error_code code;

    /* Forces and tangents at the begin of the step */
    if ((code = plant_load_bodies(plant, plant->state, &load))) {
        return code;
    }
    if ((code = implicit_linearize_contact(plant, h))) {
        return code;
    }
    linearize_actuators(plant, h);
    implicit_add_contact_inertia(plant);

    /* Accelerations, and with them the contact's wrenches at the end */
    implicit_solve(plant);
    while (!plant->clamped && revise_stops(plant, h)) {
        implicit_solve(plant); /* ends: each joint's stop changes twice at most */
    }
    if (!plant->clamped) {
        implicit_end_contact(plant);
    }

    /* The state at the end */
    advance_robot(plant, h);
    advance_free_bodies(plant, h);
    advance_actuators(plant, h);
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

    /* How many accelerations and observed bodies there are */
    im->na = robot->nv + FREE_ACCELERATIONS * nfree;
    for (size_t b = 0; b < robot->nbody; b++) {
        im->nobserved += robot->body[b].observed;
    }

    TAKE(im->drive, plant->ndrive);
    TAKE(im->extra, robot->njoint);
    TAKE(im->torque, robot->njoint);
    TAKE(im->stop, robot->njoint);
    TAKE(im->added, im->nobserved);
    TAKE(im->number, ncontact);
    TAKE(im->contact_inertia, ncontact);
    TAKE(im->tangent, pairs);
    TAKE(im->active, pairs);
    TAKE(im->wrench, ncontact);
    TAKE(im->free_inertia, nfree);
    TAKE(im->free_load, nfree);
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

    /* Which of the observed bodies each contact body is */
    for (size_t c = 0; ok && c < ncontact; c++) {
        for (size_t b = 0; b < robot->nbody && (int)b < plant->config.contact_body[c]; b++) {
            im->number[c] += robot->body[b].observed;
        }
    }
    return ok ? im : NULL;
}
