/* SPDX-License-Identifier: Apache-2.0 */
/* Waits for the time of a tick: its deadline (real clock, paced free run), its STEP frame
 * (lockstep, loop_lockstep.c) or not at all (free run). */
#include "rt/loop_private.h"

/* Returns when to look for requests again while the deadline is far off (ns of the clock). */
static int64_t wait_next_look(const struct loop *loop, int64_t now_ns)
{
    int64_t slice = now_ns + WAIT_SLICE_NS, before = loop->deadline_ns - POLL_SLICE_NS;

    return slice < before ? slice : before;
}

/* Sleeps until the tick's deadline. False = the run ends, or a request has to be carried out
 * first. */
static bool wait_for_deadline(struct loop *loop)
{
    int64_t now = clock_now(loop->config.time);
    bool slept = false;

    /* Speed 0: as fast as possible, the deadline is always now */
    if (loop->period_ns == 0) {
        loop->deadline_ns = now;
    }

    for (;;) {
        if (loop_stop_requested(loop)) {
            return false;
        }
        if (now - loop->deadline_ns > LOOP_PAUSE_NS) {
            overrun_skip_pause(loop, now);
        }
        if (now >= loop->deadline_ns) {
            break;
        }

        /* Far from the deadline requests interrupt the sleep; close to it nothing does */
        if (loop->config.requests && loop->deadline_ns - now > 2 * POLL_SLICE_NS) {
            loop->config.machine.idle(loop->config.machine.context);
            loop_requests_sleep(loop, NULL, wait_next_look(loop, now));
            if (loop_request_waits(loop)) {
                return false;
            }
        } else {
            clock_sleep_until(loop->config.time, loop->deadline_ns);
            slept = true;
        }
        now = clock_now(loop->config.time);
    }

    /* From its reference time on the tick is charged for its time; how late the sleep ended is
     * counted */
    loop->reference_ns =
        loop->deadline_ns > loop->last_end_ns ? loop->deadline_ns : loop->last_end_ns;
    if (slept) {
        histogram_add(&loop->stats.wakeup, now - loop->deadline_ns);
    }
    return true;
}

bool loop_wait_by_clock(struct loop *loop)
{
    bool go;

    switch (loop->config.clock) {
    case LOOP_CLOCK_REAL:
        return wait_for_deadline(loop);
    case LOOP_CLOCK_LOCKSTEP:
        return loop_wait_for_step(loop);
    default:
        go = loop_is_paced(loop) ? wait_for_deadline(loop) : !loop_stop_requested(loop);
        if (go) {
            loop_step_controller(loop);
        }
        return go;
    }
}
