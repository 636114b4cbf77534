/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The core under the tasks that stand and walk: estimates the state (tasks/estimate.h), has the
 * gait say where feet and center of mass are to be (tasks/gait.h), answers what the measured
 * divergent component of motion is off with another center of pressure, and makes the references
 * of the leg motors of it. docs/walking.md has the derivation. SI units. RT-safe after creation.
 */
#ifndef TASKS_BALANCE_H
#define TASKS_BALANCE_H

#include "tasks/estimate.h"
#include "tasks/gait.h"
#include "tasks/servo.h"

struct balance;

/* initial: by axis of the host, the pose of all other joints. ERROR_INPUT when the robot has no
 * legs of that kind, boards are missing, or the posture is out of reach. */
enum error_code balance_create(const struct balance_config *config, const struct body_model *model,
                               const double *initial_rad, struct host *host, struct servo *servo,
                               struct arena *arena, struct balance **balance, struct error *error);

/* The motors are on and hold still. */
void balance_start(struct balance *balance);

/* Once a control period: sets the servo's references. */
void balance_update(struct balance *balance, const struct gait_command *command, double dt_s);

/* Whether it has come to its posture and balances. */
bool balance_ready(const struct balance *balance);

const struct estimate *balance_estimate(const struct balance *balance);
const struct gait *balance_gait(const struct balance *balance);

/* What it estimates and plans, for recordings. */
enum { BALANCE_SIGNALS = 55 };
extern const char *const balance_signal_name[BALANCE_SIGNALS];
void balance_signals(const struct balance *balance, double value[BALANCE_SIGNALS]);

#endif
