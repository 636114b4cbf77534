/* SPDX-License-Identifier: Apache-2.0 */
/* The host against moteus controllers played by the test, by the document "CAN Protocol" of
 * github.com/mjbots/moteus: controllers 1 and 9 on a CAN FD bus. */
#include "tests/unit/tasks/host_bench.h"

enum { AXES = 2, FAR = 9 };

static const char *const joint[AXES] = {"hip", "knee"};
static uint8_t mode[AXES], fault[AXES];

/* What the host is to ask: mode, position to torque, absolute position, voltage to fault. */
#define QUESTION 0x11, 0x00, 0x1f, 0x01, 0x1d, 0x06, 0x13, 0x0d

static bool asks(const struct bus_frame *frame, int from)
{
    static const uint8_t question[] = {QUESTION};

    return memcmp(frame->data + from, question, sizeof question) == 0;
}

/* 0.25 turn, -0.5 turn/s, 2 N m, the link at 0.98 turn (which is -0.02), 48 V, 30 degC */
static void answer(struct bench *bench, int bus, int axis)
{
    const uint8_t reply[32] = {
        0x21, 0x00, mode[axis],                                   /* mode */
        0x2f, 0x01, 0,          0,    0x80,        0x3e,          /* position */
        0,    0,    0,          0xbf, 0,           0,    0, 0x40, /* velocity, torque */
        0x2d, 0x06, 0x48,       0xe1, 0x7a,        0x3f,          /* absolute position */
        0x23, 0x0d, 96,         30,   fault[axis],                /* voltage, .. fault */
        0x50, 0x50, 0x50,       0x50};
    struct bus_frame frame = {.id = axis == 0 ? 0x100 : FAR << 8,
                              .flags = FRAME_FD | FRAME_BRS | (axis == 0 ? 0 : FRAME_EXTENDED),
                              .len = sizeof reply};

    memcpy(frame.data, reply, sizeof reply);
    say_frame(bench, bus, &frame);
}

static void play(struct bench *bench, int bus, const struct bus_frame *frame)
{
    int axis = (frame->id & 0xff) == FAR;

    assert_int_equal(frame->flags, FRAME_EXTENDED | FRAME_FD | FRAME_BRS);
    assert_true(frame->id == 0x8001 || frame->id == 0x8000 + FAR);
    if (frame->data[0] == 0x01 && frame->data[2] == 0) {
        assert_true(frame->len == 12 && asks(frame, 3) && frame->data[11] == 0x50);
        mode[axis] = 0;
    } else if (frame->data[0] == 0x01) {
        assert_true(frame->len == 24 && asks(frame, 15) && frame->data[23] == 0x50);
        mode[axis] = mode[axis] == 0 ? 3 : mode[axis] == 3 ? 10 : mode[axis];
    } else {
        assert_true(frame->len == 8 && asks(frame, 0));
    }
    if (!bench->mute || axis == 0) {
        answer(bench, bus, axis);
    }
}

static inline void set_up(struct bench *bench)
{
    static struct host_axis axis[AXES];
    static const struct host_bus bus[] = {{.protocol = "moteus", .fd = true}};
    const struct host_config config = {
        .nbus = 1, .bus = bus, .naxis = AXES, .axis = axis, .supply_v = 48, .period_ns = 1000000};

    memset(fault, 0, sizeof fault);
    memset(mode, 1, sizeof mode); /* in fault, from an earlier run */
    for (int k = 0; k < AXES; k++) {
        axis[k] = (struct host_axis){.joint = joint[k],
                                     .address = k == 0 ? 1 : FAR,
                                     .torque_address = -1,
                                     .drive = {.gear = 100,
                                               .spring_nm_rad = k == 0 ? 200 : 0,
                                               .winding_ohm = 0.5,
                                               .torque_nm_a = 4,
                                               .bemf_v_s_rad = 4}};
    }
    bench->play[0] = play;
    bench_open(bench, &config);
}

BENCH(set_up, struct bench, bench_close)

TEST_ON(start_up_finds_stops_and_enables, set_up, bench)
{
    const uint8_t question[] = {QUESTION}, stop[12] = {1, 0, 0, QUESTION, 0x50};
    assert_int_equal(start_up(bench, 100), HOST_READY);
    for (uint32_t a = 1; a <= FAR; a += FAR - 1) {
        int asked = find_sent(bench, 0, 0, 0x8000 + a, 8, question);
        int off = find_sent(bench, 0, 0, 0x8000 + a, 12, stop);

        assert_true(asked >= 0 && off > asked);
    }
    assert_true(host_healthy(bench->host));
}

TEST_ON(a_lost_frame_does_not_stop_the_start_up, set_up, bench)
{
    check_start_up_without_each_frame(bench, set_up);
}

TEST_ON(a_voltage_is_a_torque, set_up, bench)
{
    const struct bus_frame *frame;
    float torque;

    reach_ready(bench);
    bench->nseen = 0;
    host_set_voltage(bench->host, 0, 6);
    one_period(bench);
    frame = &bench->seen[0];
    /* mode position, the present one; kp scaled to 0 */
    assert_memory_equal(frame->data, ((const uint8_t[]){1, 0, 10, 1, 0x20, 0x80, 0x0d, 0x22}), 8);
    assert_memory_equal(frame->data + 12, ((const uint8_t[]){1, 0x23, 0}), 3);
    memcpy(&torque, frame->data + 8, sizeof torque);
    assert_near(torque, 6 / 0.5 * 4, 1e-4); /* 0.5 Ohm, 4 N m/A */
}

TEST_ON(replies_are_angles_current_and_torque, set_up, bench)
{
    const struct host_joint *hip = host_joint(bench->host, 0), *knee = host_joint(bench->host, 1);

    reach_ready(bench);
    assert_near(hip->motor_rad, M_PI / 2, 1e-6);
    assert_near(hip->joint_rad, -0.02 * 2 * M_PI, 1e-6);
    assert_near(hip->torque_nm, 200 * 0.27 * 2 * M_PI, 1e-4); /* the spring's */
    assert_near(knee->torque_nm, 2, 1e-6);                    /* without one the motor's */
    assert_near(hip->current_a, 0.5, 1e-6);
    assert_true(hip->torque_told && hip->torque_time_ns == bench->now_ns);
}

TEST_ON(a_fault_and_the_watchdog_are_told, set_up, bench)
{
    reach_ready(bench);

    mode[1] = 1;
    fault[1] = 34;
    one_period(bench);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint knee is in fault 0x04: over-voltage");
    reopen(bench, set_up);
    assert_int_equal(start_up(bench, 100), HOST_READY);
    mode[0] = 11;
    one_period(bench);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint hip is in fault 0x00: watchdog time-out");
}

TEST_ON(a_silent_controller_is_missed, set_up, bench)
{
    bench->mute = true;
    assert_int_equal(start_up(bench, 9000), HOST_FAILED);
    assert_string_equal(host_message(bench->host),
                        "board 9 on can0 does not answer discovery (66 frames sent on this bus, 33 "
                        "received)");
    assert_true(host_lost(bench->host));
}

/* Frames that are cut off, of others, or that say nothing of use. */
TEST_ON(odd_frames_change_nothing, set_up, bench)
{
    static const uint8_t odd[][8] = {
        {0x2f, 0x01, 1, 2, 3},    {0x2c, 0xff, 0xff, 0xff},       {0x23, 0x0d, 1, 2},
        {0x24, 0x80, 0x80, 0x80}, {0x2d, 0x01, 0, 0, 0xc0, 0x7f}, {0x31, 0x01, 0x01}};
    reach_ready(bench);
    struct host_joint before;

    before = *host_joint(bench->host, 0);
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        for (uint8_t len = 0; len <= 8; len++) {
            say_fd(bench, 0, 0x100, len, odd[i]);
            say_fd(bench, 0, 0x101, len, odd[i]); /* to another host */
            say_fd(bench, 0, 0x200, len, odd[i]); /* from nobody of ours */
        }
    }
    host_receive(bench->host, bench->now_ns);
    assert_memory_equal(host_joint(bench->host, 0), &before, sizeof before);
}
