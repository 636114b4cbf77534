/* SPDX-License-Identifier: Apache-2.0 */
/* The host and an inertial board, which the test plays: on an iCub bus, and on compact ones. */
#include "tests/protocol_file.h"
#include "tests/unit/tasks/host_bench.h"

#include "base/array.h"

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
    void (*answer)(struct bench *, int, uint32_t, uint8_t, const uint8_t *) =
        frame->flags & FRAME_FD ? say_fd : say;

    if (frame->id == 0x7e0) {
        answer(bench, bus, 0x7c0 | ADDRESS, 8, (const uint8_t[]){4, 0, 0, 1, 1, 0, 1, 0});
    } else if (frame->id == (0x680 | ADDRESS)) {
        answer(bench, bus, 0x6a0 | ADDRESS, 7,
               (const uint8_t[]){data[0], data[1], data[2], data[3], data[4], data[5], 0});
    }
}

static struct bench *open_host_every(const char *protocol, bool fd, int64_t period_ns)
{
    static struct bench bench;
    static struct host_bus bus[1];
    const struct host_config config = {.nbus = 1,
                                       .bus = bus,
                                       .imu = {true, 0, ADDRESS, period_ns},
                                       .supply_v = 48,
                                       .period_ns = 1000000};

    memset(&bench, 0, sizeof bench);
    bus[0] = (struct host_bus){.protocol = protocol, .fd = fd};
    bench.play[0] = play_icub;
    if (!strcmp(protocol, "compact")) {
        bus[0].described = protocol_file(fd ? "compact-fd" : "compact");
        bench.play[0] = play_compact;
    }
    bench_open(&bench, &config);
    return &bench;
}

static struct bench *open_host(const char *protocol, bool fd)
{
    return open_host_every(protocol, fd, 5000000);
}

static void assert_motion(const struct host_motion *motion, double tolerance)
{
    static const double acceleration[3] = {1.0, -2.0, 9.81}, rate[3] = {0.0, -0.5, 1.0};
    static const double quaternion[4] = {0.866025403784, 0.0, 0.0, 0.5};

    assert_true(motion->acceleration_time_ns >= 0 && motion->rate_time_ns >= 0 &&
                motion->quaternion_time_ns >= 0);
    for (int i = 0; i < 3; i++) {
        assert_near(motion->acceleration_m_s2[i], acceleration[i], tolerance);
        assert_near(motion->rate_rad_s[i], rate[i], tolerance);
    }
    for (int i = 0; i < 4; i++) {
        assert_near(motion->quaternion[i], quaternion[i], 1e-4);
    }
}

TEST(icub_board_is_configured_and_heard)
{
    struct bench *bench = open_host("icub", false);
    const struct host_motion *motion = host_motion(bench->host);

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(was_sent(bench, 0, 0x209, 8, (const uint8_t[]){0x34, 0x15, 0, 1, 0, 0, 0, 0}));
    assert_true(was_sent(bench, 0, 0x209, 2, (const uint8_t[]){0x35, 5}));
    assert_true(find_sent(bench, 0, 0, 0x209, 8, (const uint8_t[]){0x34, 0x15, 0, 1, 0, 0, 0, 0}) <
                find_sent(bench, 0, 0, 0x209, 2, (const uint8_t[]){0x35, 5}));
    assert_true(motion->acceleration_time_ns < 0 && motion->rate_time_ns < 0 &&
                motion->quaternion_time_ns < 0);
    say(bench, 0, 0x593, 8, (const uint8_t[]){7, 0, 100, 0, 0x38, 0xff, 0xd5, 0x03});
    say(bench, 0, 0x593, 8, (const uint8_t[]){7, 2, 0, 0, 0x36, 0xfe, 0x95, 0x03}); /* 1/16 deg/s */
    say(bench, 0, 0x594, 8, (const uint8_t[]){0x6d, 0x37, 0, 0, 0, 0, 0, 0x20});
    one_period(bench);
    assert_motion(motion, 1e-3);
    assert_true(motion->rate_time_ns == host_time_ns(bench->host));
    /* Of another sensor, or of a wrong length: nothing changes */
    say(bench, 0, 0x593, 8, (const uint8_t[]){8, 1, 1, 2, 3, 4, 5, 6});
    say(bench, 0, 0x594, 7, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7});
    one_period(bench);
    assert_motion(motion, 1e-3);
    bench_close(bench);
}

TEST(compact_boards_are_heard)
{
    /* 5 mm/s2, mrad/s, 2^-14 */
    static const uint8_t all[32] = {200,  0,    0x70, 0xfe, 0xaa, 0x07, 0, 0, 0x0c, 0xfe,
                                    0xe8, 0x03, 0x6d, 0x37, 0,    0,    0, 0, 0,    0x20};

    for (int fd = 0; fd < 2; fd++) {
        struct bench *bench = open_host("compact", fd);

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

/* The bus says the rate and the quaternion, or one of them, for as many periods of 1 ms. */
static void say_motion(struct bench *bench, int periods, bool rate, bool quaternion)
{
    for (int i = 0; i < periods; i++) {
        if (rate) {
            say(bench, 0, 0x593, 8, (const uint8_t[]){7, 2, 0, 0, 0x36, 0xfe, 0x95, 0x03});
        }
        if (quaternion) {
            say(bench, 0, 0x594, 8, (const uint8_t[]){0x6d, 0x37, 0, 0, 0, 0, 0, 0x20});
        }
        one_period(bench);
    }
}

TEST(a_board_that_falls_silent_is_noticed_by_who_needs_it)
{
    static const struct {
        bool rate, quaternion;
        const char *message;
    } part[] = {{false, false, "board 9 on can0 sends no angular rate"},
                {false, true, "board 9 on can0 sends no angular rate"},
                {true, false, "board 9 on can0 sends no attitude"}};

    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        for (int watched = 0; watched < 2; watched++) {
            struct bench *bench = open_host("icub", false);

            assert_int_equal(start_up(bench, 100), HOST_READY);
            if (watched) {
                host_watch_motion(bench->host);
            }
            say_motion(bench, 50, true, true);
            say_motion(bench, 100, part[i].rate, part[i].quaternion);
            assert_true(host_healthy(bench->host));
            say_motion(bench, 1, part[i].rate, part[i].quaternion);
            assert_int_equal(host_healthy(bench->host), !watched);
            assert_int_equal(host_lost(bench->host), watched);
            if (watched) {
                assert_string_equal(host_message(bench->host), part[i].message);
            }
            bench_close(bench);
        }
    }
}

/* One that never says anything; ten of its periods are longer than 100 ms. */
TEST(a_board_that_is_never_heard_has_ten_periods)
{
    struct bench *bench = open_host_every("icub", false, 20000000);
    int waited = 0;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    host_watch_motion(bench->host);
    while (host_healthy(bench->host) && waited < 1000) {
        one_period(bench);
        waited++;
    }
    assert_true(waited > 190 && waited <= 201);
    assert_string_equal(host_message(bench->host), "board 9 on can0 sends no angular rate");
    bench_close(bench);
}
