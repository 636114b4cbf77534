/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Position loops on the motor angles, closed in the controller by voltage commands, for all axes of
 * a host, with the spring's yielding trimmed away by the link angle: struct servo_config. RT-safe
 * after creation.
 */
#ifndef TASKS_SERVO_H
#define TASKS_SERVO_H

#include "tasks/host.h"

struct servo;

enum error_code servo_create(const struct servo_config *config, struct host *host,
                             struct arena *arena, struct servo **servo, struct error *error);

/* Takes the present angles as wanted, so that no motor moves, and forgets the integrals. */
void servo_start(struct servo *servo);

/* What is wanted of one axis: angle (rad) and rate (rad/s). */
void servo_set(struct servo *servo, size_t axis, double angle, double rate);
double servo_wanted(const struct servo *servo, size_t axis);

/* Motor angle that the inner loop drives to: wanted + trim. */
double servo_reference(const struct servo *servo, size_t axis);

/* Queues voltages on the host when the command period has come. */
void servo_update(struct servo *servo);

#endif
