/* SPDX-License-Identifier: Apache-2.0 */
/* The host's side of lockstep on two buses: STEP sent once and again, DONE, refusals, lost ones. */
#include "tests/unit/tasks/host_bench.h"

#define MS INT64_C(1000000)

enum { STEP = 0x6f0, DONE = 0x6ff, REFUSED = 1 << 2 };

static inline void set_up(struct bench *bench)
{
    struct host_config config = {.nbus = 2,
                                 .period_ns = MS,
                                 .supply_v = 48.0,
                                 .lockstep = true,
                                 .step_id = STEP,
                                 .done_id = DONE};

    bench_open(bench, &config);
}

static void say_done(struct bench *bench, int bus, uint32_t tick, uint16_t flags)
{
    say(bench, bus, DONE, 6,
        (const uint8_t[]){(uint8_t)tick, (uint8_t)(tick >> 8), 0, 0, (uint8_t)flags, 0});
}

/* the tick of the STEP that the host has sent, -1 when it has not */
static int take_step(struct bench *bench)
{
    struct bus_frame frame;
    int tick = -1;

    while (can_receive(bench->board_port[0], &frame, 1)) {
        assert_int_equal(frame.id, STEP);
        assert_int_equal(frame.len, 6);
        assert_int_equal(tick, -1);
        tick = frame.data[0] | frame.data[1] << 8;
    }
    return tick;
}

/* the host and a simulator that is at this tick find each other */
static void meet(struct bench *bench, uint32_t tick)
{
    host_send(bench->host);
    assert_int_equal(take_step(bench), 0);
    say_done(bench, 0, tick, REFUSED);
    say_done(bench, 1, tick, REFUSED);
    assert_true(host_receive(bench->host, 0));
    host_send(bench->host);
    assert_int_equal(take_step(bench), tick);
}

BENCH(set_up, struct bench, bench_close)

TEST_ON(a_tick_is_over_when_every_bus_says_so, set_up, bench)
{
    meet(bench, 1000);
    assert_false(host_receive(bench->host, 0));
    say_done(bench, 1, 1001, 0);
    assert_false(host_receive(bench->host, 0));
    say_done(bench, 0, 1001, 0);
    assert_true(host_receive(bench->host, 0));
    assert_int_equal(host_time_ns(bench->host), 1001 * MS);
}

TEST_ON(a_step_that_is_sent_again_is_the_same, set_up, bench)
{
    meet(bench, 1000);
    say_done(bench, 0, 1001, 0); /* the other one is late, or lost */
    assert_false(host_receive(bench->host, 0));
    host_repeat_step(bench->host, 1);
    assert_int_equal(take_step(bench), -1);
    host_repeat_step(bench->host, 1 + 100 * MS);
    assert_int_equal(take_step(bench), 1000);
}

TEST_ON(the_refusal_of_a_copy_stands_for_a_lost_done, set_up, bench)
{
    meet(bench, 1000);
    say_done(bench, 0, 1001, 0);
    say_done(bench, 0, 1001, REFUSED);
    assert_false(host_receive(bench->host, 0));
    say_done(bench, 1, 1001, REFUSED);
    assert_true(host_receive(bench->host, 0));
    assert_int_equal(host_time_ns(bench->host), 1001 * MS);
}

TEST_ON(the_refusal_of_an_earlier_copy_changes_nothing, set_up, bench)
{
    meet(bench, 1000);
    say_done(bench, 0, 1001, 0);
    say_done(bench, 1, 1001, 0);
    assert_true(host_receive(bench->host, 0));
    host_send(bench->host);
    /* bus 0 is ahead of bus 1, which still tells of the copy */
    say_done(bench, 0, 1001, REFUSED);
    say_done(bench, 0, 1002, 0);
    say_done(bench, 1, 1001, REFUSED);
    assert_false(host_receive(bench->host, 0));
    say_done(bench, 1, 1002, 0);
    assert_true(host_receive(bench->host, 0));
    assert_int_equal(host_time_ns(bench->host), 1002 * MS);
}

TEST_ON(a_simulator_that_was_restarted_is_noticed, set_up, bench)
{
    meet(bench, 1000);
    say_done(bench, 0, 990, REFUSED); /* it went back a little: follow it */
    assert_true(host_receive(bench->host, 0));
    assert_false(host_lost(bench->host));
    host_send(bench->host);
    say_done(bench, 0, 0, REFUSED);
    assert_true(host_receive(bench->host, 0));
    assert_true(host_lost(bench->host));
    assert_string_equal(host_message(bench->host), "the simulator was restarted: it is at tick 0");
}
