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

/* ---- the time of answers ---- */

#define US INT64_C(1000)
#define MS INT64_C(1000000)

/* Sends discovery to all boards of bus 0, and collects the answers in steps of 1 us. Fills in the
 * time of each node's answer. */
static void time_answers(struct board_bench *bench, int64_t now_ns, int64_t arrival_ns,
                         int64_t at_ns[4])
{
    const struct bus_frame request = frame_make(0x70f, 1, (const uint8_t[]){0xff});
    int64_t before_ns = 0;
    size_t seen = 0;

    boards_receive_early(bench->boards, now_ns, arrival_ns, 0, &request);
    for (int64_t t = arrival_ns; seen < 4; t += US) {
        const int64_t next_ns = boards_next_answer(bench->boards, 0);
        struct bus_frame answer[2];

        assert_true(t < arrival_ns + MS && next_ns >= before_ns);
        for (size_t n; (n = boards_answer(bench->boards, t, t, 0, answer, 1)) > 0; seen++) {
            at_ns[answer[0].node] = t;
            assert_true(next_ns <= t && t < next_ns + US);
        }
        before_ns = seen < 4 ? boards_next_answer(bench->boards, 0) : before_ns;
    }
    assert_true(boards_next_answer(bench->boards, 0) == INT64_MAX);
}

TEST_ON(an_answer_is_due_after_the_delay_and_spread_of_its_board, bench_configure, bench)
{
    int64_t at_ns[4], least = MS, greatest = 0, changes = 0, before = 0;

    bench->board[0].reply = (struct board_reply_time){300 * US, 0};
    bench->board[1].reply = (struct board_reply_time){100 * US, 50 * US};
    bench->board[2].reply = (struct board_reply_time){-1, -1}; /* the protocol's, assumed */
    bench_start(bench);
    for (int64_t k = 1; k <= 200; k++) {
        /* In real time the boards' own time is ahead of a frame between two ticks */
        const int64_t now_ns = 2 * k * MS, arrival_ns = now_ns - (k % 2) * 250 * US;

        time_answers(bench, now_ns, arrival_ns, at_ns);
        assert_int_equal(at_ns[0] - arrival_ns, 300 * US);
        assert_int_equal(at_ns[2] - arrival_ns, 100 * US);
        assert_int_equal(at_ns[3] - arrival_ns, 0);
        at_ns[1] -= arrival_ns;
        least = at_ns[1] < least ? at_ns[1] : least;
        greatest = at_ns[1] > greatest ? at_ns[1] : greatest;
        changes += at_ns[1] != before;
        before = at_ns[1];
    }
    assert_true(least >= 100 * US && least < 105 * US);
    assert_true(greatest <= 150 * US && greatest > 145 * US);
    assert_true(changes > 150);
}

TEST_ON(without_a_wire_an_answer_waits_for_the_end_of_its_tick, bench_configure, bench)
{
    bench->board[0].reply = (struct board_reply_time){1500 * US, 0};
    bench_start(bench);
    for (int tick = 0; tick < 3; tick++) {
        bench_say(bench, 0, 0x701, "FF");
        assert_int_equal(bench->count[0], tick > 0); /* due in the second tick */
    }
}
