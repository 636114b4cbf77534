/* SPDX-License-Identifier: Apache-2.0 */
/* The rings of requests and answers, the state that other threads may read, and the sleep that a
 * request interrupts. */
#include "rt/steering_private.h"

#include "base/ring.h"

#include <errno.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

enum { REQUESTS = 64 };

/* Bits of `sleep`. Both sides change it by read-modify-write, which are in one order: either the
 * loop sees the request before it sleeps, or the client sees the loop asleep and wakes it. */
enum { SLEEPING = 1, REQUESTED = 2 };

struct steering {
    struct steering_machine machine;
    struct ring requests, answers; /* struct steer_request, struct steer_answer */
    size_t open;                   /* requests taken and not answered */
    int wake;                      /* eventfd */
    _Atomic uint32_t sleep;
    atomic_bool closed, paused;
    _Atomic uint64_t speed;  /* bits of a double, as below */
    _Atomic uint64_t *value; /* of each tunable */
    uint64_t changes;        /* of the machine, when the values were published last */
};

static uint64_t double_to_bits(double value)
{
    uint64_t bits;

    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static double double_from_bits(uint64_t bits)
{
    double value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

enum error_code steering_create(const struct steering_machine *machine, struct arena *arena,
                                struct steering **out, struct error *error)
{
    struct steering *made = arena_alloc(arena, 1, sizeof *made);
    void *requests = arena_alloc(arena, REQUESTS, sizeof(struct steer_request));
    void *answers = arena_alloc(arena, REQUESTS, sizeof(struct steer_answer));

    if (!made || !requests || !answers ||
        !(made->value = arena_alloc(arena, machine->ntunable + 1, sizeof *made->value))) {
        return error_set(error, ERROR_MEMORY, "no memory left for the steering");
    }
    made->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (made->wake < 0) {
        return error_set_errno(error, errno, "cannot create an event descriptor");
    }
    made->machine = *machine;
    ring_init(&made->requests, requests, sizeof(struct steer_request), REQUESTS);
    ring_init(&made->answers, answers, sizeof(struct steer_answer), REQUESTS);
    steering_publish_values(made, true);
    *out = made;
    return ERROR_NONE;
}

void steering_destroy(struct steering *steering)
{
    if (steering) {
        close(steering->wake);
    }
}

const struct steering_machine *steering_machine(const struct steering *steering)
{
    return &steering->machine;
}

/* ---- the client's side ---- */

bool steering_ask(struct steering *steering, const struct steer_request *request)
{
    const uint64_t one = 1;
    uint32_t before;

    if (atomic_load_explicit(&steering->closed, memory_order_acquire) ||
        !ring_push(&steering->requests, request)) {
        return false;
    }
    before = atomic_fetch_or_explicit(&steering->sleep, REQUESTED, memory_order_acq_rel);
    if ((before & SLEEPING) && !(before & REQUESTED)) {
        ssize_t written;

        do {
            written = write(steering->wake, &one, sizeof one);
        } while (written < 0 && errno == EINTR);
    }
    return true;
}

bool steering_answer(struct steering *steering, struct steer_answer *answer)
{
    return ring_pop(&steering->answers, answer);
}

const char *steer_verdict_text(enum steer_verdict verdict)
{
    switch (verdict) {
    case STEER_OK:
        return "done";
    case STEER_RANGE:
        return "an index, a count or a value is out of range";
    case STEER_EMPTY:
        return "there is no checkpoint in this slot";
    case STEER_RECORDING:
        return "time cannot go back while a recording runs";
    case STEER_CLOCK:
        return "this clock cannot do it";
    case STEER_BUSY:
        return "a step is under way";
    case STEER_UNAVAILABLE:
        return "this run cannot do it";
    case STEER_CUT:
        return "a pause ended the step before its last tick";
    }
    return "unknown verdict";
}

size_t steering_tunables(const struct steering *steering)
{
    return steering->machine.ntunable;
}

const struct tunable *steering_tunable(const struct steering *steering, size_t index)
{
    return index < steering->machine.ntunable ? &steering->machine.tunable[index] : NULL;
}

int steering_find(const struct steering *steering, const char *name)
{
    for (size_t i = 0; i < steering->machine.ntunable; i++) {
        if (strcmp(steering->machine.tunable[i].name, name) == 0) {
            return (int)i;
        }
    }
    return -1;
}

double steering_value(const struct steering *steering, size_t index)
{
    return index < steering->machine.ntunable ? double_from_bits(atomic_load_explicit(
                                                    &steering->value[index], memory_order_relaxed))
                                              : 0.0;
}

bool steering_paused(const struct steering *steering)
{
    return atomic_load_explicit(&steering->paused, memory_order_relaxed);
}

double steering_speed(const struct steering *steering)
{
    return double_from_bits(atomic_load_explicit(&steering->speed, memory_order_relaxed));
}

/* ---- the loop's side ---- */

bool steering_waits(const struct steering *steering)
{
    return ring_count(&steering->requests) > 0 &&
           ring_count(&steering->answers) + steering->open < REQUESTS;
}

bool steering_next(struct steering *steering, struct steer_request *request)
{
    if (!steering_waits(steering) || !ring_pop(&steering->requests, request)) {
        return false;
    }
    steering->open++;
    return true;
}

void steering_reply(struct steering *steering, uint64_t ticket, enum steer_verdict verdict,
                    uint64_t tick, int64_t now_ns)
{
    const struct steering_machine *machine = &steering->machine;
    struct steer_answer answer = {
        .ticket = ticket,
        .verdict = verdict,
        .tick = tick,
        .time_ns = now_ns,
        .state_hash = machine->hash ? machine->hash(machine->context) : 0,
    };

    steering->open--;
    ring_push(&steering->answers, &answer); /* steering_next has made sure of the room */
}

void steering_publish(struct steering *steering, bool paused, double speed)
{
    atomic_store_explicit(&steering->paused, paused, memory_order_relaxed);
    atomic_store_explicit(&steering->speed, double_to_bits(speed), memory_order_relaxed);
}

void steering_publish_values(struct steering *steering, bool all)
{
    const struct steering_machine *machine = &steering->machine;
    uint64_t changes = machine->changes ? machine->changes(machine->context) : 0;

    if (!all && machine->changes && changes == steering->changes) {
        return;
    }
    steering->changes = changes;
    for (size_t i = 0; i < machine->ntunable; i++) {
        atomic_store_explicit(&steering->value[i],
                              double_to_bits(machine->get(machine->context, i)),
                              memory_order_relaxed);
    }
}

void steering_close(struct steering *steering, uint64_t tick, int64_t now_ns)
{
    struct steer_request request;

    atomic_store_explicit(&steering->closed, true, memory_order_release);
    while (steering_next(steering, &request)) {
        steering_reply(steering, request.ticket, STEER_UNAVAILABLE, tick, now_ns);
    }
}

int steering_sleep_begin(struct steering *steering)
{
    atomic_exchange_explicit(&steering->sleep, SLEEPING, memory_order_acq_rel);
    return steering_waits(steering) ? -1 : steering->wake;
}

void steering_sleep_end(struct steering *steering, bool readable)
{
    uint32_t before = atomic_exchange_explicit(&steering->sleep, 0, memory_order_acq_rel);
    uint64_t count;
    ssize_t got;

    if (!(before & REQUESTED) && !readable) {
        return;
    }
    do {
        got = read(steering->wake, &count, sizeof count);
    } while (got < 0 && errno == EINTR);
}
