/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the loop makes of requests, by the scripted clock: standing still, going on, steps, speed,
 * the order of things and what is refused. Requests come from the host's turn while the loop waits,
 * or from the end of a tick.
 */
#include "rt/steering_machine.h"
#include "tests/unit/rt/loop_bench.h"

#include <math.h>

/* The machine behind the steering, and a script of what is asked when. */
struct steering_bench {
    struct bench *bench;
    struct steering *steering;
    uint64_t kept[STEERING_SLOTS];
    int backs;
    double value;
    int sets, faults;
    uint64_t tickets;
    uint64_t paused_at; /* tick at whose end PAUSE is asked */
    int waits_left;     /* while paused, before on_paused */
    int waits;          /* seen while paused */
    void (*on_paused)(struct steering_bench *sb);
    void (*each_tick)(struct steering_bench *sb);
};

static struct steering_bench sb;

static enum steer_verdict fault(void *context, size_t index, bool on, int64_t time_ns)
{
    (void)context;
    (void)time_ns;
    assert_int_equal(index, 1);
    assert_true(on);
    sb.faults++;
    return STEER_OK;
}

static enum steer_verdict save(void *context, size_t slot)
{
    (void)context;
    sb.kept[slot] = sb.bench->tick;
    return STEER_OK;
}

static void restore(void *context, size_t slot)
{
    (void)context;
    sb.bench->tick = sb.kept[slot];
    sb.bench->restored = true;
    sb.backs++;
}

static double get(void *context, size_t index)
{
    (void)context;
    (void)index;
    return sb.value;
}

static enum steer_verdict set(void *context, size_t index, double value)
{
    (void)context;
    (void)index;
    sb.value = value;
    sb.sets++;
    return STEER_OK;
}

static uint64_t ask(enum steer_kind kind, size_t index, uint64_t count, double value)
{
    struct steer_request request = {.ticket = ++sb.tickets,
                                    .kind = kind,
                                    .index = index,
                                    .count = count,
                                    .value = value,
                                    .on = true};

    assert_true(steering_ask(sb.steering, &request));
    return sb.tickets;
}

/* The next answer is to this ticket; returns it */
static struct steer_answer answer(uint64_t ticket, enum steer_verdict verdict)
{
    struct steer_answer got;

    assert_true(steering_answer(sb.steering, &got));
    assert_int_equal(got.ticket, ticket);
    assert_string_equal(steer_verdict_text(got.verdict), steer_verdict_text(verdict));
    return got;
}

static void no_answer(void)
{
    struct steer_answer got;

    assert_false(steering_answer(sb.steering, &got));
}

static void on_tick(struct bench *bench)
{
    (void)bench;
    if (sb.bench->tick == sb.paused_at) {
        ask(STEER_PAUSE, 0, 0, 0.0);
    }
    if (sb.each_tick) {
        sb.each_tick(&sb);
    }
}

static void on_wait(struct bench *bench)
{
    (void)bench;
    if (steering_paused(sb.steering)) {
        sb.waits++;
        if (sb.waits_left-- == 0) {
            sb.on_paused(&sb);
        }
    }
}

static struct bench *create(enum loop_clock clock, uint64_t ticks)
{
    static const struct tunable tunable[] = {{"gain", "", 0.0, 10.0, true},
                                             {"supply_v", "V", -5.0, 5.0, false}};
    const struct steering_machine machine = {
        .fault = fault,
        .set = set,
        .get = get,
        .save = save,
        .restore = restore,
        .nfault = 2,
        .ntunable = 2,
        .tunable = tunable,
    };
    struct bench *bench = bench_create(clock, ticks);
    struct error error;

    memset(&sb, 0, sizeof sb);
    sb.bench = bench;
    sb.paused_at = UINT64_MAX;
    bench->on_tick = on_tick;
    bench->on_wait = on_wait;
    assert_int_equal(steering_create(&machine, &bench->arena, &sb.steering, &error), ERROR_NONE);
    bench->config.steering = sb.steering;
    return bench;
}

static void destroy(struct bench *bench)
{
    steering_destroy(sb.steering);
    bench_destroy(bench);
}

static void go_on(struct steering_bench *unused)
{
    (void)unused;
    ask(STEER_RESUME, 0, 0, 0.0);
}

/* ---- standing still ---- */

static void a_pause_in_real_time_costs_no_deadline(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 100);
    struct loop_event event;
    const struct loop_stats *stats;

    (void)state;
    sb.paused_at = 40;
    sb.waits_left = 50; /* of 100 ms each: far beyond LOOP_PAUSE_NS */
    sb.on_paused = go_on;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    stats = loop_stats(bench->loop);
    assert_int_equal(stats->ticks, 100);
    assert_int_equal(stats->overrun_total + stats->lost_ticks + stats->late_ticks, 0);
    assert_int_equal(stats->pauses + stats->pause_ticks, 0);
    assert_true(bench->now - START > 5 * CLOCK_SECOND);
    assert_true(loop_beat(bench->loop) > 100 + 50); /* it has lived meanwhile */
    assert_int_equal(answer(1, STEER_OK).tick, 40);
    assert_int_equal(answer(2, STEER_OK).tick, 40);
    assert_int_equal(bench_events(bench, LOOP_EVENT_PAUSED, &event), 1);
    destroy(bench);
}

static void the_grid_begins_anew_at_resume(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 20);
    int64_t first;

    (void)state;
    sb.paused_at = 10;
    sb.waits_left = 3;
    sb.on_paused = go_on;
    bench_run(bench);
    /* Tick 0 runs at once, as does the first after the pause: both begin a grid */
    assert_int_equal(bench->sleeps, 18);
    first = bench->deadline[9];
    for (size_t i = 0; i < 9; i++) {
        assert_int_equal(bench->deadline[i], START + (int64_t)(i + 1) * TICK);
        assert_int_equal(bench->deadline[9 + i], first + (int64_t)i * TICK);
    }
    destroy(bench);
}

static void stop_it(struct steering_bench *unused)
{
    (void)unused;
    loop_stop(sb.bench->loop);
}

static void a_loop_that_stands_still_can_be_ended(void **state)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_LOCKSTEP, LOOP_CLOCK_FREE};

    (void)state;
    for (int i = 0; i < 3; i++) {
        struct bench *bench = create(clocks[i], 0);

        ask(STEER_PAUSE, 0, 0, 0.0);
        sb.waits_left = 2;
        sb.on_paused = stop_it;
        assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
        assert_int_equal(loop_stats(bench->loop)->ticks, 0);
        assert_int_equal(bench->shut_downs, 1);
        destroy(bench);
    }
}

static void ask_two_and_stop(struct steering_bench *unused)
{
    (void)unused;
    loop_stop(sb.bench->loop);
    ask(STEER_SPEED, 0, 0, 1.0);
}

static void what_waits_at_the_end_is_answered(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 0);
    struct steer_request late = {.kind = STEER_PAUSE};

    (void)state;
    sb.each_tick = NULL;
    ask(STEER_PAUSE, 0, 0, 0.0);
    sb.waits_left = 0;
    sb.on_paused = ask_two_and_stop;
    bench_run(bench);
    answer(1, STEER_OK);
    answer(2, STEER_OK); /* came before the loop looked at its end */
    no_answer();
    assert_false(steering_ask(sb.steering, &late));
    destroy(bench);
}

/* ---- steps ---- */

static void step_5_then_go_on(struct steering_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(STEER_STEP, 0, 5, 0.0);
        sb.waits_left = 2;
    } else {
        ask(STEER_RESUME, 0, 0, 0.0);
    }
}

static void steps_end_where_they_should(void **state)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    (void)state;
    for (int i = 0; i < 2; i++) {
        struct bench *bench = create(clocks[i], 30);

        sb.paused_at = 10;
        sb.on_paused = step_5_then_go_on;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(answer(1, STEER_OK).tick, 10);
        assert_int_equal(answer(2, STEER_OK).tick, 15);
        assert_int_equal(answer(3, STEER_OK).tick, 15);
        assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
        destroy(bench);
    }
}

static void ask_while_it_steps(struct steering_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 12) {
        ask(STEER_STEP, 0, 1, 0.0);
        ask(STEER_RESUME, 0, 0, 0.0);
        ask(STEER_RESTORE, 1, 0, 0.0);
        ask(STEER_FAULT, 1, 0, 0.0);
    } else if (sb.bench->tick == 14) {
        ask(STEER_PAUSE, 0, 0, 0.0);
    }
}

static void step_100_then_stop(struct steering_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(STEER_STEP, 0, 100, 0.0);
        sb.waits_left = 1;
    } else {
        loop_stop(sb.bench->loop);
    }
}

static void a_step_under_way_refuses_others_and_is_cut_by_a_pause(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 0);

    (void)state;
    sb.paused_at = 10;
    sb.each_tick = ask_while_it_steps;
    sb.on_paused = step_100_then_stop;
    bench_run(bench);
    answer(1, STEER_OK);
    answer(3, STEER_BUSY);
    answer(4, STEER_BUSY);
    answer(5, STEER_BUSY);
    answer(6, STEER_OK);
    assert_int_equal(answer(2, STEER_CUT).tick, 14);
    assert_int_equal(answer(7, STEER_OK).tick, 14);
    assert_int_equal(sb.faults, 1);
    destroy(bench);
}

static void a_step_of_nothing_is_refused(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 3);

    (void)state;
    ask(STEER_STEP, 0, 0, 0.0);
    bench_run(bench);
    answer(1, STEER_RANGE);
    destroy(bench);
}

static void a_step_ends_with_the_run(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 3);

    (void)state;
    ask(STEER_STEP, 0, 7, 0.0);
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(answer(1, STEER_CUT).tick, 3);
    destroy(bench);
}

/* ---- lockstep ---- */

static size_t dones(struct bench *bench, size_t bus, uint32_t *tick)
{
    struct bus_frame frame;
    size_t count = 0;

    while (can_receive(bench->host[bus], &frame, 1)) {
        if (frame.id == LOCKSTEP_DONE_ID && !(get_u16_le(frame.data + 4) & LOCKSTEP_STOPPING)) {
            *tick = get_u32_le(frame.data);
            count++;
        }
    }
    return count;
}

static void send_step(struct bench *bench, uint32_t expected, uint16_t ticks)
{
    uint8_t data[LOCKSTEP_LENGTH];
    struct bus_frame frame;

    put_u32_le(data, expected);
    put_u16_le(data + 4, ticks);
    frame = frame_make(LOCKSTEP_STEP_ID, LOCKSTEP_LENGTH, data);
    assert_int_equal(can_send(bench->host[1], &frame, 1), 1);
}

static void step_4_then_stop(struct steering_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(STEER_STEP, 0, 4, 0.0);
        sb.waits_left = 3;
    } else {
        loop_stop(sb.bench->loop);
    }
}

static void a_step_plays_the_part_of_a_step_frame(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_LOCKSTEP, 0);
    uint8_t data[8] = {1, 2, 3};
    struct bus_frame command = frame_make(0x123, 8, data);
    uint32_t tick;

    (void)state;
    ask(STEER_PAUSE, 0, 0, 0.0);
    /* On the STEP's bus: what comes before a STEP belongs to the step, the STEP waits */
    can_send(bench->host[1], &command, 1);
    send_step(bench, 0, 2);
    can_send(bench->host[1], &command, 1);
    sb.on_paused = step_4_then_stop;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 4);
    assert_int_equal(answer(1, STEER_OK).tick, 0);
    assert_int_equal(answer(2, STEER_OK).tick, 4);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(dones(bench, b, &tick), 1);
        assert_int_equal(tick, 4);
    }
    assert_int_equal(bench->received_count, 1);
    assert_int_equal(bench->received_tick[0], 0);
    assert_int_equal(loop_stats(bench->loop)->lockstep.steps, 0);
    destroy(bench);
}

static void send_step_and_go_on(struct steering_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        assert_int_equal(sb.bench->tick, 3); /* three of the STEP's ten have run */
        ask(STEER_STEP, 0, 2, 0.0);
        sb.waits_left = 1;
    } else if (sb.tickets == 2) {
        assert_int_equal(sb.bench->tick, 5);
        ask(STEER_RESUME, 0, 0, 0.0);
    }
}

static void a_pause_interrupts_a_step_frame_and_its_rest_follows(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_LOCKSTEP, 10);
    uint32_t tick;

    (void)state;
    send_step(bench, 0, 10);
    sb.paused_at = 3;
    sb.on_paused = send_step_and_go_on;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(answer(1, STEER_OK).tick, 3);
    assert_int_equal(answer(2, STEER_OK).tick, 5);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(dones(bench, b, &tick), 1);
        assert_int_equal(tick, 10);
    }
    destroy(bench);
}

static void steps_wait_while_it_stands_still(struct steering_bench *unused)
{
    (void)unused;
    assert_int_equal(sb.bench->tick, 0);
    ask(STEER_RESUME, 0, 0, 0.0);
}

static void step_frames_wait_during_a_pause(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_LOCKSTEP, 2);
    struct loop_event event;

    (void)state;
    ask(STEER_PAUSE, 0, 0, 0.0);
    send_step(bench, 0, 2);
    sb.waits_left = 40; /* four seconds: no silence is counted for them */
    sb.on_paused = steps_wait_while_it_stands_still;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(loop_stats(bench->loop)->lockstep.silences, 0);
    assert_int_equal(bench_events(bench, LOOP_EVENT_SILENT, &event), 0);
    destroy(bench);
}

static void ask_often_and_stop(struct bench *bench)
{
    static int turns;
    struct steer_answer unread;

    if (bench->waits == 1) {
        turns = 0;
    }
    while (steering_answer(sb.steering, &unread)) {
    }
    if (++turns == 90) {
        loop_stop(bench->loop);
    } else {
        ask(STEER_FAULT, 1, 0, 0.0);
    }
}

static void requests_do_not_begin_the_silence_anew(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_LOCKSTEP, 0);
    struct loop_event event;

    (void)state;
    bench->on_wait = ask_often_and_stop;
    bench_run(bench);
    /* Nine seconds: told after one, three and seven */
    assert_int_equal(bench_events(bench, LOOP_EVENT_SILENT, &event), 3);
    destroy(bench);
}

/* ---- speed ---- */

static void speed_at_10(struct steering_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 10) {
        ask(STEER_SPEED, 0, 0, sb.value);
    }
}

static void speed_scales_the_grid_and_what_an_overrun_is(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 30);

    (void)state;
    sb.value = 0.25; /* 4 ms a tick */
    sb.each_tick = speed_at_10;
    bench->slow_tick = 20;
    bench->slow_phase = PHASE_PLANT;
    bench->slow_by = 3 * TICK; /* too long for a tick of 1 ms, not for one of 4 ms */
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(bench->deadline[15] - bench->deadline[14], 4 * TICK);
    assert_true(steering_speed(sb.steering) == 0.25);
    assert_int_equal(answer(1, STEER_OK).tick, 10);
    destroy(bench);

    bench = create(LOOP_CLOCK_REAL, 30);
    sb.value = 20.0; /* 0.05 ms a tick, half of what one takes */
    sb.each_tick = speed_at_10;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 20);
    destroy(bench);
}

static void real_time_without_a_pace_waits_for_nothing(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 1000);

    (void)state;
    sb.value = 0.0;
    sb.each_tick = speed_at_10;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->lost_ticks, 0);
    assert_int_equal(bench->sleeps, 9);
    assert_int_equal(bench->now, START + 9 * TICK + 991 * TICK / 10);
    destroy(bench);
}

static void free_run_can_be_paced_and_counts_nothing(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 50);

    (void)state;
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
    destroy(bench);
}

static void a_slow_loop_hears_requests_between_its_ticks(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 0);

    (void)state;
    ask(STEER_SPEED, 0, 0, 0.001); /* a tick a second */
    sb.bench->on_wait = ask_often_and_stop;
    bench_run(bench);
    assert_true(sb.faults >= 80);
    assert_true(loop_stats(bench->loop)->ticks < 12);
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->late_ticks, 0);
    destroy(bench);
}

static void speeds_out_of_range_are_refused(void **state)
{
    static const double bad[] = {-1.0, 0.0009, 1001.0, NAN, INFINITY};
    struct bench *bench = create(LOOP_CLOCK_REAL, 5);

    (void)state;
    for (uint64_t i = 0; i < 5; i++) {
        ask(STEER_SPEED, 0, 0, bad[i]);
    }
    bench_run(bench);
    for (uint64_t i = 0; i < 5; i++) {
        answer(i + 1, STEER_RANGE);
    }
    assert_true(steering_speed(sb.steering) == 1.0);
    destroy(bench);

    bench = create(LOOP_CLOCK_LOCKSTEP, 1);
    ask(STEER_SPEED, 0, 0, 1.0);
    send_step(bench, 0, 1);
    bench_run(bench);
    answer(1, STEER_CLOCK);
    destroy(bench);
}

/* ---- the way back, and what is set ---- */

static void back_at_20(struct steering_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 10) {
        ask(STEER_CHECKPOINT, 2, 0, 0.0);
    } else if (sb.bench->tick == 20 && sb.backs == 0) {
        ask(STEER_RESTORE, 2, 0, 0.0);
    } else if (sb.bench->tick == 25 && sb.backs == 1) {
        ask(STEER_RESET, 0, 0, 0.0);
    }
}

static void time_goes_back_and_the_run_ends_at_its_length(void **state)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    (void)state;
    for (int i = 0; i < 2; i++) {
        struct bench *bench = create(clocks[i], 40);
        struct loop_event event;

        sb.each_tick = back_at_20;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(sb.backs, 2);
        assert_int_equal(answer(1, STEER_OK).tick, 10);
        assert_int_equal(answer(2, STEER_OK).tick, 10);
        assert_int_equal(answer(3, STEER_OK).tick, 0);
        assert_int_equal(answer(4, STEER_OK).tick, 10); /* the checkpoint again, on the way */
        assert_int_equal(loop_stats(bench->loop)->ticks, 40);
        assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
        assert_int_equal(bench_events(bench, LOOP_EVENT_RESTORED, &event), 2);
        destroy(bench);
    }
}

static void ask_in_vain(struct steering_bench *unused)
{
    (void)unused;
    ask(STEER_RESTORE, 1, 0, 0.0);
}

static void a_refused_way_back_moves_no_deadline(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_REAL, 20);

    (void)state;
    sb.each_tick = ask_in_vain;
    bench_run(bench);
    assert_int_equal(bench->sleeps, 19);
    for (size_t i = 0; i < 19; i++) {
        assert_int_equal(bench->deadline[i], START + (int64_t)(i + 1) * TICK);
    }
    destroy(bench);
}

static void slots_are_checked(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 5);
    uint64_t t;

    (void)state;
    ask(STEER_CHECKPOINT, 0, 0, 0.0);
    ask(STEER_CHECKPOINT, STEERING_SLOTS, 0, 0.0);
    ask(STEER_RESTORE, STEERING_SLOTS, 0, 0.0);
    ask(STEER_RESTORE, 1, 0, 0.0);
    t = ask(STEER_RESTORE, 0, 0, 0.0);
    bench_run(bench);
    answer(1, STEER_RANGE);
    answer(2, STEER_RANGE);
    answer(3, STEER_RANGE);
    answer(4, STEER_EMPTY);
    answer(t, STEER_OK);
    destroy(bench);
}

static void tunables_are_checked_and_seen(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 5);

    (void)state;
    assert_int_equal(steering_find(sb.steering, "supply_v"), 1);
    assert_int_equal(steering_find(sb.steering, "supply"), -1);
    ask(STEER_SET, 0, 0, 11.0);
    ask(STEER_SET, 0, 0, 1.5); /* whole only */
    ask(STEER_SET, 2, 0, 1.0);
    ask(STEER_SET, 1, 0, NAN);
    ask(STEER_SET, 1, 0, -4.5);
    ask(STEER_FAULT, 2, 0, 0.0);
    ask(STEER_PUSH, 0, 0, 0.0); /* this machine has no bodies */
    bench_run(bench);
    answer(1, STEER_RANGE);
    answer(2, STEER_RANGE);
    answer(3, STEER_RANGE);
    answer(4, STEER_RANGE);
    answer(5, STEER_OK);
    answer(6, STEER_RANGE);
    answer(7, STEER_UNAVAILABLE);
    assert_int_equal(sb.sets, 1);
    assert_true(steering_value(sb.steering, 1) == -4.5);
    destroy(bench);
}

static void an_asker_who_never_listens_only_stops_being_heard(void **state)
{
    struct bench *bench = create(LOOP_CLOCK_FREE, 100);
    struct steer_request request = {.kind = STEER_FAULT, .index = 1, .on = true};
    struct steer_answer got;
    size_t asked = 0, answered = 0;

    (void)state;
    while (steering_ask(sb.steering, &request)) {
        asked++;
    }
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 100);
    while (steering_answer(sb.steering, &got)) {
        answered++;
    }
    assert_int_equal(answered, asked);
    destroy(bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pause_in_real_time_costs_no_deadline),
        cmocka_unit_test(the_grid_begins_anew_at_resume),
        cmocka_unit_test(a_loop_that_stands_still_can_be_ended),
        cmocka_unit_test(what_waits_at_the_end_is_answered),
        cmocka_unit_test(steps_end_where_they_should),
        cmocka_unit_test(a_step_under_way_refuses_others_and_is_cut_by_a_pause),
        cmocka_unit_test(a_step_of_nothing_is_refused),
        cmocka_unit_test(a_step_ends_with_the_run),
        cmocka_unit_test(a_step_plays_the_part_of_a_step_frame),
        cmocka_unit_test(a_pause_interrupts_a_step_frame_and_its_rest_follows),
        cmocka_unit_test(step_frames_wait_during_a_pause),
        cmocka_unit_test(requests_do_not_begin_the_silence_anew),
        cmocka_unit_test(speed_scales_the_grid_and_what_an_overrun_is),
        cmocka_unit_test(real_time_without_a_pace_waits_for_nothing),
        cmocka_unit_test(free_run_can_be_paced_and_counts_nothing),
        cmocka_unit_test(a_slow_loop_hears_requests_between_its_ticks),
        cmocka_unit_test(speeds_out_of_range_are_refused),
        cmocka_unit_test(time_goes_back_and_the_run_ends_at_its_length),
        cmocka_unit_test(a_refused_way_back_moves_no_deadline),
        cmocka_unit_test(slots_are_checked),
        cmocka_unit_test(tunables_are_checked_and_seen),
        cmocka_unit_test(an_asker_who_never_listens_only_stops_being_heard),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
