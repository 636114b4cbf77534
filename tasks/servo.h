/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Position loops on the motor angles, closed in the controller by voltage commands, for all axes of
 * a host; an outer loop on the link angle takes out the deflection of the spring (struct
 * servo_config). RT-safe after creation.
 */
#ifndef TASKS_SERVO_H
#define TASKS_SERVO_H

#include "tasks/host.h"

struct servo;

/* Creates the loops in the arena; the host stays the caller's. Not RT-safe. */
enum error_code servo_create(const struct servo_config *config, struct host *host,
                             struct arena *arena, struct servo **servo, struct error *error);

/* Makes the present angles the references, so that no motor moves, and resets the integrals. */
void servo_start(struct servo *servo);

/* Replaces the gains, one an axis, and starts anew; they are the caller's and must outlive the
 * servo. */
void servo_use(struct servo *servo, const struct servo_gains *gains);

/* Sets the torque (N m) that an axis carries: load_v_per_nm makes a voltage of it. */
void servo_set_load(struct servo *servo, size_t axis, double torque_nm);

/* Sets the reference of one axis: angle (rad) and rate (rad/s). */
void servo_set(struct servo *servo, size_t axis, double angle, double rate);
double servo_wanted(const struct servo *servo, size_t axis);

/* Adds a voltage to that of the loop, for identification, until it is set again. */
void servo_excite(struct servo *servo, size_t axis, double volts);

/* Returns the motor angle that the inner loop drives to, rad: wanted + trim. */
double servo_reference(const struct servo *servo, size_t axis);

/* Computes the voltages and queues them on the host when the command period has come. */
void servo_update(struct servo *servo);

#endif
