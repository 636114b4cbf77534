/* SPDX-License-Identifier: Apache-2.0 */
/* A clock at a multiple of another, by a scripted one behind it. */
#include "rt/clock.h"

#include "tests/unit/arena_fixture.h"

struct scripted {
    struct clock clock;
    int64_t now;
    int sleeps;
    struct pace *pace;
    double rate; /* to be set in sleep number change_at */
    int change_at;
};

static int64_t scripted_now(struct clock *clock)
{
    return ((struct scripted *)clock)->now;
}

static void scripted_sleep(struct clock *clock, int64_t deadline)
{
    struct scripted *scripted = (struct scripted *)clock;

    scripted->now = deadline > scripted->now ? deadline : scripted->now;
    if (++scripted->sleeps == scripted->change_at) {
        pace_set(scripted->pace, scripted->rate);
    }
    assert_true(scripted->sleeps < 1000);
}

static const struct clock_ops scripted_ops = {scripted_now, scripted_sleep, NULL};

static struct clock *paced(struct scripted *scripted)
{
    struct error error;

    *scripted = (struct scripted){.clock = {&scripted_ops}, .now = 7000000000, .change_at = -1};
    assert_ok(pace_create(&scripted->clock, &arena, &scripted->pace, &error));
    return pace_clock(scripted->pace);
}

TEST_WITH(a_clock_follows_its_pace, open_arena, close_arena)
{
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    assert_int_equal(clock_now(clock), 7000000000);
    scripted.now += 1000;
    assert_int_equal(clock_now(clock), 7000001000);
    pace_set(scripted.pace, 0.25);
    scripted.now += 4000;
    assert_int_equal(clock_now(clock), 7000002000);
    pace_set(scripted.pace, 0.0);
    scripted.now += 1000000;
    assert_int_equal(clock_now(clock), 7000002000);
    pace_set(scripted.pace, 8.0);
    scripted.now += 1000;
    assert_int_equal(clock_now(clock), 7000010000);
}

TEST_WITH(a_sleeper_wakes_at_its_own_deadline, open_arena, close_arena)
{
    static const double rates[] = {0.01, 0.5, 1.0, 3.0, 1000.0};
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    for (int i = 0; i < 5; i++) {
        int64_t begin = scripted.now, deadline;

        pace_set(scripted.pace, rates[i]);
        scripted.sleeps = 0;
        deadline = clock_now(clock) + CLOCK_MS;
        clock_sleep_until(clock, deadline);
        assert_true(clock_now(clock) >= deadline);
        assert_true((double)(scripted.now - begin) <= 1e6 / rates[i] + 5.0);
    }
}

TEST_WITH(a_sleeper_sleeps_on_while_the_clock_stands, open_arena, close_arena)
{
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    pace_set(scripted.pace, 0.0);
    scripted.rate = 2.0;
    scripted.change_at = 100; /* of 5 ms each */
    clock_sleep_until(clock, clock_now(clock) + CLOCK_MS);
    assert_true(scripted.now - 7000000000 > 500 * CLOCK_MS);
    assert_true(scripted.now - 7000000000 < 502 * CLOCK_MS);
}
