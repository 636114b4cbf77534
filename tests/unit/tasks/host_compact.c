/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host against compact boards played by the test: on a classic bus two boards of three and two
 * axes and a force-torque board; on an FD bus one board of four axes and one of one.
 */
#include "tests/unit/tasks/host_bench.h"

enum { CLASSIC, FD };
enum { AXES = 10 };

/* function << 5 | number, as boards/compact/protocol.h has them in its table */
enum {
    MODE = 0x020,
    COMMAND = 0x040,
    TELEMETRY = 0x100,
    TELEMETRY_FD = 0x120,
    FORCE = 0x140,
    MOMENT = 0x160,
    WRENCH_FD = 0x180,
    STATE = 0x200,
    FT_STATE = 0x220,
    REQUEST = 0x680,
    REPLY = 0x6a0,
    IDENTITY = 0x7c0,
    DISCOVER = 0x7e0,
};

/* motor 1.23456 rad, deflection -0.02 rad, current -1.5 A, torque 3.2 N m, sequence 2 */
static const uint8_t telemetry[8] = {0x40, 0xe2, 0x01, 0x0c, 0xbe, 0xda, 0x93, 0x81};
/* motor -1.23456 rad, deflection 0.32767 rad, current 20.47 A, torque -65.536 N m, sequence 3 */
static const uint8_t telemetry_ends[8] = {0xc0, 0x1d, 0xfe, 0xff, 0xdf, 0xff, 0x01, 0xe0};
/* motor 1.23456 rad, link 1.21456 rad, -0.5 rad/s, -1.5 A, 3.2 N m, VOLTAGE, sequence 5 */
static const uint8_t telemetry_fd[16] = {0x40, 0xe2, 0x01, 0x00, 0x70, 0xda, 0x01, 0x00,
                                         0x0c, 0xfe, 0x24, 0xfa, 0x80, 0x0c, 0x00, 0x51};

static uint8_t identity_of_7[8] = {2, 2, 3, 1, 1, 0, 0, 0}; /* two axes, slots 3 and 4 */
static uint8_t result;                                      /* of every request */

static void say_mode(struct bench *bench, uint8_t mode, uint32_t slots)
{
    for (uint32_t s = 0; s < 5; s++) {
        if (slots >> s & 1) {
            say(bench, CLASSIC, STATE | s, 8, (const uint8_t[]){mode, 0, 0, 0x80, 0xbb, 25, 0, 0});
            say(bench, CLASSIC, TELEMETRY | s, 8, telemetry);
        }
    }
}

static void play_classic(struct bench *bench, int bus, const struct bus_frame *frame)
{
    const uint8_t *data = frame->data;

    assert_int_equal(frame->flags, 0);
    if (frame->id == DISCOVER && frame->len == 0) {
        say(bench, bus, IDENTITY | 3, 8, (const uint8_t[]){2, 3, 0, 1, 1, 0, 0, 0});
        say(bench, bus, IDENTITY | 7, 8, identity_of_7);
        if (!bench->mute) {
            say(bench, bus, IDENTITY | 31, 8, (const uint8_t[]){3, 0, 0, 1, 1, 0, 0, 0});
        }
    } else if (frame->id >> 5 == REQUEST >> 5 && frame->len == 6) {
        say(bench, bus, REPLY | (frame->id & 31), 7,
            (const uint8_t[]){data[0], data[1], data[2], data[3], data[4], data[5], result});
    } else if (frame->id == MODE && frame->len == 5) {
        say_mode(bench, data[0], data[1]);
    }
}

static void play_fd(struct bench *bench, int bus, const struct bus_frame *frame)
{
    const uint8_t *data = frame->data;
    uint8_t all[64];

    assert_int_equal(frame->flags, FRAME_FD | FRAME_BRS);
    if (frame->id == DISCOVER) {
        say_fd(bench, bus, IDENTITY | 1, 8, (const uint8_t[]){2, 4, 0, 1, 1, 0, 0, 0});
        say_fd(bench, bus, IDENTITY | 2, 8, (const uint8_t[]){2, 1, 4, 1, 1, 0, 0, 0});
        say_fd(bench, bus, IDENTITY | 3, 8, (const uint8_t[]){3, 0, 0, 1, 1, 0, 0, 0});
    } else if (frame->id >> 5 == REQUEST >> 5) {
        say_fd(bench, bus, REPLY | (frame->id & 31), 7,
               (const uint8_t[]){data[0], data[1], data[2], data[3], data[4], data[5], 0});
    } else if (frame->id == MODE) {
        for (int k = 0; k < 4; k++) {
            memcpy(all + 16 * k, telemetry_fd, 16);
            all[16 * k + 15] = data[0];
        }
        say_fd(bench, bus, TELEMETRY_FD | 1, 64, all);
        say_fd(bench, bus, TELEMETRY_FD | 2, 16, all);
    }
}

FIXTURE(set_up)
{
    static struct bench bench;
    static char names[AXES][16];
    static struct host_axis axis[AXES];
    static const struct host_bus bus[] = {{.protocol = "compact"},
                                          {.protocol = "compact", .fd = true}};
    static const struct host_ft ft[] = {
        {.name = "foot", .bus = CLASSIC, .address = 31},
        {.name = "hand", .bus = FD, .address = 3, .period_ns = 2000000}};
    static const uint8_t at[AXES][3] = {
        {CLASSIC, 3, 0}, {CLASSIC, 3, 1}, {CLASSIC, 3, 2}, {CLASSIC, 7, 0}, {CLASSIC, 7, 1},
        {FD, 1, 0},      {FD, 1, 1},      {FD, 1, 2},      {FD, 1, 3},      {FD, 2, 0}};
    struct host_config config = {
        .nbus = 2,
        .bus = bus,
        .naxis = AXES,
        .axis = axis,
        .nft = 2,
        .ft = ft,
        .supply_v = 48,
        .period_ns = 1000000,
    };

    memset(&bench, 0, sizeof bench);
    identity_of_7[0] = 2;
    identity_of_7[2] = 3;
    identity_of_7[3] = 1;
    result = 0;
    for (int k = 0; k < AXES; k++) {
        snprintf(names[k], sizeof names[k], "j%d", k);
        axis[k] = (struct host_axis){.joint = names[k],
                                     .bus = at[k][0],
                                     .address = at[k][1],
                                     .axis = at[k][2],
                                     .torque_address = -1};
    }
    bench.play[CLASSIC] = play_classic;
    bench.play[FD] = play_fd;
    bench_open(&bench, &config);
    *test_state = &bench;
    return 0;
}

TEST_WITH(start_up_discovers_configures_and_enables, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;
    int off;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(was_sent(bench, CLASSIC, DISCOVER, 0, NULL));
    /* telemetry every millisecond, or as the rig says */
    assert_true(was_sent(bench, CLASSIC, REQUEST | 3, 6, (const uint8_t[]){0x85, 0, 1, 0, 0, 0}));
    assert_true(was_sent(bench, CLASSIC, REQUEST | 31, 6, (const uint8_t[]){0x85, 0, 1, 0, 0, 0}));
    assert_true(was_sent(bench, FD, REQUEST | 3, 6, (const uint8_t[]){0x85, 0, 2, 0, 0, 0}));
    /* all motors of a bus with one frame: off, which clears faults, then voltage */
    off = find_sent(bench, 0, CLASSIC, MODE, 5, (const uint8_t[]){0, 0x1f, 0, 0, 0});
    assert_true(off >= 0);
    assert_true(find_sent(bench, off, CLASSIC, MODE, 5, (const uint8_t[]){1, 0x1f, 0, 0, 0}) > off);
    assert_int_equal(count_sent(bench, MODE), 4);
}

TEST_WITH(a_lost_frame_does_not_stop_the_start_up, set_up, bench_tear_down)
{
    check_start_up_without_each_frame(test_state, set_up);
}

TEST_WITH(set_points_go_out_by_slot_in_groups_of_four, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    for (size_t k = 0; k < 5; k++) {
        host_set_voltage(bench->host, k, 2.0 * (double)k - 4.0);
    }
    bench->nseen = 0;
    one_period(bench);
    /* -4, -2, 0, 2 V are -2000, -1000, 0, 1000 counts of 2 mV; the fifth is in the next group */
    assert_true(was_sent(bench, CLASSIC, COMMAND | 0, 8,
                         (const uint8_t[]){0x30, 0xf8, 0x18, 0xfc, 0, 0, 0xe8, 0x03}));
    assert_true(was_sent(bench, CLASSIC, COMMAND | 1, 2, (const uint8_t[]){0xd0, 0x07}));
    assert_int_equal(bench->nseen, 3);
}

TEST_WITH(an_fd_bus_takes_all_set_points_in_one_frame, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;
    uint8_t expected[12] = {0};

    assert_int_equal(start_up(bench, 100), HOST_READY);
    host_set_voltage(bench->host, 5, 48);
    host_set_voltage(bench->host, 9, -1000);
    bench->nseen = 0;
    one_period(bench);
    /* 48 V = 24000 counts; five slots are ten bytes, and the next length is 12 */
    expected[0] = 0xc0;
    expected[1] = 0x5d;
    expected[8] = 0x40;
    expected[9] = 0xa2;
    assert_true(was_sent(bench, FD, COMMAND, 12, expected));
    assert_int_equal(bench->nseen, 3);
}

TEST_WITH(the_last_set_points_are_repeated_every_period, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    host_set_voltage(bench->host, 0, 2);
    bench->nseen = 0;
    for (int i = 0; i < 20; i++) {
        one_period(bench);
    }
    assert_int_equal(count_sent(bench, COMMAND), 40); /* both buses */
    for (size_t i = 0; i < bench->nseen; i += 3) {
        assert_memory_equal(bench->seen[i].data, ((const uint8_t[]){0xe8, 0x03}), 2);
    }
}

TEST_WITH(classic_telemetry_is_unpacked, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;
    const struct host_joint *joint = host_joint(bench->host, 4);

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_near(joint->motor_rad, 1.23456, 1e-12);
    assert_near(joint->joint_rad, 1.25456, 1e-12);
    assert_near(joint->current_a, -1.5, 1e-12);
    assert_near(joint->torque_nm, 3.2, 1e-12);
    say(bench, CLASSIC, TELEMETRY | 4, 8, telemetry_ends);
    host_receive(bench->host, bench->now_ns);
    assert_near(joint->motor_rad, -1.23456, 1e-12);
    assert_near(joint->joint_rad, -1.56223, 1e-12);
    assert_near(joint->current_a, 20.47, 1e-12);
    assert_near(joint->torque_nm, -65.536, 1e-12);
}

TEST_WITH(fd_telemetry_is_unpacked, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    for (size_t k = 5; k < AXES; k++) {
        const struct host_joint *joint = host_joint(bench->host, k);

        assert_near(joint->motor_rad, 1.23456, 1e-12);
        assert_near(joint->joint_rad, 1.21456, 1e-12);
        assert_near(joint->current_a, -1.5, 1e-12);
        assert_near(joint->torque_nm, 3.2, 1e-12);
    }
}

TEST_WITH(forces_are_scaled_on_both_kinds_of_bus, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;
    const struct host_force *foot = host_force(bench->host, 0), *hand = host_force(bench->host, 1);

    assert_int_equal(start_up(bench, 100), HOST_READY);
    /* 1000, -1, 2781 counts of 0.1 N; 500, 0, -500 counts of 2 mN m */
    say(bench, CLASSIC, FORCE | 31, 6, (const uint8_t[]){0xe8, 3, 0xff, 0xff, 0xdd, 0x0a});
    say(bench, CLASSIC, MOMENT | 31, 6, (const uint8_t[]){0xf4, 1, 0, 0, 0x0c, 0xfe});
    say(bench, CLASSIC, FT_STATE | 31, 8, (const uint8_t[]){4, 0, 4, 0x80, 0xbb, 25, 0, 0});
    say_fd(bench, FD, WRENCH_FD | 3, 12,
           (const uint8_t[]){0xe8, 3, 0xff, 0xff, 0xdd, 0x0a, 0xf4, 1, 0, 0, 0x0c, 0xfe});
    host_receive(bench->host, bench->now_ns);
    for (int i = 0; i < 2; i++) {
        const struct host_force *force = i ? hand : foot;

        assert_near(force->force_n[0], 100, 1e-9);
        assert_near(force->force_n[1], -0.1, 1e-9);
        assert_near(force->force_n[2], 278.1, 1e-9);
        assert_near(force->torque_nm[0], 1, 1e-9);
        assert_near(force->torque_nm[2], -1, 1e-9);
        assert_true(force->force_time_ns >= 0 && force->torque_time_ns >= 0);
    }
    assert_true(foot->overflow);
    assert_false(hand->overflow);
}

TEST_WITH(faults_are_named, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(host_healthy(bench->host));
    say(bench, CLASSIC, STATE | 1, 8, (const uint8_t[]){0x57, 0x44, 0, 0x80, 0xbb, 90, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host),
                        "joint j1 is in fault 0x44: over-current, temperature");
}

TEST_WITH(a_warning_is_no_fault, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, CLASSIC, STATE | 1, 8, (const uint8_t[]){0x51, 0x80, 0, 0x80, 0xbb, 25, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_true(host_healthy(bench->host));
    assert_int_equal(host_joint(bench->host, 1)->fault, 0x80);
}

TEST_WITH(a_board_that_restarted_fails_the_host, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, CLASSIC, IDENTITY | 7, 8, identity_of_7);
    say(bench, CLASSIC, STATE | 3, 8, (const uint8_t[]){0, 0, 0, 0x80, 0xbb, 25, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint j3 has switched its motor off");
}

TEST_WITH(a_silent_board_is_named, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    bench->mute = true;
    assert_int_equal(start_up(bench, 10000), HOST_FAILED);
    assert_string_equal(host_message(bench->host), "board 31 on can0 does not answer discovery");
}

TEST_WITH(boards_that_are_not_as_the_rig_has_them_are_named, set_up, bench_tear_down)
{
    static const struct {
        int byte;
        uint8_t value;
        const char *message;
    } wrong[] = {
        {0, 3, "board 7 on can0 is of another kind"},
        {1, 1, "board 7 on can0 has other axes"},
        {2, 2, "board 7 on can0 has other axes"}, /* slot 2 is another board's */
        {2, 31, "board 7 on can0 is of another kind"},
        {3, 2, "board 7 on can0 speaks another version of the protocol"},
    };

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        uint8_t before = identity_of_7[wrong[i].byte];
        struct bench *bench = *test_state;

        identity_of_7[wrong[i].byte] = wrong[i].value;
        assert_int_equal(start_up(bench, 100), HOST_FAILED);
        assert_string_equal(host_message(bench->host), wrong[i].message);
        identity_of_7[wrong[i].byte] = before;
        bench_tear_down(test_state);
        set_up(test_state);
    }
}

TEST_WITH(a_refused_request_is_named, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    result = 3;
    assert_int_equal(start_up(bench, 100), HOST_FAILED);
    assert_string_equal(host_message(bench->host), "board 3 on can0 refuses a start-up request");
}

TEST_WITH(stopping_switches_all_off_with_one_frame, set_up, bench_tear_down)
{
    struct bench *bench = *test_state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    for (size_t i = 0; i < AXES; i++) {
        host_set_voltage(bench->host, i, 5);
        host_set_motor(bench->host, i, false);
    }
    bench->nseen = 0;
    one_period(bench);
    assert_true(was_sent(bench, CLASSIC, MODE, 5, (const uint8_t[]){0, 0x1f, 0, 0, 0}));
    assert_true(was_sent(bench, FD, MODE, 5, (const uint8_t[]){0, 0x1f, 0, 0, 0}));
    assert_true(was_sent(bench, CLASSIC, COMMAND, 8, (const uint8_t[8]){0}));
}
