/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The clock that the loop waits on, passed in so that tests can script time. Times are int64_t ns
 * of one monotonic axis; its zero means nothing. RT-safe.
 */
#ifndef RT_CLOCK_H
#define RT_CLOCK_H

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

#endif
