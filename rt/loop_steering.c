/* SPDX-License-Identifier: Apache-2.0 */
/* Carrying out, between two ticks, what is asked of a running loop (rt/steering.h). */
#include "rt/loop_private.h"

#include <math.h>
#include <string.h>

#define SPEED_MIN 0.001
#define SPEED_MAX 1000.0

bool loop_steer_create(struct loop *loop, struct arena *arena)
{
    struct loop_steer *steer = &loop->steer;

    steer->speed = loop->config.clock == LOOP_CLOCK_REAL ? 1.0 : 0.0;
    for (size_t i = 0; i < STEERING_SLOTS && loop->config.clock == LOOP_CLOCK_LOCKSTEP; i++) {
        steer->moment[i].held = arena_alloc(arena, HELD_MAX, sizeof *steer->moment[i].held);
        if (!steer->moment[i].held) {
            return false;
        }
    }
    return true;
}

/* ---- checkpoints ---- */

static void keep_moment(struct loop *loop, struct loop_moment *moment)
{
    uint64_t rx, tx;

    loop_count_lost(loop, &rx, &tx);
    moment->kept = true;
    moment->ticks = loop->stats.ticks;
    moment->lockstep = loop->lockstep;
    if (loop->step_asked) {
        moment->lockstep.ticks = 0; /* a step is asked for once */
    }
    moment->lost_since_done = rx + tx - loop->lost_at_done;
    moment->held_count = loop->held_count;
    moment->held_seen = loop->held_seen;
    if (moment->held) {
        memcpy(moment->held, loop->held, loop->held_count * sizeof *loop->held);
    }
}

/* The accounts of what has been done stay: only time goes back. */
static void restore_moment(struct loop *loop, const struct loop_moment *moment)
{
    struct lockstep_counters counters = loop->lockstep.counters;

    loop->stats.ticks = moment->ticks;
    loop->stats.time_ns = (int64_t)moment->ticks * loop->config.tick_ns;
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

static enum steer_verdict keep(struct loop *loop, size_t slot)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);
    enum steer_verdict verdict = STEER_UNAVAILABLE;

    if (machine->keep && machine->back) {
        verdict = machine->keep(machine->context, slot);
    }
    if (verdict == STEER_OK) {
        keep_moment(loop, &loop->steer.moment[slot]);
    } else {
        loop->steer.moment[slot].kept = false;
    }
    return verdict;
}

static enum steer_verdict go_back(struct loop *loop, size_t slot)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);

    if (slot >= STEERING_SLOTS) {
        return STEER_RANGE;
    }
    if (!machine->keep || !machine->back) {
        return STEER_UNAVAILABLE;
    }
    if (loop->config.recorder) {
        return STEER_RECORDING;
    }
    if (!loop->steer.moment[slot].kept) {
        return slot == 0 ? STEER_UNAVAILABLE : STEER_EMPTY;
    }
    machine->back(machine->context, slot);
    restore_moment(loop, &loop->steer.moment[slot]);
    loop_emit(loop, LOOP_EVENT_WENT_BACK, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    return STEER_OK;
}

static enum steer_verdict checkpoint(struct loop *loop, size_t slot)
{
    enum steer_verdict verdict;

    if (slot < 1 || slot >= STEERING_SLOTS) {
        return STEER_RANGE;
    }
    verdict = keep(loop, slot);
    if (verdict == STEER_OK) {
        loop_emit(loop, LOOP_EVENT_CHECKPOINT, -1, (int64_t)slot, (int64_t)loop->stats.ticks);
    }
    return verdict;
}

/* ---- standing still and pace ---- */

/* The grid begins at once: what came before, an intended stop or another pace, counts for nothing. */
static void begin_anew(struct loop *loop)
{
    loop->mark_ns = clock_now(loop->config.time);
    loop->deadline_ns = loop->mark_ns;
    loop->last_end_ns = loop->mark_ns;
    loop->awaiting = false;
}

static void show(struct loop *loop)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);
    bool paused = loop->steer.standing;

    steering_show(loop->config.steering, paused, loop->steer.speed);
    if (machine->pace) {
        machine->pace(machine->context, loop->steer.speed, paused);
    }
}

static void reply(struct loop *loop, uint64_t ticket, enum steer_verdict verdict)
{
    steering_reply(loop->config.steering, ticket, verdict, loop->stats.ticks, loop->stats.time_ns);
}

static void stand(struct loop *loop)
{
    loop->steer.standing = true;
    show(loop);
    loop_emit(loop, LOOP_EVENT_PAUSED, -1, (int64_t)loop->stats.ticks, 0);
}

static enum steer_verdict pause_run(struct loop *loop)
{
    if (loop->steer.step_left > 0) {
        loop->steer.step_left = 0;
        if (loop->step_asked && loop->lockstep.ticks > 0) {
            loop->lockstep.ticks = 0;
            loop_send_done(loop, 0);
        }
        reply(loop, loop->steer.step_ticket, STEER_CUT);
    }
    if (!loop->steer.standing) {
        stand(loop);
    }
    return STEER_OK;
}

static enum steer_verdict resume(struct loop *loop)
{
    if (loop->steer.standing) {
        loop->steer.standing = false;
        show(loop);
        loop_emit(loop, LOOP_EVENT_RESUMED, -1, (int64_t)loop->stats.ticks, 0);
    }
    return STEER_OK;
}

/* Answered by loop_steer_ticked. */
static enum steer_verdict step(struct loop *loop, const struct steer_request *request)
{
    if (request->count == 0) {
        return STEER_RANGE;
    }
    loop->steer.step_left = request->count;
    loop->steer.step_ticket = request->ticket;
    loop->steer.standing = false;
    show(loop);
    return STEER_OK;
}

static enum steer_verdict set_speed(struct loop *loop, double speed)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);

    if (loop->config.clock == LOOP_CLOCK_LOCKSTEP || (speed == 0.0 && machine->pace)) {
        return STEER_CLOCK;
    }
    if (!(speed == 0.0 || (speed >= SPEED_MIN && speed <= SPEED_MAX))) {
        return STEER_RANGE;
    }
    loop->steer.speed = speed;
    loop->period_ns =
        speed > 0.0 ? (int64_t)fmax(1.0, round((double)loop->config.tick_ns / speed)) : 0;
    begin_anew(loop);
    show(loop);
    loop_emit(loop, LOOP_EVENT_SPEED, -1, (int64_t)(speed * 1e6), 0);
    return STEER_OK;
}

/* ---- requests ---- */

static enum steer_verdict push(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);
    enum steer_verdict verdict = machine->push
                                     ? machine->push(machine->context, request, loop->stats.time_ns)
                                     : STEER_UNAVAILABLE;

    if (verdict == STEER_OK) {
        const double *f = request->force_n;

        loop_emit(loop, LOOP_EVENT_PUSH, -1, (int64_t)request->index,
                  (int64_t)(1e3 * sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])));
    }
    return verdict;
}

static enum steer_verdict set(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);
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
        loop_emit(loop, LOOP_EVENT_SET, -1, (int64_t)request->index, bits);
    }
    return verdict;
}

static bool has_to_wait_for_the_step(enum steer_kind kind)
{
    return kind == STEER_RESUME || kind == STEER_STEP || kind == STEER_RESET ||
           kind == STEER_RESTORE;
}

static enum steer_verdict carry_out(struct loop *loop, const struct steer_request *request)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);

    if (loop->steer.step_left > 0 && has_to_wait_for_the_step(request->kind)) {
        return STEER_BUSY;
    }
    switch (request->kind) {
    case STEER_PAUSE:
        return pause_run(loop);
    case STEER_RESUME:
        return resume(loop);
    case STEER_STEP:
        return step(loop, request);
    case STEER_SPEED:
        return set_speed(loop, request->value);
    case STEER_RESET:
        return go_back(loop, 0);
    case STEER_CHECKPOINT:
        return checkpoint(loop, request->index);
    case STEER_RESTORE:
        return go_back(loop, request->index);
    case STEER_FAULT:
        return request->index < machine->nfault ? machine->fault(machine->context, request->index,
                                                                 request->on, loop->stats.time_ns)
                                                : STEER_RANGE;
    case STEER_PUSH:
        return push(loop, request);
    case STEER_SET:
        return set(loop, request);
    }
    return STEER_UNAVAILABLE;
}

static void carry_out_all(struct loop *loop)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);
    struct steer_request request;

    while (steering_next(loop->config.steering, &request)) {
        enum steer_verdict verdict = carry_out(loop, &request);
        bool back = request.kind == STEER_RESTORE || request.kind == STEER_RESET;
        bool went_back = back && verdict == STEER_OK;

        if (went_back) {
            begin_anew(loop);
        }
        steering_show_values(loop->config.steering, went_back);
        if (machine->show) {
            machine->show(machine->context, &loop->stats);
        }
        if (request.kind != STEER_STEP || verdict != STEER_OK) {
            reply(loop, request.ticket, verdict);
        }
    }
}

/* ---- the loop's calls ---- */

void loop_steer_begin(struct loop *loop)
{
    keep(loop, 0);
    show(loop);
}

bool loop_steer(struct loop *loop)
{
    bool stood = false;

    carry_out_all(loop);
    while (loop->steer.standing) {
        if (loop_stop_wanted(loop)) {
            return false;
        }
        stood = true;
        loop_steer_sleep(loop, NULL, clock_now(loop->config.time) + WAIT_SLICE_NS);
        carry_out_all(loop);
    }
    if (stood) {
        begin_anew(loop);
    }
    return true;
}

void loop_steer_sleep(struct loop *loop, struct pollfd *fd, int64_t until_ns)
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

void loop_steer_ticks(struct loop *loop)
{
    const struct steering_machine *machine = steering_machine(loop->config.steering);

    if (machine->begin) {
        machine->begin(machine->context, loop->stats.time_ns);
    }
}

void loop_steer_ticked(struct loop *loop)
{
    steering_show_values(loop->config.steering, false);
    if (loop->steer.step_left > 0 && --loop->steer.step_left == 0) {
        stand(loop);
        reply(loop, loop->steer.step_ticket, STEER_OK);
    }
}

void loop_steer_end(struct loop *loop)
{
    if (loop->steer.step_left > 0) {
        loop->steer.step_left = 0;
        reply(loop, loop->steer.step_ticket, STEER_CUT);
    }
    steering_close(loop->config.steering, loop->stats.ticks, loop->stats.time_ns);
}
