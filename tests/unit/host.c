/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host library against boards played by the test, frame by frame as the iCub protocol has them.
 */
#include "canbus/port.h"
#include "tasks/host.h"
#include "tasks/servo.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

enum { MOTOR = 2, STRAIN = 13 };

struct bench {
    struct arena arena;
    struct local_bus *bus;
    struct can_port *host_port, *board_port;
    struct host_axis axis[2];
    struct host_ft ft[1];
    struct host_config config;
    struct host *host;
    int64_t now_ns;
    struct bus_frame seen[512]; /* everything that the host sent */
    size_t nseen;
    bool mute_strain;
};

static int set_up(void **state)
{
    static struct bench bench;
    struct error error;

    memset(&bench, 0, sizeof bench);
    assert_int_equal(arena_init(&bench.arena, 16u << 20, &error), ERROR_NONE);
    assert_int_equal(local_bus_create("can0", 4, 256, false, &bench.arena, &bench.bus, &error), 0);
    assert_int_equal(local_bus_join(bench.bus, NULL, 0, &bench.host_port, &error), 0);
    assert_int_equal(local_bus_join(bench.bus, NULL, 0, &bench.board_port, &error), 0);
    for (int k = 0; k < 2; k++) {
        bench.axis[k] = (struct host_axis){
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
    bench.ft[0] = (struct host_ft){.name = "foot", .bus = 0, .address = STRAIN};
    bench.config = (struct host_config){
        .nbus = 1,
        .port = &bench.host_port,
        .naxis = 2,
        .axis = bench.axis,
        .nft = 1,
        .ft = bench.ft,
        .supply_v = 48,
        .period_ns = 1000000,
    };
    assert_int_equal(host_create(&bench.config, &bench.arena, &bench.host, &error), 0);
    *state = &bench;
    return 0;
}

static int tear_down(void **state)
{
    struct bench *bench = *state;

    bench->host_port->ops->close(bench->host_port);
    bench->board_port->ops->close(bench->board_port);
    local_bus_destroy(bench->bus);
    arena_fini(&bench->arena);
    return 0;
}

static void say(struct bench *bench, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame frame = frame_make(id, len, data);

    assert_int_equal(can_send(bench->board_port, &frame, 1), 1);
}

/* the boards' side of one period */
static void play_boards(struct bench *bench)
{
    struct bus_frame frame;

    while (can_receive(bench->board_port, &frame, 1) == 1) {
        assert_true(bench->nseen < sizeof bench->seen / sizeof bench->seen[0]);
        bench->seen[bench->nseen++] = frame;
        if (frame.id == 0x70f) {
            say(bench, 0x720, 5, (const uint8_t[]){0xff, 4, 3, 0, 1});
            if (!bench->mute_strain) {
                say(bench, 0x7d0, 5, (const uint8_t[]){0xff, 6, 3, 0, 5});
            }
        } else if (frame.id == 0x002 && frame.data[0] == 0x5b) {
            say(bench, 0x020, 8, (const uint8_t[]){0x5b, 4, 3, 0, 1, 1, 6, 1});
        } else if (frame.id == 0x002 && (frame.data[0] & 0x7f) == 0x09) {
            /* STATUS: both axes in open loop */
            say(bench, 0x123, 8, (const uint8_t[]){0, 0x50, 0, 0x50, 0, 0, 0, 0});
            say(bench, 0x121, 8, (const uint8_t[]){0, 4, 0, 0, 0, 0xfc, 0xff, 0xff});
            say(bench, 0x12a, 8, (const uint8_t[]){0, 0, 1, 0, 0, 0, 0, 0});
        } else if (frame.id == 0x20d && frame.data[0] == 0x1c) {
            say(bench, 0x2d0, 8, (const uint8_t[]){0x1c, 6, 3, 0, 5, 1, 0, 1});
        } else if (frame.id == 0x20d && frame.data[0] == 0x18) {
            uint8_t full_scale = frame.data[1] < 3 ? 200 : 40;

            say(bench, 0x2d0, 4, (const uint8_t[]){0x18, frame.data[1], 0, full_scale});
        }
    }
}

static enum host_phase start_up(struct bench *bench, int periods)
{
    enum host_phase phase = HOST_DISCOVERING;

    for (int i = 0; i < periods && phase != HOST_READY && phase != HOST_FAILED; i++) {
        assert_true(host_receive(bench->host, bench->now_ns));
        phase = host_start_up(bench->host);
        host_send(bench->host);
        play_boards(bench);
        bench->now_ns += bench->config.period_ns;
    }
    return phase;
}

static bool was_sent(const struct bench *bench, uint32_t id, uint8_t len, const uint8_t *data)
{
    for (size_t i = 0; i < bench->nseen; i++) {
        const struct bus_frame *frame = &bench->seen[i];

        if (frame->id == id && frame->len == len && memcmp(frame->data, data, len) == 0) {
            return true;
        }
    }
    return false;
}

static void start_up_discovers_configures_and_enables(void **state)
{
    struct bench *bench = *state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(was_sent(bench, 0x70f, 1, (const uint8_t[]){0xff}));
    assert_true(was_sent(bench, 0x002, 3, (const uint8_t[]){0x5b, 1, 6}));
    /* POSITION, STATUS, CURRENT, MOTOR_POSITION */
    assert_true(was_sent(bench, 0x002, 5, (const uint8_t[]){0x49, 0x0d, 0x02, 0, 0}));
    assert_true(was_sent(bench, 0x002, 2, (const uint8_t[]){0x09, 0x50}));
    assert_true(was_sent(bench, 0x002, 2, (const uint8_t[]){0x89, 0x50}));
    assert_true(was_sent(bench, 0x20d, 2, (const uint8_t[]){0x18, 5}));
    assert_true(was_sent(bench, 0x20d, 2, (const uint8_t[]){0x07, 0}));
}

static void a_silent_board_is_named(void **state)
{
    struct bench *bench = *state;

    bench->mute_strain = true;
    assert_int_equal(start_up(bench, 10000), HOST_FAILED);
    assert_string_equal(host_message(bench->host), "board 13 on can0 does not answer discovery");
}

static void telemetry_is_scaled_to_si_units(void **state)
{
    struct bench *bench = *state;
    const struct host_force *force;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0x124, 8, (const uint8_t[]){0xe8, 0x03, 0x18, 0xfc, 0, 0, 0, 0});
    /* 0xC000 is half of the full scale, 200 N; 0x4000 is minus half of 40 N m */
    say(bench, 0x3da, 6, (const uint8_t[]){0x00, 0x80, 0x00, 0x80, 0x00, 0xc0});
    say(bench, 0x3db, 6, (const uint8_t[]){0x00, 0x40, 0x00, 0x80, 0x00, 0x80});
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

static void a_quarter_of_the_supply_is_333_counts(void **state)
{
    struct bench *bench = *state;

    host_receive(bench->host, 0);
    host_set_voltage(bench->host, 0, 12);
    host_set_voltage(bench->host, 1, -480);
    host_send(bench->host);
    play_boards(bench);
    assert_int_equal(bench->nseen, 2);
    assert_true(was_sent(bench, 0x002, 3, (const uint8_t[]){0x72, 0x4d, 0x01}));
    assert_true(was_sent(bench, 0x002, 3, (const uint8_t[]){0xf2, 0xcb, 0xfa})); /* -1333 */
}

static void faults_and_silence_are_reported(void **state)
{
    struct bench *bench = *state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(host_healthy(bench->host));
    host_receive(bench->host, bench->now_ns + 300000000);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint hip has gone silent");
}

static void an_over_current_fault_fails_the_host(void **state)
{
    struct bench *bench = *state;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    say(bench, 0x123, 8, (const uint8_t[]){0, 0x50, 0x08, 0xa0, 0, 0, 0, 0});
    host_receive(bench->host, bench->now_ns);
    assert_false(host_healthy(bench->host));
    assert_string_equal(host_message(bench->host), "joint knee is in fault 0x08");
}

static void foreign_and_short_frames_change_nothing(void **state)
{
    struct bench *bench = *state;
    struct bus_frame odd = frame_make(0x121, 8, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7, 8});
    double before;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    host_receive(bench->host, bench->now_ns);
    before = host_joint(bench->host, 0)->joint_rad;
    say(bench, 0x121, 7, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7});
    say(bench, 0x1e1, 8, (const uint8_t[]){1, 2, 3, 4, 5, 6, 7, 8});
    odd.flags = FRAME_EXTENDED;
    can_send(bench->board_port, &odd, 1);
    host_receive(bench->host, bench->now_ns);
    assert_true(host_joint(bench->host, 0)->joint_rad == before);
}

static void servo_drives_towards_the_reference(void **state)
{
    struct bench *bench = *state;
    struct servo_config config = {
        .kp_v_per_rad = 100,
        .ki_v_per_rad_s = 200,
        .kw_v_s_per_rad = 4,
        .command_period_ns = 2000000,
    };
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(start_up_discovers_configures_and_enables, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_silent_board_is_named, set_up, tear_down),
        cmocka_unit_test_setup_teardown(telemetry_is_scaled_to_si_units, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_quarter_of_the_supply_is_333_counts, set_up, tear_down),
        cmocka_unit_test_setup_teardown(faults_and_silence_are_reported, set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_over_current_fault_fails_the_host, set_up, tear_down),
        cmocka_unit_test_setup_teardown(foreign_and_short_frames_change_nothing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(servo_drives_towards_the_reference, set_up, tear_down),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
