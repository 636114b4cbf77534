/* SPDX-License-Identifier: Apache-2.0 */
/* The periodic frames of iCub motor boards: slots, policy, STATUS, scales, ticks of other
 * lengths. */
#include "tests/unit/boards/icub/motor_bench.h"

TEST_ON(boards_are_silent_until_the_host_sets_a_policy, board_bench, bench)
{
    bench_open(bench);
    set_mode(bench, 0x50);
    for (int i = 0; i < 6000; i++) {
        bench_tick(bench);
        assert_int_equal(bench->count[0] + bench->count[1], 0);
    }
    bench_configure(bench);
    bench->board[4].transmit_at_start = true;
    bench_start(bench);
    bench_tick(bench);
    bench_expect(bench, 1, 0x111, "00 00 00 00 00 00 00 00");
    assert_int_equal(bench->count[0], 0);
}

TEST_ON(frames_keep_their_slots_and_the_mask_decides, bench_open, bench)
{
    static const unsigned slot_of[13] = {9, 0, 1, 2, 3, 3, 3, 3, 3, 3, 3, 3, 2};

    for (unsigned type = 1; type <= 11; type++) {
        unsigned mask = 1u << (type - 1);
        char text[32];

        /* the mask of one board; either axis bit sets it */
        snprintf(text, sizeof text, "%s %02X %02X 00 00", type % 2 ? "49" : "C9", mask & 0xff,
                 mask >> 8);
        bench_send(bench, 0, 0x001, text);
        to_slot_0(bench);
        set_mode(bench, 0x50); /* STATUS has something to say */
        set_mode(bench, 0x00);
        for (unsigned slot = 0; slot < 4; slot++) {
            bool event = type == 5 || type == 6; /* OVERFLOW and PRINT have no cause here */

            bench_tick(bench);
            assert_int_equal(bench_sent(bench, 0, 0x110 | type), slot == slot_of[type] && !event);
            /* nothing else but ADDITIONAL_STATUS with STATUS */
            assert_int_equal(bench->count[0],
                             slot == slot_of[type] && !event ? 1 + (type == 3) : 0);
        }
    }
}

TEST_ON(the_default_mask_gives_every_frame_each_4_ms, bench_open, bench)
{
    unsigned sent[16] = {0};

    bench_send(bench, 0, 0x001, POLICY_7F);
    for (int i = 0; i < 4000; i++) {
        bench_tick(bench);
        for (size_t f = 0; f < bench->count[0]; f++) {
            assert_int_equal(bench->frame[0][f].id & 0x7f0, 0x110);
            assert_int_equal(bench->frame[0][f].len, 8);
            sent[bench->frame[0][f].id & 0xf]++;
        }
    }
    assert_int_equal(sent[1], 1000);
    assert_int_equal(sent[2], 1000);
    assert_int_equal(sent[4], 1000);
    assert_int_equal(sent[7], 1000);
    assert_int_equal(sent[3] + sent[5] + sent[6] + sent[8], 0);
}

TEST_ON(status_follows_a_mode_change_in_the_next_slot_2, board_bench, bench)
{
    for (int phase = 0; phase < 4; phase++) {
        bench_open(bench);
        bench_send(bench, 0, 0x001, "49 04 00 00 00");
        bench_ticks(bench, 4 + phase);
        set_mode(bench, 0x50);
        for (int i = phase; i != 2; i = (i + 1) % 4) {
            bench_tick(bench);
            assert_int_equal(bench->count[0], 0);
        }
        bench_tick(bench);
        bench_expect(bench, 0, 0x113, "00 50 00 00 00 00 00 00");
        bench_expect(bench, 0, 0x11c, "00");
        bench_ticks(bench, 4);
        assert_int_equal(bench->count[0], 0);
    }
}

TEST_ON(status_comes_every_5_s_and_interaction_with_it, bench_open, bench)
{
    int64_t last = 0;
    int count = 0;

    bench_send(bench, 0, 0x001, "49 04 00 00 00; F4 01"); /* axis 1 compliant */
    bench_ticks(bench, 3);
    bench_expect(bench, 0, 0x11c, "10"); /* its change alone needs no STATUS */
    assert_int_equal(bench_sent(bench, 0, 0x113), 0);
    for (int i = 0; i < 20000; i++) {
        bench_tick(bench);
        if (bench->count[0]) {
            bench_expect_frame(&bench->frame[0][0], 0x113, "00 00 00 00 00 00 00 00");
            bench_expect_frame(&bench->frame[0][1], 0x11c, "10");
            assert_in_range(bench->sensors.time_ns - last, 5000000000 - 1, 5004000000);
            last = bench->sensors.time_ns;
            count++;
        }
    }
    assert_int_equal(count, 4);
}

TEST_ON(positions_are_ticks_of_link_and_rotor, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "49 01 02 00 00");
    to_slot_0(bench);
    bench->sense[0].q = 1.23456789;  /* 12346 = 0x303A */
    bench->sense[0].qm = 1.3;        /* 84500 = 0x14A14 */
    bench->sense[1].q = -0.00005001; /* -1 */
    bench->sense[1].qm = -1e9;       /* the counter ends */
    bench_tick(bench);
    bench_expect(bench, 0, 0x111, "3A 30 00 00 FF FF FF FF");
    bench_ticks(bench, 3);
    bench_expect(bench, 0, 0x11a, "14 4A 01 00 00 00 00 80");
}

TEST_ON(position_error_is_at_most_half_a_tick, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "49 01 00 00 00");
    to_slot_0(bench);
    for (int i = 0; i < 500; i++) {
        double q = sin(0.1 * i) * 2.0;
        const struct bus_frame *frame;
        int32_t ticks;

        bench->sense[0].q = q;
        bench_tick(bench);
        frame = bench_find(bench, 0, 0x111);
        assert_non_null(frame);
        ticks = get_i32_le(frame->data);
        assert_true(fabs(ticks - q * TICKS_PER_RAD) <= 0.5 + 1e-9);
        bench_ticks(bench, 3);
    }
}

TEST_ON(current_is_milliamperes_and_saturates, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "49 08 00 00 00");
    bench->sense[0].current_a = 1.2345; /* 1235 after rounding (1234.5 up) */
    bench->sense[1].current_a = -2.0;
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x114, "D3 04 30 F8 00 00 00 00");
    bench->sense[0].current_a = 40.0;
    bench->sense[1].current_a = -40.0;
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x114, "FF 7F 00 80 00 00 00 00");
}

/* 2 ticks/ms on link 0, 1/4 tick/ms^2 on link 1, 1 tick/ms^2 on rotor 0, nothing on rotor 1. */
TEST_ON(velocities_are_scaled_by_the_estimator_shifts, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "49 40 04 00 00"); /* VELOCITY and MOTOR_SPEED */
    bench_send(bench, 0, 0x001, "0E 03 00 00 00");
    for (int i = 1; i <= 400; i++) {
        bench->sense[0].q = 2.0 * i / TICKS_PER_RAD;
        bench->sense[0].qm = 0.5 * i * i / MOTOR_TICKS_PER_RAD;
        bench->sense[1].q = 0.125 * i * i / TICKS_PER_RAD;
        bench_tick(bench);
    }
    /* axis 0: 2 * 2^3 = 16; axis 1 keeps its shifts of 5: the speed of 16 ms ago, 384/4 * 2^5 =
     * 3072, and 1/4 * 2^10 = 256 */
    bench_expect(bench, 0, 0x117, "10 00 00 0C 00 00 00 01");
    /* 384 ticks/ms, 1 tick/ms^2 */
    bench_expect(bench, 0, 0x11b, "80 01 00 00 01 00 00 00");
    bench_send(bench, 0, 0x001, "0E FF FF FF FF"); /* absurd shifts saturate */
    for (int i = 401; i <= 404; i++) {
        bench->sense[0].q = 2.0 * i / TICKS_PER_RAD;
        bench->sense[0].qm = 0.5 * i * i / MOTOR_TICKS_PER_RAD;
        bench_tick(bench);
    }
    assert_int_equal(bench_find(bench, 0, 0x117)->data[1], 0x7f);
    assert_int_equal(bench_find(bench, 0, 0x11b)->data[1], 0x7f);
}

/* ---- ticks of other lengths ---- */

TEST_ON(slots_follow_the_time_whatever_the_tick, board_bench, bench)
{
    static const int64_t ticks_ns[] = {250000, 500000, 1000000, 2000000, 3000000, 10000000};

    for (size_t t = 0; t < sizeof ticks_ns / sizeof *ticks_ns; t++) {
        int sent = 0;

        bench_configure(bench);
        bench->config.tick_ns = ticks_ns[t];
        bench_start(bench);
        bench_send(bench, 0, 0x001, "49 01 00 00 00");
        bench_ticks(bench, (int)(1200000000 / ticks_ns[t]) - 1);
        for (int64_t ns = 0; ns < 1200000000; ns += ticks_ns[t]) {
            bench_tick(bench);
            sent += (int)bench_sent(bench, 0, 0x111);
        }
        assert_int_equal(sent, ticks_ns[t] <= 4000000 ? 300 : 120);
    }
}

TEST_ON(too_little_room_delays_replies_and_loses_telemetry, bench_open, bench)
{
    struct bus_frame frame[4];

    bench_send(bench, 0, 0x001, "49 01 00 00 00");
    for (int i = 0; i < 6; i++) {
        bench_send(bench, 0, 0x001, "33");
    }
    bench_control(bench);
    assert_int_equal(boards_transmit(bench->boards, bench->now_ns, 0, frame, 4), 4);
    assert_int_equal(bench_counters(bench).overflows, 1);
    bench_control(bench);
    assert_int_equal(boards_transmit(bench->boards, bench->now_ns, 0, frame, 4), 2);
    bench_expect_frame(&frame[1], 0x010, "33 01");
    assert_int_equal(boards_transmit(bench->boards, bench->now_ns, 0, frame, 0), 0);
    assert_int_equal(boards_transmit(bench->boards, bench->now_ns, 9, frame, 4), 0);
}
