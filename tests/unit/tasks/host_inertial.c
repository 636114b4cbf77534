/* SPDX-License-Identifier: Apache-2.0 */
/* The host and an inertial board, which the test plays: on an iCub bus, and on compact ones. */
#include "tests/unit/tasks/host_bench.h"

enum { ADDRESS = 9 };

static void play_icub(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x70f) {
        say(bench, bus, 0x790, 5, (const uint8_t[]){0xff, 13, 1, 0, 1});
    } else if (frame->id == 0x209 && frame->data[0] == 0x1c) {
        say(bench, bus, 0x290, 8, (const uint8_t[]){0x1c, 13, 1, 0, 1, 1, 0, 1});
    }
}

static void play_compact(struct bench *bench, int bus, const struct bus_frame *frame)
{
    const uint8_t *data = frame->data;

    if (frame->id == 0x7e0) {
        say(bench, bus, 0x7c0 | ADDRESS, 8, (const uint8_t[]){bench->mute ? 3 : 4, 0, 0, 1});
    } else if (frame->id == (0x680 | ADDRESS)) {
        say(bench, bus, 0x6a0 | ADDRESS, 7,
            (const uint8_t[]){data[0], data[1], data[2], data[3], data[4], data[5], 0});
    }
}

static struct bench *open_host(enum host_personality personality, bool fd)
{
    static struct bench bench;
    static struct host_bus bus[1];
    const struct host_config config = {.nbus = 1,
                                       .bus = bus,
                                       .imu = {true, 0, ADDRESS, 5000000},
                                       .supply_v = 48,
                                       .period_ns = 1000000};

    memset(&bench, 0, sizeof bench);
    bus[0] = (struct host_bus){.personality = personality, .fd = fd};
    bench.play[0] = personality == HOST_COMPACT ? play_compact : play_icub;
    bench_open(&bench, &config);
    return &bench;
}

static void assert_motion(const struct host_motion *motion, double tolerance)
{
    static const double acceleration[3] = {1.0, -2.0, 9.81}, rate[3] = {0.0, -0.5, 1.0};
    static const double quaternion[4] = {0.866025403784, 0.0, 0.0, 0.5};

    assert_true(motion->acceleration_seen && motion->rate_seen && motion->quaternion_seen);
    for (int i = 0; i < 3; i++) {
        assert_near(motion->acceleration_m_s2[i], acceleration[i], tolerance);
        assert_near(motion->rate_rad_s[i], rate[i], tolerance);
    }
    for (int i = 0; i < 4; i++) {
        assert_near(motion->quaternion[i], quaternion[i], 1e-4);
    }
}

static void icub_board_is_configured_and_heard(void **state)
{
    struct bench *bench = open_host(HOST_ICUB, false);
    const struct host_motion *motion = host_motion(bench->host);

    (void)state;
    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(was_sent(bench, 0, 0x209, 8, (const uint8_t[]){0x34, 0x15, 0, 1, 0, 0, 0, 0}));
    assert_true(was_sent(bench, 0, 0x209, 2, (const uint8_t[]){0x35, 5}));
    assert_true(find_sent(bench, 0, 0, 0x209, 8, (const uint8_t[]){0x34, 0x15, 0, 1, 0, 0, 0, 0}) <
                find_sent(bench, 0, 0, 0x209, 2, (const uint8_t[]){0x35, 5}));
    assert_false(motion->acceleration_seen || motion->rate_seen || motion->quaternion_seen);
    say(bench, 0, 0x593, 8, (const uint8_t[]){7, 0, 100, 0, 0x38, 0xff, 0xd5, 0x03});
    say(bench, 0, 0x593, 8, (const uint8_t[]){7, 2, 0, 0, 0x36, 0xfe, 0x95, 0x03}); /* 1/16 deg/s */
    say(bench, 0, 0x594, 8, (const uint8_t[]){0x6d, 0x37, 0, 0, 0, 0, 0, 0x20});
    one_period(bench);
    assert_motion(motion, 1e-3);
    assert_true(motion->time_ns == host_time_ns(bench->host));
    /* Of another sensor, or of a wrong length: nothing changes */
    say(bench, 0, 0x593, 8, (const uint8_t[]){8, 1, 1, 2, 3, 4, 5, 6});
    say(bench, 0, 0x594, 7, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7});
    one_period(bench);
    assert_motion(motion, 1e-3);
    bench_close(bench);
}

static void compact_boards_are_heard(void **state)
{
    /* 5 mm/s2, mrad/s, 2^-14 */
    static const uint8_t all[32] = {200,  0,    0x70, 0xfe, 0xaa, 0x07, 0, 0, 0x0c, 0xfe,
                                    0xe8, 0x03, 0x6d, 0x37, 0,    0,    0, 0, 0,    0x20};

    (void)state;
    for (int fd = 0; fd < 2; fd++) {
        struct bench *bench = open_host(HOST_COMPACT, fd);

        assert_int_equal(start_up(bench, 100), HOST_READY);
        assert_true(was_sent(bench, 0, 0x689, 6, (const uint8_t[]){0x85, 0, 5, 0, 0, 0}));
        if (fd) {
            say_fd(bench, 0, 0x249, 32, all);
        } else {
            say(bench, 0, 0x1a9, 6, all);
            say(bench, 0, 0x1c9, 6, all + 6);
            say(bench, 0, 0x1e9, 8, all + 12);
        }
        one_period(bench);
        assert_motion(host_motion(bench->host), 1e-9);
        bench_close(bench);
    }
}

static void another_kind_of_board_there_ends_the_start_up(void **state)
{
    struct bench *bench = open_host(HOST_COMPACT, false);

    (void)state;
    bench->mute = true;
    assert_int_equal(start_up(bench, 100), HOST_FAILED);
    assert_string_equal(host_message(bench->host), "board 9 on can0 is of another kind");
    bench_close(bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(icub_board_is_configured_and_heard),
        cmocka_unit_test(compact_boards_are_heard),
        cmocka_unit_test(another_kind_of_board_there_ends_the_start_up),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
