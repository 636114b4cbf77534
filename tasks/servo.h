/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Position loops on the motor angles, for all axes of a host. The controller closes them with
 * voltage commands. An outer loop on the link angle compensates the deflection of the spring
 * (struct servo_gains, tasks/task.h). RT-safe after creation.
 */
#ifndef TASKS_SERVO_H
#define TASKS_SERVO_H

#include "tasks/host.h"

struct servo;

/* Creates the loops in the arena; borrows the host. Not RT-safe. */
enum error_code servo_create(const struct servo_config *config, struct host *host,
                             struct arena *arena, struct servo **servo, struct error *error);

/* Sets the references to the present angles, so that no motor moves, and resets the integrals. */
void servo_start(struct servo *servo);

/* Replaces the gains, one entry per axis, and calls servo_start. The gains are borrowed and must
 * outlive the servo. */
void servo_use(struct servo *servo, const struct servo_gains *gains);

/* Sets the load torque (N m) of an axis. The servo adds the voltage load_v_per_nm times the
 * torque. */
void servo_set_load(struct servo *servo, size_t axis, double torque_nm);

/* Sets the reference of one axis: angle (rad) and rate (rad/s). */
void servo_set(struct servo *servo, size_t axis, double angle, double rate);
double servo_wanted(const struct servo *servo, size_t axis);

/* Adds a constant voltage to the loop's output, for identification. It stays until the next
 * call. */
void servo_excite(struct servo *servo, size_t axis, double volts);

/* Returns the motor reference of the inner loop: wanted + trim, rad. */
double servo_reference(const struct servo *servo, size_t axis);

/* Computes the voltages and queues them on the host, once per command period. */
void servo_update(struct servo *servo);

#endif
