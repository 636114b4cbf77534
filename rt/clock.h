/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The clock that the loop waits on, passed in so that tests can script time. Times are int64_t ns
 * of one monotonic axis; its zero means nothing. RT-safe.
 */
#ifndef RT_CLOCK_H
#define RT_CLOCK_H

#include "base/arena.h"

#include <poll.h>
#include <stddef.h>
#include <stdint.h>

#define CLOCK_MS INT64_C(1000000)
#define CLOCK_SECOND INT64_C(1000000000)

struct clock;

struct clock_ops {
    int64_t (*now)(struct clock *clock);
    /* Returns at the deadline, or earlier when a signal came: the caller asks now() again. */
    void (*sleep_until)(struct clock *clock, int64_t deadline_ns);
    /* Returns when one of the descriptors can be read, at the deadline or at a signal. */
    void (*wait_readable)(struct clock *clock, struct pollfd *fds, size_t count,
                          int64_t deadline_ns);
};

/* An implementation's private struct begins with this. */
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
 * A clock that runs at a multiple of the clock behind it, or stands still: a controller in a thread
 * of its own waits on it while requests change the simulator's speed (rt/requests.h), so that both
 * agree how long a second is. It begins equal to the other clock and never goes back. One thread
 * changes the rate, any may wait. RT-safe.
 */
struct pace;

/* Creates a clock at rate 1; borrows `behind`. Memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code pace_create(struct clock *behind, struct arena *arena, struct pace **pace,
                            struct error *error);

/* Sets the rate from now on, in seconds of this clock a second of the other; 0 = stands still,
 * and threads that sleep on it sleep on. */
void pace_set(struct pace *pace, double rate);

struct clock *pace_clock(struct pace *pace);

#endif
