/* SPDX-License-Identifier: Apache-2.0 */
/* The client's side of requests: creation, the rings, and the state that other threads may read. */
#include "rt/loop_private.h"

#include <errno.h>
#include <sys/eventfd.h>
#include <unistd.h>

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

const struct tunable *requests_tunable(const struct requests *requests, size_t index)
{
    return index < requests->machine.ntunable ? &requests->machine.tunable[index] : NULL;
}

double requests_value(const struct requests *requests, size_t index)
{
    return index < requests->machine.ntunable
               ? atomic_load_explicit(&requests->value[index], memory_order_relaxed)
               : 0.0;
}

bool requests_paused(const struct requests *requests)
{
    return atomic_load_explicit(&requests->paused, memory_order_relaxed);
}

double requests_speed(const struct requests *requests)
{
    return atomic_load_explicit(&requests->speed, memory_order_relaxed);
}
