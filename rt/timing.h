/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Clocks and overrun policies of a loop, and their names in a configuration. rt/loop.h describes
 * them. No functions, so everything is RT-safe. Times in ns.
 */
#ifndef RT_TIMING_H
#define RT_TIMING_H

#include "base/enum_names.h"

#include <stdint.h>

enum loop_clock {
    LOOP_CLOCK_REAL,     /* absolute deadlines, one tick per tick_ns */
    LOOP_CLOCK_LOCKSTEP, /* the controller's STEP frame drives virtual time */
    LOOP_CLOCK_FREE,     /* virtual time, no pacing */
};

/* The names of the clocks. All clocks after the first run in virtual time. */
extern const struct word loop_clock_words[];

/* Policy for the deadlines that an overrun has missed; rt/loop.h has the details. */
enum loop_overrun {
    LOOP_OVERRUN_SKIP, /* drop them: virtual time falls behind by one tick per deadline */
    LOOP_OVERRUN_SLIP, /* run the late ticks back to back until the loop has caught up */
    LOOP_OVERRUN_STOP, /* as skip, and end the run at overrun number stop_after */
};

extern const struct word loop_overrun_words[];

struct loop_lockstep {
    int bus; /* bus that carries the STEP frame */
    uint32_t step_id, done_id;
    int64_t partner_timeout_ns; /* time without STEP after which the silence is reported */
};

#endif
