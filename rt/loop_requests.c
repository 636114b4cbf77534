/* SPDX-License-Identifier: Apache-2.0 */
/* Carries out requests to a running loop between two ticks (rt/requests.h). */
#include "rt/loop_private.h"

#include <errno.h>
#include <math.h>
#include <unistd.h>

/* Range of the speed, virtual seconds per second. */
#define SPEED_MIN 0.001
#define SPEED_MAX 1000.0

enum {
    PUSH_GROWS = 10
    /* a push is reported again when its force grows by more than this factor */
};

bool loop_requests_create(struct loop *loop, struct arena *arena)
{
    struct loop_requests *requests = &loop->requests;

    requests->speed = loop->config.clock == LOOP_CLOCK_REAL ? 1.0 : 0.0;
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP) {
        return true;
    }
    for (size_t i = 0; i < CHECKPOINT_SLOTS; i++) {
        struct loop_moment *moment = &requests->moment[i];

        moment->held = arena_alloc(arena, HELD_MAX, sizeof *moment->held);
        if (!moment->held) {
            return false;
        }
    }
    return true;
}

/* ---- the rings ---- */

/* Removes the next request from the ring. Returns false if there is none, or if the ring of answers
 * has no room. */
static bool request_take(struct loop *loop, struct loop_request *request)
{
    struct requests *requests = loop->config.requests;

    if (!loop_request_waits(loop) || !ring_pop(&requests->requests, request)) {
        return false;
    }
    requests->open++;
    return true;
}

/* Answers a taken request with the present tick and time. The ring has room for the answer, because
 * request_take checked it. */
static void request_reply(struct loop *loop, uint64_t ticket, enum request_verdict verdict)
{
    struct requests *requests = loop->config.requests;
    const struct request_machine *machine = &requests->machine;
    struct request_answer answer = {
        .ticket = ticket,
        .verdict = verdict,
        .tick = loop->stats.ticks,
        .time_ns = loop->stats.time_ns,
        .state_hash = machine->hash ? machine->hash(machine->context) : 0,
        .ended = {loop->requests.ended[0], loop->requests.ended[1]},
    };

    loop->requests.ended[0] = loop->requests.ended[1] = 0.0;
    requests->open--;
    ring_push(&requests->answers, &answer);
}

void requests_publish_values(struct requests *requests, bool all)
{
    const struct request_machine *machine = &requests->machine;
    uint64_t changes = machine->changes ? machine->changes(machine->context) : 0;

    if (!all && machine->changes && changes == requests->changes) {
        return;
    }
    requests->changes = changes;
    for (size_t i = 0; i < machine->ntunable; i++) {
        atomic_store_explicit(&requests->value[i], machine->get(machine->context, i),
                              memory_order_relaxed);
    }
}

/* ---- checkpoints ---- */

/* Saves machine and loop into a checkpoint slot. On failure the slot is empty. */
static enum request_verdict loop_save_slot(struct loop *loop, size_t slot)
{
    const struct request_machine *machine = &loop->config.requests->machine;
    struct loop_moment *moment = &loop->requests.moment[slot];
    enum request_verdict verdict = REQUEST_UNAVAILABLE;

    if (machine->save && machine->restore) {
        verdict = machine->save(machine->context, slot);
    }
    if (verdict == REQUEST_OK) {
        /* Copy the loop's own state (tick, lockstep, held frames) into a checkpoint slot */
        uint64_t rx, tx;

        loop_count_lost(loop, &rx, &tx);
        moment->kept = true;
        moment->ticks = loop->stats.ticks;
        moment->lockstep = loop->lockstep;
        if (loop->step_asked) {
            moment->lockstep.ticks = 0; /* a restore does not repeat a REQUEST_STEP */
        }
        moment->lost_since_done = rx + tx - loop->lost_at_done;
        moment->held_count = loop->held_count;
        moment->held_seen = loop->held_seen;
        if (moment->held) {
            memcpy(moment->held, loop->held, loop->held_count * sizeof *loop->held);
        }
    } else {
        moment->kept = false;
    }
    return verdict;
}

/* Saves a checkpoint into a slot; slot 0 is the start and cannot be overwritten. */
static enum request_verdict request_checkpoint(struct loop *loop, size_t slot)
{
    enum request_verdict verdict;

    if (slot < 1 || slot >= CHECKPOINT_SLOTS) {
        return REQUEST_RANGE;
    }
    verdict = loop_save_slot(loop, slot);
    if (verdict == REQUEST_OK) {
        loop_emit_event(loop, LOOP_EVENT_CHECKPOINT, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    }
    return verdict;
}

/* Restores a slot. Refused while a recording runs, because time in a recording always increases. */
static enum request_verdict request_restore(struct loop *loop, size_t slot)
{
    const struct request_machine *machine = &loop->config.requests->machine;

    if (slot >= CHECKPOINT_SLOTS) {
        return REQUEST_RANGE;
    }
    if (!machine->save || !machine->restore) {
        return REQUEST_UNAVAILABLE;
    }
    if (loop->config.recorder) {
        return REQUEST_RECORDING;
    }

    const struct loop_moment *moment = &loop->requests.moment[slot];

    if (!moment->kept) {
        return slot == 0 ? REQUEST_UNAVAILABLE : REQUEST_EMPTY;
    }
    machine->restore(machine->context, slot);

    /* Restore the loop's own state, including time. Statistics and counters continue. */
    struct lockstep_counters counters = loop->lockstep.counters;

    loop->stats.ticks = moment->ticks;
    loop->stats.time_ns = (int64_t)moment->ticks * loop->config.tick_ns;
    loop->requests.push.until_ns = 0;
    loop->lockstep = moment->lockstep;
    loop->lockstep.counters = counters;
    loop_count_lost(loop, &loop->rx_lost, &loop->tx_lost);
    loop->lost_at_done = loop->rx_lost + loop->tx_lost - moment->lost_since_done;
    loop->held_count = moment->held_count;
    loop->held_seen = moment->held_seen;
    if (moment->held) {
        memcpy(loop->held, moment->held, moment->held_count * sizeof *loop->held);
    }

    loop_emit_event(loop, LOOP_EVENT_RESTORED, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    return REQUEST_OK;
}

/* ---- pause and speed ---- */

/* Restarts the grid of deadlines now. The time before (a pause, or another speed) counts no
 * overruns. */
static void loop_restart_grid(struct loop *loop)
{
    loop->mark_ns = clock_now(loop->config.time);
    loop->deadline_ns = loop->mark_ns;
    loop->last_end_ns = loop->mark_ns;
    loop->awaiting = false;
}

/* Publishes pause and speed to other threads and to the machine. */
static void loop_publish_pace(struct loop *loop)
{
    struct requests *requests = loop->config.requests;
    const struct request_machine *machine = &requests->machine;

    atomic_store_explicit(&requests->paused, loop->requests.paused, memory_order_relaxed);
    atomic_store_explicit(&requests->speed, loop->requests.speed, memory_order_relaxed);
    if (machine->pace) {
        machine->pace(machine->context, loop->requests.speed, loop->requests.paused);
    }
}

/* Pauses the loop and emits an event. */
static void loop_pause(struct loop *loop)
{
    loop->requests.paused = true;
    loop_publish_pace(loop);
    loop_emit_event(loop, LOOP_EVENT_PAUSED, -1, (int64_t)loop->stats.ticks, 0);
}

/* Pauses the loop and ends a running REQUEST_STEP. */
static enum request_verdict request_pause(struct loop *loop)
{
    /* End a running step here: send DONE if it is due, and answer the request */
    if (loop->requests.step_left > 0) {
        loop->requests.step_left = 0;
        if (loop->step_asked && loop->lockstep.ticks > 0) {
            loop->lockstep.ticks = 0;
            loop_send_done(loop, 0);
        }
        request_reply(loop, loop->requests.step_ticket, REQUEST_CUT);
    }
    if (!loop->requests.paused) {
        loop_pause(loop);
    }
    return REQUEST_OK;
}

/* Sets the speed (0 = as fast as possible) and restarts the grid of deadlines. */
static enum request_verdict request_speed(struct loop *loop, double speed)
{
    const struct request_machine *machine = &loop->config.requests->machine;

    if (loop->config.clock == LOOP_CLOCK_LOCKSTEP || (speed == 0.0 && machine->pace)) {
        return REQUEST_CLOCK;
    }
    if (!(speed == 0.0 || (speed >= SPEED_MIN && speed <= SPEED_MAX))) {
        return REQUEST_RANGE;
    }
    /* The period of the grid is the tick divided by the speed, at least 1 ns */
    loop->requests.speed = speed;
    loop->period_ns =
        speed > 0.0 ? (int64_t)fmax(1.0, round((double)loop->config.tick_ns / speed)) : 0;
    loop_restart_grid(loop);
    loop_publish_pace(loop);
    loop_emit_event(loop, LOOP_EVENT_SPEED, -1, (int64_t)(speed * 1e6), 0);
    return REQUEST_OK;
}

/* ---- the machine: faults, pushes, tunables ---- */

/* Returns the length of a vector in thousandths of its unit. */
static int64_t vector_length_milli(const double v[3])
{
    return (int64_t)(1e3 * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
}

/* Emits the event of a push. For a push that renews the last one, emits an event only at a large
 * rise of the force and at the end. */
static void loop_tell_push(struct loop *loop, const struct loop_request *request)
{
    struct loop_push *push = &loop->requests.push;
    int64_t now_ns = loop->stats.time_ns, force_mn = vector_length_milli(request->force_n);
    bool goes_on = push->until_ns > now_ns && push->body == request->index;
    bool ends = force_mn == 0 && vector_length_milli(request->moment_nm) == 0;

    /* Find out whether this push renews the last one and whether it ends; update the greatest
     * force */
    if (!goes_on) {
        *push = (struct loop_push){.body = request->index};
    }
    push->most_mn = force_mn > push->most_mn ? force_mn : push->most_mn;
    push->until_ns = ends                       ? 0
                     : request->duration_ns > 0 ? now_ns + request->duration_ns
                                                : INT64_MAX;
    /* One event at the beginning, at each large rise, and at the end */
    if (goes_on && ends) {
        loop_emit_event(loop, LOOP_EVENT_LET_GO, -1, (int64_t)push->body, push->most_mn);
    } else if (!goes_on || force_mn > PUSH_GROWS * push->told_mn) {
        push->told_mn = force_mn;
        loop_emit_event(loop, LOOP_EVENT_PUSH, -1, (int64_t)push->body, force_mn);
    }
}

/* Sets a tunable within its range. The event carries the bits of the double. */
static enum request_verdict request_set(struct loop *loop, const struct loop_request *request)
{
    const struct request_machine *machine = &loop->config.requests->machine;
    const struct tunable *tunable = requests_tunable(loop->config.requests, request->index);
    enum request_verdict verdict;
    int64_t bits;

    if (!tunable || !(request->value >= tunable->min && request->value <= tunable->max) ||
        (tunable->whole && request->value != rint(request->value))) {
        return REQUEST_RANGE;
    }
    verdict = machine->set(machine->context, request->index, request->value);
    if (verdict == REQUEST_OK) {
        memcpy(&bits, &request->value, sizeof bits);
        loop_emit_event(loop, LOOP_EVENT_SET, -1, (int64_t)request->index, bits);
    }
    return verdict;
}

/* ---- requests ---- */

/* Carries out one request and returns its verdict. */
static enum request_verdict request_dispatch(struct loop *loop, const struct loop_request *request)
{
    const struct request_machine *machine = &loop->config.requests->machine;
    const enum request_kind kind = request->kind;
    enum request_verdict verdict;

    /* While a REQUEST_STEP runs, these requests are refused */
    if (loop->requests.step_left > 0 && (kind == REQUEST_RESUME || kind == REQUEST_STEP ||
                                         kind == REQUEST_RESET || kind == REQUEST_RESTORE)) {
        return REQUEST_BUSY;
    }
    switch (kind) {
    case REQUEST_PAUSE:
        return request_pause(loop);
    case REQUEST_RESUME:
        if (loop->requests.paused) {
            loop->requests.paused = false;
            loop_publish_pace(loop);
            loop_emit_event(loop, LOOP_EVENT_RESUMED, -1, (int64_t)loop->stats.ticks, 0);
        }
        return REQUEST_OK;
    case REQUEST_STEP:
        /* loop_requests_tick_ended sends the answer after the last tick */
        if (request->count == 0) {
            return REQUEST_RANGE;
        }
        loop->requests.step_left = request->count;
        loop->requests.step_ticket = request->ticket;
        loop->requests.paused = false;
        loop_publish_pace(loop);
        return REQUEST_OK;
    case REQUEST_SPEED:
        return request_speed(loop, request->value);
    case REQUEST_RESET:
        return request_restore(loop, 0);
    case REQUEST_CHECKPOINT:
        return request_checkpoint(loop, request->index);
    case REQUEST_RESTORE:
        return request_restore(loop, request->index);
    case REQUEST_FAULT:
        return request->index < machine->nfault ? machine->fault(machine->context, request->index,
                                                                 request->on, loop->stats.time_ns)
                                                : REQUEST_RANGE;
    case REQUEST_PUSH:
        verdict = machine->push ? machine->push(machine->context, request, loop->stats.time_ns,
                                                loop->requests.ended)
                                : REQUEST_UNAVAILABLE;
        if (verdict == REQUEST_OK) {
            loop_tell_push(loop, request);
        }
        return verdict;
    case REQUEST_SET:
        return request_set(loop, request);
    }
    return REQUEST_UNAVAILABLE;
}

/* Carries out and answers all waiting requests, in their order. */
static void request_dispatch_all(struct loop *loop)
{
    const struct request_machine *machine = &loop->config.requests->machine;
    struct loop_request request;

    while (request_take(loop, &request)) {
        enum request_verdict verdict = request_dispatch(loop, &request);
        bool back = request.kind == REQUEST_RESTORE || request.kind == REQUEST_RESET;
        bool went_back = back && verdict == REQUEST_OK;

        if (went_back) {
            loop_restart_grid(loop);
        }

        /* Publish the new state before the answer */
        requests_publish_values(loop->config.requests, went_back);
        if (machine->publish) {
            machine->publish(machine->context, loop->stats.time_ns, &loop->stats);
        }

        /* A started step is answered when it ends */
        if (request.kind != REQUEST_STEP || verdict != REQUEST_OK) {
            request_reply(loop, request.ticket, verdict);
        }
    }
}

/* ---- the loop's calls ---- */

void loop_requests_begin(struct loop *loop)
{
    loop_save_slot(loop, 0);
    loop_publish_pace(loop);
}

bool loop_requests_carry_out(struct loop *loop)
{
    bool was_paused = false;

    request_dispatch_all(loop);
    while (loop->requests.paused) {
        if (loop_stop_requested(loop)) {
            return false;
        }
        was_paused = true;
        loop_requests_sleep(loop, 0, clock_now(loop->config.time) + WAIT_SLICE_NS);
        request_dispatch_all(loop);
    }
    if (was_paused) {
        loop_restart_grid(loop);
    }
    return true;
}

void loop_requests_sleep(struct loop *loop, size_t count, int64_t until_ns)
{
    struct requests *requests = loop->config.requests;
    struct pollfd *wake = &loop->poll[count];
    uint32_t before;
    uint64_t events;
    ssize_t got;

    loop_idle(loop);
    atomic_exchange_explicit(&requests->sleep, SLEEPING, memory_order_acq_rel);
    *wake = (struct pollfd){.fd = requests->wake, .events = POLLIN};
    if (!loop_request_waits(loop)) {
        clock_wait_readable(loop->config.time, loop->poll, count + 1, until_ns);
    }

    /* Clear the eventfd, so that the next sleep does not end at once */
    before = atomic_exchange_explicit(&requests->sleep, 0, memory_order_acq_rel);
    if ((before & REQUESTED) || (wake->revents & POLLIN)) {
        do {
            got = read(requests->wake, &events, sizeof events);
        } while (got < 0 && errno == EINTR);
    }
}

void loop_requests_tick_begins(struct loop *loop)
{
    const struct request_machine *machine = &loop->config.requests->machine;

    if (machine->advance) {
        machine->advance(machine->context, loop->stats.time_ns);
    }
}

void loop_requests_tick_ended(struct loop *loop)
{
    requests_publish_values(loop->config.requests, false);
    if (loop->requests.step_left > 0 && --loop->requests.step_left == 0) {
        loop_pause(loop);
        request_reply(loop, loop->requests.step_ticket, REQUEST_OK);
    }
}

void loop_requests_end(struct loop *loop)
{
    struct loop_request request;

    if (loop->requests.step_left > 0) {
        loop->requests.step_left = 0;
        request_reply(loop, loop->requests.step_ticket, REQUEST_CUT);
    }
    atomic_store_explicit(&loop->config.requests->closed, true, memory_order_release);
    while (request_take(loop, &request)) {
        request_reply(loop, request.ticket, REQUEST_UNAVAILABLE);
    }
}
