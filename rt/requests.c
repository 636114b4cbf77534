/* SPDX-License-Identifier: Apache-2.0 */
/* Holds the rings of requests and answers, the state that other threads may read, and the sleep
 * that a request interrupts. */
#include "rt/loop_private.h"

#include "base/ring.h"

#include <errno.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Capacity of the ring of requests and of the ring of answers. */
enum { REQUESTS = 64 };

/* Bits of `sleep`. Both sides change it with atomic read-modify-write operations, so all changes
 * have one order. Either the loop sees the request before it sleeps, or the client sees that the
 * loop sleeps and wakes it. */
enum { SLEEPING = 1, REQUESTED = 2 };

struct requests {
    struct request_machine machine;
    struct ring requests, answers; /* struct loop_request, struct request_answer */
    size_t open;                   /* number of requests taken and not yet answered */
    int wake;                      /* eventfd that ends the loop's sleep */
    _Atomic uint32_t sleep;
    atomic_bool closed, paused;
    _Atomic uint64_t speed;  /* bits of a double */
    _Atomic uint64_t *value; /* one per tunable, bits of a double */
    uint64_t changes;        /* the machine's counter of changes at the last publication */
};

/* Returns the bits of a double, for atomics that hold one. */
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

enum error_code requests_create(const struct request_machine *machine, struct arena *arena,
                                struct requests **out, struct error *error)
{
    struct requests *made = arena_alloc(arena, 1, sizeof *made);
    void *requests = arena_alloc(arena, REQUESTS, sizeof(struct loop_request));
    void *answers = arena_alloc(arena, REQUESTS, sizeof(struct request_answer));

    if (!made || !requests || !answers ||
        !(made->value = arena_alloc(arena, machine->ntunable + 1, sizeof *made->value))) {
        return error_set(error, ERROR_MEMORY, "no memory left for the requests");
    }
    made->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (made->wake < 0) {
        return error_set_errno(error, errno, "cannot create an event descriptor");
    }
    made->machine = *machine;
    ring_init(&made->requests, requests, sizeof(struct loop_request), REQUESTS);
    ring_init(&made->answers, answers, sizeof(struct request_answer), REQUESTS);
    requests_publish_values(made, true);
    *out = made;
    return ERROR_NONE;
}

void requests_destroy(struct requests *requests)
{
    if (requests) {
        close(requests->wake);
    }
}

const struct request_machine *requests_machine(const struct requests *requests)
{
    return &requests->machine;
}

/* ---- the client's side ---- */

bool requests_ask(struct requests *requests, const struct loop_request *request)
{
    const uint64_t one = 1;
    uint32_t before;

    if (atomic_load_explicit(&requests->closed, memory_order_acquire) ||
        !ring_push(&requests->requests, request)) {
        return false;
    }
    /* Wake the loop if it sleeps, unless an earlier request has done so */
    before = atomic_fetch_or_explicit(&requests->sleep, REQUESTED, memory_order_acq_rel);
    if ((before & SLEEPING) && !(before & REQUESTED)) {
        ssize_t written;

        do {
            written = write(requests->wake, &one, sizeof one);
        } while (written < 0 && errno == EINTR);
    }
    return true;
}

bool requests_answer(struct requests *requests, struct request_answer *answer)
{
    return ring_pop(&requests->answers, answer);
}

const char *request_verdict_text(enum request_verdict verdict)
{
    switch (verdict) {
    case REQUEST_OK:
        return "done";
    case REQUEST_RANGE:
        return "an index, a count or a value is out of range";
    case REQUEST_EMPTY:
        return "there is no checkpoint in this slot";
    case REQUEST_RECORDING:
        return "time cannot go back while a recording runs";
    case REQUEST_CLOCK:
        return "this clock cannot do it";
    case REQUEST_BUSY:
        return "a step is under way";
    case REQUEST_UNAVAILABLE:
        return "this run cannot do it";
    case REQUEST_CUT:
        return "a pause ended the step before its last tick";
    }
    return "unknown verdict";
}

size_t requests_tunables(const struct requests *requests)
{
    return requests->machine.ntunable;
}

const struct tunable *requests_tunable(const struct requests *requests, size_t index)
{
    return index < requests->machine.ntunable ? &requests->machine.tunable[index] : NULL;
}

int requests_find(const struct requests *requests, const char *name)
{
    for (size_t i = 0; i < requests->machine.ntunable; i++) {
        if (strcmp(requests->machine.tunable[i].name, name) == 0) {
            return (int)i;
        }
    }
    return -1;
}

double requests_value(const struct requests *requests, size_t index)
{
    return index < requests->machine.ntunable ? double_from_bits(atomic_load_explicit(
                                                    &requests->value[index], memory_order_relaxed))
                                              : 0.0;
}

bool requests_paused(const struct requests *requests)
{
    return atomic_load_explicit(&requests->paused, memory_order_relaxed);
}

double requests_speed(const struct requests *requests)
{
    return double_from_bits(atomic_load_explicit(&requests->speed, memory_order_relaxed));
}

/* ---- the loop's side ---- */

bool requests_waits(const struct requests *requests)
{
    return ring_count(&requests->requests) > 0 &&
           ring_count(&requests->answers) + requests->open < REQUESTS;
}

bool requests_next(struct requests *requests, struct loop_request *request)
{
    if (!requests_waits(requests) || !ring_pop(&requests->requests, request)) {
        return false;
    }
    requests->open++;
    return true;
}

void requests_reply(struct requests *requests, uint64_t ticket, enum request_verdict verdict,
                    uint64_t tick, int64_t now_ns)
{
    const struct request_machine *machine = &requests->machine;
    struct request_answer answer = {
        .ticket = ticket,
        .verdict = verdict,
        .tick = tick,
        .time_ns = now_ns,
        .state_hash = machine->hash ? machine->hash(machine->context) : 0,
    };

    requests->open--;
    /* Has room: requests_next takes no request unless the answer fits */
    ring_push(&requests->answers, &answer);
}

void requests_publish(struct requests *requests, bool paused, double speed)
{
    atomic_store_explicit(&requests->paused, paused, memory_order_relaxed);
    atomic_store_explicit(&requests->speed, double_to_bits(speed), memory_order_relaxed);
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
        atomic_store_explicit(&requests->value[i],
                              double_to_bits(machine->get(machine->context, i)),
                              memory_order_relaxed);
    }
}

void requests_close(struct requests *requests, uint64_t tick, int64_t now_ns)
{
    struct loop_request request;

    atomic_store_explicit(&requests->closed, true, memory_order_release);
    while (requests_next(requests, &request)) {
        requests_reply(requests, request.ticket, REQUEST_UNAVAILABLE, tick, now_ns);
    }
}

int requests_sleep_begin(struct requests *requests)
{
    atomic_exchange_explicit(&requests->sleep, SLEEPING, memory_order_acq_rel);
    return requests_waits(requests) ? -1 : requests->wake;
}

void requests_sleep_end(struct requests *requests, bool readable)
{
    uint32_t before = atomic_exchange_explicit(&requests->sleep, 0, memory_order_acq_rel);
    uint64_t count;
    ssize_t got;

    if (!(before & REQUESTED) && !readable) {
        return;
    }
    do {
        got = read(requests->wake, &count, sizeof count);
    } while (got < 0 && errno == EINTR);
}
