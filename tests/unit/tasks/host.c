/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host against iCub boards played by the test.
 */
#include "tests/unit/tasks/host_bench.h"

#include "tasks/servo.h"

enum { MOTOR = 2, STRAIN = 13 };

static bool motor_in_bootloader;

static void play(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x702 && frame->len == 1 && frame->data[0] == 0x04) {
        motor_in_bootloader = false;
        say(bench, bus, 0x720, 2, (const uint8_t[]){0x04, 1});
    } else if (frame->id == 0x70f && motor_in_bootloader) {
        say(bench, bus, 0x720, 4, (const uint8_t[]){0xff, 0, 2, 0x51});
        say(bench, bus, 0x7d0, 5, (const uint8_t[]){0xff, 6, 3, 0, 5});
    } else if (frame->id == 0x70f) {
        say(bench, bus, 0x720, 5, (const uint8_t[]){0xff, 4, 3, 0, 1});
        if (!bench->mute) {
            say(bench, bus, 0x7d0, 5, (const uint8_t[]){0xff, 6, 3, 0, 5});
        }
    } else if (frame->id == 0x002 && frame->data[0] == 0x5b) {
        say(bench, bus, 0x020, 8, (const uint8_t[]){0x5b, 4, 3, 0, 1, 1, 6, 1});
    } else if (frame->id == 0x002 && (frame->data[0] & 0x7f) == 0x09) {
        uint8_t mode = frame->data[1] == 0x50 ? 0x50 : 0;

        say(bench, bus, 0x123, 8, (const uint8_t[]){0, mode, 0, mode, 0, 0, 0, 0});
        say(bench, bus, 0x121, 8, (const uint8_t[]){0, 4, 0, 0, 0, 0xfc, 0xff, 0xff});
        say(bench, bus, 0x12a, 8, (const uint8_t[]){0, 0, 1, 0, 0, 0, 0, 0});
    } else if (frame->id == 0x20d && frame->data[0] == 0x1c) {
        say(bench, bus, 0x2d0, 8, (const uint8_t[]){0x1c, 6, 3, 0, 5, 1, 0, 1});
    } else if (frame->id == 0x20d && frame->data[0] == 0x18) {
        uint8_t full_scale = frame->data[1] < 3 ? 200 : 40;

        say(bench, bus, 0x2d0, 4, (const uint8_t[]){0x18, frame->data[1], 0, full_scale});
    }
}

static inline void set_up(struct bench *bench)
{
    static struct host_axis axis[2];
    static const struct host_ft ft[1] = {
        {.name = "foot", .bus = 0, .address = STRAIN, .period_ns = 5000000}};
    struct host_config config = {
        .nbus = 1,
        .naxis = 2,
        .axis = axis,
        .nft = 1,
        .ft = ft,
        .supply_v = 48,
        .period_ns = 1000000,
    };

    for (int k = 0; k < 2; k++) {
        axis[k] = (struct host_axis){
            .joint = k ? "knee" : "hip",
            .bus = 0,
            .address = MOTOR,
            .axis = (uint8_t)k,
            .joint_ticks_per_rad = 4096 / (2 * M_PI),
            .motor_ticks_per_rad = 409600 / (2 * M_PI),
            .torque_address = -1,
            .lower_rad = -2,
            .upper_rad = 2,
        };
    }
    bench->play[0] = play;
    bench_open(bench, &config);
}

BENCH(set_up, struct bench, bench_close)

TEST_ON(start_up_discovers_configures_and_enables, set_up, bench)
{
    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_int_equal(host_round_trip_ns(bench->host), bench->config.period_ns);
    assert_true(was_sent(bench, 0, 0x70f, 1, (const uint8_t[]){0xff}));
    assert_true(was_sent(bench, 0, 0x002, 3, (const uint8_t[]){0x5b, 1, 6}));
    /* POSITION, STATUS, CURRENT, MOTOR_POSITION */
    assert_true(was_sent(bench, 0, 0x002, 5, (const uint8_t[]){0x49, 0x0d, 0x02, 0, 0}));
    assert_true(was_sent(bench, 0, 0x002, 2, (const uint8_t[]){0x09, 0x50}));
    assert_true(was_sent(bench, 0, 0x002, 2, (const uint8_t[]){0x89, 0x50}));
    /* only force idle leaves a fault that an earlier host has left behind */
    assert_true(find_sent(bench, 0, 0, 0x002, 2, (const uint8_t[]){0x09, 0x09}) <
                find_sent(bench, 0, 0, 0x002, 2, (const uint8_t[]){0x09, 0x50}));
    assert_true(was_sent(bench, 0, 0x20d, 2, (const uint8_t[]){0x08, 5}));
    assert_true(was_sent(bench, 0, 0x20d, 2, (const uint8_t[]){0x18, 5}));
    assert_true(was_sent(bench, 0, 0x20d, 2, (const uint8_t[]){0x07, 0}));
}

/* Boards hear the bus once in five periods, a request goes out in the first of them */
TEST_ON(the_round_trip_is_the_shortest_to_an_answer, set_up, bench)
{
    enum host_phase phase = HOST_DISCOVERING;

    host_receive(bench->host, bench->now_ns);
    for (int i = 0; i < 1000 && phase < HOST_READY; i++) {
        phase = host_start_up(bench->host);
        host_send(bench->host);
        if (i % 5 == 4) {
            play_boards(bench);
        }
        bench->now_ns += bench->config.period_ns;
        assert_true(host_receive(bench->host, bench->now_ns));
    }
    assert_int_equal(phase, HOST_READY);
    assert_int_equal(host_round_trip_ns(bench->host), 4 * bench->config.period_ns);
}

/* A bootloader that has been asked stays until it is told to go. */
TEST_ON(a_board_in_its_bootloader_is_sent_to_its_application, set_up, bench)
{
    motor_in_bootloader = true;
    assert_int_equal(start_up(bench, 10000), HOST_READY);
    assert_true(was_sent(bench, 0, 0x702, 1, (const uint8_t[]){0x04}));
}

TEST_ON(a_silent_board_is_named, set_up, bench)
{
    bench->mute = true;
    assert_int_equal(start_up(bench, 10000), HOST_FAILED);
    assert_string_equal(
        host_message(bench->host),
        "board 13 on can0 does not answer discovery (33 frames sent on this bus, 33 "
        "received)");
    assert_true(host_lost(bench->host));
}

TEST_ON(a_lost_frame_does_not_stop_the_start_up, set_up, bench)
{
    check_start_up_without_each_frame(bench, set_up);
}

TEST_ON(telemetry_is_scaled_to_si_units, set_up, bench)
{
    const struct host_force *force;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0, 0x124, 8, (const uint8_t[]){0xe8, 0x03, 0x18, 0xfc, 0, 0, 0, 0});
    /* 0xC000 is half of the full scale, 200 N; 0x4000 is minus half of 40 N m */
    say(bench, 0, 0x3da, 6, (const uint8_t[]){0x00, 0x80, 0x00, 0x80, 0x00, 0xc0});
    say(bench, 0, 0x3db, 6, (const uint8_t[]){0x00, 0x40, 0x00, 0x80, 0x00, 0x80});
    host_receive(bench->host, bench->now_ns);
    force = host_force(bench->host, 0);
    assert_true(fabs(host_joint(bench->host, 0)->joint_rad - M_PI / 2) < 1e-12);
    assert_true(fabs(host_joint(bench->host, 1)->joint_rad + M_PI / 2) < 1e-12);
    assert_true(fabs(host_joint(bench->host, 0)->motor_rad - 65536 * 2 * M_PI / 409600) < 1e-12);
    assert_true(fabs(host_joint(bench->host, 0)->current_a - 1) < 1e-12);
    assert_true(fabs(host_joint(bench->host, 1)->current_a + 1) < 1e-12);
    assert_true(force->force_n[2] == 100 && force->force_n[0] == 0);
    assert_true(force->torque_nm[0] == -20 && force->torque_nm[2] == 0);
}

TEST_ON(a_quarter_of_the_supply_is_333_counts, set_up, bench)
{
    host_receive(bench->host, 0);
    host_set_voltage(bench->host, 0, 12);
    host_set_voltage(bench->host, 1, -480);
    host_send(bench->host);
    play_boards(bench);
    assert_int_equal(bench->nseen, 2);
    assert_true(was_sent(bench, 0, 0x002, 3, (const uint8_t[]){0x72, 0x4d, 0x01}));
    assert_true(was_sent(bench, 0, 0x002, 3, (const uint8_t[]){0xf2, 0xcb, 0xfa})); /* -1333 */
}

TEST_ON(faults_and_silence_are_reported, set_up, bench)
{
    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(host_healthy(bench->host));
    assert_false(host_lost(bench->host));
    host_receive(bench->host, bench->now_ns + 300000000);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint hip sends no telemetry");
    assert_true(host_lost(bench->host));
}

TEST_ON(an_over_current_fault_fails_the_host, set_up, bench)
{
    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0, 0x123, 8, (const uint8_t[]){0, 0x50, 0x08, 0xa0, 0, 0, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint knee is in fault 0x08: over-current");
    assert_false(host_lost(bench->host));
}

TEST_ON(a_fault_without_a_bit_is_explained, set_up, bench)
{
    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0, 0x123, 8, (const uint8_t[]){0, 0x50, 0, 0xa0, 0, 0, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_non_null(
        strstr(host_message(bench->host), "joint knee is in fault 0x00: a strict board"));
}

TEST_ON(a_motor_that_goes_off_by_itself_fails_the_host, set_up, bench)
{
    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0, 0x123, 8, (const uint8_t[]){0, 0x00, 0, 0x50, 0, 0, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint hip has switched its motor off");
    /* without a fault: the board has started anew */
    assert_true(host_lost(bench->host));
}

TEST_ON(foreign_and_short_frames_change_nothing, set_up, bench)
{
    struct bus_frame odd = frame_make(0x121, 8, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7, 8});
    double before;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    host_receive(bench->host, bench->now_ns);
    before = host_joint(bench->host, 0)->joint_rad;
    say(bench, 0, 0x121, 7, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7});
    say(bench, 0, 0x1e1, 8, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7, 8});
    odd.flags = FRAME_EXTENDED;
    can_send(bench->board_port[0], &odd, 1);
    host_receive(bench->host, bench->now_ns);
    assert_true(host_joint(bench->host, 0)->joint_rad == before);
}

TEST_ON(servo_drives_towards_the_reference, set_up, bench)
{
    const struct servo_gains gains[] = {
        {.kp_v_per_rad = 100, .ki_v_per_rad_s = 200, .kw_v_s_per_rad = 4},
        {.kp_v_per_rad = 100, .ki_v_per_rad_s = 200, .kw_v_s_per_rad = 4}};
    const struct servo_config config = {.gains = gains, .command_period_ns = 2000000};
    struct servo *servo;
    struct error error;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_int_equal(servo_create(&config, bench->host, &bench->arena, &servo, &error), 0);
    servo_start(servo);
    servo_set(servo, 0, servo_reference(servo, 0) + 0.1, 0.5);
    bench->nseen = 0;
    for (int i = 0; i < 4; i++) { /* commands go out every other period */
        host_receive(bench->host, bench->now_ns);
        servo_update(servo);
        host_send(bench->host);
        play_boards(bench);
        bench->now_ns += bench->config.period_ns;
    }
    assert_int_equal(bench->nseen, 4);
    /* 100 * 0.1 + 4 * 0.5 = 12 V, then 200 * 0.1 * 2 ms = 0.04 V more */
    assert_memory_equal(bench->seen[0].data, ((const uint8_t[]){0x72, 0x4d, 0x01}), 3);
    assert_memory_equal(bench->seen[2].data, ((const uint8_t[]){0x72, 0x4d, 0x01}), 3);
    assert_memory_equal(bench->seen[1].data, ((const uint8_t[]){0xf2, 0x00, 0x00}), 3);
}
