/* SPDX-License-Identifier: Apache-2.0 */
/* What the loop makes of requests, by the scripted clock: speed, the way back, and what is set. */
#include "tests/tunables.h"
#include "tests/unit/rt/request_bench.h"

/* ---- speed ---- */

static void speed_at_10(struct request_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 10) {
        ask(REQUEST_SPEED, 0, 0, sb.value);
    }
}

TEST(speed_scales_the_grid_and_what_an_overrun_is)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 30);

    sb.value = 0.25; /* 4 ms a tick */
    sb.each_tick = speed_at_10;
    bench->slow_tick = 20;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 3 * TICK; /* too long for a tick of 1 ms, not for one of 4 ms */
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(bench->deadline[15] - bench->deadline[14], 4 * TICK);
    assert_true(requests_speed(sb.requests) == 0.25);
    assert_int_equal(answer(1, REQUEST_OK).tick, 10);

    bench = requested_create(LOOP_CLOCK_REAL, 30);
    sb.value = 20.0; /* 0.05 ms a tick, half of what one takes */
    sb.each_tick = speed_at_10;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 20);
}

TEST(real_time_without_a_pace_waits_for_nothing)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 1000);

    sb.value = 0.0;
    sb.each_tick = speed_at_10;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->lost_ticks, 0);
    assert_int_equal(bench->sleeps, 9);
    assert_int_equal(bench->now, START + 9 * TICK + 991 * TICK / 10);
}

TEST(free_run_can_be_paced_and_counts_nothing)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 50);

    sb.value = 2.0; /* 0.5 ms a tick */
    sb.each_tick = speed_at_10;
    bench->slow_tick = 30;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 20 * TICK;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->late_ticks, 0);
    /* 10 unpaced ones, 40 on the grid but for the slow one, which nothing catches up */
    assert_int_equal(bench->now, START + 10 * (TICK / 10) + 20 * (TICK / 2) + TICK / 10 +
                                     20 * TICK + 18 * (TICK / 2) + TICK / 10);
}

TEST(a_slow_loop_hears_requests_between_its_ticks)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 0);

    ask(REQUEST_SPEED, 0, 0, 0.001); /* a tick a second */
    sb.bench->on_wait = ask_often_and_stop;
    bench_run(bench);
    assert_true(sb.faults >= 80);
    assert_true(loop_stats(bench->loop)->ticks < 12);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->late_ticks, 0);
}

TEST(speeds_out_of_range_are_refused)
{
    static const double bad[] = {-1.0, 0.0009, 1001.0, NAN, INFINITY};
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 5);

    for (uint64_t i = 0; i < 5; i++) {
        ask(REQUEST_SPEED, 0, 0, bad[i]);
    }
    bench_run(bench);
    for (uint64_t i = 0; i < 5; i++) {
        answer(i + 1, REQUEST_RANGE);
    }
    assert_true(requests_speed(sb.requests) == 1.0);

    bench = requested_create(LOOP_CLOCK_LOCKSTEP, 1);
    ask(REQUEST_SPEED, 0, 0, 1.0);
    send_step(bench, 0, 1);
    bench_run(bench);
    answer(1, REQUEST_CLOCK);
}

/* ---- the way back, and what is set ---- */

static void back_at_20(struct request_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 10) {
        ask(REQUEST_CHECKPOINT, 2, 0, 0.0);
    } else if (sb.bench->tick == 20 && sb.backs == 0) {
        ask(REQUEST_RESTORE, 2, 0, 0.0);
    } else if (sb.bench->tick == 25 && sb.backs == 1) {
        ask(REQUEST_RESET, 0, 0, 0.0);
    }
}

TEST(time_goes_back_and_the_run_ends_at_its_length)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    for (int i = 0; i < 2; i++) {
        struct bench *bench = requested_create(clocks[i], 40);
        struct loop_event event;

        sb.each_tick = back_at_20;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(sb.backs, 2);
        assert_int_equal(answer(1, REQUEST_OK).tick, 10);
        assert_int_equal(answer(2, REQUEST_OK).tick, 10);
        assert_int_equal(answer(3, REQUEST_OK).tick, 0);
        assert_int_equal(answer(4, REQUEST_OK).tick, 10); /* the checkpoint again, on the way */
        assert_int_equal(loop_stats(bench->loop)->ticks, 40);
        assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
        assert_int_equal(bench_events(bench, LOOP_EVENT_RESTORED, &event), 2);
    }
}

static void ask_in_vain(struct request_bench *unused)
{
    (void)unused;
    ask(REQUEST_RESTORE, 1, 0, 0.0);
}

TEST(a_refused_way_back_moves_no_deadline)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 20);

    sb.each_tick = ask_in_vain;
    bench_run(bench);
    assert_int_equal(bench->sleeps, 19);
    for (size_t i = 0; i < 19; i++) {
        assert_int_equal(bench->deadline[i], START + (int64_t)(i + 1) * TICK);
    }
}

TEST(slots_are_checked)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 5);
    uint64_t t;

    ask(REQUEST_CHECKPOINT, 0, 0, 0.0);
    ask(REQUEST_CHECKPOINT, CHECKPOINT_SLOTS, 0, 0.0);
    ask(REQUEST_RESTORE, CHECKPOINT_SLOTS, 0, 0.0);
    ask(REQUEST_RESTORE, 1, 0, 0.0);
    t = ask(REQUEST_RESTORE, 0, 0, 0.0);
    bench_run(bench);
    answer(1, REQUEST_RANGE);
    answer(2, REQUEST_RANGE);
    answer(3, REQUEST_RANGE);
    answer(4, REQUEST_EMPTY);
    answer(t, REQUEST_OK);
}

TEST(tunables_are_checked_and_seen)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 5);

    assert_int_equal(requests_find(sb.requests, "supply_v"), 1);
    assert_int_equal(requests_find(sb.requests, "supply"), -1);
    ask(REQUEST_SET, 0, 0, 11.0);
    ask(REQUEST_SET, 0, 0, 1.5); /* whole only */
    ask(REQUEST_SET, 2, 0, 1.0);
    ask(REQUEST_SET, 1, 0, NAN);
    ask(REQUEST_SET, 1, 0, -4.5);
    ask(REQUEST_FAULT, 2, 0, 0.0);
    ask(REQUEST_PUSH, 0, 0, 0.0); /* this machine has no bodies */
    bench_run(bench);
    answer(1, REQUEST_RANGE);
    answer(2, REQUEST_RANGE);
    answer(3, REQUEST_RANGE);
    answer(4, REQUEST_RANGE);
    answer(5, REQUEST_OK);
    answer(6, REQUEST_RANGE);
    answer(7, REQUEST_UNAVAILABLE);
    assert_int_equal(sb.sets, 1);
    assert_true(requests_value(sb.requests, 1) == -4.5);
}

TEST(an_asker_who_never_listens_only_stops_being_heard)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 100);
    struct loop_request request = {.kind = REQUEST_FAULT, .index = 1, .on = true};
    struct request_answer got;
    size_t asked = 0, answered = 0;

    while (requests_ask(sb.requests, &request)) {
        asked++;
    }
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 100);
    while (requests_answer(sb.requests, &got)) {
        answered++;
    }
    assert_int_equal(answered, asked);
}
