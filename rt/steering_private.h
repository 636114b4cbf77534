/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The other end of rt/steering.h: what the loop takes requests from and answers to, and what it
 * drives carries them out with. All in the loop's thread, RT-safe, but for making and destroying.
 */
#ifndef RT_STEERING_PRIVATE_H
#define RT_STEERING_PRIVATE_H

#include "rt/steering.h"

#include <stdatomic.h>

struct loop_stats;

/* What a steered machine can be asked. What it has not is NULL. */
struct steering_machine {
    void *context;
    enum steer_verdict (*fault)(void *context, size_t index, bool on, int64_t time_ns);
    enum steer_verdict (*push)(void *context, const struct steer_request *request, int64_t time_ns);
    enum steer_verdict (*set)(void *context, size_t index, double value);
    double (*get)(void *context, size_t index);
    /* What moves in virtual time, to a slot and back from one that was kept; NULL: there is no way
     * back. Says STEER_UNAVAILABLE when a slot does not hold it. */
    enum steer_verdict (*keep)(void *context, size_t slot);
    void (*back)(void *context, size_t slot);
    uint64_t (*hash)(void *context);
    /* The speed has changed or the loop stands still (paused); NULL = nobody minds. Where somebody
     * does, 0 (as fast as it goes) is no speed: STEER_CLOCK. */
    void (*pace)(void *context, double speed, bool paused);
    /* Before the tick that begins at time_ns. */
    void (*begin)(void *context, int64_t time_ns);
    /* Something was carried out: what others can see of the machine is to be made anew. */
    void (*show)(void *context, const struct loop_stats *stats);
    /* Moves whenever some tunable may have another value; NULL = they are looked at every tick. */
    uint64_t (*changes)(void *context);
    const char *(*body)(void *context, size_t index); /* of a push, for the log */
    size_t nfault;
    size_t ntunable;
    const struct tunable *tunable; /* borrowed */
};

/* Memory from arena. Not RT-safe. */
enum error_code steering_create(const struct steering_machine *machine, struct arena *arena,
                                struct steering **steering, struct error *error);

/* Closes what it has open; the arena is the caller's. NULL is allowed. */
void steering_destroy(struct steering *steering);

const struct steering_machine *steering_machine(const struct steering *steering);

/* The next request, when one waits and there is room for its answer. */
bool steering_next(struct steering *steering, struct steer_request *request);
bool steering_waits(const struct steering *steering);
void steering_reply(struct steering *steering, uint64_t ticket, enum steer_verdict verdict,
                    uint64_t tick, int64_t time_ns);

/* For others to see: the loop's state, the values of the tunables. */
void steering_show(struct steering *steering, bool paused, double speed);
void steering_show_values(struct steering *steering,
                          bool all); /* not only when they may have changed */

/* Nothing is asked any more: what waits is answered STEER_UNAVAILABLE. */
void steering_close(struct steering *steering, uint64_t tick, int64_t time_ns);

/* Sleeping until somebody asks: between begin (false: a request waits, there is nothing to sleep
 * for) and end the descriptor becomes readable when a request comes. */
int steering_sleep_begin(struct steering *steering);
void steering_sleep_end(struct steering *steering, bool readable);

#endif
