/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The balance controller of the tasks stand and walk. Each period, it estimates the state
 * (tasks/estimate.h), and updates the gait, which plans feet and center of mass (tasks/gait.h). It
 * moves the center of pressure to correct errors of the divergent component of motion. It then
 * computes the references of the leg motors. docs/walking.md has the derivation. SI units. RT-safe
 * after creation.
 */
#ifndef TASKS_BALANCE_H
#define TASKS_BALANCE_H

#include "tasks/estimate.h"
#include "tasks/gait.h"
#include "tasks/servo.h"

struct balance;

/* Creates the controller in the arena. initial_rad: joint angles by axis of the host. Joints
 * outside the legs stay at these angles; the leg angles are the initial guess of the posture.
 * Returns ERROR_INPUT if the legs are of an unknown kind, boards are missing, or the posture is
 * out of reach. */
enum error_code balance_create(const struct balance_config *config, const struct body_model *model,
                               const double *initial_rad, struct host *host, struct servo *servo,
                               struct arena *arena, struct balance **balance, struct error *error);

/* Starts the ramp into the posture. The motors must be on and at rest. */
void balance_start(struct balance *balance);

/* Runs one control period of dt_s, and sets the servo's references and loads. */
void balance_update(struct balance *balance, const struct gait_command *command, double dt_s);

/* Returns whether the robot has reached its posture and the gait has started. */
bool balance_ready(const struct balance *balance);

const struct estimate *balance_estimate(const struct balance *balance);
const struct gait *balance_gait(const struct balance *balance);

/* Names and present values of the estimated and planned signals, for recordings. */
enum { BALANCE_SIGNALS = 55 };
extern const char *const balance_signal_name[BALANCE_SIGNALS];
void balance_signals(const struct balance *balance, double value[BALANCE_SIGNALS]);

#endif
