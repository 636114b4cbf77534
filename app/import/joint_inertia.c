/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the inertias of joints from trial torques and accelerations, and from the inertias the
 * stiffness and damping of couplings. The rules are in drive.h. */
#include "app/import/joint_inertia.h"
#include "app/import/drive.h"

#include "base/array.h"
#include "model/coupling.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Computes the accelerations under the trial's torques and gravity, without couplings. */
static void trial_accelerate(struct import_trial *t, double *vdot)
{
    const struct dynamics *d = &t->dynamics;

    d->ops->implicit(d, t->q, t->v, t->tau, t->ext, t->extra, t->none, vdot);
}

/* Computes the accelerations from a unit force in each coupling. The force acts on the follower;
 * its reaction, times the multiplier, acts on the leader. Factorizes the matrix that gives the
 * coupling forces. */
static void trial_find_columns(struct import_trial *t)
{
    const struct robot *robot = t->dynamics.robot;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        double *column = t->column + i * robot->nv;

        coupling_press(&robot->coupling[i], -1.0, t->tau);
        trial_accelerate(t, column);
        coupling_press(&robot->coupling[i], 1.0, t->tau);
        for (size_t k = 0; k < robot->nv; k++) {
            column[k] -= t->still[k];
        }
    }
    coupling_factorize(robot, t->column, t->zero, t->factor);
}

enum error_code import_trial_make(const struct robot *robot, const double *joint,
                                  struct arena *arena, struct import_trial *t, struct error *error)
{
    const size_t n = robot->njoint + BASE_Q_COUNT, k = robot->ncoupling;
    double **const part[] = {&t->q, &t->v, &t->tau, &t->extra, &t->still, &t->vdot, &t->force};
    double *next = arena_alloc(arena, ARRAY_COUNT(part) * n + k * (n + k + 2) + 1, sizeof *next);
    enum error_code code;

    /* Allocate state, torques, accelerations, and data for couplings */
    t->none = arena_alloc(arena, robot->nbody, sizeof *t->none);
    t->ext = arena_alloc(arena, robot->nbody, sizeof *t->ext);
    if (!next || !t->none || !t->ext) {
        return error_set(error, ERROR_MEMORY, "no memory for a trial of %s", robot->name);
    }
    for (size_t i = 0; i < ARRAY_COUNT(part); i++, next += n) {
        *part[i] = next;
    }
    t->column = next;
    t->factor = t->column + k * n;
    t->zero = t->factor + k * k;
    t->press = t->zero + k;

    /* The base is upright; the rotors' inertias are added to their joints */
    if (robot->floating) {
        t->q[BASE_Q_QUATERNION] = 1.0;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        t->q[robot->nq - robot->njoint + j] = joint[j];
        t->extra[j] = robot->joint[j].sea.present ? robot->joint[j].sea.J : 0.0;
    }

    /* Compute the effect of gravity alone, which each later trial subtracts */
    code = dynamics_generic(robot, arena, &t->dynamics, error);
    if (!code) {
        trial_accelerate(t, t->still);
        trial_find_columns(t);
    }
    return code;
}

double import_trial_inertia(struct import_trial *t, size_t j)
{
    const struct robot *robot = t->dynamics.robot;

    /* Acceleration by a unit torque minus acceleration at rest, with couplings */
    t->tau[j] = 1.0;
    trial_accelerate(t, t->vdot);
    t->tau[j] = 0.0;
    for (size_t k = 0; k < robot->nv; k++) {
        t->vdot[k] -= t->still[k];
    }
    coupling_correct(robot, t->column, t->factor, t->zero, t->press, t->vdot);
    return 1.0 / t->vdot[robot->nv - robot->njoint + j];
}

/* Projects the forces on all joints onto the motion of joint j and its followers. */
static double trial_project(const struct import_trial *t, size_t j)
{
    const struct robot *robot = t->dynamics.robot;
    const double *force = t->force + robot->nv - robot->njoint;
    double sum = force[j];

    for (size_t i = 0; i < robot->ncoupling; i++) {
        if (robot->coupling[i].leader == (int)j) {
            sum += robot->coupling[i].multiplier * force[robot->coupling[i].follower];
        }
    }
    return sum;
}

double import_trial_held_inertia(struct import_trial *t, size_t j)
{
    const struct dynamics *d = &t->dynamics;
    const struct robot *robot = d->robot;
    double *joint = t->vdot + robot->nv - robot->njoint, torque;

    /* Inverse dynamics at rest gives the gravity torque, which is subtracted below */
    memset(t->vdot, 0, robot->nv * sizeof *t->vdot);
    d->ops->inverse(d, t->q, t->v, t->vdot, NULL, t->force);
    torque = trial_project(t, j);

    /* Set a unit acceleration of the joint; its followers have their multipliers as
     * accelerations */
    joint[j] = 1.0;
    for (size_t i = 0; i < robot->ncoupling; i++) {
        if (robot->coupling[i].leader == (int)j) {
            joint[robot->coupling[i].follower] = robot->coupling[i].multiplier;
        }
    }
    d->ops->inverse(d, t->q, t->v, t->vdot, NULL, t->force);
    return trial_project(t, j) - torque;
}

/* ---- couplings ---- */

#define SWINGS_RAD_S 1000.0 /* frequency of a held follower on its coupling */
#define GIVES 1e-3          /* deflection under full strength, rad or m at the leader */
#define STIFFNESS_LEAST 1e-6
#define STIFFNESS_MOST 1e8

void import_lead(const struct robot *robot, enum import_lead what, double *value)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const double m = coupling->multiplier;

        value[coupling->leader] += (what == IMPORT_LEAD_TORQUES ? m
                                    : what == IMPORT_LEAD_LOADS ? fabs(m)
                                                                : m * m) *
                                   value[coupling->follower];
    }
}

enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error)
{
    const struct robot *robot = from->robot;
    struct import_trial trial;
    enum error_code code;

    if (robot->ncoupling == 0) {
        return ERROR_NONE;
    }
    code = import_trial_make(robot, from->rest, arena, &trial, error);

    /* Stiffness from the follower's inertia and the leader's drive; critical damping */
    for (size_t i = 0; i < robot->ncoupling && !code; i++) {
        struct robot_coupling *coupling = &robot->coupling[i];
        const struct robot_joint *leader = &robot->joint[coupling->leader];
        const double square = coupling->multiplier * coupling->multiplier;
        const double inertia = import_trial_held_inertia(&trial, (size_t)coupling->follower);
        double K = SWINGS_RAD_S * SWINGS_RAD_S * inertia;

        if (robot_joint_is_driven(leader)) {
            K = fmax(K, leader->torque_limit / (GIVES * square));
        }
        coupling->stiffness = fmin(fmax(K, STIFFNESS_LEAST), STIFFNESS_MOST);
        coupling->damping = 2.0 * sqrt(coupling->stiffness * fmax(inertia, 0.0));

        /* Add a note on the assumed coupling */
        const struct import_joint *source = from->source[coupling->follower];
        const bool turns = from->robot->joint[coupling->follower].type == JOINT_REVOLUTE;
        char shift[32] = "";

        if (coupling->offset != 0.0) {
            snprintf(shift, sizeof shift, " %c %.9g", coupling->offset < 0.0 ? '-' : '+',
                     fabs(coupling->offset));
        }
        import_note_add(notes, IMPORT_ASSUMED, source->mimic_file, source->mimic_line,
                        "joint \"%.63s\" follows \"%.63s\", %.9g times its position%s, through a "
                        "coupling of %.3g %s and %.3g %s; it has no drive of its own, the file's "
                        "effort %g and velocity %g are not used",
                        source->name, from->source[coupling->leader]->name, coupling->multiplier,
                        shift, coupling->stiffness, turns ? "N m/rad" : "N/m", coupling->damping,
                        turns ? "N m s/rad" : "N s/m", source->effort, source->velocity);
    }
    return code;
}
