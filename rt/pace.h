/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A clock that goes at another pace than the one behind it, or stands still: what a controller in a
 * thread of its own waits on while the simulator is steered (rt/steering.h), so that it and the
 * robot agree how long a second is. It begins as the other clock and never goes back. One thread
 * changes the pace, any may wait. RT-safe.
 */
#ifndef RT_PACE_H
#define RT_PACE_H

#include "base/arena.h"
#include "rt/clock.h"

struct pace;

/* Memory from arena; at pace 1. Not RT-safe. */
enum error_code pace_create(struct clock *behind, struct arena *arena, struct pace **pace,
                            struct error *error);

/* Seconds of this clock a second of the other, from now on; 0 = stands still, and whoever sleeps
 * sleeps on. */
void pace_set(struct pace *pace, double rate);

struct clock *pace_clock(struct pace *pace);

#endif
