/* SPDX-License-Identifier: Apache-2.0 */
/* Implements the clock's interface by CLOCK_MONOTONIC. */
#include "rt/clock.h"

#include <time.h>

static struct timespec to_timespec(int64_t ns)
{
    return (struct timespec){.tv_sec = ns / CLOCK_SECOND, .tv_nsec = ns % CLOCK_SECOND};
}

static int64_t monotonic_now(struct clock *clock)
{
    struct timespec now;

    (void)clock;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * CLOCK_SECOND + now.tv_nsec;
}

static void monotonic_sleep_until(struct clock *clock, int64_t deadline_ns)
{
    struct timespec deadline = to_timespec(deadline_ns > 0 ? deadline_ns : 0);

    (void)clock;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, NULL);
}

static void monotonic_wait_readable(struct clock *clock, struct pollfd *fds, size_t count,
                                    int64_t deadline_ns)
{
    int64_t left = deadline_ns - monotonic_now(clock);
    struct timespec timeout = to_timespec(left > 0 ? left : 0);

    ppoll(fds, count, &timeout, NULL);
}

struct clock *clock_monotonic(void)
{
    static const struct clock_ops ops = {
        .now = monotonic_now,
        .sleep_until = monotonic_sleep_until,
        .wait_readable = monotonic_wait_readable,
    };
    static struct clock clock = {.ops = &ops};

    return &clock;
}
