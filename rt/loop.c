/* SPDX-License-Identifier: Apache-2.0 */
/* Waiting, the phases of a tick, and their accounting. */
#include "rt/loop.h"

#include "base/ring.h"
#include "boards/icub_protocol.h"

#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

enum {
    BATCH = 64,          /* frames per receive call */
    RECEIVE_MAX = 16384, /* frames taken from a bus in one tick */
    HELD_MAX = 1024,     /* frames of the STEP's bus kept until the STEP comes */
    EVENT_RING = 1024,
    WAIT_SLICE_NS = 100000000, /* the stop flag is looked at as often while waiting */
    POLL_SLICE_NS = 10000000,  /* the same when the port is gone and has nothing to sleep on */
};

struct loop {
    struct loop_config config;
    struct loop_stats stats;
    atomic_bool stop;
    _Atomic uint64_t beat; /* loop_beat */
    enum loop_end end;

    /* the tick being run */
    int64_t mark_ns;            /* end of the last phase */
    int64_t spent[PHASE_COUNT]; /* wait: how late the tick began */
    int64_t work_begin_ns;

    /* real clock */
    int64_t deadline_ns;
    int64_t reference_ns; /* when the tick could have begun: its deadline, or the end of the last */
    int64_t last_end_ns;

    /* lockstep */
    struct lockstep lockstep;
    bool step_begins; /* this tick is the first of its STEP */
    struct bus_frame *held;
    size_t held_count; /* frames in held */
    size_t held_seen;  /* of which judged; up to and with the STEP once it was found */

    struct bus_frame *batch;    /* BATCH, received */
    struct bus_frame *outgoing; /* largest transmit_max + DONE */
    enum can_port_state *state; /* of each bus, as last reported */
    uint64_t rx_lost, tx_lost;  /* of all buses, as last reported */
    uint64_t lost_at_done;
    struct ring events;
};

/* ---- events ---- */

static void emit(struct loop *loop, enum loop_event_kind kind, int bus, int64_t a, int64_t b)
{
    struct loop_event event = {loop->stats.time_ns, kind, bus, a, b};

    loop->stats.events_lost += !ring_push(&loop->events, &event);
}

bool loop_next_event(struct loop *loop, struct loop_event *event)
{
    return ring_pop(&loop->events, event);
}

const char *loop_phase_name(enum loop_phase phase)
{
    static const char *const names[PHASE_COUNT] = {
        "wait", "receive", "boards", "plant", "sensors", "transmit", "publish",
    };

    return names[phase];
}

static const char *state_name(int64_t state)
{
    static const char *const names[] = {
        [CAN_PORT_UP] = "up",
        [CAN_PORT_WARNING] = "error warning",
        [CAN_PORT_PASSIVE] = "error passive",
        [CAN_PORT_BUS_OFF] = "bus-off",
        [CAN_PORT_DOWN] = "down",
        [CAN_PORT_GONE] = "gone",
        [CAN_PORT_STUCK] = "stuck: its queue does not empty",
    };

    return names[state];
}

void loop_event_format(const struct loop *loop, const struct loop_event *event, char *text,
                       size_t size)
{
    const char *bus = event->bus >= 0 ? loop->config.port[event->bus]->bus : "";
    long long a = event->a, b = event->b;

    switch (event->kind) {
    case LOOP_EVENT_OVERRUN:
        snprintf(text, size, "overrun by %.3f ms in phase %s", (double)b * 1e-6,
                 loop_phase_name((enum loop_phase)a));
        break;
    case LOOP_EVENT_PAUSE:
        snprintf(text, size, "%.1f s behind: taken for a pause, grid taken up again",
                 (double)a * 1e-9);
        break;
    case LOOP_EVENT_BUS_STATE:
        snprintf(text, size, "bus %s is %s (was %s)", bus, state_name(b), state_name(a));
        break;
    case LOOP_EVENT_FRAMES_LOST:
        snprintf(text, size, "lost %lld frames on receiving and %lld on sending", a, b);
        break;
    case LOOP_EVENT_SILENT:
        snprintf(text, size, "no STEP frame on %s for %.1f s: still waiting for the controller",
                 bus, (double)a * 1e-9);
        break;
    case LOOP_EVENT_BACK:
        snprintf(text, size, "STEP frames on %s again after %.1f s", bus, (double)a * 1e-9);
        break;
    case LOOP_EVENT_STEP_MISMATCH:
        snprintf(text, size, "STEP on %s expects tick %lld, but this is tick %lld: not run", bus, a,
                 b);
        break;
    case LOOP_EVENT_STEP_MALFORMED:
        snprintf(text, size, "malformed STEP on %s: length %lld, expected %d", bus, a,
                 LOCKSTEP_LENGTH);
        break;
    }
}

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

/* at each wake-up */
static bool stop_wanted(struct loop *loop)
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
    const struct rig_lockstep *lockstep = &loop->config.lockstep;

    return loop->config.recorder &&
           (!loop->config.machine.advance || (frame->flags & FRAME_ERROR) ||
            frame->id == lockstep->step_id || frame->id == lockstep->done_id);
}

static void deliver(struct loop *loop, size_t bus, const struct bus_frame *frame)
{
    if (recorded_here(loop, frame)) {
        recorder_frame(loop->config.recorder, bus, frame, loop->stats.time_ns);
    }
    if (loop->config.clock != RIG_CLOCK_LOCKSTEP || frame->id != loop->config.lockstep.step_id) {
        loop->config.machine.receive(loop->config.machine.context, bus, frame);
    }
}

static void drain(struct loop *loop, size_t bus)
{
    size_t count, total = 0;

    do {
        count = can_receive(loop->config.port[bus], loop->batch, BATCH);
        for (size_t i = 0; i < count; i++) {
            deliver(loop, bus, &loop->batch[i]);
        }
        total += count;
    } while (count == BATCH && total < RECEIVE_MAX);
}

static void send(struct loop *loop, size_t bus, size_t count, int64_t time_ns)
{
    size_t sent = count ? can_send(loop->config.port[bus], loop->outgoing, count) : 0;

    for (size_t i = 0; loop->config.recorder && i < sent; i++) {
        if (recorded_here(loop, &loop->outgoing[i])) {
            recorder_frame(loop->config.recorder, bus, &loop->outgoing[i], time_ns);
        }
    }
}

static void send_done(struct loop *loop, uint16_t flags)
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
        emit(loop, LOOP_EVENT_STEP_MISMATCH, bus, loop->lockstep.expected, loop->lockstep.tick);
        send_done(loop, LOCKSTEP_MISMATCH);
        break;
    case LOCKSTEP_MALFORMED:
        emit(loop, LOOP_EVENT_STEP_MALFORMED, bus, frame->len, 0);
        break;
    case LOCKSTEP_OTHER:
        break;
    }
    return false;
}

/* reads the STEP's bus up to a STEP; false when none has come */
static bool find_step(struct loop *loop)
{
    struct can_port *port = loop->config.port[loop->config.lockstep.bus];

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
        loop->held_count +=
            can_receive(port, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        if (loop->held_seen == loop->held_count) {
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

/* false when no tick is to be run */
static bool wait_lockstep(struct loop *loop)
{
    int bus = loop->config.lockstep.bus;
    int64_t now = loop->mark_ns, silent;

    loop->step_begins = loop->lockstep.ticks == 0;
    if (!loop->step_begins) {
        return !stop_wanted(loop);
    }
    lockstep_wait_begin(&loop->lockstep, now);
    for (;;) {
        if (stop_wanted(loop)) {
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
            emit(loop, LOOP_EVENT_SILENT, bus, silent, 0);
        }
        sleep_for_step(loop, now);
    }
    if (lockstep_wait_end(&loop->lockstep, now, &silent)) {
        emit(loop, LOOP_EVENT_BACK, bus, silent, 0);
    }
    return true;
}

/* ---- waiting: real time ---- */

/* deadlines that have passed at now, not counting one at now itself */
static uint64_t deadlines_missed(const struct loop *loop, int64_t now)
{
    int64_t behind = now - loop->deadline_ns;

    return (uint64_t)((behind + loop->config.tick_ns - 1) / loop->config.tick_ns);
}

static void drop_deadlines(struct loop *loop, uint64_t count)
{
    loop->deadline_ns += (int64_t)count * loop->config.tick_ns;
}

static void take_up_grid(struct loop *loop, int64_t now)
{
    uint64_t missed = deadlines_missed(loop, now);

    emit(loop, LOOP_EVENT_PAUSE, -1, now - loop->deadline_ns, 0);
    drop_deadlines(loop, missed);
    loop->stats.pauses++;
    loop->stats.pause_ticks += missed;
}

static bool wait_real(struct loop *loop)
{
    int64_t now = clock_now(loop->config.time);
    bool slept = false;

    for (;;) {
        if (stop_wanted(loop)) {
            return false;
        }
        if (now - loop->deadline_ns > LOOP_PAUSE_NS) {
            take_up_grid(loop, now);
        }
        if (now >= loop->deadline_ns) {
            break;
        }
        clock_sleep_until(loop->config.time, loop->deadline_ns);
        slept = true;
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
    emit(loop, LOOP_EVENT_OVERRUN, -1, worst, over);
    if (loop->config.overrun == RIG_OVERRUN_STOP &&
        loop->stats.overrun_total >= (uint64_t)loop->config.stop_after) {
        loop->end = LOOP_END_OVERRUNS;
    }
}

/* the tick has ended at now: was it in time, and which deadline is next? */
static void account_real(struct loop *loop, int64_t now)
{
    loop->last_end_ns = now;
    loop->deadline_ns += loop->config.tick_ns;
    if (now <= loop->deadline_ns) {
        return;
    }
    if (now - loop->deadline_ns > LOOP_PAUSE_NS) {
        take_up_grid(loop, now);
        return;
    }
    if (now - loop->reference_ns > loop->config.tick_ns) {
        charge_overrun(loop, now - loop->deadline_ns);
    } else {
        loop->stats.late_ticks++;
    }
    if (loop->config.overrun != RIG_OVERRUN_SLIP) {
        uint64_t missed = deadlines_missed(loop, now);

        drop_deadlines(loop, missed);
        loop->stats.lost_ticks += missed;
    }
}

/* ---- the phases of a tick ---- */

static void phase_end(struct loop *loop, enum loop_phase phase)
{
    int64_t now = clock_now(loop->config.time);

    loop->spent[phase] = now - loop->mark_ns;
    histogram_add(&loop->stats.phase[phase], loop->spent[phase]);
    loop->mark_ns = now;
}

static bool wait_for_tick(struct loop *loop)
{
    bool go;

    switch (loop->config.clock) {
    case RIG_CLOCK_REAL:
        go = wait_real(loop);
        break;
    case RIG_CLOCK_LOCKSTEP:
        go = wait_lockstep(loop);
        break;
    default:
        go = !stop_wanted(loop);
        if (go) {
            control_inline(loop);
        }
        break;
    }
    phase_end(loop, PHASE_WAIT);
    if (loop->config.clock == RIG_CLOCK_REAL) {
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
    struct can_port *port = loop->config.port[loop->config.lockstep.bus];
    size_t count;

    do {
        count = can_receive(port, loop->held + loop->held_count, HELD_MAX - loop->held_count);
        loop->held_count += count;
        while (loop->held_seen < loop->held_count &&
               loop->held[loop->held_seen].id != loop->config.lockstep.step_id) {
            loop->held_seen++;
        }
        deliver_held(loop);
    } while (count && loop->held_count < HELD_MAX);
}

static void receive(struct loop *loop)
{
    bool lockstep = loop->config.clock == RIG_CLOCK_LOCKSTEP;
    bool due = !lockstep || loop->step_begins || loop->config.machine.advance;

    for (size_t b = 0; b < loop->config.nbus && due; b++) {
        if (!lockstep || b != (size_t)loop->config.lockstep.bus) {
            drain(loop, b);
        } else if (loop->step_begins) {
            deliver_held(loop);
        } else {
            drain_held(loop);
        }
    }
    phase_end(loop, PHASE_RECEIVE);
}

static void count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx)
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
    if (loop->config.clock != RIG_CLOCK_LOCKSTEP) {
        return false;
    }
    count_lost(loop, &rx, &tx);
    flags |= rx + tx > loop->lost_at_done ? LOCKSTEP_OVERRUN : 0;
    flags |= machine->fault(machine->context) ? LOCKSTEP_FAULT : 0;
    loop->lost_at_done = rx + tx;
    return lockstep_advance(&loop->lockstep, flags);
}

static void transmit(struct loop *loop)
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

        if (done_due) {
            loop->outgoing[count++] = done;
        }
        send(loop, b, count, loop->stats.time_ns);
    }
    phase_end(loop, PHASE_TRANSMIT);
}

static void watch_buses(struct loop *loop)
{
    uint64_t rx, tx;

    for (size_t b = 0; b < loop->config.nbus; b++) {
        enum can_port_state state = loop->config.port[b]->state;

        if (state != loop->state[b]) {
            emit(loop, LOOP_EVENT_BUS_STATE, (int)b, loop->state[b], state);
            loop->state[b] = state;
        }
    }
    count_lost(loop, &rx, &tx);
    if (rx != loop->rx_lost || tx != loop->tx_lost) {
        emit(loop, LOOP_EVENT_FRAMES_LOST, -1, (int64_t)(rx - loop->rx_lost),
             (int64_t)(tx - loop->tx_lost));
        loop->rx_lost = rx;
        loop->tx_lost = tx;
    }
}

static void publish(struct loop *loop)
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
    receive(loop);
    machine->control(machine->context);
    phase_end(loop, PHASE_BOARDS);
    sane = machine->plant(machine->context);
    phase_end(loop, PHASE_PLANT);
    sane = machine->sample(machine->context) && sane;
    phase_end(loop, PHASE_SENSORS);
    transmit(loop);
    publish(loop);
    if (loop->config.clock == RIG_CLOCK_REAL) {
        account_real(loop, loop->mark_ns);
    }
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

    loop->stats.start_ns = clock_now(loop->config.time);
    loop->mark_ns = loop->stats.start_ns;
    loop->deadline_ns = loop->stats.start_ns;
    loop->last_end_ns = loop->stats.start_ns;
    while (loop->end == LOOP_RUNNING) {
        run_tick(loop);
    }
    loop->stats.page_faults = page_faults() - faults;
    loop->config.machine.shut_down(loop->config.machine.context);
    if (loop->config.clock == RIG_CLOCK_LOCKSTEP) {
        send_done(loop, LOCKSTEP_STOPPING);
    }
    loop->stats.lockstep = loop->lockstep.counters;
    loop->stats.end_ns = clock_now(loop->config.time);
    return loop->end;
}
