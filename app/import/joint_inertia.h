/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Computes the effective inertias of joints by trial torques on the robot at rest in a pose.
 * Followers move exactly as their couplings say, and their inertia counts at their leaders. SI
 * units. The caller's arena owns the memory. Not RT-safe.
 */
#ifndef APP_IMPORT_JOINT_INERTIA_H
#define APP_IMPORT_JOINT_INERTIA_H

#include "model/dynamics.h"

/* A robot in a pose, with buffers for a trial, and its accelerations without torques. */
struct import_trial {
    struct dynamics dynamics;
    double *q, *v, *tau, *extra, *still, *vdot, *force;
    struct added_inertia *none;
    struct wrench *ext;
    double *column, *factor, *zero, *press; /* data for couplings, see model/coupling.h */
};

/* Prepares a trial of a finished robot with its joints at these positions. */
enum error_code import_trial_make(const struct robot *robot, const double *joint,
                                  struct arena *arena, struct import_trial *t, struct error *error);

/* Returns the inertia of joint j, rotor included, with other joints free: 1 / its acceleration by a
 * unit torque. kg m2, or kg for a prismatic joint. */
double import_trial_inertia(struct import_trial *t, size_t j);

/* Returns the inertia of joint j with other joints held: the inertia of all bodies behind it and
 * behind its followers. */
double import_trial_held_inertia(struct import_trial *t, size_t j);

#endif
