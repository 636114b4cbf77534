/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stiffness and damping of the couplings of an import, which no file gives. The follower alone,
 * with the inertia I that it shows while all else is held, would swing on its coupling at 1000
 * rad/s, a radian a tick, so that gravity bends it by tenths of a milliradian; where the leader has
 * a drive, the coupling gives way by no more than 1 mrad of the leader's under all that this drive
 * gives. K is the larger of the two, and 1e8 at most; D = 2 sqrt(K I) damps the follower
 * critically. Units are the follower's.
 *
 * Loads of followers are their leaders': what a follower bears counts there by the multiplier, and
 * as a stiffness by its square. Not RT-safe.
 */
#ifndef APP_IMPORT_STIFFNESS_H
#define APP_IMPORT_STIFFNESS_H

#include "app/import/tree_simplify.h"

/* Fills stiffness and damping of the robot's couplings and notes each; torque limits and drives
 * must be known. */
enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error);

/* Add to each leader what its followers bear, by joint: torques with their signs, by the
 * multiplier; magnitudes of loads, by its magnitude; stiffnesses, by its square. */
void import_lead_torques(const struct robot *robot, double *torque);
void import_lead_loads(const struct robot *robot, double *load);
void import_lead_stiffnesses(const struct robot *robot, double *stiffness);

#endif
