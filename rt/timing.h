/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How a loop keeps time: what a configuration says and what rt/loop.h runs by. Types and words, no
 * calls: RT-safe. Times in ns.
 */
#ifndef RT_TIMING_H
#define RT_TIMING_H

#include "base/enum_names.h"

#include <stdint.h>

enum loop_clock {
    LOOP_CLOCK_REAL,     /* absolute deadlines, one tick each tick_ns */
    LOOP_CLOCK_LOCKSTEP, /* the controller's STEP frame drives virtual time */
    LOOP_CLOCK_FREE,     /* virtual time, no pacing */
};

/* The words of the clocks; those from the second on are clocks of virtual time. */
extern const struct word loop_clock_words[];

/* What happens with the deadlines that an overrun has missed; rt/loop.h says it exactly. */
enum loop_overrun {
    LOOP_OVERRUN_SKIP, /* dropped: virtual time falls behind by them */
    LOOP_OVERRUN_SLIP, /* run back to back until the grid is caught up */
    LOOP_OVERRUN_STOP, /* as skip, and stop_after overruns end the run */
};

extern const struct word loop_overrun_words[];

struct loop_lockstep {
    int bus; /* of the STEP frame */
    uint32_t step_id, done_id;
    int64_t partner_timeout_ns; /* without STEP until the silence is reported */
};

#endif
