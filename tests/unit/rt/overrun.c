/* SPDX-License-Identifier: Apache-2.0 */
/* The loop when the machine or the buses are too much for it (rt/loop.h): overruns, what they are
 * charged to and what becomes of their deadlines; pauses; accounts that balance whatever the clock
 * does; and no bus that stalls it. */
#include "loop_bench.h"

/* ---- overruns and pauses ---- */

TEST(an_end_at_the_deadline_is_in_time)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 100);

    bench->work[PHASE_PLANT] = TICK;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->lost_ticks, 0);
    assert_int_equal(bench->now, START + 100 * TICK);
}

TEST(skip_drops_the_missed_deadlines_and_stays_on_the_grid)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);
    const struct loop_stats *stats;
    struct loop_event event;

    /* Tick 3 ends at 5.6 T: the deadlines 4 T and 5 T are lost, tick 4 runs at 6 T */
    bench->slow_tick = 3;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 5 * TICK / 2;
    bench_run(bench);
    stats = loop_stats(bench->loop);
    assert_int_equal(stats->overruns[PHASE_PLANT], 1);
    assert_int_equal(stats->overrun_total, 1);
    assert_int_equal(stats->lost_ticks, 2);
    assert_int_equal(stats->late_ticks, 0);
    assert_int_equal(stats->ticks, 10);
    assert_int_equal(bench->deadline[3], START + 6 * TICK);
    assert_int_equal(bench->deadline[8], START + 11 * TICK);
    assert_int_equal(bench_events(bench, LOOP_EVENT_OVERRUN, &event), 1);
    assert_int_equal(event.a, PHASE_PLANT);
    assert_int_equal(event.b, 16 * TICK / 10);
}

TEST(slip_runs_late_ticks_until_the_grid_is_caught_up)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 20);
    const struct loop_stats *stats;

    /* Work 0.4 T; tick 3 ends at 6.9 T, tick 4 at 7.3, 5 at 7.7, 6 at 8.1, 7 at 8.5, 8 at 8.9 T */
    bench->config.overrun = LOOP_OVERRUN_SLIP;
    bench->work[PHASE_PLANT] = 4 * TICK / 10;
    bench->slow_tick = 3;
    bench->slow_phase = PHASE_SENSORS;
    bench->slow_by = 35 * TICK / 10;
    bench_run(bench);
    stats = loop_stats(bench->loop);
    assert_int_equal(stats->overrun_total, 1);
    assert_int_equal(stats->overruns[PHASE_SENSORS], 1);
    assert_int_equal(stats->late_ticks, 4); /* 4, 5, 6, 7 end after 5, 6, 7, 8 T */
    assert_int_equal(stats->lost_ticks, 0);
    assert_int_equal(bench->deadline[3], START + 9 * TICK); /* the first sleep after it */
    assert_int_equal(bench->now, START + 19 * TICK + 4 * TICK / 10);
}

TEST(slip_charges_every_tick_that_is_itself_too_long)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 50);

    bench->config.overrun = LOOP_OVERRUN_SLIP;
    bench->work[PHASE_BOARDS] = 11 * TICK / 10;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overruns[PHASE_BOARDS], 50);
    assert_int_equal(loop_stats(bench->loop)->late_ticks, 0);
    assert_int_equal(bench->sleeps, 0);
}

TEST(stop_ends_the_run_at_the_nth_overrun)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 50);

    bench->config.overrun = LOOP_OVERRUN_STOP;
    bench->config.stop_after = 4;
    bench->work[PHASE_PLANT] = 2 * TICK;
    assert_int_equal(bench_run(bench), LOOP_END_OVERRUNS);
    assert_int_equal(loop_stats(bench->loop)->ticks, 4);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 4);
    assert_int_equal(bench->shut_downs, 1);
}

TEST(an_overrun_is_charged_to_the_phase_that_caused_it)
{
    for (int p = PHASE_WAIT; p <= PHASE_PUBLISH; p++) {
        struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);

        if (p == PHASE_WAIT) {
            bench->late_sleep = 4;
            bench->late_by = 15 * TICK / 10;
        } else if (p == PHASE_RECEIVE) {
            struct bus_frame frame = frame_make(0x123, 0, NULL);

            can_send(bench->host[2], &frame, 1);
            bench->work[PHASE_RECEIVE] = 15 * TICK / 10;
        } else {
            bench->slow_tick = 5;
            bench->slow_phase = (enum loop_phase)p;
            bench->slow_by = 15 * TICK / 10;
        }
        bench_run(bench);
        for (int q = PHASE_WAIT; q < PHASE_COUNT; q++) {
            assert_int_equal(loop_stats(bench->loop)->overruns[q], q == p);
        }
        assert_int_equal(loop_stats(bench->loop)->lost_ticks, 1);
    }
}

TEST(a_pause_skips_deadlines_and_is_no_overrun)
{
    static const enum loop_overrun policies[] = {LOOP_OVERRUN_SKIP, LOOP_OVERRUN_SLIP,
                                                 LOOP_OVERRUN_STOP};

    for (size_t i = 0; i < 3; i++) {
        struct bench *bench = bench_create(LOOP_CLOCK_REAL, 20);
        const struct loop_stats *stats;

        /* Stopped while it sleeps for 5 T */
        bench->config.overrun = policies[i];
        bench->late_sleep = 4;
        bench->late_by = 5300 * TICK + TICK / 2;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        stats = loop_stats(bench->loop);
        assert_int_equal(stats->pauses, 1);
        assert_int_equal(stats->pause_ticks, 5301);
        assert_int_equal(stats->overrun_total, 0);
        assert_int_equal(stats->late_ticks, 0);
        assert_int_equal(bench->deadline[5], START + 5306 * TICK);
    }
}

TEST(a_pause_inside_a_tick_is_no_overrun_either)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 20);
    struct loop_event event;

    bench->config.overrun = LOOP_OVERRUN_SLIP;
    bench->slow_tick = 7;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 3000 * TICK;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->pauses, 1);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(bench->deadline[7], START + 3008 * TICK);
    assert_int_equal(bench_events(bench, LOOP_EVENT_PAUSE, &event), 1);
}

TEST(a_second_behind_is_still_caught_up)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 1200);

    bench->config.overrun = LOOP_OVERRUN_SLIP;
    bench->slow_tick = 0;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 1000 * TICK;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->pauses, 0);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 1);
    assert_int_equal(loop_stats(bench->loop)->lost_ticks, 0);
    assert_int_equal(bench->now, START + 1199 * TICK + TICK / 10);
}

/* ---- the accounts of the real clock ---- */

struct dice {
    uint64_t state;
};

static struct dice dice;

static uint64_t roll(uint64_t below)
{
    dice.state = dice.state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (dice.state >> 33) % below;
}

/* Of a hundred ticks some are too long, some wake too late, and now and then the machine is gone.
 * */
static void throw_the_dice(struct bench *bench)
{
    bench->work[PHASE_PLANT] = (int64_t)roll(TICK * 9 / 10);
    bench->work[PHASE_BOARDS] = (int64_t)roll(TICK / 10);
    bench->wake_late = (int64_t)roll(TICK / 5);
    if (roll(10) == 0) {
        bench->slow_tick = bench->tick;
        bench->slow_phase = (enum loop_phase)(PHASE_BOARDS + roll(PHASE_ARRIVALS - PHASE_BOARDS));
        bench->slow_by = (int64_t)roll(roll(20) == 0 ? 3 * CLOCK_SECOND : 30 * TICK);
    }
    if (roll(20) == 0) {
        bench->late_sleep = bench->sleeps;
        bench->late_by = (int64_t)roll(roll(10) == 0 ? 3 * CLOCK_SECOND : 10 * TICK);
    }
}

static void assert_accounts_balance(const struct bench *bench, enum loop_overrun policy)
{
    const struct loop_stats *stats = loop_stats(bench->loop);
    int64_t next =
        stats->start_ns + (int64_t)(stats->ticks + stats->lost_ticks + stats->pause_ticks) * TICK;
    uint64_t charged = 0;

    for (int p = 0; p < PHASE_COUNT; p++) {
        charged += stats->overruns[p];
    }
    assert_int_equal(charged, stats->overrun_total);
    assert_int_equal(stats->time_ns, (int64_t)stats->ticks * TICK);
    assert_true(stats->end_ns > next - TICK);
    if (policy == LOOP_OVERRUN_SLIP) {
        assert_true(stats->end_ns <= next + LOOP_PAUSE_NS);
        assert_int_equal(stats->lost_ticks, 0);
    } else {
        assert_true(stats->end_ns <= next);
        assert_int_equal(stats->late_ticks, 0);
    }
    for (size_t i = 0; i < bench->sleeps && i < BENCH_SLEEPS; i++) {
        assert_int_equal((bench->deadline[i] - START) % TICK, 0);
    }
}

TEST(the_accounts_balance_whatever_the_machine_does)
{
    static const enum loop_overrun policies[] = {LOOP_OVERRUN_SKIP, LOOP_OVERRUN_SLIP,
                                                 LOOP_OVERRUN_STOP};
    uint64_t overruns = 0, pauses = 0, lost = 0, late = 0;

    for (uint64_t seed = 0; seed < 60; seed++) {
        struct bench *bench = bench_create(LOOP_CLOCK_REAL, 2000);
        enum loop_overrun policy = policies[seed % 3];
        enum loop_end end;

        dice.state = seed;
        bench->config.overrun = policy;
        bench->config.stop_after = 100;
        bench->on_tick = throw_the_dice;
        end = bench_run(bench);
        assert_int_equal(end, policy == LOOP_OVERRUN_STOP ? LOOP_END_OVERRUNS : LOOP_END_LENGTH);
        assert_accounts_balance(bench, policy);
        overruns += loop_stats(bench->loop)->overrun_total;
        pauses += loop_stats(bench->loop)->pauses;
        lost += loop_stats(bench->loop)->lost_ticks;
        late += loop_stats(bench->loop)->late_ticks;
    }
    /* It was about something */
    assert_true(overruns > 1000 && pauses > 100 && lost > 1000 && late > 1000);
}

TEST(an_hour_ahead_is_one_pause_and_no_burst)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);
    const struct loop_stats *stats;
    struct loop_event event;

    bench->config.overrun = LOOP_OVERRUN_SLIP;
    bench->late_sleep = 2;
    bench->late_by = 3600 * CLOCK_SECOND + TICK / 4;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    stats = loop_stats(bench->loop);
    assert_int_equal(stats->pauses, 1);
    assert_int_equal(stats->pause_ticks, 3600001);
    assert_int_equal(stats->ticks, 10);
    assert_int_equal(stats->late_ticks + stats->overrun_total, 0);
    assert_int_equal(bench->deadline[3], START + 3600004 * TICK);
    assert_int_equal(bench->deadline[4], START + 3600005 * TICK);
    assert_accounts_balance(bench, LOOP_OVERRUN_SLIP);
    assert_int_equal(bench_events(bench, LOOP_EVENT_PAUSE, &event), 1);
    assert_int_equal(event.a, 3600 * CLOCK_SECOND + TICK / 4);
}

TEST(a_sleep_that_ends_too_early_is_slept_to_its_end)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);

    /* A signal, or a clock that stands still */
    bench->late_sleep = 4;
    bench->late_by = -TICK / 2;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(bench->deadline[4], START + 5 * TICK);
    assert_int_equal(bench->deadline[5], START + 5 * TICK);
    assert_int_equal(bench->deadline[6], START + 6 * TICK);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_accounts_balance(bench, LOOP_OVERRUN_SKIP);
}

/* ---- a bus that never falls silent ---- */

struct flood {
    struct can_port port;
    uint64_t given;
    uint64_t step_at; /* this frame (from 1) is a STEP; 0 = none */
};

static size_t flood_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct flood *flood = (struct flood *)port;

    for (size_t i = 0; i < max; i++) {
        frames[i] = frame_make(0x7AA, 0, NULL);
        if (++flood->given == flood->step_at) {
            frames[i] = frame_make(LOCKSTEP_STEP_ID, LOCKSTEP_LENGTH, (const uint8_t[8]){0});
        }
    }
    return max;
}

static size_t flood_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    (void)port;
    (void)frames;
    return count;
}

static int flood_descriptor(const struct can_port *port)
{
    (void)port;
    return -1;
}

static void flood_close(struct can_port *port)
{
    (void)port;
}

static const struct can_port_ops flood_ops = {
    .name = "flood",
    .receive = flood_receive,
    .send = flood_send,
    .descriptor = flood_descriptor,
    .close = flood_close,
};

/* A flood in the place of the port of bus 1, which is the STEP's. */
static void break_the_dam(struct bench *bench, struct flood *flood)
{
    *flood = (struct flood){.port = {.ops = &flood_ops, .bus = "can1"}};
    bench->port[1]->ops->close(bench->port[1]);
    bench->port[1] = &flood->port;
}

TEST(a_flooded_bus_costs_a_bounded_time)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    for (size_t c = 0; c < 2; c++) {
        struct bench *bench = bench_create(clocks[c], 3);
        struct bus_frame frame = frame_make(0x123, 0, NULL);
        static struct flood flood; /* the next test closes it */

        break_the_dam(bench, &flood);
        can_send(bench->host[2], &frame, 1);
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(loop_stats(bench->loop)->ticks, 3);
        assert_int_equal(flood.given, 3 * LOOP_RECEIVE_MAX);
        /* The bus behind it has its turn in the same tick */
        assert_int_equal(bench->received_count, 3 * LOOP_RECEIVE_MAX + 1);
        assert_int_equal(bench->received_tick[LOOP_RECEIVE_MAX], 0);
        assert_int_equal(bench->received[LOOP_RECEIVE_MAX].id, 0x123);
    }
}

static void stop_at_the_fifth_look(struct bench *bench)
{
    if (bench->waits == 5) {
        loop_stop(bench->loop);
    }
}

TEST(a_flood_without_a_step_does_not_stall_the_loop)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct flood flood;
    uint64_t beat;

    break_the_dam(bench, &flood);
    bench->on_wait = stop_at_the_fifth_look;
    assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
    assert_int_equal(loop_stats(bench->loop)->ticks, 0);
    assert_in_range(flood.given, 5 * LOOP_RECEIVE_MAX, 5 * (LOOP_RECEIVE_MAX + 1024));
    /* The watchdog of a service sees it alive */
    beat = loop_beat(bench->loop);
    assert_true(beat >= 5);
}

TEST(a_step_is_found_in_a_flood)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 1);
    struct flood flood;

    break_the_dam(bench, &flood);
    flood.step_at = 3 * LOOP_RECEIVE_MAX + 7;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(loop_stats(bench->loop)->lockstep.steps, 1);
    assert_int_equal(bench->received_count, flood.step_at - 1);
}
