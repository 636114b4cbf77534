/* SPDX-License-Identifier: Apache-2.0 */
/* Carrying out, between two ticks, the requests to a running loop (rt/steering.h). */
#include "rt/loop_private.h"

#include <math.h>
#include <string.h>

#define SPEED_MIN 0.001
#define SPEED_MAX 1000.0

enum { PUSH_GROWS = 10 }; /* by more than this factor: worth an event of its own */

bool loop_steering_create(struct loop *loop, struct arena *arena)
{
    struct loop_steering *steering = &loop->steering;

    steering->speed = loop->config.clock == LOOP_CLOCK_REAL ? 1.0 : 0.0;
    if (loop->config.clock != LOOP_CLOCK_LOCKSTEP) {
        return true;
    }
    for (size_t i = 0; i < STEERING_SLOTS; i++) {
        struct loop_moment *moment = &steering->moment[i];

        moment->held = arena_alloc(arena, HELD_MAX, sizeof *moment->held);
        if (!moment->held) {
            return false;
        }
    }
    return true;
}

static const struct steering_machine *loop_steering_machine(const struct loop *loop)
{
    return steering_machine(loop->config.steering);
}

/* ---- checkpoints ---- */

static void loop_save_moment(struct loop *loop, struct loop_moment *moment)
{
    uint64_t rx, tx;

    loop_count_lost(loop, &rx, &tx);
    moment->kept = true;
    moment->ticks = loop->stats.ticks;
    moment->lockstep = loop->lockstep;
    if (loop->step_asked) {
        moment->lockstep.ticks = 0; /* a STEER_STEP runs once */
    }
    moment->lost_since_done = rx + tx - loop->lost_at_done;
    moment->held_count = loop->held_count;
    moment->held_seen = loop->held_seen;
    if (moment->held) {
        memcpy(moment->held, loop->held, loop->held_count * sizeof *loop->held);
    }
}

/* Accounts go on: only time goes back. */
static void loop_restore_moment(struct loop *loop, const struct loop_moment *moment)
{
    struct lockstep_counters counters = loop->lockstep.counters;

    loop->stats.ticks = moment->ticks;
    loop->stats.time_ns = (int64_t)moment->ticks * loop->config.tick_ns;
    loop->steering.push.until_ns = 0;
    loop->lockstep = moment->lockstep;
    loop->lockstep.counters = counters;
    loop_count_lost(loop, &loop->rx_lost, &loop->tx_lost);
    loop->lost_at_done = loop->rx_lost + loop->tx_lost - moment->lost_since_done;
    loop->held_count = moment->held_count;
    loop->held_seen = moment->held_seen;
    if (moment->held) {
        memcpy(loop->held, moment->held, moment->held_count * sizeof *loop->held);
    }
}

static enum steer_verdict loop_save_slot(struct loop *loop, size_t slot)
{
    const struct steering_machine *machine = loop_steering_machine(loop);
    enum steer_verdict verdict = STEER_UNAVAILABLE;

    if (machine->save && machine->restore) {
        verdict = machine->save(machine->context, slot);
    }
    if (verdict == STEER_OK) {
        loop_save_moment(loop, &loop->steering.moment[slot]);
    } else {
        loop->steering.moment[slot].kept = false;
    }
    return verdict;
}

static enum steer_verdict request_checkpoint(struct loop *loop, size_t slot)
{
    enum steer_verdict verdict;

    if (slot < 1 || slot >= STEERING_SLOTS) {
        return STEER_RANGE;
    }
    verdict = loop_save_slot(loop, slot);
    if (verdict == STEER_OK) {
        loop_emit_event(loop, LOOP_EVENT_CHECKPOINT, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    }
    return verdict;
}

static enum steer_verdict request_restore(struct loop *loop, size_t slot)
{
    const struct steering_machine *machine = loop_steering_machine(loop);

    if (slot >= STEERING_SLOTS) {
        return STEER_RANGE;
    }
    if (!machine->save || !machine->restore) {
        return STEER_UNAVAILABLE;
    }
    if (loop->config.recorder) {
        return STEER_RECORDING;
    }
    if (!loop->steering.moment[slot].kept) {
        return slot == 0 ? STEER_UNAVAILABLE : STEER_EMPTY;
    }
    machine->restore(machine->context, slot);
    loop_restore_moment(loop, &loop->steering.moment[slot]);
    loop_emit_event(loop, LOOP_EVENT_RESTORED, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    return STEER_OK;
}

/* ---- pause and speed ---- */

/* The grid begins now: time before it, an intended pause or another speed, is not accounted. */
static void loop_restart_grid(struct loop *loop)
{
    loop->mark_ns = clock_now(loop->config.time);
    loop->deadline_ns = loop->mark_ns;
    loop->last_end_ns = loop->mark_ns;
    loop->awaiting = false;
}

/* Publishes pause and speed, to other threads and to the machine. */
static void loop_publish_pace(struct loop *loop)
{
    const struct steering_machine *machine = loop_steering_machine(loop);
    bool paused = loop->steering.paused;

    steering_publish(loop->config.steering, paused, loop->steering.speed);
    if (machine->pace) {
        machine->pace(machine->context, loop->steering.speed, paused);
    }
}

static void request_reply(struct loop *loop, uint64_t ticket, enum steer_verdict verdict)
{
    steering_reply(loop->config.steering, ticket, verdict, loop->stats.ticks, loop->stats.time_ns);
}

static void loop_pause(struct loop *loop)
{
    loop->steering.paused = true;
    loop_publish_pace(loop);
    loop_emit_event(loop, LOOP_EVENT_PAUSED, -1, (int64_t)loop->stats.ticks, 0);
}

static enum steer_verdict request_pause(struct loop *loop)
{
    /* A step under way ends here, with its DONE where one is due */
    if (loop->steering.step_left > 0) {
        loop->steering.step_left = 0;
        if (loop->step_asked && loop->lockstep.ticks > 0) {
            loop->lockstep.ticks = 0;
            loop_send_done(loop, 0);
        }
        request_reply(loop, loop->steering.step_ticket, STEER_CUT);
    }
    if (!loop->steering.paused) {
        loop_pause(loop);
    }
    return STEER_OK;
}

static enum steer_verdict request_resume(struct loop *loop)
{
    if (loop->steering.paused) {
        loop->steering.paused = false;
        loop_publish_pace(loop);
        loop_emit_event(loop, LOOP_EVENT_RESUMED, -1, (int64_t)loop->stats.ticks, 0);
    }
    return STEER_OK;
}

/* Answered by loop_steering_tick_ended. */
static enum steer_verdict request_step(struct loop *loop, const struct steer_request *request)
{
    if (request->count == 0) {
        return STEER_RANGE;
    }
    loop->steering.step_left = request->count;
    loop->steering.step_ticket = request->ticket;
    loop->steering.paused = false;
    loop_publish_pace(loop);
    return STEER_OK;
}

static enum steer_verdict request_speed(struct loop *loop, double speed)
{
    const struct steering_machine *machine = loop_steering_machine(loop);

    if (loop->config.clock == LOOP_CLOCK_LOCKSTEP || (speed == 0.0 && machine->pace)) {
        return STEER_CLOCK;
    }
    if (!(speed == 0.0 || (speed >= SPEED_MIN && speed <= SPEED_MAX))) {
        return STEER_RANGE;
    }
    loop->steering.speed = speed;
    loop->period_ns =
        speed > 0.0 ? (int64_t)fmax(1.0, round((double)loop->config.tick_ns / speed)) : 0;
    loop_restart_grid(loop);
    loop_publish_pace(loop);
    loop_emit_event(loop, LOOP_EVENT_SPEED, -1, (int64_t)(speed * 1e6), 0);
    return STEER_OK;
}

/* ---- the machine: faults, pushes, tunables ---- */

static enum steer_verdict request_fault(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = loop_steering_machine(loop);

    return request->index < machine->nfault
               ? machine->fault(machine->context, request->index, request->on, loop->stats.time_ns)
               : STEER_RANGE;
}

static int64_t vector_length_milli(const double v[3])
{
    return (int64_t)(1e3 * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
}

/* Tells a push, where it renews the last one only when it has become much greater, or ends. */
static void loop_tell_push(struct loop *loop, const struct steer_request *request)
{
    struct loop_push *push = &loop->steering.push;
    int64_t now_ns = loop->stats.time_ns, force_mn = vector_length_milli(request->force_n);
    bool goes_on = push->until_ns > now_ns && push->body == request->index;
    bool ends = force_mn == 0 && vector_length_milli(request->moment_nm) == 0;

    if (!goes_on) {
        *push = (struct loop_push){.body = request->index};
    }
    push->most_mn = force_mn > push->most_mn ? force_mn : push->most_mn;
    push->until_ns = ends                       ? 0
                     : request->duration_ns > 0 ? now_ns + request->duration_ns
                                                : INT64_MAX;
    if (goes_on && ends) {
        loop_emit_event(loop, LOOP_EVENT_LET_GO, -1, (int64_t)push->body, push->most_mn);
    } else if (!goes_on || force_mn > PUSH_GROWS * push->told_mn) {
        push->told_mn = force_mn;
        loop_emit_event(loop, LOOP_EVENT_PUSH, -1, (int64_t)push->body, force_mn);
    }
}

static enum steer_verdict request_push(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = loop_steering_machine(loop);
    enum steer_verdict verdict = machine->push
                                     ? machine->push(machine->context, request, loop->stats.time_ns)
                                     : STEER_UNAVAILABLE;

    if (verdict == STEER_OK) {
        loop_tell_push(loop, request);
    }
    return verdict;
}

static enum steer_verdict request_set(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = loop_steering_machine(loop);
    const struct tunable *tunable = steering_tunable(loop->config.steering, request->index);
    enum steer_verdict verdict;
    int64_t bits;

    if (!tunable || !(request->value >= tunable->min && request->value <= tunable->max) ||
        (tunable->whole && request->value != rint(request->value))) {
        return STEER_RANGE;
    }
    verdict = machine->set(machine->context, request->index, request->value);
    if (verdict == STEER_OK) {
        memcpy(&bits, &request->value, sizeof bits);
        loop_emit_event(loop, LOOP_EVENT_SET, -1, (int64_t)request->index, bits);
    }
    return verdict;
}

/* ---- requests ---- */

static bool request_conflicts_with_step(enum steer_kind kind)
{
    return kind == STEER_RESUME || kind == STEER_STEP || kind == STEER_RESET ||
           kind == STEER_RESTORE;
}

static enum steer_verdict request_dispatch(struct loop *loop, const struct steer_request *request)
{
    if (loop->steering.step_left > 0 && request_conflicts_with_step(request->kind)) {
        return STEER_BUSY;
    }
    switch (request->kind) {
    case STEER_PAUSE:
        return request_pause(loop);
    case STEER_RESUME:
        return request_resume(loop);
    case STEER_STEP:
        return request_step(loop, request);
    case STEER_SPEED:
        return request_speed(loop, request->value);
    case STEER_RESET:
        return request_restore(loop, 0);
    case STEER_CHECKPOINT:
        return request_checkpoint(loop, request->index);
    case STEER_RESTORE:
        return request_restore(loop, request->index);
    case STEER_FAULT:
        return request_fault(loop, request);
    case STEER_PUSH:
        return request_push(loop, request);
    case STEER_SET:
        return request_set(loop, request);
    }
    return STEER_UNAVAILABLE;
}

static void request_dispatch_all(struct loop *loop)
{
    const struct steering_machine *machine = loop_steering_machine(loop);
    struct steer_request request;

    while (steering_next(loop->config.steering, &request)) {
        enum steer_verdict verdict = request_dispatch(loop, &request);
        bool back = request.kind == STEER_RESTORE || request.kind == STEER_RESET;
        bool went_back = back && verdict == STEER_OK;

        if (went_back) {
            loop_restart_grid(loop);
        }

        /* What others may see is up to date before they have the answer */
        steering_publish_values(loop->config.steering, went_back);
        if (machine->publish) {
            machine->publish(machine->context, loop->stats.time_ns, &loop->stats);
        }

        /* A step that has begun is answered at its end */
        if (request.kind != STEER_STEP || verdict != STEER_OK) {
            request_reply(loop, request.ticket, verdict);
        }
    }
}

/* ---- the loop's calls ---- */

void loop_steering_begin(struct loop *loop)
{
    loop_save_slot(loop, 0);
    loop_publish_pace(loop);
}

bool loop_steering_carry_out(struct loop *loop)
{
    bool was_paused = false;

    request_dispatch_all(loop);
    while (loop->steering.paused) {
        if (loop_stop_requested(loop)) {
            return false;
        }
        was_paused = true;
        loop->config.machine.idle(loop->config.machine.context);
        loop_steering_sleep(loop, NULL, clock_now(loop->config.time) + WAIT_SLICE_NS);
        request_dispatch_all(loop);
    }
    if (was_paused) {
        loop_restart_grid(loop);
    }
    return true;
}

void loop_steering_sleep(struct loop *loop, struct pollfd *fd, int64_t until_ns)
{
    struct steering *steering = loop->config.steering;
    struct pollfd fds[2] = {{.fd = -1, .events = POLLIN}, {.fd = -1}};

    fds[0].fd = steering_sleep_begin(steering);
    if (fd) {
        fds[1] = *fd;
    }
    if (fds[0].fd >= 0) {
        clock_wait_readable(loop->config.time, fds, fd ? 2 : 1, until_ns);
    }
    steering_sleep_end(steering, (fds[0].revents & POLLIN) != 0);
}

void loop_steering_tick_begins(struct loop *loop)
{
    const struct steering_machine *machine = loop_steering_machine(loop);

    if (machine->advance) {
        machine->advance(machine->context, loop->stats.time_ns);
    }
}

void loop_steering_tick_ended(struct loop *loop)
{
    steering_publish_values(loop->config.steering, false);
    if (loop->steering.step_left > 0 && --loop->steering.step_left == 0) {
        loop_pause(loop);
        request_reply(loop, loop->steering.step_ticket, STEER_OK);
    }
}

void loop_steering_end(struct loop *loop)
{
    if (loop->steering.step_left > 0) {
        loop->steering.step_left = 0;
        request_reply(loop, loop->steering.step_ticket, STEER_CUT);
    }
    steering_close(loop->config.steering, loop->stats.ticks, loop->stats.time_ns);
}
