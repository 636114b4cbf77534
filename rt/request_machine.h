/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The functions that a machine provides so that the loop can carry out the requests of
 * rt/requests.h. They run in the loop's thread, between two ticks, and must be RT-safe. Virtual
 * times in ns.
 */
#ifndef RT_REQUEST_MACHINE_H
#define RT_REQUEST_MACHINE_H

#include "rt/requests.h"

struct loop_stats;

/* If a function is NULL, the loop refuses its request, unless the function's comment says
 * otherwise. */
struct request_machine {
    void *context;
    enum request_verdict (*fault)(void *context, size_t index, bool on, int64_t now_ns);
    /* ended: force and moment of the push that it ends, N and N m; 0 = none acted */
    enum request_verdict (*push)(void *context, const struct loop_request *request, int64_t now_ns,
                                 double ended[2]);
    enum request_verdict (*set)(void *context, size_t index, double value);
    double (*get)(void *context, size_t index);
    /* save copies all state that changes in virtual time to a checkpoint slot; restore copies it
     * back. NULL = time cannot go back. save returns REQUEST_UNAVAILABLE when the slot is too
     * small. */
    enum request_verdict (*save)(void *context, size_t slot);
    void (*restore)(void *context, size_t slot);
    uint64_t (*hash)(void *context);
    /* Reports a new speed or a pause; NULL = not needed. A machine with this function cannot run at
     * speed 0 (as fast as possible): REQUEST_CLOCK. */
    void (*pace)(void *context, double speed, bool paused);
    /* Advances by one tick the effects of earlier requests, such as a push. Called once a tick,
     * after the wait. NULL = not needed. */
    void (*advance)(void *context, int64_t now_ns);
    /* Publishes the machine's state again after a request. NULL = not needed. */
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    /* Returns a counter that changes when a tunable may have changed. NULL = the loop reads the
     * tunables every tick. */
    uint64_t (*changes)(void *context);
    const char *(*body)(void *context, size_t index); /* name of a body, for the log */
    size_t nfault;
    size_t ntunable;
    const struct tunable *tunable; /* borrowed */
};

/* Creates the requests of a machine and copies `machine`. Memory from arena. ERROR_MEMORY,
 * ERROR_SYSTEM. Not RT-safe. */
enum error_code requests_create(const struct request_machine *machine, struct arena *arena,
                                struct requests **requests, struct error *error);

/* Closes its descriptor; the arena is the caller's. NULL is allowed. Not RT-safe. */
void requests_destroy(struct requests *requests);

#endif
