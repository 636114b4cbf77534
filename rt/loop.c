/* SPDX-License-Identifier: Apache-2.0 */
/* Waiting, the phases of a tick, and their accounting. */
#include "rt/loop_private.h"
#include "rt/probes.h"

#include <string.h>
#include <sys/resource.h>

/* A function of its own in the program: one place for a probe, a line of its own in a profile, and
 * what the test of the budget (rt/phase_budget.h) counts. */
#define APART static __attribute__((noinline))

/* ---- creation ---- */

enum error_code loop_create(const struct loop_config *config, struct arena *arena,
                            struct loop **out, struct error *error)
{
    struct loop *loop = arena_alloc(arena, 1, sizeof *loop);
    struct lockstep_config lockstep = {config->lockstep.step_id, config->lockstep.done_id,
                                       config->lockstep.partner_timeout_ns};
    void *events = arena_alloc(arena, EVENT_RING, sizeof(struct loop_event));
    size_t most = 0;

    for (size_t b = 0; b < config->nbus; b++) {
        most = config->transmit_max[b] > most ? config->transmit_max[b] : most;
    }
    if (!loop || !events || !(loop->held = arena_alloc(arena, HELD_MAX, sizeof *loop->held)) ||
        !(loop->batch = arena_alloc(arena, BATCH, sizeof *loop->batch)) ||
        !(loop->outgoing = arena_alloc(arena, most + 1, sizeof *loop->outgoing)) ||
        !(loop->state = arena_alloc(arena, config->nbus, sizeof *loop->state))) {
        return error_set(error, ERROR_MEMORY, "no memory left for the loop");
    }
    loop->config = *config;
    loop->period_ns = config->tick_ns;
    if (config->steering && !loop_steer_create(loop, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the steering of the loop");
    }
    lockstep_init(&loop->lockstep, &lockstep);
    ring_init(&loop->events, events, sizeof(struct loop_event), EVENT_RING);
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

bool loop_stop_wanted(struct loop *loop)
{
    uint64_t beat = atomic_load_explicit(&loop->beat, memory_order_relaxed);

    atomic_store_explicit(&loop->beat, beat + 1, memory_order_relaxed);
    if (atomic_load_explicit(&loop->stop, memory_order_relaxed)) {
        loop->end = LOOP_END_STOPPED;
        return true;
    }
    return false;
}

/* ---- frames ---- */

/* Whether a frame goes into the recording from here: a wire records what it carries itself. */
static bool recorded_here(const struct loop *loop, const struct bus_frame *frame)
{
    const struct loop_lockstep *lockstep = &loop->config.lockstep;

    return loop->config.recorder &&
           (!loop->config.machine.advance || (frame->flags & FRAME_ERROR) ||
            frame->id == lockstep->step_id || frame->id == lockstep->done_id);
}

static void deliver(struct loop *loop, size_t bus, const struct bus_frame *frame)
{
    if (recorded_here(loop, frame)) {
        recorder_frame(loop->config.recorder, bus, frame, loop->stats.time_ns);
    }
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP || frame->id != loop->config.lockstep.step_id) {
        loop->config.machine.receive(loop->config.machine.context, bus, frame);
    }
}

APART size_t take(struct loop *loop, size_t bus, struct bus_frame *frames, size_t max)
{
    size_t count = can_receive(loop->config.port[bus], frames, max);

    PROBE2(received, bus, count);
    return count;
}

static void drain(struct loop *loop, size_t bus)
{
    size_t count, total = 0;

    do {
        count = take(loop, bus, loop->batch, BATCH);
        for (size_t i = 0; i < count; i++) {
            deliver(loop, bus, &loop->batch[i]);
        }
        total += count;
    } while (count == BATCH && total < LOOP_RECEIVE_MAX);
}

APART void send(struct loop *loop, size_t bus, size_t count, int64_t time_ns)
{
    size_t sent = count ? can_send(loop->config.port[bus], loop->outgoing, count) : 0;

    PROBE3(sent, bus, count, sent);
    for (size_t i = 0; loop->config.recorder && i < sent; i++) {
        if (recorded_here(loop, &loop->outgoing[i])) {
            recorder_frame(loop->config.recorder, bus, &loop->outgoing[i], time_ns);
        }
    }
}

void loop_send_done(struct loop *loop, uint16_t flags)
{
    struct bus_frame done = lockstep_done(&loop->lockstep, flags);

    for (size_t b = 0; b < loop->config.nbus; b++) {
        loop->outgoing[0] = done;
        send(loop, b, 1, loop->stats.time_ns);
    }
}

/* ---- waiting: lockstep ---- */

static void deliver_held(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;

    for (size_t i = 0; i < loop->held_seen; i++) {
        deliver(loop, bus, &loop->held[i]);
    }
    loop->held_count -= loop->held_seen;
    memmove(loop->held, loop->held + loop->held_seen, loop->held_count * sizeof *loop->held);
    loop->held_seen = 0;
}

/* judges the next held frame; true when it is a STEP to run */
static bool judge(struct loop *loop, const struct bus_frame *frame)
{
    int bus = loop->config.lockstep.bus;

    switch (lockstep_receive(&loop->lockstep, frame)) {
    case LOCKSTEP_RUN:
        return true;
    case LOCKSTEP_REFUSED:
        loop_emit(loop, LOOP_EVENT_STEP_MISMATCH, bus, loop->lockstep.expected,
                  loop->lockstep.tick);
        loop_send_done(loop, LOCKSTEP_MISMATCH);
        break;
    case LOCKSTEP_MALFORMED:
        loop_emit(loop, LOOP_EVENT_STEP_MALFORMED, bus, frame->len, 0);
        break;
    case LOCKSTEP_OTHER:
        break;
    }
    return false;
}

/* reads the STEP's bus up to a STEP; false when none has come */
static bool find_step(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;
    size_t count, total = 0;

    for (;;) {
        while (loop->held_seen < loop->held_count) {
            if (judge(loop, &loop->held[loop->held_seen++])) {
                return true;
            }
        }
        if (loop->held_count == HELD_MAX) {
            /* that much talk without a STEP: the boards take it now */
            deliver_held(loop);
        }
        if (total >= LOOP_RECEIVE_MAX) {
            return false;
        }
        count = take(loop, bus, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        loop->held_count += count;
        total += count;
        if (count == 0) {
            return false;
        }
    }
}

static void sleep_for_step(struct loop *loop, int64_t now)
{
    struct can_port *port = loop->config.port[loop->config.lockstep.bus];
    struct pollfd fd = {.fd = port->ops->descriptor(port), .events = POLLIN};
    int64_t slice = fd.fd >= 0 ? WAIT_SLICE_NS : POLL_SLICE_NS;
    int64_t until = now + slice;

    if (loop->lockstep.report_at_ns < until) {
        until = loop->lockstep.report_at_ns;
    }
    if (loop->config.steering) {
        loop_steer_sleep(loop, fd.fd >= 0 ? &fd : NULL, until);
        return;
    }
    clock_wait_readable(loop->config.time, &fd, fd.fd >= 0, until);
}

/* false: the inline controller has finished */
static bool control_inline(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;

    if (machine->controller && !machine->controller(machine->context, loop->stats.time_ns)) {
        loop->end = LOOP_END_CONTROLLER;
        return false;
    }
    return true;
}

/* between two ticks somebody is to be heard first */
static bool request_waits(const struct loop *loop)
{
    return loop->config.steering && steering_waits(loop->config.steering);
}

/* STEER_STEP plays the part of a STEP frame, unless an inline controller sends its own. */
static bool step_asked_for(struct loop *loop)
{
    uint64_t left = loop->config.steering ? loop->steer.step_left : 0;

    loop->step_asked = left > 0 && !loop->config.machine.controller;
    if (loop->step_asked) {
        loop->lockstep.ticks = left < UINT32_MAX ? (uint32_t)left : UINT32_MAX;
    }
    return loop->step_asked;
}

/* false when no tick is to be run */
static bool wait_lockstep(struct loop *loop)
{
    int bus = loop->config.lockstep.bus;
    int64_t now = loop->mark_ns, silent;

    loop->step_begins = loop->lockstep.ticks == 0;
    if (!loop->step_begins || step_asked_for(loop)) {
        return !loop_stop_wanted(loop);
    }
    if (!loop->awaiting) {
        lockstep_wait_begin(&loop->lockstep, now);
        loop->awaiting = true;
    }
    for (;;) {
        if (loop_stop_wanted(loop)) {
            return false;
        }
        if (!control_inline(loop)) {
            return find_step(loop);
        }
        if (find_step(loop)) {
            break;
        }
        now = clock_now(loop->config.time);
        if (lockstep_wait_check(&loop->lockstep, now, &silent)) {
            loop_emit(loop, LOOP_EVENT_SILENT, bus, silent, 0);
        }
        sleep_for_step(loop, now);
        if (request_waits(loop)) {
            return false;
        }
    }
    loop->awaiting = false;
    if (lockstep_wait_end(&loop->lockstep, now, &silent)) {
        loop_emit(loop, LOOP_EVENT_BACK, bus, silent, 0);
    }
    return true;
}

/* ---- waiting: real time ---- */

/* deadlines that have passed at now, not counting one at now itself */
static uint64_t deadlines_missed(const struct loop *loop, int64_t now)
{
    int64_t behind = now - loop->deadline_ns;

    return (uint64_t)((behind + loop->period_ns - 1) / loop->period_ns);
}

static void drop_deadlines(struct loop *loop, uint64_t count)
{
    loop->deadline_ns += (int64_t)count * loop->period_ns;
}

static void take_up_grid(struct loop *loop, int64_t now)
{
    uint64_t missed = deadlines_missed(loop, now);

    loop_emit(loop, LOOP_EVENT_PAUSE, -1, now - loop->deadline_ns, 0);
    drop_deadlines(loop, missed);
    loop->stats.pauses++;
    loop->stats.pause_ticks += missed;
}

/* of a loop that sleeps until a deadline far off */
static int64_t next_look(const struct loop *loop, int64_t now)
{
    int64_t slice = now + WAIT_SLICE_NS, before = loop->deadline_ns - POLL_SLICE_NS;

    return slice < before ? slice : before;
}

static bool wait_real(struct loop *loop)
{
    int64_t now = clock_now(loop->config.time);
    bool slept = false;

    if (loop->period_ns == 0) {
        loop->deadline_ns = now;
    }
    for (;;) {
        if (loop_stop_wanted(loop)) {
            return false;
        }
        if (now - loop->deadline_ns > LOOP_PAUSE_NS) {
            take_up_grid(loop, now);
        }
        if (now >= loop->deadline_ns) {
            break;
        }
        if (loop->config.steering && loop->deadline_ns - now > 2 * POLL_SLICE_NS) {
            /* far off: somebody may ask meanwhile */
            loop_steer_sleep(loop, NULL, next_look(loop, now));
            if (request_waits(loop)) {
                return false;
            }
        } else {
            clock_sleep_until(loop->config.time, loop->deadline_ns);
            slept = true;
        }
        now = clock_now(loop->config.time);
    }
    loop->reference_ns =
        loop->deadline_ns > loop->last_end_ns ? loop->deadline_ns : loop->last_end_ns;
    if (slept) {
        histogram_add(&loop->stats.wakeup, now - loop->deadline_ns);
    }
    return true;
}

static void charge_overrun(struct loop *loop, int64_t over)
{
    int worst = 0;

    for (int p = 1; p < PHASE_COUNT; p++) {
        worst = loop->spent[p] > loop->spent[worst] ? p : worst;
    }
    loop->stats.overruns[worst]++;
    loop->stats.overrun_total++;
    PROBE2(overrun, worst, over);
    loop_emit(loop, LOOP_EVENT_OVERRUN, -1, worst, over);
    if (loop->config.overrun == LOOP_OVERRUN_STOP &&
        loop->stats.overrun_total >= (uint64_t)loop->config.stop_after) {
        loop->end = LOOP_END_OVERRUNS;
    }
}

/* the tick has ended at now: was it in time, and which deadline is next? */
static void account_real(struct loop *loop, int64_t now)
{
    loop->last_end_ns = now;
    loop->deadline_ns += loop->period_ns;
    if (now <= loop->deadline_ns || loop->period_ns == 0) {
        return;
    }
    if (now - loop->deadline_ns > LOOP_PAUSE_NS) {
        take_up_grid(loop, now);
        return;
    }
    if (now - loop->reference_ns > loop->period_ns) {
        charge_overrun(loop, now - loop->deadline_ns);
    } else {
        loop->stats.late_ticks++;
    }
    if (loop->config.overrun != LOOP_OVERRUN_SLIP) {
        uint64_t missed = deadlines_missed(loop, now);

        drop_deadlines(loop, missed);
        loop->stats.lost_ticks += missed;
    }
}

/* free run that has been given a speed */
static bool paced(const struct loop *loop)
{
    return loop->config.clock == LOOP_CLOCK_FREE && loop->steer.speed > 0.0;
}

/* A pace, not a promise: what is late stays late, and nobody counts it. */
static void account_paced(struct loop *loop, int64_t now)
{
    loop->last_end_ns = now;
    loop->deadline_ns += loop->period_ns;
    loop->deadline_ns = loop->deadline_ns > now ? loop->deadline_ns : now;
}

/* ---- the phases of a tick ---- */

APART void phase_end(struct loop *loop, enum loop_phase phase)
{
    int64_t now = clock_now(loop->config.time);

    int64_t spent = now - loop->mark_ns;

    loop->spent[phase] = spent;
    loop->mark_ns = now;
    PROBE2(phase_end, phase, spent);
    histogram_add(&loop->stats.phase[phase], spent);
}

static bool wait_by_clock(struct loop *loop)
{
    bool go;

    switch (loop->config.clock) {
    case LOOP_CLOCK_REAL:
        return wait_real(loop);
    case LOOP_CLOCK_LOCKSTEP:
        return wait_lockstep(loop);
    default:
        go = paced(loop) ? wait_real(loop) : !loop_stop_wanted(loop);
        if (go) {
            control_inline(loop);
        }
        return go;
    }
}

static bool wait_for_tick(struct loop *loop)
{
    bool go = (!loop->config.steering || loop_steer(loop)) && wait_by_clock(loop);

    if (!go && loop->end == LOOP_RUNNING) {
        return false; /* there is something to be carried out first */
    }
    phase_end(loop, PHASE_WAIT);
    if (loop->config.clock == LOOP_CLOCK_REAL) {
        /* for the blame only the lateness counts, not the sleep */
        loop->spent[PHASE_WAIT] = loop->mark_ns - loop->reference_ns;
    }
    loop->work_begin_ns = loop->mark_ns;
    return go;
}

/* Takes the frames that a wire has delivered on the STEP's bus while a STEP runs; the next STEP, if it
 * is there already, and what follows it stay. */
static void drain_held(struct loop *loop)
{
    size_t bus = (size_t)loop->config.lockstep.bus;
    size_t count;

    do {
        count = take(loop, bus, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        loop->held_count += count;
        while (loop->held_seen < loop->held_count &&
               loop->held[loop->held_seen].id != loop->config.lockstep.step_id) {
            loop->held_seen++;
        }
        deliver_held(loop);
    } while (count && loop->held_count < HELD_MAX);
}

APART void receive(struct loop *loop)
{
    bool lockstep = loop->config.clock == LOOP_CLOCK_LOCKSTEP;
    bool due = !lockstep || loop->step_begins || loop->config.machine.advance;

    for (size_t b = 0; b < loop->config.nbus && due; b++) {
        if (!lockstep || b != (size_t)loop->config.lockstep.bus) {
            drain(loop, b);
        } else if (loop->step_begins && !loop->step_asked) {
            deliver_held(loop);
        } else {
            drain_held(loop);
        }
    }
    phase_end(loop, PHASE_RECEIVE);
}

void loop_count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx)
{
    *rx = *tx = 0;
    for (size_t b = 0; b < loop->config.nbus; b++) {
        *rx += loop->config.port[b]->counters.rx_dropped;
        *tx += loop->config.port[b]->counters.tx_dropped;
    }
}

/* true when this tick ends with DONE */
static bool advance(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    uint64_t rx, tx;
    uint16_t flags = 0;

    loop->stats.ticks++;
    loop->stats.time_ns += loop->config.tick_ns;
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP) {
        return false;
    }
    loop_count_lost(loop, &rx, &tx);
    flags |= rx + tx > loop->lost_at_done ? LOCKSTEP_OVERRUN : 0;
    flags |= machine->fault(machine->context) ? LOCKSTEP_FAULT : 0;
    loop->lost_at_done = rx + tx;
    return lockstep_advance(&loop->lockstep, flags);
}

APART void transmit(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    bool done_due = advance(loop);
    struct bus_frame done = {0};

    if (done_due) {
        done = lockstep_done(&loop->lockstep, 0);
    }
    /* what was on its way during the tick arrives before what the tick's end sends */
    if (machine->advance) {
        machine->advance(machine->context, loop->stats.time_ns);
    }
    for (size_t b = 0; b < loop->config.nbus; b++) {
        size_t count =
            machine->transmit(machine->context, b, loop->outgoing, loop->config.transmit_max[b]);

        send(loop, b, count, loop->stats.time_ns);
        if (done_due) {
            /* by itself: it passes also where the boards' frames are lost */
            loop->outgoing[0] = done;
            send(loop, b, 1, loop->stats.time_ns);
        }
    }
    phase_end(loop, PHASE_TRANSMIT);
}

static void watch_buses(struct loop *loop)
{
    uint64_t rx, tx;

    for (size_t b = 0; b < loop->config.nbus; b++) {
        enum can_port_state state = loop->config.port[b]->state;

        if (state != loop->state[b]) {
            loop_emit(loop, LOOP_EVENT_BUS_STATE, (int)b, loop->state[b], state);
            loop->state[b] = state;
        }
    }
    loop_count_lost(loop, &rx, &tx);
    if (rx != loop->rx_lost || tx != loop->tx_lost) {
        loop_emit(loop, LOOP_EVENT_FRAMES_LOST, -1, (int64_t)(rx - loop->rx_lost),
                  (int64_t)(tx - loop->tx_lost));
        loop->rx_lost = rx;
        loop->tx_lost = tx;
    }
}

APART void publish(struct loop *loop)
{
    watch_buses(loop);
    loop->stats.lockstep = loop->lockstep.counters;
    loop->config.machine.publish(loop->config.machine.context, &loop->stats);
    phase_end(loop, PHASE_PUBLISH);
    histogram_add(&loop->stats.work, loop->mark_ns - loop->work_begin_ns);
}

static void run_tick(struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;
    bool sane;

    if (!wait_for_tick(loop)) {
        return;
    }
    PROBE2(tick_begin, loop->stats.ticks, loop->stats.time_ns);
    if (loop->config.steering) {
        loop_steer_ticks(loop);
    }
    receive(loop);
    machine->control(machine->context);
    phase_end(loop, PHASE_BOARDS);
    sane = machine->plant(machine->context);
    phase_end(loop, PHASE_PLANT);
    sane = machine->sample(machine->context) && sane;
    phase_end(loop, PHASE_SENSORS);
    transmit(loop);
    publish(loop);
    if (loop->config.clock == LOOP_CLOCK_REAL) {
        account_real(loop, loop->mark_ns);
    } else if (paced(loop)) {
        account_paced(loop, loop->mark_ns);
    }
    if (loop->config.steering) {
        loop_steer_ticked(loop);
    }
    PROBE2(tick_end, loop->stats.ticks - 1, loop->mark_ns - loop->work_begin_ns);
    if (!sane) {
        loop->end = LOOP_END_MODEL;
    } else if (loop->end == LOOP_RUNNING && loop->stats.ticks == loop->config.ticks) {
        loop->end = LOOP_END_LENGTH;
    }
}

static uint64_t page_faults(void)
{
    struct rusage usage = {0};

    getrusage(RUSAGE_THREAD, &usage);
    return (uint64_t)(usage.ru_minflt + usage.ru_majflt);
}

enum loop_end loop_run(struct loop *loop)
{
    uint64_t faults = page_faults();

    if (loop->config.steering) {
        loop_steer_begin(loop);
    }
    loop->stats.start_ns = clock_now(loop->config.time);
    loop->mark_ns = loop->stats.start_ns;
    loop->deadline_ns = loop->stats.start_ns;
    loop->last_end_ns = loop->stats.start_ns;
    PROBE2(run_begin, loop->config.clock, loop->config.tick_ns);
    while (loop->end == LOOP_RUNNING) {
        run_tick(loop);
    }
    PROBE2(run_end, loop->end, loop->stats.ticks);
    loop->stats.page_faults = page_faults() - faults;
    if (loop->config.steering) {
        loop_steer_end(loop);
    }
    loop->config.machine.shut_down(loop->config.machine.context);
    if (loop->config.clock == LOOP_CLOCK_LOCKSTEP) {
        loop_send_done(loop, LOCKSTEP_STOPPING);
    }
    loop->stats.lockstep = loop->lockstep.counters;
    loop->stats.end_ns = loop->config.clock == LOOP_CLOCK_REAL ? loop->last_end_ns : loop->mark_ns;
    return loop->end;
}
