/* SPDX-License-Identifier: Apache-2.0 */
/* The host against FOC boards played by the test: four motors and a joint torque board on a bus. */
#include "tests/unit/tasks/host_bench.h"

enum { AXES = 4, TORQUE = 12 };

static const char *const joint[AXES] = {"pitch", "roll", "yaw", "elbow"};

static void answer_targets(struct bench *bench, int bus, int address)
{
    uint32_t id = 0x100u | (uint32_t)address << 4;
    uint8_t mode = bench->mute ? 0 : 0x50;

    /* -1500 mA, 0 icubdeg/ms, 1043038 icubdeg = 1 rad behind a gear of 100 */
    say(bench, bus, id, 8, (const uint8_t[]){0x24, 0xfa, 0, 0, 0x5e, 0xea, 0x0f, 0});
    say(bench, bus, id | 3, 8, (const uint8_t[]){mode, 0, 0, 0, 0, 0, 0, 0});
}

static void play(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x70f) {
        for (uint32_t a = 1; a <= AXES; a++) {
            say(bench, bus, 0x700 | a << 4, 5, (const uint8_t[]){0xff, 8, 3, 0, 1});
        }
        say(bench, bus, 0x7c0, 5, (const uint8_t[]){0xff, 6, 3, 0, 5});
    } else if (frame->id >> 8 == 0 && frame->data[0] == 0x5b) {
        say(bench, bus, (frame->id & 0xf) << 4, 8, (const uint8_t[]){0x5b, 8, 3, 0, 1, 1, 6, 1});
    } else if (frame->id == 0x20c && frame->data[0] == 0x1c) {
        say(bench, bus, 0x2c0, 8, (const uint8_t[]){0x1c, 6, 3, 0, 5, 1, 0, 1});
    } else if (frame->id == 0x10f) {
        for (int a = 1; a <= AXES; a++) {
            answer_targets(bench, bus, a);
        }
    }
}

static void open_with_period(struct bench *bench, int64_t period_ns)
{
    static struct host_axis axis[AXES];
    static const struct host_bus bus[] = {{.protocol = "foc"}};
    struct host_config config = {
        .nbus = 1,
        .bus = bus,
        .naxis = AXES,
        .axis = axis,
        .supply_v = 48,
        .period_ns = period_ns,
    };

    for (int k = 0; k < AXES; k++) {
        axis[k] = (struct host_axis){
            .joint = joint[k],
            .address = (uint8_t)(k + 1),
            .joint_ticks_per_rad = 4096 / (2 * M_PI),
            .motor_ticks_per_rad = 409600 / (2 * M_PI),
            .torque_address = k == 1 ? TORQUE : -1,
            .torque_channel = 2,
            .torque_full_scale_nm = 64,
            .torque_period_ns = 10000000,
            .drive = {.gear = 100,
                      .spring_nm_rad = 200,
                      .winding_ohm = 0.6,
                      .winding_h = 0.0003,
                      .current_limit_a = 12,
                      .poles = 14},
        };
    }
    bench->play[0] = play;
    bench_open(bench, &config);
}

static void set_up(struct bench *bench)
{
    open_with_period(bench, 1000000);
}

BENCH(set_up, struct bench, bench_close)
CLOSED_BENCH(bench, struct bench, bench_close)

TEST_ON(start_up_discovers_configures_and_enables, set_up, bench)
{
    reach_ready(bench);

    assert_true(was_sent(bench, 0, 0x70f, 1, (const uint8_t[]){0xff}));
    for (uint32_t a = 1; a <= AXES; a++) {
        int off = find_sent(bench, 0, 0, a, 2, (const uint8_t[]){0x09, 0x09});

        assert_true(was_sent(bench, 0, a, 3, (const uint8_t[]){0x5b, 1, 6}));
        /* rotor encoder of 4096 ticks, 14 poles; 12, 18 and 24 A */
        assert_true(was_sent(bench, 0, a, 7, (const uint8_t[]){0x77, 1, 0, 0x10, 0, 0, 14}));
        assert_true(was_sent(bench, 0, a, 8,
                             (const uint8_t[]){0x48, 0, 0xe0, 0x2e, 0x50, 0x46, 0xc0, 0x5d}));
        /* by the rule in the head of boards/foc/board.c with g = 1/2 and a = exp(-2): 134.45 and
         * 204.8 shifted by 15 */
        assert_true(was_sent(bench, 0, a, 8, (const uint8_t[]){0x65, 134, 0, 205, 0, 0, 0, 15}));
        assert_true(off >= 0);
        assert_true(find_sent(bench, off, 0, a, 2, (const uint8_t[]){0x09, 0x50}) > off);
    }
    /* no broadcast policy: these boards have none */
    for (size_t i = 0; i < bench->nseen; i++) {
        assert_false(bench->seen[i].id >> 8 == 0 && bench->seen[i].data[0] == 0x49);
    }
    assert_true(was_sent(bench, 0, 0x20c, 2, (const uint8_t[]){0x08, 10}));
    assert_true(was_sent(bench, 0, 0x20c, 2, (const uint8_t[]){0x07, 0}));
}

TEST_ON(a_lost_frame_does_not_stop_the_start_up, set_up, bench)
{
    check_start_up_without_each_frame(bench, set_up);
}

TEST_ON(no_target_goes_out_before_the_motors_are_switched_on, set_up, bench)
{
    reach_ready(bench);
    int on;

    on = find_sent(bench, 0, 0, 0x001, 2, (const uint8_t[]){0x09, 0x50});
    for (int i = 0; i < on; i++) {
        assert_true(bench->seen[i].id != 0x10f);
    }
    assert_true(was_sent(bench, 0, 0x10f, 8, (const uint8_t[8]){0}));
}

TEST_ON(half_of_the_supply_is_16000_counts, set_up, bench)
{
    reach_ready(bench);

    host_set_voltage(bench->host, 0, 24);
    host_set_voltage(bench->host, 1, -48);
    host_set_voltage(bench->host, 2, 480);
    host_set_voltage(bench->host, 3, -0.0015);
    bench->nseen = 0;
    one_period(bench);
    assert_int_equal(bench->nseen, 1);
    /* 16000, -32000, 32000, -1 */
    assert_true(was_sent(bench, 0, 0x10f, 8,
                         (const uint8_t[]){0x80, 0x3e, 0x00, 0x83, 0x00, 0x7d, 0xff, 0xff}));
}

TEST_ON(the_last_targets_are_repeated_every_millisecond, set_up, bench)
{
    reach_ready(bench);

    host_set_voltage(bench->host, 0, 24);
    bench->nseen = 0;
    for (int i = 0; i < 20; i++) {
        one_period(bench);
    }
    assert_int_equal(bench->nseen, 20);
    for (size_t i = 0; i < 20; i++) {
        assert_memory_equal(bench->seen[i].data, ((const uint8_t[]){0x80, 0x3e, 0, 0}), 4);
    }
}

TEST_ON(half_a_millisecond_of_period_sends_every_other_time, bench, bench)
{
    open_with_period(bench, 500000);
    assert_int_equal(start_up(bench, 100), HOST_READY);
    bench->nseen = 0;
    for (int i = 0; i < 20; i++) {
        one_period(bench);
    }
    assert_int_equal(count_sent(bench, 0x10f), 10);
}

TEST_ON(rotor_angles_pass_the_gear_and_the_spring_tells_the_link, set_up, bench)
{
    reach_ready(bench);
    const struct host_joint *roll;

    roll = host_joint(bench->host, 1);
    assert_near(host_joint(bench->host, 0)->motor_rad, 1, 1e-6);
    assert_near(host_joint(bench->host, 0)->joint_rad, 1, 1e-6);
    assert_near(host_joint(bench->host, 0)->current_a, -1.5, 1e-12);
    /* channel 2: 0x9000 is an eighth of 64 N m, which bends 200 N m/rad by 0.04 rad */
    say(bench, 0, 0x3ca, 6, (const uint8_t[]){0, 0x80, 0, 0x80, 0x00, 0x90});
    one_period(bench);
    one_period(bench);
    assert_near(roll->torque_nm, 8, 1e-12);
    assert_near(roll->motor_rad - roll->joint_rad, 0.04, 1e-12);
    assert_near(host_joint(bench->host, 0)->joint_rad, 1, 1e-6);
}

TEST_ON(an_expired_set_point_is_named, set_up, bench)
{
    reach_ready(bench);

    assert_true(host_healthy(bench->host));
    /* bit 14, and bit 4 */
    say(bench, 0, 0x133, 8, (const uint8_t[]){0xa0, 0, 0, 0, 0x10, 0x40, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host),
                        "joint yaw is in fault 0x4010: over-current, set-point expired");
}

TEST_ON(a_motor_that_stays_off_is_named, set_up, bench)
{
    bench->mute = true;
    assert_int_equal(start_up(bench, 3000), HOST_FAILED);
    assert_string_equal(host_message(bench->host),
                        "joint pitch does not switch its motor on: its board still reports another "
                        "state (1039 frames sent on this bus, 8002 received)");
}

TEST_ON(stopping_sends_force_idle_and_targets_of_zero, set_up, bench)
{
    reach_ready(bench);

    host_set_voltage(bench->host, 2, 24);
    one_period(bench);
    bench->nseen = 0;
    for (size_t i = 0; i < AXES; i++) {
        host_set_motor(bench->host, i, false);
    }
    one_period(bench);
    assert_int_equal(bench->nseen, AXES + 1);
    assert_true(was_sent(bench, 0, 0x004, 2, (const uint8_t[]){0x09, 0x09}));
    assert_true(was_sent(bench, 0, 0x10f, 8, (const uint8_t[8]){0}));
}

TEST_ON(frames_of_wrong_length_and_from_nobody_change_nothing, set_up, bench)
{
    reach_ready(bench);
    static const uint8_t data[8] = {9, 9, 9, 9, 9, 9, 9, 9};
    double before;

    host_receive(bench->host, bench->now_ns);
    before = host_joint(bench->host, 0)->motor_rad;
    say(bench, 0, 0x110, 7, data);
    say(bench, 0, 0x113, 7, data);
    say(bench, 0, 0x150, 8, data);
    say(bench, 0, 0x1f0, 8, data);
    host_receive(bench->host, bench->now_ns);
    assert_true(host_joint(bench->host, 0)->motor_rad == before);
    assert_true(host_healthy(bench->host));
}

TEST_ON(five_motors_on_a_bus_are_refused, set_up, bench)
{
    static const struct host_bus bus[] = {{.protocol = "foc"}};
    static const struct host_axis axis[] = {{.joint = "fifth",
                                             .address = 5,
                                             .drive = {.gear = 100, .spring_nm_rad = 200},
                                             .torque_address = -1}};
    struct host_config config = bench->config;
    struct error error;
    struct host *host;

    config.bus = bus;
    config.axis = axis;
    config.naxis = 1;
    assert_int_equal(host_create(&config, &bench->arena, &host, &error), ERROR_INPUT);
    assert_string_equal(error.text, "host: no address 5 on bus 0");
}
