/* SPDX-License-Identifier: Apache-2.0 */
/* Runs the ticks: the wait, then the phases in order, each with its duration measured. */
#include "rt/loop_private.h"

#include "rt/probes.h"

#include <sys/resource.h>

/* ---- the configuration ---- */

/* Replaces a NULL function of the machine, so that the loop needs no check per frame. */
static void ignore_frame(void *context, int64_t now_ns, size_t bus, const struct bus_frame *frame)
{
    (void)context, (void)now_ns, (void)bus, (void)frame;
}

/* Sets the defaults of the configuration; false = out of memory. */
static bool loop_complete_config(struct loop_config *config, struct arena *arena)
{
    struct loop_lockstep *lockstep = &config->lockstep;

    config->tick_ns = config->tick_ns ? config->tick_ns : CLOCK_MS;
    config->stop_after = config->stop_after ? config->stop_after : 1;
    config->time = config->time ? config->time : clock_monotonic();
    config->machine.receive = config->machine.receive ? config->machine.receive : ignore_frame;
    /* Equal identifiers are not set: use the defaults */
    if (lockstep->step_id == lockstep->done_id) {
        lockstep->step_id = LOCKSTEP_STEP_ID;
        lockstep->done_id = LOCKSTEP_DONE_ID;
    }
    if (lockstep->partner_timeout_ns == 0) {
        lockstep->partner_timeout_ns = CLOCK_SECOND;
    }
    if (!config->transmit_max) {
        size_t *most = arena_alloc(arena, config->nbus + 1, sizeof *most);

        for (size_t b = 0; most && b < config->nbus; b++) {
            most[b] = LOOP_TRANSMIT_DEFAULT;
        }
        config->transmit_max = most;
    }
    return config->transmit_max != NULL;
}

/* ---- creation and what others may ask ---- */

/* Allocates the frame buffers, the states of the buses and the ring of events; false = out of
 * memory. */
static bool loop_allocate(struct loop *loop, struct arena *arena)
{
    const struct loop_config *config = &loop->config;
    void *events = arena_alloc(arena, EVENT_RING, sizeof(struct loop_event));
    size_t most = 0;

    for (size_t b = 0; b < config->nbus; b++) {
        most = config->transmit_max[b] > most ? config->transmit_max[b] : most;
    }
    loop->held = arena_alloc(arena, HELD_MAX, sizeof *loop->held);
    loop->batch = arena_alloc(arena, BATCH, sizeof *loop->batch);
    loop->outgoing = arena_alloc(arena, most + 1, sizeof *loop->outgoing);
    loop->state = arena_alloc(arena, config->nbus, sizeof *loop->state);
    if (!events || !loop->held || !loop->batch || !loop->outgoing || !loop->state ||
        !loop_arrivals_create(loop, arena)) {
        return false;
    }
    ring_init(&loop->events, events, sizeof(struct loop_event), EVENT_RING);
    return true;
}

enum error_code loop_create(const struct loop_config *config, struct arena *arena,
                            struct loop **out, struct error *error)
{
    struct loop *loop = arena_alloc(arena, 1, sizeof *loop);
    struct lockstep_config lockstep;

    if (!loop) {
        return error_set(error, ERROR_MEMORY, "no memory left for the loop");
    }
    loop->config = *config;
    if (!loop_complete_config(&loop->config, arena) || !loop_allocate(loop, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the loop");
    }
    if (config->requests && !loop_requests_create(loop, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the requests of the loop");
    }
    lockstep =
        (struct lockstep_config){loop->config.lockstep.step_id, loop->config.lockstep.done_id,
                                 loop->config.lockstep.partner_timeout_ns};
    lockstep_init(&loop->lockstep, &lockstep);
    loop->period_ns = loop->config.tick_ns;
    for (size_t b = 0; b < config->nbus; b++) {
        loop->state[b] = config->port[b]->state;
    }
    *out = loop;
    return ERROR_NONE;
}

void loop_stop(struct loop *loop)
{
    atomic_store_explicit(&loop->stop, true, memory_order_relaxed);
}

uint64_t loop_beat(const struct loop *loop)
{
    return atomic_load_explicit(&loop->beat, memory_order_relaxed);
}

const struct loop_stats *loop_stats(const struct loop *loop)
{
    return &loop->stats;
}

bool loop_stop_requested(struct loop *loop)
{
    uint64_t beat = atomic_load_explicit(&loop->beat, memory_order_relaxed);

    atomic_store_explicit(&loop->beat, beat + 1, memory_order_relaxed);
    if (atomic_load_explicit(&loop->stop, memory_order_relaxed)) {
        loop->end = LOOP_END_STOPPED;
        return true;
    }
    return false;
}

bool loop_step_controller(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;

    if (machine->controller && !machine->controller(machine->context, loop->stats.time_ns)) {
        loop->end = LOOP_END_CONTROLLER;
        return false;
    }
    return true;
}

/* ---- the wait for a tick's deadline, STEP frame (loop_lockstep.c) or nothing ---- */

/* Sleeps until the tick's deadline. False = the run has ended, or a request must be carried out
 * first. */
static bool wait_for_deadline(struct loop *loop)
{
    int64_t now = clock_now(loop->config.time), until;
    bool slept = false, asks, listens;

    /* Speed 0, as fast as possible: the deadline is always now */
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

        /* A request may interrupt the sleep only far from the deadline; frames may until shortly
         * before it */
        asks = loop->config.requests && loop->deadline_ns - now > 2 * POLL_SLICE_NS;
        until = loop->deadline_ns - (asks ? POLL_SLICE_NS : 0);
        until = asks && now + WAIT_SLICE_NS < until ? now + WAIT_SLICE_NS : until;
        listens = loop_arrivals_begin(loop, now, &until);
        if (asks) {
            loop_requests_sleep(loop, listens ? loop->config.nbus : 0, until);
        } else if (listens) {
            clock_wait_readable(loop->config.time, loop->poll, loop->config.nbus, until);
        } else {
            clock_sleep_until(loop->config.time, loop->deadline_ns);
            slept = true;
        }
        now = clock_now(loop->config.time);
        if (listens) {
            now = loop_arrivals_serve(loop, now);
        }
        if (asks && loop_request_waits(loop)) {
            return false;
        }
    }
    loop_arrivals_end(loop);

    /* The tick's duration counts from reference_ns; the histogram gets the delay of the wake-up */
    loop->reference_ns =
        loop->deadline_ns > loop->last_end_ns ? loop->deadline_ns : loop->last_end_ns;
    if (slept) {
        histogram_add(&loop->stats.wakeup, now - loop->deadline_ns);
    }
    return true;
}

static bool loop_wait_by_clock(struct loop *loop)
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

/* ---- frames ---- */

/* Checks whether the loop records a frame, according to config.recording. */
static bool loop_records_frame(const struct loop *loop, const struct bus_frame *frame)
{
    const struct loop_lockstep *lockstep = &loop->config.lockstep;

    return loop->config.recorder &&
           (loop->config.recording == LOOP_RECORD_ALL || (frame->flags & FRAME_ERROR) ||
            frame->id == lockstep->step_id || frame->id == lockstep->done_id);
}

void loop_deliver_frame(struct loop *loop, size_t bus, struct bus_frame *frame)
{
    const struct loop_machine *machine = &loop->config.machine;

    if (loop_records_frame(loop, frame)) {
        recorder_frame(loop->config.recorder, bus, frame, loop->stats.time_ns);
    }
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP || frame->id != loop->config.lockstep.step_id) {
        frame->time_ns = loop->stats.time_ns - loop->early_ns;
        machine->receive(machine->context, loop->stats.time_ns, bus, frame);
    }
}

LOOP_NOINLINE size_t loop_take_frames(struct loop *loop, size_t bus, struct bus_frame *frames,
                                      size_t max)
{
    size_t count = can_receive(loop->config.port[bus], frames, max);

    PROBE2(received, bus, count);
    return count;
}

LOOP_NOINLINE void loop_send_frames(struct loop *loop, size_t bus, size_t count)
{
    size_t sent = count ? can_send(loop->config.port[bus], loop->outgoing, count) : 0;

    PROBE3(sent, bus, count, sent);
    for (size_t i = 0; loop->config.recorder && i < sent; i++) {
        if (loop_records_frame(loop, &loop->outgoing[i])) {
            recorder_frame(loop->config.recorder, bus, &loop->outgoing[i], loop->stats.time_ns);
        }
    }
}

void loop_send_done(struct loop *loop, uint16_t flags)
{
    const size_t last = (size_t)loop->config.lockstep.bus;
    struct bus_frame done = lockstep_done(&loop->lockstep, flags);

    /* Send DONE in a separate batch, so that it is sent even if the boards' frames are lost */
    done.time_ns = loop->stats.time_ns;
    for (size_t b = 0; b < loop->config.nbus; b++) {
        if (b != last) {
            loop->outgoing[0] = done;
            loop_send_frames(loop, b, 1);
        }
    }
    loop->outgoing[0] = done;
    loop_send_frames(loop, last, 1);
}

void loop_count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx)
{
    *rx = *tx = 0;
    for (size_t b = 0; b < loop->config.nbus; b++) {
        *rx += loop->config.port[b]->counters.rx_dropped;
        *tx += loop->config.port[b]->counters.tx_dropped;
    }
}

/* ---- the phases of a tick ---- */

/* Ends a phase: stores its duration for a possible overrun, and adds it to the phase's
 * histogram. */
static LOOP_NOINLINE void loop_phase_end(struct loop *loop, enum loop_phase phase)
{
    int64_t now = clock_now(loop->config.time);
    int64_t spent = now - loop->mark_ns;

    loop->spent[phase] = spent;
    loop->mark_ns = now;
    PROBE2(phase_end, phase, spent);
    histogram_add(&loop->stats.phase[phase], spent);
}

/* Starts the effects that are due at the tick's time, carries out requests, then waits. False = do
 * not run the tick: requests must be carried out first, or the run has ended. */
static bool loop_wait(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    bool go;

    /* Call begin before the wait, because in lockstep the wait already receives frames */
    if (machine->begin) {
        machine->begin(machine->context, loop->stats.time_ns);
    }
    go = (!loop->config.requests || loop_requests_carry_out(loop)) && loop_wait_by_clock(loop);
    if (!go && loop->end == LOOP_RUNNING) {
        return false;
    }

    loop_phase_end(loop, PHASE_WAIT);
    if (loop->config.clock == LOOP_CLOCK_REAL) {
        /* The wait's share of an overrun is the delay of the wake-up, not the sleep */
        loop->spent[PHASE_WAIT] = loop->mark_ns - loop->reference_ns - loop->spent[PHASE_ARRIVALS];
    }
    loop->work_begin_ns = loop->mark_ns;
    return go;
}

/* Receives all buses in order. In lockstep, the STEP's own bus delivers only the frames before the
 * STEP. */
static LOOP_NOINLINE void loop_receive(struct loop *loop)
{
    bool lockstep = loop->config.clock == LOOP_CLOCK_LOCKSTEP;
    bool due = !lockstep || loop->step_begins || loop->config.machine.advance;

    for (size_t b = 0; b < loop->config.nbus && due; b++) {
        if (!lockstep || b != (size_t)loop->config.lockstep.bus) {
            /* Receive the waiting frames of a bus, at most LOOP_RECEIVE_MAX, and hand them to the
             * machine */
            size_t count = BATCH;

            for (size_t total = 0; count == BATCH && total < LOOP_RECEIVE_MAX; total += count) {
                count = loop_take_frames(loop, b, loop->batch, BATCH);
                for (size_t i = 0; i < count; i++) {
                    loop_deliver_frame(loop, b, &loop->batch[i]);
                }
            }
        } else if (loop->step_begins && !loop->step_asked) {
            loop_deliver_held(loop);
        } else {
            loop_drain_step_bus(loop);
        }
    }
    loop_phase_end(loop, PHASE_RECEIVE);
}

/* Moves virtual time to the tick's end. Returns whether DONE is due there. */
static bool loop_advance_time(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    uint64_t rx, tx;
    uint16_t flags = 0;

    loop->stats.ticks++;
    loop->stats.time_ns += loop->config.tick_ns;
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP) {
        return false;
    }
    /* DONE reports frames lost since the last DONE, and boards in fault */
    loop_count_lost(loop, &rx, &tx);
    flags |= rx + tx > loop->lost_at_done ? LOCKSTEP_OVERRUN : 0;
    flags |= machine->fault && machine->fault(machine->context) ? LOCKSTEP_FAULT : 0;
    loop->lost_at_done = rx + tx;
    return lockstep_advance(&loop->lockstep, flags);
}

/* Sends the machine's frames on each bus at the tick's end, then DONE if it is due. */
static LOOP_NOINLINE void loop_transmit(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    bool done_due = loop_advance_time(loop);
    int64_t now_ns = loop->stats.time_ns, due_ns = now_ns;

    /* Deliver the frames that were in transit during the tick before sending new ones at its end */
    if (machine->advance) {
        machine->advance(machine->context, now_ns);
    }
    if (machine->set_due) {
        /* Where the loop can send an answer between ticks, it sends none too early */
        if (loop_arrivals_possible(loop)) {
            due_ns = loop_virtual_time(loop, now_ns - loop->config.tick_ns,
                                       clock_now(loop->config.time));
        }
        machine->set_due(machine->context, due_ns);
    }
    for (size_t b = 0; b < loop->config.nbus; b++) {
        size_t count = machine->transmit
                           ? machine->transmit(machine->context, now_ns, b, loop->outgoing,
                                               loop->config.transmit_max[b])
                           : 0;

        loop_send_frames(loop, b, count);
    }
    if (done_due) {
        loop_send_done(loop, 0);
    }
    loop_phase_end(loop, PHASE_TRANSMIT);
}

/* Publishes state and statistics to other threads, and ends the tick's work. */
static LOOP_NOINLINE void loop_publish(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;

    /* Emit events for changed bus states and for lost frames */
    uint64_t rx, tx;

    for (size_t b = 0; b < loop->config.nbus; b++) {
        enum can_port_state state = loop->config.port[b]->state;

        if (state != loop->state[b]) {
            loop_emit_event(loop, LOOP_EVENT_BUS_STATE, (int)b, loop->state[b], state);
            loop->state[b] = state;
        }
    }
    loop_count_lost(loop, &rx, &tx);
    if (rx != loop->rx_lost || tx != loop->tx_lost) {
        loop_emit_event(loop, LOOP_EVENT_FRAMES_LOST, -1, (int64_t)(rx - loop->rx_lost),
                        (int64_t)(tx - loop->tx_lost));
        loop->rx_lost = rx;
        loop->tx_lost = tx;
    }
    loop->stats.lockstep = loop->lockstep.counters;
    if (machine->publish) {
        machine->publish(machine->context, loop->stats.time_ns, &loop->stats);
    }
    loop_phase_end(loop, PHASE_PUBLISH);
    histogram_add(&loop->stats.work, loop->mark_ns - loop->work_begin_ns);
}

/* ---- the run ---- */

/* Runs one tick, or returns early when the wait before it was interrupted. */
static void loop_run_tick(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    int64_t begin_ns, end_ns;
    bool sane;

    /* Wait until the tick may begin; a request may set time back meanwhile */
    if (!loop_wait(loop)) {
        return;
    }
    begin_ns = loop->stats.time_ns;
    end_ns = begin_ns + loop->config.tick_ns;
    PROBE2(tick_begin, loop->stats.ticks, begin_ns);
    if (loop->config.requests) {
        loop_requests_tick_begins(loop);
    }

    /* Run the phases: receive frames, apply them, move the plant, measure, send frames */
    loop_receive(loop);
    if (machine->control) {
        machine->control(machine->context, begin_ns);
    }
    loop_phase_end(loop, PHASE_BOARDS);
    sane = !machine->plant || machine->plant(machine->context, begin_ns);
    loop_phase_end(loop, PHASE_PLANT);
    sane = (!machine->sample || machine->sample(machine->context, end_ns)) && sane;
    loop_phase_end(loop, PHASE_SENSORS);
    loop_transmit(loop);
    loop_publish(loop);

    /* Count an overrun or a late tick, and set the next deadline */
    if (loop->config.clock == LOOP_CLOCK_REAL) {
        overrun_account_tick(loop, loop->mark_ns);
    } else if (loop_is_paced(loop)) {
        overrun_pace_tick(loop, loop->mark_ns);
    }
    if (loop->config.requests) {
        loop_requests_tick_ended(loop);
    }
    PROBE2(tick_end, loop->stats.ticks - 1, loop->mark_ns - loop->work_begin_ns);

    /* A failed model or the configured length ends the run */
    if (!sane) {
        loop->end = LOOP_END_MODEL;
    } else if (loop->end == LOOP_RUNNING && loop->stats.ticks == loop->config.ticks) {
        loop->end = LOOP_END_LENGTH;
    }
}

/* Returns the page faults of the calling thread so far, minor and major. */
static uint64_t thread_page_faults(void)
{
    struct rusage usage = {0};

    getrusage(RUSAGE_THREAD, &usage);
    return (uint64_t)(usage.ru_minflt + usage.ru_majflt);
}

enum loop_end loop_run(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    uint64_t faults = thread_page_faults();

    if (loop->config.requests) {
        loop_requests_begin(loop);
    }

    /* The grid of deadlines begins now */
    loop->stats.start_ns = clock_now(loop->config.time);
    loop->mark_ns = loop->stats.start_ns;
    loop->deadline_ns = loop->stats.start_ns;
    loop->last_end_ns = loop->stats.start_ns;

    PROBE2(run_begin, loop->config.clock, loop->config.tick_ns);
    while (loop->end == LOOP_RUNNING) {
        loop_run_tick(loop);
    }
    PROBE2(run_end, loop->end, loop->stats.ticks);
    loop->stats.page_faults = thread_page_faults() - faults;

    /* At the end, refuse requests, switch the motors off, and notify a lockstep controller */
    if (loop->config.requests) {
        loop_requests_end(loop);
    }
    if (machine->shut_down) {
        machine->shut_down(machine->context, loop->stats.time_ns);
    }
    if (loop->config.clock == LOOP_CLOCK_LOCKSTEP) {
        loop_send_done(loop, LOCKSTEP_STOPPING);
    }
    loop->stats.lockstep = loop->lockstep.counters;
    loop->stats.end_ns = loop->config.clock == LOOP_CLOCK_REAL ? loop->last_end_ns : loop->mark_ns;
    return loop->end;
}
