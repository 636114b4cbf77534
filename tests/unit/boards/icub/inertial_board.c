/* SPDX-License-Identifier: Apache-2.0 */
/* Inertial boards: which sensors they send, when, and in which bytes. */
#include "tests/unit/boards/fault_bench.h"

enum { ADDRESS = 9, TRIPLE = 0x593, QUATERNION = 0x594 };

static void configure(struct board_bench *bench, bool at_once)
{
    bench_configure(bench);
    bench->board[3] = (struct board_config){.name = "pelvis",
                                            .kind = BOARD_INERTIAL,
                                            .address = ADDRESS,
                                            .period_ns = 5000000,
                                            .transmit_at_start = at_once};
    /* Turned by 60 degrees about the vertical: cos 30, sin 30 */
    bench->sensors.imu = (struct imu_sense){
        .gyro_rad_s = {0.0, -M_PI / 180.0, 1.0},
        .accel_m_s2 = {1.0, -2.0, 9.81},
        .magnetic_t = {11.4e-6, -19.75e-6, -41.1e-6},
        .quaternion = {sqrt(0.75), 0.0, 0.0, 0.5},
    };
}

static void start(struct board_bench *bench, bool at_once)
{
    configure(bench, at_once);
    bench_start(bench);
}

static void config(struct board_bench *bench, const char *hex)
{
    bench_say(bench, 0, 0x209, hex);
}

TEST_ON(every_sensor_has_its_frame_in_order, board_bench, bench)
{
    static const char *const triple[] = {
        "00 00 64 00 38 FF D5 03", /* 100, -200, 981 cm/s2 */
        "00 01 B6 00 C4 FE 6E FD", /* 182, -316, -658 / 16 uT */
        "00 02 00 00 F0 FF 95 03", /* 0, -16, 917 / 16 deg/s */
        "00 03 00 00 00 00 C0 03", /* yaw 60 deg = 960 / 16 */
        "00 05 64 00 38 FF 00 00", /* less gravity */
        "00 06 00 00 00 00 D5 03", "00 0F FF 00 00 00 00 00",
    };
    size_t sent = 0;

    start(bench, false);
    config(bench, "34 7F 80 01");
    config(bench, "35 01");
    for (size_t i = 0; i < bench->count[0]; i++) {
        const struct bus_frame *frame = &bench->frame[0][i];

        if (frame->id == TRIPLE) {
            assert_true(sent < 7);
            bench_expect_frame(frame, TRIPLE, triple[sent++]);
        }
    }
    assert_int_equal(sent, 7);
    bench_expect(bench, 0, QUATERNION, "6D 37 00 00 00 00 00 20"); /* 14189, 8192 */
    bench_tick(bench);
    assert_int_equal(bench_find(bench, 0, TRIPLE)->data[0], 1); /* the next period */
}

TEST_ON(mask_and_period_are_obeyed, board_bench, bench)
{
    size_t gyro = 0, others = 0;

    start(bench, false);
    bench_ticks(bench, 20);
    assert_int_equal(bench_sent(bench, 0, TRIPLE), 0);
    config(bench, "34 04 00 01 00 00 00 00");
    config(bench, "35 07");
    for (int t = 0; t < 70; t++) {
        bench_tick(bench);
        gyro += bench_sent(bench, 0, TRIPLE);
        others += bench_sent(bench, 0, QUATERNION);
    }
    assert_int_equal(gyro, 10);
    assert_int_equal(others, 0);
    /* 0 stops; SET_CONFIG does too, until the next TRANSMIT */
    for (int i = 0; i < 2; i++) {
        config(bench, "35 01");
        assert_int_equal(bench_sent(bench, 0, TRIPLE), 1);
        config(bench, i ? "35 00" : "34 04 00 01");
        bench_ticks(bench, 3);
        assert_int_equal(bench_sent(bench, 0, TRIPLE), 0);
    }
}

TEST_ON(config_is_told_and_identity_too, board_bench, bench)
{
    start(bench, true);
    bench_ticks(bench, 5);
    assert_int_equal(bench_sent(bench, 0, TRIPLE), 2);
    assert_int_equal(bench_sent(bench, 0, QUATERNION), 1);
    config(bench, "33");
    bench_expect(bench, 0, 0x290, "33 15 00 01 00 00 00 00");
    config(bench, "34 34 12 21 01 02 03 04");
    config(bench, "33");
    bench_expect(bench, 0, 0x290, "33 34 12 21 01 02 03 04");
    config(bench, "1C 01 00");
    bench_expect(bench, 0, 0x290, "1C 0D 01 00 01 01 00 01");
    bench_say(bench, 0, 0x70f, "FF");
    bench_expect(bench, 0, 0x790, "FF 0D 01 00 01");
}

TEST_ON(wrong_commands_are_counted, board_bench, bench)
{
    start(bench, true);
    config(bench, "34 7F 80");
    config(bench, "35");
    config(bench, "35 01 02");
    assert_int_equal(bench_counters(bench).malformed, 3);
    config(bench, "07 00"); /* of STRAIN boards */
    assert_int_equal(bench_counters(bench).unknown, 1);
    assert_int_equal(bench_counters(bench).malformed, 3);
    config(bench, "32 08");
    bench_ticks(bench, 5);
    assert_int_equal(bench_sent(bench, 0, TRIPLE), 0);
}

/* Without fusion, or without a reading, what needs the orientation is 0 and the status says so. */
TEST_ON(status_tells_what_is_missing, board_bench, bench)
{
    start(bench, false);
    config(bench, "34 18 80 21");
    config(bench, "35 01");
    bench_expect_frame(bench_find(bench, 0, TRIPLE), TRIPLE, "00 03 00 00 00 00 00 00");
    bench_expect(bench, 0, QUATERNION, "00 00 00 00 00 00 00 00");
    config(bench, "34 00 80 01");
    bench->sensors.imu.gyro_rad_s[1] = NAN;
    bench->sensors.imu.accel_m_s2[2] = 1000.0;
    config(bench, "35 01");
    bench_expect(bench, 0, TRIPLE, "01 0F CF 00 21 00 04 00");
    bench->sensors.imu.gyro_rad_s[1] = 0.0;
    memset(bench->sensors.imu.quaternion, 0, sizeof bench->sensors.imu.quaternion);
    bench_tick(bench);
    bench_expect(bench, 0, TRIPLE, "02 0F 3F 00 01 00 00 00");
}

TEST_ON(a_restart_forgets_mask_and_period, board_bench, bench)
{
    start(bench, false);
    config(bench, "34 04 00 01");
    config(bench, "35 01");
    bench_say(bench, 0, 0x709, "00");
    bench_send(bench, 0, 0x709, "04");
    bench_ticks(bench, 2);
    config(bench, "33");
    bench_expect(bench, 0, 0x290, "33 00 00 01 00 00 00 00");
    assert_int_equal(bench_sent(bench, 0, TRIPLE), 0);
}

/* Between 50 and 100 ms; before and after a frame of type 3 each millisecond. */
TEST(faults_of_boards_act_on_it)
{
    static const struct {
        const char *line;
        size_t during, after; /* frames in 50 ms */
    } cases[] = {
        {"board ankle off 0.05..0.1", 0, 0}, /* has forgotten what it was told */
        {"board ankle hung watchdog=0.02 0.05..0.1", 0, 0},
        {"board ankle stuck 0.05..0.1", 50, 50},
        {"board ankle garbage 0.05..0.1", 50, 50},
        {"board ankle slow factor=5 0.05..0.1", 10, 50},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct fault_bench bench = {0};
        size_t sent[3] = {0};
        uint8_t first = 0, last = 0;
        struct error error;

        configure(&bench.base, false);
        assert_ok(arena_init(&bench.arena, 8u << 20, &error));
        bench.faults = arm(&bench.base, &bench.arena, cases[i].line);
        bench_start(&bench.base);
        bench_send(&bench.base, 0, 0x209, "34 04 00 01");
        bench_send(&bench.base, 0, 0x209, "35 01");
        while (bench.ms < 150) {
            int64_t part = bench.ms / 50;
            const struct bus_frame *frame;

            tick(&bench);
            sent[part] += bench_sent(&bench.base, 0, TRIPLE);
            frame = bench_find(&bench.base, 0, TRIPLE);
            first = frame && bench.ms == 60 ? frame->data[0] : first;
            last = frame && bench.ms == 90 ? frame->data[0] : last;
        }
        assert_int_equal(sent[0], 50);
        assert_int_equal(sent[1], cases[i].during);
        assert_int_equal(sent[2], cases[i].after);
        assert_true(!strstr(cases[i].line, "stuck") || first == last);
        end(&bench);
    }
}
