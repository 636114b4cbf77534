/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A clock that runs at a multiple of the clock behind it, or stands still: a controller in a thread
 * of its own waits on it while requests change the simulator's speed (rt/requests.h), so that both
 * agree how long a second is. It begins equal to the other clock and never goes back. One thread
 * changes the rate, any may wait. RT-safe.
 */
#ifndef RT_PACE_H
#define RT_PACE_H

#include "base/arena.h"
#include "rt/clock.h"

struct pace;

/* Creates a clock at rate 1; borrows `behind`. Memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code pace_create(struct clock *behind, struct arena *arena, struct pace **pace,
                            struct error *error);

/* Sets the rate from now on, in seconds of this clock a second of the other; 0 = stands still,
 * and threads that sleep on it sleep on. */
void pace_set(struct pace *pace, double rate);

struct clock *pace_clock(struct pace *pace);

#endif
