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

/* Memory from arena; the host stays the caller's. Not RT-safe. */
enum error_code servo_create(const struct servo_config *config, struct host *host,
                             struct arena *arena, struct servo **servo, struct error *error);

/* The present angles become the references, so that no motor moves; integrals are reset. */
void servo_start(struct servo *servo);

/* Other gains, one an axis, from now on; the caller's, must outlive the servo. */
void servo_use(struct servo *servo, const struct servo_gains *gains);

/* The torque (N m) that an axis bears: its voltage carries it, load_v_per_nm. */
void servo_set_load(struct servo *servo, size_t axis, double torque_nm);

/* The reference of one axis: angle (rad) and rate (rad/s). */
void servo_set(struct servo *servo, size_t axis, double angle, double rate);
double servo_wanted(const struct servo *servo, size_t axis);

/* A voltage that is added to that of the loop, for identification, until it is set again. */
void servo_excite(struct servo *servo, size_t axis, double volts);

/* Motor angle that the inner loop drives to: wanted + trim. */
double servo_reference(const struct servo *servo, size_t axis);

/* Queues voltages on the host when the command period has come. */
void servo_update(struct servo *servo);

#endif
