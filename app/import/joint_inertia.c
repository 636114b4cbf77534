/* SPDX-License-Identifier: Apache-2.0 */
/* Finds the inertias of joints by trial torques and accelerations. */
#include "app/import/joint_inertia.h"

#include "model/coupling.h"

#include <string.h>

/* Computes the accelerations under the trial's torques and gravity, as if no joint followed
 * another. */
static void trial_accelerate(struct import_trial *t, double *vdot)
{
    const struct dynamics *d = &t->dynamics;

    d->ops->implicit(d, t->q, t->v, t->tau, t->ext, t->extra, t->none, vdot);
}

/* Computes for each coupling the accelerations by a unit force on its follower and minus the
 * multiplier on its leader, and factorizes the matrix that makes followers follow. */
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
    enum error_code code;

    /* State, torques and accelerations; then what couplings need */
    t->q = arena_alloc(arena, n, sizeof *t->q);
    t->v = arena_alloc(arena, n, sizeof *t->v);
    t->tau = arena_alloc(arena, n, sizeof *t->tau);
    t->extra = arena_alloc(arena, n, sizeof *t->extra);
    t->still = arena_alloc(arena, n, sizeof *t->still);
    t->vdot = arena_alloc(arena, n, sizeof *t->vdot);
    t->force = arena_alloc(arena, n, sizeof *t->force);
    t->none = arena_alloc(arena, robot->nbody, sizeof *t->none);
    t->ext = arena_alloc(arena, robot->nbody, sizeof *t->ext);
    t->column = arena_alloc(arena, k * n + 1, sizeof *t->column);
    t->factor = arena_alloc(arena, k * k + 1, sizeof *t->factor);
    t->zero = arena_alloc(arena, k + 1, sizeof *t->zero);
    t->press = arena_alloc(arena, k + 1, sizeof *t->press);
    if (!t->q || !t->v || !t->tau || !t->extra || !t->still || !t->vdot || !t->force || !t->none ||
        !t->ext || !t->column || !t->factor || !t->zero || !t->press) {
        return error_set(error, ERROR_MEMORY, "no memory for a trial of %s", robot->name);
    }

    /* The base is upright; rotors count as inertia added to their joints */
    if (robot->floating) {
        t->q[BASE_Q_QUATERNION] = 1.0;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        t->q[robot->nq - robot->njoint + j] = joint[j];
        t->extra[j] = robot->joint[j].sea.present ? robot->joint[j].sea.J : 0.0;
    }

    /* What gravity does alone is taken off every later trial */
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

    /* The acceleration by a unit torque, less that at rest, with followers following */
    t->tau[j] = 1.0;
    trial_accelerate(t, t->vdot);
    t->tau[j] = 0.0;
    for (size_t k = 0; k < robot->nv; k++) {
        t->vdot[k] -= t->still[k];
    }
    coupling_correct(robot, t->column, t->factor, t->zero, t->press, t->vdot);
    return 1.0 / t->vdot[robot->nv - robot->njoint + j];
}

/* Projects forces on all joints onto the motion of joint j with its followers. */
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

    /* Inverse dynamics at rest give the gravity torque, which is taken off below */
    memset(t->vdot, 0, robot->nv * sizeof *t->vdot);
    d->ops->inverse(d, t->q, t->v, t->vdot, NULL, t->force);
    torque = trial_project(t, j);

    /* A unit of acceleration, which its followers follow by their multipliers */
    joint[j] = 1.0;
    for (size_t i = 0; i < robot->ncoupling; i++) {
        if (robot->coupling[i].leader == (int)j) {
            joint[robot->coupling[i].follower] = robot->coupling[i].multiplier;
        }
    }
    d->ops->inverse(d, t->q, t->v, t->vdot, NULL, t->force);
    return trial_project(t, j) - torque;
}
