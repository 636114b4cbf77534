/* SPDX-License-Identifier: Apache-2.0 */
/* The loop in lockstep, with a host on local buses that sends STEP and reads DONE. */
#include "loop_bench.h"

enum { STEP_BUS = 1 };

static struct bus_frame step_frame(uint32_t tick, uint16_t count)
{
    uint8_t data[LOCKSTEP_LENGTH];

    put_u32_le(data, tick);
    put_u16_le(data + 4, count);
    return frame_make(LOCKSTEP_STEP_ID, LOCKSTEP_LENGTH, data);
}

static void send_step(struct bench *bench, uint32_t tick, uint16_t count)
{
    struct bus_frame frame = step_frame(tick, count);

    assert_int_equal(can_send(bench->host[STEP_BUS], &frame, 1), 1);
}

static void send_frame(struct bench *bench, size_t bus, uint32_t id)
{
    struct bus_frame frame = frame_make(id, 0, NULL);

    assert_int_equal(can_send(bench->host[bus], &frame, 1), 1);
}

/* The DONE frames that wait on a bus (at most 16 are kept); others are left out */
struct done_list {
    size_t count, before; /* frames that came before the first */
    uint32_t tick[16];
    uint16_t flags[16];
};

static struct done_list read_done(struct bench *bench, size_t bus)
{
    struct done_list list = {0};
    struct bus_frame frame;

    while (can_receive(bench->host[bus], &frame, 1)) {
        if (frame.id != LOCKSTEP_DONE_ID) {
            list.before += list.count == 0;
            continue;
        }
        assert_int_equal(frame.len, LOCKSTEP_LENGTH);
        assert_true(list.count < 16);
        list.tick[list.count] = get_u32_le(frame.data);
        list.flags[list.count++] = get_u16_le(frame.data + 4);
    }
    return list;
}

static void stop_now(struct bench *bench)
{
    loop_stop(bench->loop);
}

TEST(a_step_runs_a_tick_and_is_answered_on_every_bus_after_its_frames)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    send_step(bench, 0, 1);
    bench->on_wait = stop_now;
    assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
    assert_int_equal(loop_stats(bench->loop)->ticks, 1);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        struct done_list list = read_done(bench, b);

        assert_int_equal(list.count, 2);
        assert_int_equal(list.before, 2);
        assert_int_equal(list.tick[0], 1);
        assert_int_equal(list.flags[0], 0);
        assert_int_equal(list.tick[1], 1);
        assert_int_equal(list.flags[1], LOCKSTEP_STOPPING);
    }
}

/* The buses on which something was sent, in that order, with the time of each last frame */
static struct {
    size_t (*send)(struct can_port *port, const struct bus_frame *frames, size_t count);
    struct can_port *const *port;
    size_t count, bus[64];
    struct bus_frame last[64];
} sent;

static size_t note_and_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    size_t bus = 0;

    while (sent.port[bus] != port) {
        bus++;
    }
    assert_true(sent.count < 64);
    sent.bus[sent.count] = bus;
    sent.last[sent.count++] = frames[count - 1];
    return sent.send(port, frames, count);
}

TEST(done_of_the_bus_of_the_step_is_the_last_frame_and_all_have_the_time)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    static struct can_port_ops ops; /* the next test closes the ports by it */

    ops = *bench->port[0]->ops;
    memset(&sent, 0, sizeof sent);
    sent.send = ops.send;
    sent.port = bench->port;
    ops.send = note_and_send;
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        bench->port[b]->ops = &ops;
    }
    send_step(bench, 0, 3);
    bench->on_wait = stop_now;
    bench_run(bench);

    /* Three ticks, DONE, and DONE of the end */
    assert_int_equal(sent.count, 5 * BENCH_BUSES);
    for (size_t i = 0; i < sent.count; i++) {
        bool done = i >= 3 * BENCH_BUSES;

        assert_int_equal(sent.last[i].id == LOCKSTEP_DONE_ID, done);
        if (done) {
            assert_int_equal(sent.last[i].time_ns, 3 * TICK);
            assert_int_equal(sent.bus[i] == STEP_BUS, i % BENCH_BUSES == BENCH_BUSES - 1);
        }
    }
}

TEST(zero_ticks_mean_one_and_several_are_answered_once)
{
    static const struct {
        uint16_t count;
        uint32_t ticks;
    } cases[] = {{0, 1}, {1, 1}, {2, 2}, {7, 7}, {1000, 1000}, {65535, 65535}};

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
        struct done_list list;

        bench->send_count = 0;
        send_step(bench, 0, cases[i].count);
        bench->on_wait = stop_now;
        bench_run(bench);
        assert_int_equal(loop_stats(bench->loop)->ticks, cases[i].ticks);
        list = read_done(bench, 2);
        assert_int_equal(list.count, 2);
        assert_int_equal(list.tick[0], cases[i].ticks);
    }
}

TEST(a_step_of_another_tick_is_refused_with_the_true_one)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct loop_event event;

    send_step(bench, 0, 3);
    send_step(bench, 2, 1);
    send_step(bench, 4, 1);
    send_step(bench, 3, 1);
    bench->on_wait = stop_now;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 4);
    assert_int_equal(loop_stats(bench->loop)->lockstep.mismatches, 2);
    for (size_t b = 0; b < BENCH_BUSES; b++) {
        struct done_list list = read_done(bench, b);

        assert_int_equal(list.count, 5);
        assert_int_equal(list.flags[1], LOCKSTEP_MISMATCH);
        assert_int_equal(list.tick[1], 3);
        assert_int_equal(list.flags[2], LOCKSTEP_MISMATCH);
        assert_int_equal(list.tick[2], 3);
        assert_int_equal(list.flags[3], 0);
        assert_int_equal(list.tick[3], 4);
    }
    assert_int_equal(bench_events(bench, LOOP_EVENT_STEP_MISMATCH, &event), 2);
    assert_int_equal(event.a, 4);
    assert_int_equal(event.b, 3);
}

TEST(malformed_steps_are_counted_and_not_answered)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct bus_frame frame = step_frame(0, 1);
    struct loop_event event;

    for (uint8_t len = 0; len <= 8; len++) {
        frame.len = len;
        if (len != LOCKSTEP_LENGTH) {
            can_send(bench->host[STEP_BUS], &frame, 1);
        }
    }
    frame = step_frame(0, 1);
    frame.flags = FRAME_REMOTE;
    memset(frame.data, 0, sizeof frame.data);
    can_send(bench->host[STEP_BUS], &frame, 1);
    /* An extended identifier of the same number is another frame, as is one on another bus */
    frame = step_frame(0, 1);
    frame.flags = FRAME_EXTENDED;
    can_send(bench->host[STEP_BUS], &frame, 1);
    frame = step_frame(0, 1);
    can_send(bench->host[0], &frame, 1);
    bench->on_wait = stop_now;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 0);
    assert_int_equal(loop_stats(bench->loop)->lockstep.malformed, 9);
    assert_int_equal(read_done(bench, STEP_BUS).count, 1); /* stopping */
    assert_int_equal(bench_events(bench, LOOP_EVENT_STEP_MALFORMED, &event), 9);
}

TEST(frames_before_the_step_belong_to_it_and_frames_after_it_to_the_next)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    static const uint32_t ids[] = {0x10, 0x20, 0x21, 0x30, 0x22, 0x23};
    static const uint64_t ticks[] = {0, 0, 0, 0, 2, 2};

    send_frame(bench, STEP_BUS, 0x20);
    send_frame(bench, 2, 0x30);
    send_frame(bench, 0, 0x10);
    send_frame(bench, STEP_BUS, 0x21);
    send_step(bench, 0, 2);
    send_frame(bench, STEP_BUS, 0x22);
    send_frame(bench, STEP_BUS, 0x23);
    send_step(bench, 2, 1);
    send_frame(bench, STEP_BUS, 0x24);
    bench->on_wait = stop_now;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 3);
    assert_int_equal(bench->received_count, 6);
    for (size_t i = 0; i < 6; i++) {
        assert_int_equal(bench->received[i].id, ids[i]);
        assert_int_equal(bench->received_tick[i], ticks[i]);
    }
}

TEST(talk_without_a_step_goes_to_the_boards_and_is_not_lost)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    for (uint32_t i = 0; i < 3000; i++) {
        send_frame(bench, STEP_BUS, i % 0x600);
    }
    send_step(bench, 0, 1);
    bench->on_wait = stop_now;
    bench_run(bench);
    assert_int_equal(bench->received_count, 3000);
    for (uint32_t i = 0; i < 3000; i++) {
        assert_int_equal(bench->received[i].id, i % 0x600);
    }
    assert_int_equal(loop_stats(bench->loop)->ticks, 1);
}

static void come_back_after_ten_seconds(struct bench *bench)
{
    if (bench->now - START >= 10 * CLOCK_SECOND && bench->tick == 0) {
        send_step(bench, 0, 1);
    } else if (bench->tick) {
        loop_stop(bench->loop);
    }
}

TEST(a_silent_partner_is_reported_at_growing_distances_and_waited_for)
{
    static const int64_t reports[] = {1, 3, 7};
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct loop_event event;

    bench->on_wait = come_back_after_ten_seconds;
    assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
    for (size_t i = 0; i < 3; i++) {
        assert_true(loop_next_event(bench->loop, &event));
        assert_int_equal(event.kind, LOOP_EVENT_SILENT);
        assert_int_equal(event.a, reports[i] * CLOCK_SECOND);
        assert_int_equal(event.bus, STEP_BUS);
    }
    assert_true(loop_next_event(bench->loop, &event));
    assert_int_equal(event.kind, LOOP_EVENT_BACK);
    assert_false(loop_next_event(bench->loop, &event));
    assert_int_equal(loop_stats(bench->loop)->ticks, 1);
    assert_int_equal(loop_stats(bench->loop)->lockstep.silences, 1);
}

/* Starts at tick 0, forgets everything at tick 5 and takes the tick from the refusal */
static void forgetful_host(struct bench *bench)
{
    struct done_list list = read_done(bench, STEP_BUS);
    uint32_t tick = list.count ? list.tick[list.count - 1] : 0;

    if (bench->tick == 5 && list.count && !(list.flags[list.count - 1] & LOCKSTEP_MISMATCH)) {
        tick = 0;
    }
    if (bench->tick == 8) {
        loop_stop(bench->loop);
    }
    send_step(bench, tick, 1);
}

TEST(the_host_may_start_again)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    bench->on_wait = forgetful_host;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 8);
    assert_int_equal(loop_stats(bench->loop)->lockstep.mismatches, 1);
}

/* Comes from an older simulator that had got to tick 100 */
static void older_host(struct bench *bench)
{
    struct done_list list = read_done(bench, STEP_BUS);

    send_step(bench, list.count ? list.tick[list.count - 1] : 100, 1);
    if (bench->tick == 3) {
        loop_stop(bench->loop);
    }
}

TEST(the_simulator_may_start_again)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    bench->on_wait = older_host;
    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->ticks, 3);
    assert_int_equal(loop_stats(bench->loop)->lockstep.mismatches, 1);
}

static void lose_in_the_second_tick(struct bench *bench)
{
    bench->fault = bench->tick == 3;
    if (bench->tick == 1) {
        bench->port[0]->counters.rx_dropped += 3;
    }
}

TEST(flags_tell_of_lost_frames_and_faults)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct done_list list;

    for (uint32_t tick = 0; tick < 6; tick++) {
        send_step(bench, tick, 1);
    }
    bench->on_tick = lose_in_the_second_tick;
    bench->on_wait = stop_now;
    bench_run(bench);
    list = read_done(bench, 0);
    assert_int_equal(list.count, 7);
    for (size_t i = 0; i < 6; i++) {
        assert_int_equal(list.flags[i], i == 1 ? LOCKSTEP_OVERRUN : i == 3 ? LOCKSTEP_FAULT : 0);
    }
}

TEST(flags_of_the_ticks_of_one_step_are_gathered)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);
    struct done_list list;

    send_step(bench, 0, 6);
    bench->on_tick = lose_in_the_second_tick;
    bench->on_wait = stop_now;
    bench_run(bench);
    list = read_done(bench, 0);
    assert_int_equal(list.count, 2);
    assert_int_equal(list.tick[0], 6);
    assert_int_equal(list.flags[0], LOCKSTEP_OVERRUN | LOCKSTEP_FAULT);
}

TEST(the_length_of_the_run_ends_it_within_a_step)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 4);
    struct done_list list;

    send_step(bench, 0, 100);
    assert_int_equal(bench_run(bench), LOOP_END_LENGTH);
    list = read_done(bench, 1);
    assert_int_equal(list.count, 1);
    assert_int_equal(list.tick[0], 4);
    assert_int_equal(list.flags[0], LOCKSTEP_STOPPING);
}

static bool stepping_controller(void *context, int64_t time_ns)
{
    struct bench *bench = context;

    if (bench->controlled == bench->tick) {
        send_step(bench, (uint32_t)bench->tick, 1);
    }
    return bench_controller(context, time_ns);
}

TEST(an_inline_controller_steps_without_waiting)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    bench->config.machine.controller = stepping_controller;
    bench->controller_ticks = 50;
    assert_int_equal(bench_run(bench), LOOP_END_CONTROLLER);
    assert_int_equal(loop_stats(bench->loop)->ticks, 50);
    assert_int_equal(bench->waits, 0);
}

/* Ends the run when the next STEP waits already. */
static bool ending_controller(void *context, int64_t time_ns)
{
    struct bench *bench = context;

    if (time_ns == 2 * TICK) {
        send_step(bench, 2, 1);
        loop_stop(bench->loop);
    }
    return true;
}

TEST(a_controller_ends_the_run_before_a_step_that_waits)
{
    struct bench *bench = bench_create(LOOP_CLOCK_LOCKSTEP, 0);

    bench->config.machine.controller = ending_controller;
    send_step(bench, 0, 2);
    assert_int_equal(bench_run(bench), LOOP_END_STOPPED);
    assert_int_equal(loop_stats(bench->loop)->ticks, 2);
}
