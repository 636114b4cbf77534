/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a machine has to offer so that the loop can carry out the requests of rt/requests.h on it:
 * the seam between the loop and whatever it drives. The functions are called in the loop's thread,
 * between two ticks, and have to be RT-safe. Virtual times in ns.
 */
#ifndef RT_REQUEST_MACHINE_H
#define RT_REQUEST_MACHINE_H

#include "rt/requests.h"

struct loop_stats;

/* A function that is NULL cannot be requested, unless its comment says otherwise. */
struct request_machine {
    void *context;
    enum request_verdict (*fault)(void *context, size_t index, bool on, int64_t now_ns);
    enum request_verdict (*push)(void *context, const struct loop_request *request, int64_t now_ns);
    enum request_verdict (*set)(void *context, size_t index, double value);
    double (*get)(void *context, size_t index);
    /* Copies all state that changes in virtual time to a checkpoint slot, and back from one that
     * was saved; NULL: time cannot go back. save says REQUEST_UNAVAILABLE when the slot is too
     * small. */
    enum request_verdict (*save)(void *context, size_t slot);
    void (*restore)(void *context, size_t slot);
    uint64_t (*hash)(void *context);
    /* The speed has changed or the loop is paused; NULL = not needed. A machine that has it cannot
     * run at speed 0 (as fast as possible): REQUEST_CLOCK. */
    void (*pace)(void *context, double speed, bool paused);
    /* Once a tick, when its wait is over: what requests have set in motion moves on by a tick. NULL
     * = nothing does. */
    void (*advance)(void *context, int64_t now_ns);
    /* A request was carried out: publishes the machine's state anew. NULL = not needed. */
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    /* A count that changes whenever some tunable may have another value; NULL = they are read every
     * tick. */
    uint64_t (*changes)(void *context);
    const char *(*body)(void *context, size_t index); /* name of a body, for the log */
    size_t nfault;
    size_t ntunable;
    const struct tunable *tunable; /* borrowed */
};

/* Creates the requests of a machine, which is copied. Memory from arena. ERROR_MEMORY,
 * ERROR_SYSTEM. Not RT-safe. */
enum error_code requests_create(const struct request_machine *machine, struct arena *arena,
                                struct requests **requests, struct error *error);

/* Closes its descriptor; the arena is the caller's. NULL is allowed. Not RT-safe. */
void requests_destroy(struct requests *requests);

#endif
