/* SPDX-License-Identifier: Apache-2.0 */
/* What every board has: a CAN node of its own, and the phases of a tick with the caller's time. */
#include "tests/unit/boards/board_bench.h"

/* Of bus 0, in the order of the configuration: boards 1, 2, 0x0C, 0x0D. */
static int node_of(unsigned address)
{
    switch (address) {
    case 1:
        return 0;
    case 2:
        return 1;
    case 0x0c:
        return 2;
    default:
        return 3;
    }
}

TEST_ON(every_frame_bears_the_number_of_its_board_on_its_bus, bench_open, bench)
{
    size_t seen[4] = {0};

    /* telemetry of the motor boards, then of the others, which send what the host starts */
    bench_send(bench, 0, 0x001, "49 7F 00 00 00");
    bench_send(bench, 0, 0x002, "49 7F 00 00 00");
    bench_send(bench, 0, 0x20c, "07 00");
    bench_send(bench, 0, 0x20d, "07 00");
    for (int tick = 0; tick < 40; tick++) {
        bench_say(bench, 0, 0x70f, "FF"); /* each board answers */
        for (size_t i = 0; i < bench->count[0]; i++) {
            const int node = node_of(bench->frame[0][i].id >> 4 & 0xf);

            assert_int_equal(bench->frame[0][i].node, node);
            seen[node]++;
        }
    }
    for (int node = 0; node < 4; node++) {
        assert_true(seen[node] > 40);
    }
}

TEST_ON(nodes_are_counted_anew_on_each_bus_and_stay_when_the_address_changes, bench_open, bench)
{
    bench_say(bench, 1, 0x70f, "FF");
    assert_int_equal(bench->count[1], 1);
    assert_int_equal(bench->frame[1][0].node, 0);
    bench_say(bench, 0, 0x002, "32 05"); /* SET_BOARD_ID */
    bench_say(bench, 0, 0x705, "FF");
    assert_int_equal(bench->count[0], 1);
    assert_int_equal(bench->frame[0][0].id >> 4 & 0xf, 5);
    assert_int_equal(bench->frame[0][0].node, 1);
}

TEST_ON(frames_show_what_was_sampled_whatever_the_sensors_do_afterwards, bench_configure, bench)
{
    const struct bus_frame *frame;

    bench->board[0].transmit_at_start = true;
    bench_start(bench);
    bench->sense[0].q = 0.5;
    bench_control(bench);
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
    bench->sense[0].q = 0.7;
    bench->count[0] =
        boards_transmit(bench->boards, bench->now_ns, 0, bench->frame[0], BENCH_FRAMES);
    frame = bench_find(bench, 0, 0x111);
    assert_non_null(frame);
    assert_int_equal(get_i32_le(frame->data), 0.5 * TICKS_PER_RAD);
}

/* A frame at the beginning of a tick, a fault that is seen in it. */
TEST_ON(events_bear_the_time_of_their_phase, bench_open, bench)
{
    struct board_event event;

    bench_ticks(bench, 5);
    bench_send(bench, 0, 0x001, "6B");
    assert_true(bench_event(bench, BOARD_EVENT_UNKNOWN, &event));
    assert_int_equal(event.time_ns, 5000000);
    bench->sensors.supply_v = 10.0;
    bench_tick(bench); /* sampled at its end */
    assert_false(bench_event(bench, BOARD_EVENT_FAULT, &event));
    bench_tick(bench);
    assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
    assert_int_equal(event.time_ns, 6000000);
}

TEST_ON(a_board_boots_by_the_time_of_its_caller, bench_configure, bench)
{
    bench->board[0].transmit_at_start = true;
    bench->board[0].boot_ns = 10000000;
    bench_start(bench);
    boards_sample(bench->boards, 0, &bench->sensors);
    boards_control(bench->boards, 8000000, &bench->command); /* until 9 ms */
    assert_int_equal(boards_transmit(bench->boards, 9000000, 0, bench->frame[0], BENCH_FRAMES), 0);
    boards_control(bench->boards, 9000000, &bench->command);
    boards_sample(bench->boards, 10000000, &bench->sensors);
    assert_true(boards_transmit(bench->boards, 10000000, 0, bench->frame[0], BENCH_FRAMES) > 0);
}
