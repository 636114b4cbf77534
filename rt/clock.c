/* SPDX-License-Identifier: Apache-2.0 */
/* Implements CLOCK_MONOTONIC as a clock, and a clock that runs at a settable rate of another. */
#include "rt/clock.h"

#include "rt/snapshot.h"

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

/* ---- a clock at a rate ---- */

/* Interval at which a sleeping thread checks for a new rate, ns. */
#define LOOK_NS (5 * CLOCK_MS)

/* Present line between the two clocks: own time = own_ns + rate (other time - behind_ns). */
struct line {
    int64_t behind_ns, own_ns;
    double rate;
};

struct pace {
    struct clock clock; /* base, must be first */
    struct clock *behind;
    struct snapshot *line; /* struct line */
};

/* Returns the time of the scaled clock at time behind_ns of the other clock, ns. */
static int64_t line_at(const struct line *line, int64_t behind_ns)
{
    return line->own_ns + (int64_t)(line->rate * (double)(behind_ns - line->behind_ns));
}

static int64_t pace_now(struct clock *clock)
{
    const struct pace *pace = (struct pace *)clock;
    struct line line;

    snapshot_read(pace->line, &line);
    return line_at(&line, clock_now(pace->behind));
}

/* Returns when to check the rate again, in time of the other clock: at the deadline if it is close,
 * else after LOOK_NS. */
static int64_t line_next_look(const struct line *line, int64_t now_ns, int64_t deadline_ns)
{
    double left = (double)(deadline_ns - line_at(line, now_ns));

    return left < line->rate * (double)LOOK_NS ? now_ns + (int64_t)(left / line->rate) + 1
                                               : now_ns + LOOK_NS;
}

/* Sleeps until a time of the scaled clock. The rate may change during the sleep. */
static void pace_sleep_until(struct clock *clock, int64_t deadline_ns)
{
    const struct pace *pace = (struct pace *)clock;

    for (;;) {
        int64_t now = clock_now(pace->behind);
        struct line line;

        snapshot_read(pace->line, &line);
        if (line_at(&line, now) >= deadline_ns) {
            return;
        }
        clock_sleep_until(pace->behind, line_next_look(&line, now, deadline_ns));
    }
}

/* Waits for a readable descriptor. Returns early when the rate must be checked again; the caller
 * then checks the time. */
static void pace_wait_readable(struct clock *clock, struct pollfd *fds, size_t count,
                               int64_t deadline_ns)
{
    const struct pace *pace = (struct pace *)clock;
    int64_t now = clock_now(pace->behind);
    struct line line;

    snapshot_read(pace->line, &line);
    clock_wait_readable(pace->behind, fds, count, line_next_look(&line, now, deadline_ns));
}

enum error_code pace_create(struct clock *behind, struct arena *arena, struct pace **out,
                            struct error *error)
{
    static const struct clock_ops ops = {pace_now, pace_sleep_until, pace_wait_readable};
    int64_t now = clock_now(behind);
    struct pace *made = arena_alloc(arena, 1, sizeof *made);
    enum error_code code;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for a clock");
    }
    made->clock.ops = &ops;
    made->behind = behind;
    code = snapshot_create(sizeof(struct line), arena, &made->line, error);
    if (code) {
        return code;
    }
    snapshot_write(made->line, &(struct line){now, now, 1.0});
    *out = made;
    return ERROR_NONE;
}

void pace_set(struct pace *pace, double rate)
{
    int64_t now = clock_now(pace->behind);
    struct line line;

    snapshot_read(pace->line, &line);
    line = (struct line){now, line_at(&line, now), rate};
    snapshot_write(pace->line, &line);
}

struct clock *pace_clock(struct pace *pace)
{
    return &pace->clock;
}
