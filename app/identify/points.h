/* SPDX-License-Identifier: Apache-2.0 */
/* Figures of steady states of a drive, as a bench of points has them. Not RT-safe. */
#ifndef APP_IDENTIFY_POINTS_H
#define APP_IDENTIFY_POINTS_H

#include "app/identify/bench.h"
#include "app/report/report.h"

/* Returns the figure that a point asks for, as the drive has it; NAN where there is no such state
 * (the motor stalls, or the gear locks itself). */
double point_compute(const struct robot_sea *sea, const struct bench_point *point);

/* Adds a drive's diagram to a page: the load that a motor's torque up to most turns, and that which
 * turns it back, at rest, with those points of the bench that say the same. */
void point_diagram(struct report *report, const char *id, const struct robot_sea *sea,
                   const struct bench *bench);

#endif
