/* SPDX-License-Identifier: Apache-2.0 */
/* Waits for the STEP frame of lockstep and holds back the other frames of its bus. Frames before
 * the STEP belong to its first tick; frames behind it do not. canbus/lockstep.c checks whether a
 * STEP is valid. */
#include "rt/loop_private.h"

/* ---- frames held back ---- */

void loop_deliver_held(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;

    for (size_t i = 0; i < loop->held_seen; i++) {
        loop_deliver_frame(loop, bus, &loop->held[i]);
    }
    loop->held_count -= loop->held_seen;
    memmove(loop->held, loop->held + loop->held_seen, loop->held_count * sizeof *loop->held);
    loop->held_seen = 0;
}

void loop_drain_step_bus(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;
    size_t count;

    do {
        count =
            loop_take_frames(loop, bus, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        loop->held_count += count;
        while (loop->held_seen < loop->held_count &&
               loop->held[loop->held_seen].id != loop->config.lockstep.step_id) {
            loop->held_seen++;
        }
        loop_deliver_held(loop);
    } while (count && loop->held_count < HELD_MAX);
}

/* ---- the STEP ---- */

/* Examines one held frame. Returns whether it is a valid STEP. An invalid STEP is answered or
 * reported. */
static bool step_accept_frame(struct loop *loop, const struct bus_frame *frame)
{
    int bus = loop->config.lockstep.bus;

    switch (lockstep_receive(&loop->lockstep, frame)) {
    case LOCKSTEP_RUN:
        return true;
    case LOCKSTEP_REFUSED:
        loop_emit_event(loop, LOOP_EVENT_STEP_MISMATCH, bus, loop->lockstep.expected,
                        loop->lockstep.tick);
        /* publish the counters now, because a refused STEP runs no tick */
        loop->stats.lockstep = loop->lockstep.counters;
        loop_send_done(loop, LOCKSTEP_MISMATCH);
        break;
    case LOCKSTEP_MALFORMED:
        loop_emit_event(loop, LOOP_EVENT_STEP_MALFORMED, bus, frame->len, 0);
        break;
    case LOCKSTEP_OTHER:
        break;
    }
    return false;
}

/* Reads the STEP's bus up to the next STEP; false = no STEP has come. */
static bool step_find_frame(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;
    size_t count, total = 0;

    for (;;) {
        while (loop->held_seen < loop->held_count) {
            if (step_accept_frame(loop, &loop->held[loop->held_seen++])) {
                return true;
            }
        }

        /* The buffer is full without a STEP: deliver its frames to the boards now */
        if (loop->held_count == HELD_MAX) {
            loop_deliver_held(loop);
        }
        if (total >= LOOP_RECEIVE_MAX) {
            return false;
        }
        count =
            loop_take_frames(loop, bus, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        loop->held_count += count;
        total += count;
        if (count == 0) {
            return false;
        }
    }
}

/* Sleeps until the STEP's bus is readable, a request comes, or the slice ends. */
static void step_sleep(struct loop *loop, int64_t now_ns)
{
    struct can_port *port = loop->config.port[loop->config.lockstep.bus];
    const int descriptor = port->ops->descriptor(port);
    const size_t count = descriptor >= 0;
    int64_t until = now_ns + (count ? WAIT_SLICE_NS : POLL_SLICE_NS);

    if (loop->lockstep.report_at_ns < until) {
        until = loop->lockstep.report_at_ns;
    }
    loop->poll[0] = (struct pollfd){.fd = descriptor, .events = POLLIN};
    if (loop->config.requests) {
        loop_requests_sleep(loop, count, until);
        return;
    }
    loop_idle(loop);
    clock_wait_readable(loop->config.time, loop->poll, count, until);
}

bool loop_wait_for_step(struct loop *loop)
{
    const uint64_t left = loop->config.requests ? loop->requests.step_left : 0;
    int bus = loop->config.lockstep.bus;
    int64_t now = loop->mark_ns, silent;

    /* Do not wait while ticks of the last STEP remain, or when a REQUEST_STEP replaces a STEP. A
     * request never replaces the STEP of an inline controller */
    loop->step_begins = loop->lockstep.ticks == 0;
    if (loop->step_begins) {
        loop->step_asked = left > 0 && !loop->config.machine.controller;
        loop->lockstep.ticks = !loop->step_asked   ? 0
                               : left < UINT32_MAX ? (uint32_t)left
                                                   : UINT32_MAX;
    }
    if (loop->lockstep.ticks > 0) {
        return !loop_stop_requested(loop);
    }

    /* Measure the silence from the first wait on; requests do not restart it */
    if (!loop->awaiting) {
        lockstep_wait_begin(&loop->lockstep, now);
        loop->awaiting = true;
    }
    for (;;) {
        if (loop_stop_requested(loop)) {
            return false;
        }
        if (!loop_step_controller(loop)) {
            return step_find_frame(loop);
        }
        /* Where the controller ends the run must not depend on when the next STEP arrives */
        if (loop_stop_requested(loop)) {
            return false;
        }
        if (step_find_frame(loop)) {
            break;
        }

        /* No STEP yet: report a long silence, then sleep */
        now = clock_now(loop->config.time);
        if (lockstep_wait_check(&loop->lockstep, now, &silent)) {
            loop_emit_event(loop, LOOP_EVENT_SILENT, bus, silent, 0);
        }
        step_sleep(loop, now);
        if (loop_request_waits(loop)) {
            return false;
        }
    }

    /* The STEP is here: report the end of a silence */
    loop->awaiting = false;
    if (lockstep_wait_end(&loop->lockstep, now, &silent)) {
        loop_emit_event(loop, LOOP_EVENT_BACK, bus, silent, 0);
    }
    return true;
}
