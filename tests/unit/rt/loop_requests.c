/* SPDX-License-Identifier: Apache-2.0 */
/* What the loop makes of requests, by the scripted clock: standing still, going on, steps,
 * lockstep. Speed, the way back and tunables: loop_requests_speed.c. */
#include "tests/unit/rt/request_bench.h"

/* ---- standing still ---- */

TEST(a_pause_in_real_time_costs_no_deadline)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 100);
    struct loop_event event;
    const struct loop_stats *stats;

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
    assert_int_equal(answer(1, REQUEST_OK).tick, 40);
    assert_int_equal(answer(2, REQUEST_OK).tick, 40);
    assert_int_equal(bench_events(bench, LOOP_EVENT_PAUSED, &event), 1);
}

TEST(the_grid_begins_anew_at_resume)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 20);
    int64_t first;

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
}

/* A request that comes while the loop sleeps ends the sleep, once; one that comes in a tick does
 * not end a later sleep. */
TEST(a_request_wakes_a_loop_that_sleeps)
{
    struct bench *bench = requested_create(LOOP_CLOCK_REAL, 100);

    sb.paused_at = 40;
    sb.waits_left = 5;
    sb.on_paused = go_on;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(sb.waits, 6);
    assert_int_equal(bench->woken, 1);
}

static void ask_69(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets < 69) {
        ask(REQUEST_FAULT, 1, 0, 0.0);
    }
}

/* The ring of answers has room for 64. The others wait, and are carried out when it has again. */
TEST(requests_wait_until_their_answers_have_room)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 100);
    struct request_answer unread;

    sb.each_tick = ask_69;
    bench_run(bench);
    assert_int_equal(sb.faults, 64);
    for (uint64_t ticket = 1; ticket <= 64; ticket++) {
        answer(ticket, REQUEST_OK);
    }
    assert_false(requests_answer(sb.requests, &unread));
}

static void stop_it(struct request_bench *unused)
{
    (void)unused;
    loop_stop(sb.bench->loop);
}

TEST(a_loop_that_stands_still_can_be_ended)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_LOCKSTEP, LOOP_CLOCK_FREE};

    for (int i = 0; i < 3; i++) {
        struct bench *bench = requested_create(clocks[i], 0);

        ask(REQUEST_PAUSE, 0, 0, 0.0);
        sb.waits_left = 2;
        sb.on_paused = stop_it;
        assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
        assert_int_equal(loop_stats(bench->loop)->ticks, 0);
        assert_int_equal(bench->shut_downs, 1);
    }
}

static void ask_two_and_stop(struct request_bench *unused)
{
    (void)unused;
    loop_stop(sb.bench->loop);
    ask(REQUEST_SPEED, 0, 0, 1.0);
}

TEST(what_waits_at_the_end_is_answered)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 0);
    struct loop_request late = {.kind = REQUEST_PAUSE};

    sb.each_tick = NULL;
    ask(REQUEST_PAUSE, 0, 0, 0.0);
    sb.waits_left = 0;
    sb.on_paused = ask_two_and_stop;
    bench_run(bench);
    answer(1, REQUEST_OK);
    answer(2, REQUEST_OK); /* came before the loop looked at its end */
    no_answer();
    assert_false(requests_ask(sb.requests, &late));
}

/* ---- steps ---- */

static void step_5_then_go_on(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(REQUEST_STEP, 0, 5, 0.0);
        sb.waits_left = 2;
    } else {
        ask(REQUEST_RESUME, 0, 0, 0.0);
    }
}

TEST(steps_end_where_they_should)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    for (int i = 0; i < 2; i++) {
        struct bench *bench = requested_create(clocks[i], 30);

        sb.paused_at = 10;
        sb.on_paused = step_5_then_go_on;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(answer(1, REQUEST_OK).tick, 10);
        assert_int_equal(answer(2, REQUEST_OK).tick, 15);
        assert_int_equal(answer(3, REQUEST_OK).tick, 15);
        assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    }
}

static void ask_while_it_steps(struct request_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 12) {
        ask(REQUEST_STEP, 0, 1, 0.0);
        ask(REQUEST_RESUME, 0, 0, 0.0);
        ask(REQUEST_RESTORE, 1, 0, 0.0);
        ask(REQUEST_FAULT, 1, 0, 0.0);
    } else if (sb.bench->tick == 14) {
        ask(REQUEST_PAUSE, 0, 0, 0.0);
    }
}

static void step_100_then_stop(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(REQUEST_STEP, 0, 100, 0.0);
        sb.waits_left = 1;
    } else {
        loop_stop(sb.bench->loop);
    }
}

TEST(a_step_under_way_refuses_others_and_is_cut_by_a_pause)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 0);

    sb.paused_at = 10;
    sb.each_tick = ask_while_it_steps;
    sb.on_paused = step_100_then_stop;
    bench_run(bench);
    answer(1, REQUEST_OK);
    answer(3, REQUEST_BUSY);
    answer(4, REQUEST_BUSY);
    answer(5, REQUEST_BUSY);
    answer(6, REQUEST_OK);
    assert_int_equal(answer(2, REQUEST_CUT).tick, 14);
    assert_int_equal(answer(7, REQUEST_OK).tick, 14);
    assert_int_equal(sb.faults, 1);
}

TEST(a_step_of_nothing_is_refused)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 3);

    ask(REQUEST_STEP, 0, 0, 0.0);
    bench_run(bench);
    answer(1, REQUEST_RANGE);
}

TEST(a_step_ends_with_the_run)
{
    struct bench *bench = requested_create(LOOP_CLOCK_FREE, 3);

    ask(REQUEST_STEP, 0, 7, 0.0);
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(answer(1, REQUEST_CUT).tick, 3);
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

static void step_4_then_stop(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(REQUEST_STEP, 0, 4, 0.0);
        sb.waits_left = 3;
    } else {
        loop_stop(sb.bench->loop);
    }
}

TEST(a_step_plays_the_part_of_a_step_frame)
{
    struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 0);
    uint8_t data[8] = {1, 2, 3};
    struct bus_frame command = frame_make(0x123, 8, data);
    uint32_t tick;

    ask(REQUEST_PAUSE, 0, 0, 0.0);
    /* On the STEP's bus: what comes before a STEP belongs to the step, the STEP waits */
    can_send(bench->host[1], &command, 1);
    send_step(bench, 0, 2);
    can_send(bench->host[1], &command, 1);
    sb.on_paused = step_4_then_stop;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 4);
    assert_int_equal(answer(1, REQUEST_OK).tick, 0);
    assert_int_equal(answer(2, REQUEST_OK).tick, 4);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(dones(bench, b, &tick), 1);
        assert_int_equal(tick, 4);
    }
    assert_int_equal(bench->received_count, 1);
    assert_int_equal(bench->received_tick[0], 0);
    assert_int_equal(loop_stats(bench->loop)->lockstep.steps, 0);
}

static void send_step_and_go_on(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        assert_int_equal(sb.bench->tick, 3); /* three of the STEP's ten have run */
        ask(REQUEST_STEP, 0, 2, 0.0);
        sb.waits_left = 1;
    } else if (sb.tickets == 2) {
        assert_int_equal(sb.bench->tick, 5);
        ask(REQUEST_RESUME, 0, 0, 0.0);
    }
}

TEST(a_pause_interrupts_a_step_frame_and_its_rest_follows)
{
    struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 10);
    uint32_t tick;

    send_step(bench, 0, 10);
    sb.paused_at = 3;
    sb.on_paused = send_step_and_go_on;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(answer(1, REQUEST_OK).tick, 3);
    assert_int_equal(answer(2, REQUEST_OK).tick, 5);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(dones(bench, b, &tick), 1);
        assert_int_equal(tick, 10);
    }
}

/* As on_wait, and ends a loop that waits for a STEP in vain. */
static void on_wait_or_end(struct bench *bench)
{
    on_wait(bench);
    if (bench->waits > 40) {
        loop_stop(bench->loop);
    }
}

/* Checkpoint after three of a STEP's ten ticks, and back at tick back_at. */
static void keep_at_3(struct request_bench *unused)
{
    (void)unused;
    if (sb.bench->tick == 3 && sb.backs == 0) {
        ask(REQUEST_CHECKPOINT, 1, 0, 0.0);
    } else if (sb.bench->tick == (uint64_t)sb.value && sb.backs == 0) {
        ask(REQUEST_RESTORE, 1, 0, 0.0);
    }
}

/* What the STEP's bus has held back since before the checkpoint, a command and the next STEP, is
 * there again after the way back: the command belongs to tick 10, both times. */
TEST(a_way_back_into_a_step_frame_runs_its_rest)
{
    static const struct {
        double back_at;
        size_t commands, dones;
    } table[] = {{7, 1, 2}, {10, 1, 3}, {12, 2, 4}};

    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 15);
        struct bus_frame command = frame_make(0x123, 0, NULL);
        uint32_t tick;

        send_step(bench, 0, 10);
        assert_int_equal(can_send(bench->host[1], &command, 1), 1);
        send_step(bench, 10, 2);
        send_step(bench, 12, 3);
        sb.value = table[i].back_at;
        sb.each_tick = keep_at_3;
        assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
        assert_int_equal(sb.backs, 1);
        assert_int_equal(answer(1, REQUEST_OK).tick, 3);
        assert_int_equal(answer(2, REQUEST_OK).tick, 3);
        assert_int_equal(bench->received_count, table[i].commands);
        for (size_t c = 0; c < table[i].commands; c++) {
            assert_int_equal(bench->received_tick[c], 10);
        }
        for (size_t b = 0; b < BENCH_BUSES; b++) {
            assert_int_equal(dones(bench, b, &tick), table[i].dones + 1);
            assert_int_equal(tick, 15);
        }
        assert_int_equal(loop_stats(bench->loop)->lockstep.mismatches, 0);
    }
}

static void step_6_then_look(struct request_bench *unused)
{
    (void)unused;
    if (sb.tickets == 1) {
        ask(REQUEST_STEP, 0, 6, 0.0);
        sb.waits_left = 1;
    } else if (sb.backs == 0) {
        assert_int_equal(sb.bench->tick, 6);
        ask(REQUEST_RESTORE, 1, 0, 0.0);
        ask(REQUEST_RESUME, 0, 0, 0.0);
        send_step(sb.bench, 3, 2);
    }
}

/* A requested step runs once: after the way back into it the next STEP frame is waited for. */
TEST(a_way_back_into_a_requested_step_waits_for_a_step)
{
    struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 0);
    uint32_t tick;

    ask(REQUEST_PAUSE, 0, 0, 0.0);
    sb.value = 100;
    sb.each_tick = keep_at_3;
    sb.on_paused = step_6_then_look;
    bench->on_wait = on_wait_or_end;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 5);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(dones(bench, b, &tick), 2);
        assert_int_equal(tick, 5);
    }
}

static void steps_wait_while_it_stands_still(struct request_bench *unused)
{
    (void)unused;
    assert_int_equal(sb.bench->tick, 0);
    ask(REQUEST_RESUME, 0, 0, 0.0);
}

TEST(step_frames_wait_during_a_pause)
{
    struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 2);
    struct loop_event event;

    ask(REQUEST_PAUSE, 0, 0, 0.0);
    send_step(bench, 0, 2);
    sb.waits_left = 40; /* four seconds: no silence is counted for them */
    sb.on_paused = steps_wait_while_it_stands_still;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(loop_stats(bench->loop)->lockstep.silences, 0);
    assert_int_equal(bench_events(bench, LOOP_EVENT_SILENT, &event), 0);
}

TEST(requests_do_not_begin_the_silence_anew)
{
    struct bench *bench = requested_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct loop_event event;

    bench->on_wait = ask_often_and_stop;
    bench_run(bench);
    /* Nine seconds: told after one, three and seven */
    assert_int_equal(bench_events(bench, LOOP_EVENT_SILENT, &event), 3);
}
