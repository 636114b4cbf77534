/* SPDX-License-Identifier: Apache-2.0 */
/* Inertial boards of the compact protocol, on a classic bus and on an FD bus. */
#include "tests/unit/boards/compact/compact_bench.h"

static void start_inertial(struct board_bench *bench, int bus)
{
    configure(bench);
    bench->board[2] = (struct board_config){.name = "pelvis",
                                            .kind = BOARD_INERTIAL,
                                            .bus = bus,
                                            .address = 9,
                                            .period_ns = 1000000,
                                            .transmit_at_start = true};
    /* Turned by 60 degrees about the vertical */
    bench->sensors.imu = (struct imu_sense){
        .gyro_rad_s = {0.0, -0.5, 40.0},
        .accel_m_s2 = {1.0, -2.0, 9.81},
        .magnetic_t = {11.4e-6, -19.7e-6, -41.1e-6},
        .quaternion = {sqrt(0.75), 0.0, 0.0, 0.5},
    };
    bench_start(bench);
}

TEST(classic_frames_bear_acceleration_rate_and_orientation)
{
    struct board_bench bench;

    start_inertial(&bench, 0);
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x1a9, "C8 00 70 FE AA 07"); /* 200, -400, 1962 of 5 mm/s2 */
    bench_expect(&bench, 0, 0x1c9, "00 00 0C FE FF 7F"); /* -500 mrad/s, cut */
    bench_expect(&bench, 0, 0x1e9, "6D 37 00 00 00 00 00 20");
    bench_expect(&bench, 0, 0x269, "72 00 3B FF 65 FE");           /* 114, -197, -411 of 0.1 uT */
    assert_int_equal(bench_find(&bench, 0, 0x289)->data[0], 0x20); /* rate z */
    assert_int_equal(get_u16_le(bench_find(&bench, 0, 0x289)->data + 1), COMPACT_FAULT_SATURATED);
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x1a9), 1);
    assert_int_equal(bench_sent(&bench, 0, 0x269), 0); /* with the state, every 50 ms */
    bench_stop(&bench);
}

TEST(one_fd_frame_bears_all)
{
    static const int16_t expected[16] = {200, -400, 1962, 0,    -500, 32767, 14189, 0,
                                         0,   8192, 114,  -197, -411, 0,     0,     10472};
    struct board_bench bench;
    const struct bus_frame *frame;

    start_inertial(&bench, 1);
    bench_tick(&bench);
    frame = bench_find(&bench, 1, 0x249);
    assert_non_null(frame);
    assert_int_equal(frame->len, 32);
    for (int i = 0; i < 16; i++) {
        assert_int_equal(get_i16_le(frame->data + 2 * i), expected[i]);
    }
    assert_int_equal(bench_sent(&bench, 1, 0x269), 0);
    bench_stop(&bench);
}

TEST(a_lost_orientation_is_a_fault_and_zero)
{
    struct board_bench bench;

    start_inertial(&bench, 0);
    bench.sensors.imu.gyro_rad_s[2] = 0.0;
    bench_ticks(&bench, 60);
    memset(bench.sensors.imu.quaternion, 0, sizeof bench.sensors.imu.quaternion);
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x1e9, "00 00 00 00 00 00 00 00");
    assert_int_equal(get_u16_le(bench_find(&bench, 0, 0x289)->data + 1), COMPACT_FAULT_INERTIAL);
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 9), "11 00");
    bench_tick(&bench);
    bench_expect(&bench, 0, compact_id(COMPACT_REPLY, 9), "11 00 00 08 00 00 00");
    bench_stop(&bench);
}

TEST(its_period_is_set_and_it_says_what_it_is)
{
    struct board_bench bench;
    size_t sent = 0;

    start_inertial(&bench, 0);
    bench_send(&bench, 0, compact_id(COMPACT_DISCOVER, 0), "");
    bench_tick(&bench);
    assert_int_equal(bench_find(&bench, 0, compact_id(COMPACT_IDENTITY, 9))->data[0],
                     COMPACT_KIND_INERTIAL);
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 9), "85 00 05 00 00 00");
    for (int t = 0; t < 50; t++) {
        bench_tick(&bench);
        sent += bench_sent(&bench, 0, 0x1c9);
    }
    assert_int_equal(sent, 10);
    bench_stop(&bench);
}
