/* SPDX-License-Identifier: Apache-2.0 */
/* The loop in real time and free run, on a scripted clock: the grid, the order of a tick, its
 * frames, and the ends of a run. What happens when it is late is in overrun.c. */
#include "loop_bench.h"

#include <unistd.h>

TEST(the_grid_does_not_drift)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 3000);

    bench->wake_late = 37123;
    bench->work[PHASE_PLANT] = 613007;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(bench->sleeps, 2999); /* the first tick begins at once */
    for (size_t i = 0; i < bench->sleeps; i++) {
        assert_int_equal(bench->deadline[i], START + (int64_t)(i + 1) * TICK);
    }
    assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    assert_int_equal(loop_stats(bench->loop)->wakeup.count, 2999);
    assert_int_equal(loop_stats(bench->loop)->wakeup.max, 37123);
}

TEST(a_tick_has_its_order)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 2);
    struct bus_frame frame = frame_make(0x123, 1, (const uint8_t[]){7});

    bench->config.machine.controller = bench_controller;
    can_send(bench->host[0], &frame, 1);
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(bench->calls, 18);
    assert_memory_equal(bench->order, "ircpstttuicpstttux", 18);
    assert_int_equal(bench->sleeps, 0);
}

TEST(what_is_due_begins_before_the_wait_of_each_tick)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);

    bench_run(bench);
    assert_int_equal(bench->begins, 10);
    assert_int_equal(bench->begun_ns, 9 * TICK);
    assert_int_equal(bench->begun_at, bench->deadline[bench->sleeps - 1] - TICK + TICK / 10);
}

TEST(a_machine_may_leave_everything_out)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 10);

    bench->config.machine = (struct loop_machine){0};
    bench->config.tick_ns = 0;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_int_equal(loop_stats(bench->loop)->time_ns, 10 * CLOCK_MS);
}

/* Frames recorded of three ticks with two frames sent on each bus, and one received. */
static uint64_t frames_recorded(enum loop_recording recording)
{
    static const char *const names[] = {"can0", "can1", "can2"};
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 3);
    char folder[] = "/tmp/loop_recording_XXXXXX";
    const struct recorder_config config = {
        .directory = mkdtemp(folder), .lossless = true, .nbus = BENCH_BUSES, .bus = names};
    struct bus_frame frame = frame_make(0x123, 0, NULL);
    struct recorder_counters counters;
    char path[64];
    struct error error;

    assert_ok(recorder_open(&config, &bench->arena, &bench->config.recorder, &error));
    bench->config.recording = recording;
    can_send(bench->host[0], &frame, 1);
    bench_run(bench);
    assert_ok(recorder_close(bench->config.recorder, &counters, &error));
    snprintf(path, sizeof path, "%s/candump.log", folder);
    unlink(path);
    snprintf(path, sizeof path, "%s/signals.csv", folder);
    unlink(path);
    rmdir(folder);
    return counters.frames;
}

TEST(who_records_frames_is_a_setting)
{
    assert_int_equal(frames_recorded(LOOP_RECORD_ALL), 3 * 2 * BENCH_BUSES + 1);
    assert_int_equal(frames_recorded(LOOP_RECORD_UNCARRIED), 0);
}

TEST(buses_are_drained_in_their_order)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 1);

    for (size_t i = 0; i < 600; i++) {
        struct bus_frame frame = frame_make((uint32_t)i, 0, NULL);

        can_send(bench->host[2 - i % 3], &frame, 1);
    }
    bench_run(bench);
    assert_int_equal(bench->received_count, 600);
    for (size_t i = 0; i < 600; i++) {
        assert_int_equal(bench->received_bus[i], i / 200);
        assert_int_equal(bench->received[i].id, 3 * (i % 200) + 2 - i / 200);
    }
}

TEST(what_is_sent_arrives_at_the_host)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 3);
    struct bus_frame frames[16];

    bench_run(bench);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        assert_int_equal(can_receive(bench->host[b], frames, 16), 6);
        assert_int_equal(frames[5].id, 0x101);
        assert_int_equal(frames[5].data[0], 2);
    }
}

static void stop_at_ten(struct bench *bench)
{
    if (bench->tick == 10) {
        loop_stop(bench->loop);
    }
}

TEST(a_stop_ends_after_the_tick_with_motors_off)
{
    static const enum loop_clock clocks[] = {LOOP_CLOCK_REAL, LOOP_CLOCK_FREE};

    for (size_t i = 0; i < 2; i++) {
        struct bench *bench = bench_create(clocks[i], 0);

        bench->on_tick = stop_at_ten;
        assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
        assert_int_equal(loop_stats(bench->loop)->ticks, 10);
        assert_int_equal(bench->shut_downs, 1);
        assert_int_equal(bench->order[bench->calls - 1], 'x');
    }
}

TEST(a_finished_controller_gets_its_last_tick)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 0);

    bench->config.machine.controller = bench_controller;
    bench->controller_ticks = 5;
    assert_int_equal(bench_run(bench), LOOP_END_CONTROLLER);
    assert_int_equal(loop_stats(bench->loop)->ticks, 5);
}

static void break_at_four(struct bench *bench)
{
    bench->broken = bench->tick == 4;
}

TEST(a_failing_model_ends_the_run)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 0);

    bench->on_tick = break_at_four;
    assert_int_equal(bench_run(bench), LOOP_END_MODEL);
    assert_int_equal(loop_stats(bench->loop)->ticks, 5);
    assert_int_equal(bench->shut_downs, 1);
}

static void bus_goes_and_loses(struct bench *bench)
{
    if (bench->tick == 3) {
        bench->port[2]->state = CAN_PORT_GONE;
    }
    if (bench->tick == 5) {
        bench->port[1]->counters.rx_dropped += 17;
        bench->port[0]->counters.tx_dropped += 4;
    }
}

TEST(a_bus_that_goes_is_an_event_and_the_loop_goes_on)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 10);
    struct loop_event event;

    bench->on_tick = bus_goes_and_loses;
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    assert_true(loop_next_event(bench->loop, &event));
    assert_int_equal(event.kind, LOOP_EVENT_BUS_STATE);
    assert_int_equal(event.bus, 2);
    assert_int_equal(event.b, CAN_PORT_GONE);
    assert_true(loop_next_event(bench->loop, &event));
    assert_int_equal(event.kind, LOOP_EVENT_FRAMES_LOST);
    assert_int_equal(event.a, 17);
    assert_int_equal(event.b, 4);
    assert_false(loop_next_event(bench->loop, &event));
}

TEST(events_that_find_the_ring_full_are_counted)
{
    struct bench *bench = bench_create(LOOP_CLOCK_REAL, 3000);
    struct loop_event event;
    uint64_t lost;

    bench->work[PHASE_PLANT] = 2 * TICK;
    bench_run(bench);
    lost = loop_stats(bench->loop)->events_lost;
    assert_int_equal(lost + bench_events(bench, LOOP_EVENT_OVERRUN, &event), 3000);
    assert_true(lost > 0);
}

TEST(phases_are_timed)
{
    struct bench *bench = bench_create(LOOP_CLOCK_FREE, 100);
    const struct loop_stats *stats;

    for (int p = PHASE_BOARDS; p <= PHASE_PUBLISH; p++) {
        bench->work[p] = 1000 * p;
    }
    bench_run(bench);
    stats = loop_stats(bench->loop);
    for (int p = PHASE_BOARDS; p <= PHASE_PUBLISH; p++) {
        assert_int_equal(stats->phase[p].count, 100);
        assert_int_equal(stats->phase[p].sum, 100000 * p);
    }
    assert_int_equal(stats->work.sum, 100000 * (2 + 3 + 4 + 5 + 6));
    assert_int_equal(stats->end_ns - stats->start_ns, stats->work.sum);
}
