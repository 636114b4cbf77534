/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The clock that the loop waits on. The caller passes it in, so that tests can script time. Times
 * are int64_t ns on one monotonic axis with an arbitrary zero. RT-safe.
 */
#ifndef RT_CLOCK_H
#define RT_CLOCK_H

#include "base/arena.h"

#include <poll.h>
#include <stdint.h>

#define CLOCK_MS INT64_C(1000000)
#define CLOCK_SECOND INT64_C(1000000000)

struct clock;

struct clock_ops {
    int64_t (*now)(struct clock *clock);
    /* Sleeps until the deadline. A signal may end the sleep early, so the caller must check
     * now(). */
    void (*sleep_until)(struct clock *clock, int64_t deadline_ns);
    /* Waits until a descriptor is readable, the deadline passes, or a signal arrives. */
    void (*wait_readable)(struct clock *clock, struct pollfd *fds, size_t count,
                          int64_t deadline_ns);
};

/* Base of all clocks. The private struct of an implementation begins with this struct. */
struct clock {
    const struct clock_ops *ops;
};

/* Returns the clock CLOCK_MONOTONIC with absolute sleeps; shared by all threads. */
struct clock *clock_monotonic(void);

static inline int64_t clock_now(struct clock *clock)
{
    return clock->ops->now(clock);
}

static inline void clock_sleep_until(struct clock *clock, int64_t deadline_ns)
{
    clock->ops->sleep_until(clock, deadline_ns);
}

static inline void clock_wait_readable(struct clock *clock, struct pollfd *fds, size_t count,
                                       int64_t deadline_ns)
{
    clock->ops->wait_readable(clock, fds, count, deadline_ns);
}

/*
 * A clock that runs at a multiple of another clock, or stands still. A controller in its own thread
 * waits on it, so that it follows changes of the simulator's speed (rt/requests.h). It starts at
 * the time of the other clock and never goes back. One thread changes the rate; any thread may
 * wait. RT-safe.
 */
struct pace;

/* Creates a clock at rate 1; borrows `behind`. Memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code pace_create(struct clock *behind, struct arena *arena, struct pace **pace,
                            struct error *error);

/* Sets the rate from now on, in seconds of this clock per second of the other. At 0 the clock
 * stands still and sleeping threads stay asleep. */
void pace_set(struct pace *pace, double rate);

struct clock *pace_clock(struct pace *pace);

#endif
