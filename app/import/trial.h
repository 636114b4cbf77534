/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The robot at rest in a pose, tried by torques: what inertia its joints show. Joints that follow
 * others follow exactly, and count to their leaders. SI units; memory is the caller's arena's. Not
 * RT-safe.
 */
#ifndef APP_IMPORT_TRIAL_H
#define APP_IMPORT_TRIAL_H

#include "model/dynamics.h"

struct import_trial {
    struct dynamics dynamics;
    double *q, *v, *tau, *extra, *still, *vdot, *force;
    struct added_inertia *none;
    struct wrench *ext;
    double *column, *factor, *zero, *press; /* of the couplings: model/coupling.h */
};

/* A trial of a finished robot with its joints there. */
enum error_code import_trial_make(const struct robot *robot, const double *joint,
                                  struct arena *arena, struct import_trial *t, struct error *error);

/* What joint j shows when the others give way, its rotor included: 1 / its acceleration by a unit
 * torque. */
double import_trial_inertia(struct import_trial *t, size_t j);

/* What joint j shows while the others are held: the inertia of all that is behind it, and behind
 * its followers. */
double import_trial_held_inertia(struct import_trial *t, size_t j);

#endif
