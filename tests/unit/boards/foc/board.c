/* SPDX-License-Identifier: Apache-2.0 */
/* A bus of 2FOC boards: configuration, targets, answers, modes, limits and faults. */
#include "boards/foc/protocol.h"
#include "tests/unit/boards/boards_rig.h"

#define GEAR 100.0
#define ROTOR_TICKS 4096.0

static const struct boards_bus_config buses[RIG_BUSES] = {{.personality = BOARD_FOC},
                                                          {.personality = BOARD_ICUB}};

/* bus 0: 2FOC boards 1 (joint 0) and 3 (joint 1), pseudo-STRAIN, F/T; bus 1: an iCub board. */
static void configure(struct rig *rig)
{
    rig_configure(rig);
    for (int i = 0; i < 2; i++) {
        rig->board[i] = rig_motor(i ? "knee" : "hip", 0, i ? 3 : 1, i, -1);
        rig->board[i].axis[0].gear = GEAR;
        rig->board[i].axis[0].motor_ticks_per_rad = GEAR * ROTOR_TICKS / (2.0 * M_PI);
    }
    rig->board[2].torque_joint[2] = -1;
    rig->config.bus = buses;
}

/* Protocol, motor, current limits (4 A nominal, 8 A peak, 20 A), current PID (shift 15). */
static void make_idle(struct rig *rig, uint32_t id)
{
    rig_send(rig, 0, id, "5B 01 06");
    rig_send(rig, 0, id, "77 01 00 10 00 00 0E");
    rig_send(rig, 0, id, "48 00 A0 0F 40 1F 20 4E");
    rig_send(rig, 0, id, "65 92 00 E3 00 00 00 0F");
    rig_tick(rig);
}

static void start(struct rig *rig)
{
    configure(rig);
    rig_start(rig);
    make_idle(rig, 0x001);
    make_idle(rig, 0x003);
}

static void enter(struct rig *rig, const char *mode)
{
    rig_send(rig, 0, 0x001, mode);
}

/* The host's period: targets, then a tick. */
static void target(struct rig *rig, const char *hex)
{
    rig_send(rig, 0, 0x10f, hex);
    rig_tick(rig);
}

static void every_target_is_answered_by_every_board_with_two_frames(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig_tick(&rig);
    assert_null(rig_find(&rig, 0, 0x110)); /* silence without targets */
    rig.sense[0].qm = 2.0 * M_PI / GEAR;   /* one revolution of the rotor */
    rig.sense[0].current_a = -1.234;
    rig_tick(&rig);
    rig_ticks(&rig, 40); /* the estimate of the velocity comes to rest */
    target(&rig, "00 00 00 00 00 00 00 00");
    rig_expect(&rig, 0, 0x110, "2E FB 00 00 00 00 01 00");
    rig_expect(&rig, 0, 0x113, "00 00 00 00 00 00 00 00");
    rig_expect(&rig, 0, 0x130, "00 00 00 00 00 00 00 00");
    rig_expect(&rig, 0, 0x133, "00 00 00 00 00 00 00 00");
    rig_send(&rig, 0, 0x10f, "00 00 00 00 00 00 00 00");
    target(&rig, "00 00 00 00 00 00 00 00");
    assert_int_equal(rig_sent(&rig, 0, 0x110), 2);
    /* a frame of two targets is none for address 3 */
    target(&rig, "00 00 00 00");
    assert_int_equal(rig_sent(&rig, 0, 0x110), 1);
    assert_int_equal(rig_sent(&rig, 0, 0x130), 0);
    assert_int_equal(rig_counters(&rig).malformed, 1);
    for (int i = 0; i < 20; i++) {
        rig_send(&rig, 0, 0x10f, "00 00 00 00 00 00 00 00");
    }
    rig_tick(&rig);
    assert_int_equal(rig_sent(&rig, 0, 0x110), 8); /* the board's buffer */
    assert_int_equal(rig_counters(&rig).overflows, 24);
    rig_stop(&rig);
}

static void velocity_is_in_icubdeg_a_millisecond(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    for (int i = 1; i <= 30; i++) {
        rig.sense[0].qm = i * 1e-3 * 2.0; /* 2 rad/s at the link */
        rig_tick(&rig);
    }
    target(&rig, "00 00");
    /* 2 rad/s * 100 / 2 pi * 65.536 icubdeg/ms a rev/s = 2086; the last tick it stood */
    assert_near((double)get_i16_le(rig_find(&rig, 0, 0x110)->data + 2), 2086.0 / 2.0, 10.0);
    rig_stop(&rig);
}

static void a_board_is_idle_only_when_it_has_everything(void **state)
{
    static const char *const steps[] = {"5B 01 06", "77 01 00 10 00 00 0E",
                                        "48 00 A0 0F 40 1F 20 4E", "65 92 00 E3 00 00 00 0F"};

    (void)state;
    for (int missing = 0; missing < 4; missing++) {
        struct rig rig;

        configure(&rig);
        rig_start(&rig);
        for (int i = 0; i < 4; i++) {
            if (i != missing) {
                rig_send(&rig, 0, 0x001, steps[i]);
            }
        }
        target(&rig, "00 00");
        assert_int_equal(rig_find(&rig, 0, 0x113)->data[0], 0xb0);
        enter(&rig, "09 50");
        target(&rig, "00 10");
        assert_int_equal(rig_find(&rig, 0, 0x113)->data[0], 0xb0);
        assert_false(rig.motor[0].bridge_on);
        if (missing > 0) { /* without the protocol the rest has been refused */
            rig_send(&rig, 0, 0x001, steps[missing]);
            rig_tick(&rig);
            rig_expect(&rig, 0, 0x113, "00 00 00 00 00 00 00 00"); /* told unasked */
        }
        rig_stop(&rig);
    }
}

static void only_the_very_protocol_is_acknowledged(void **state)
{
    struct rig rig;

    (void)state;
    configure(&rig);
    rig_start(&rig);
    rig_ask(&rig, "5B 01 05", "5B 08 03 06 1F 01 06 00");
    rig_ask(&rig, "5B 02 06", "5B 08 03 06 1F 01 06 00");
    rig_ask(&rig, "5B 01 06", "5B 08 03 06 1F 01 06 01");
    rig_ask(&rig, "07", "07 B0");
    rig_ask(&rig, "33", "33 01");
    rig_stop(&rig);
}

static void discovery_tells_a_2foc_and_asks_of_more_are_not_answered(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig_send(&rig, 0, 0x70f, "FF");
    rig_tick(&rig);
    rig_expect(&rig, 0, 0x710, "FF 08 03 06 1F");
    rig_expect(&rig, 0, 0x730, "FF 08 03 06 1F");
    rig_expect(&rig, 0, 0x7d0, "FF 06 03 00 05"); /* the STRAIN board beside them */
    rig_send(&rig, 0, 0x701, "0C");
    rig_tick(&rig);
    assert_int_equal(rig_sent(&rig, 0, 0x710), 0);
    /* bit 7 of a command is no axis here, and most GETs are not there */
    rig_send(&rig, 0, 0x001, "89 50");
    rig_send(&rig, 0, 0x001, "14");
    rig_send(&rig, 0, 0x001, "53");
    assert_int_equal(rig_counters(&rig).unknown, 3);
    rig_stop(&rig);
}

static void open_loop_is_a_share_of_the_supply_up_to_95_percent(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    enter(&rig, "09 50");
    target(&rig, "80 3E"); /* 16000: 50 % */
    assert_true(rig.motor[0].bridge_on);
    assert_near(rig.motor[0].voltage_v, 0.5 * SUPPLY_V, 1e-9);
    rig_expect(&rig, 0, 0x113, "50 00 80 3E 00 00 00 00");
    target(&rig, "00 83"); /* -32000 */
    assert_near(rig.motor[0].voltage_v, -0.95 * SUPPLY_V, 1e-9);
    rig_expect(&rig, 0, 0x113, "50 00 40 89 00 00 00 00");
    assert_false(rig.motor[1].bridge_on);
    enter(&rig, "09 00");
    target(&rig, "00 10");
    assert_false(rig.motor[0].bridge_on);
    assert_true(rig.motor[0].voltage_v == 0.0);
    rig_stop(&rig);
}

static void a_mode_begins_with_set_point_0(void **state)
{
    static const char *const modes[] = {"09 50", "09 06", "09 0A", "09 0B", "09 01"};

    (void)state;
    for (int m = 0; m < 5; m++) {
        struct rig rig;

        start(&rig);
        enter(&rig, "09 50");
        target(&rig, "80 3E");
        enter(&rig, modes[m]);
        rig_tick(&rig);
        assert_true(rig.motor[0].bridge_on);
        assert_near(rig.motor[0].voltage_v, 0.0, 1e-9);
        rig_stop(&rig);
    }
}

static void modes_that_a_2foc_has_not_are_refused(void **state)
{
    static const char *const modes[] = {"09 02", "09 03", "09 04", "09 08", "09 60", "09 A0"};
    struct rig rig;

    (void)state;
    start(&rig);
    for (int m = 0; m < 6; m++) {
        enter(&rig, modes[m]);
        target(&rig, "00 10 00 00 00 00 00 00");
        assert_int_equal(rig_find(&rig, 0, 0x113)->data[0], 0);
    }
    assert_int_equal(rig_counters(&rig).malformed, 6);
    rig_stop(&rig);
}

static void a_set_point_expires_after_50_ms(void **state)
{
    struct board_event event;
    struct rig rig;
    char text[256];

    (void)state;
    start(&rig);
    enter(&rig, "09 50");
    target(&rig, "80 3E");
    rig_ticks(&rig, 49);
    assert_true(rig.motor[0].bridge_on);
    rig_ticks(&rig, 2);
    assert_false(rig.motor[0].bridge_on);
    assert_true(boards_fault(rig.boards));
    assert_true(rig_event(&rig, BOARD_EVENT_TIMEOUT, &event));
    board_event_format(rig.boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "axis 0: the voltage command went stale, a fault"));
    assert_true(rig_event(&rig, BOARD_EVENT_FAULT, &event));
    assert_int_equal(event.a, FOC_FAULT_SET_POINT_EXPIRED);
    board_event_format(rig.boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "hip (bus 0, address 1): axis 0 has a fault: set-point expired"));
    target(&rig, "80 3E");
    rig_expect(&rig, 0, 0x113, "A0 00 00 00 00 40 00 00");
    enter(&rig, "09 50"); /* no way out */
    target(&rig, "00 00");
    assert_int_equal(rig_find(&rig, 0, 0x113)->data[0], 0xa0);
    enter(&rig, "09 09");
    target(&rig, "00 00");
    rig_expect(&rig, 0, 0x113, "00 00 00 00 00 00 00 00");
    rig_ticks(&rig, 200); /* nothing expires in idle */
    assert_false(boards_fault(rig.boards));
    rig_stop(&rig);
}

static void faults_have_their_bits(void **state)
{
    static const struct {
        const char *what, *status;
    } faults[] = {{"over-current", "A0 00 00 00 10 00 00 00"},
                  {"under-voltage", "A0 00 00 00 40 00 00 00"},
                  {"encoder", "A0 08 00 00 00 00 08 00"},
                  {"I2t", "A0 00 00 00 00 00 40 00"}};

    (void)state;
    for (int f = 0; f < 4; f++) {
        struct rig rig;

        start(&rig);
        enter(&rig, "09 50");
        target(&rig, "00 00");
        if (f == 0) {
            rig.sense[0].current_a = -20.5; /* above the overload */
        } else if (f == 1) {
            rig.sensors.supply_v = 20.0;
        } else if (f == 2) {
            rig.sense[0].qm = (double)NAN;
        } else {
            rig.sense[0].current_a = 12.0;
        }
        /* I2t: (12^2 - 4^2) t = (8^2 - 4^2) * 10.24 s gives 3.84 s */
        for (int t = 0; t < (f < 3 ? 2 : 3830); t++) {
            target(&rig, "00 00");
            assert_true(f < 3 || rig.motor[0].bridge_on);
        }
        for (int t = 0; t < 20; t++) {
            target(&rig, "00 00");
        }
        rig_expect(&rig, 0, 0x113, faults[f].status);
        assert_false(rig.motor[0].bridge_on);
        rig_stop(&rig);
    }
}

/* v += kp (e - e') + ki / 2 (e + e'), kp 146, ki 227, in 2^-15 thousandths of the supply a mA */
static void the_current_law_is_the_firmware_s(void **state)
{
    struct rig rig;
    int64_t v = 0, before = 0;
    int32_t current = 0; /* mA, as the board has sampled it */

    (void)state;
    start(&rig);
    enter(&rig, "09 06");
    for (int t = 0; t < 300; t++) {
        int64_t error = 1500 - current;

        v += 146 * (error - before) + 113 * (error + before);
        v = v > 950 * 32768 ? 950 * 32768 : v < -950 * 32768 ? -950 * 32768 : v;
        before = error;
        current = 7 * t % 4000 - (t > 200 ? 0 : 2500);
        rig.sense[0].current_a = current * 1e-3;
        target(&rig, "DC 05");
        assert_near(rig.motor[0].voltage_v, floor((double)v / 32768.0) * 1e-3 * SUPPLY_V, 1e-9);
    }
    rig_stop(&rig);
}

static void open_loop_holds_the_current_at_its_peak(void **state)
{
    struct rig rig;
    double before;

    (void)state;
    start(&rig);
    enter(&rig, "09 50");
    target(&rig, "80 3E");
    before = rig.motor[0].voltage_v;
    rig.sense[0].current_a = 9.0; /* peak 8 */
    target(&rig, "80 3E");
    for (int t = 0; t < 50; t++) {
        target(&rig, "80 3E");
    }
    assert_true(rig.motor[0].voltage_v < before - 1.0);
    rig.sense[0].current_a = 1.0;
    for (int t = 0; t < 50; t++) {
        target(&rig, "80 3E");
    }
    assert_near(rig.motor[0].voltage_v, before, 1e-9);
    rig_stop(&rig);
}

static void floats_set_the_same_gains_as_integers(void **state)
{
    struct rig a, b;

    (void)state;
    start(&a);
    start(&b);
    rig_send(&a, 0, 0x001, "69 00 20 00 10 00 00 0F"); /* kp 0.25, ki 0.125 */
    rig_send(&b, 0, 0x001, "69 01 00 00 80 3E");       /* kp = 0.25f */
    rig_send(&b, 0, 0x001, "7D 01 03 00 00 00 00 3E"); /* ki = 0.125f */
    enter(&a, "09 0A");
    enter(&b, "09 0A");
    for (int t = 0; t < 10; t++) {
        target(&a, "F4 01");
        target(&b, "F4 01");
        assert_true(fabs(a.motor[0].voltage_v) > 0.1);
        assert_near(a.motor[0].voltage_v, b.motor[0].voltage_v, 0.001 * SUPPLY_V + 1e-9);
    }
    rig_stop(&a);
    rig_stop(&b);
}

static void position_mode_counts_from_where_it_began(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig.sense[0].qm = 0.5;
    rig_ticks(&rig, 2);
    rig_send(&rig, 0, 0x001, "7D 02 02 00 00 00 80 3F"); /* kp 1 of +-32000 an icubdeg */
    enter(&rig, "09 01");
    target(&rig, "00 00");
    assert_near(rig.motor[0].voltage_v, 0.0, 1e-9);
    target(&rig, "80 0C"); /* 3200: 10 % */
    assert_near(rig.motor[0].voltage_v, 0.1 * SUPPLY_V, 1e-9);
    rig_stop(&rig);
}

static void the_index_calibrates_the_encoder(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig_send(&rig, 0, 0x001, "77 09 00 10 00 00 0E");
    target(&rig, "00 00");
    assert_int_equal(rig_find(&rig, 0, 0x113)->data[1], FOC_QE_NOT_CALIBRATED);
    rig.sense[0].qm = 1.01 * 2.0 * M_PI / GEAR;
    rig_tick(&rig);
    target(&rig, "00 00");
    assert_int_equal(rig_find(&rig, 0, 0x113)->data[1], 0);
    rig_stop(&rig);
}

static void status_can_be_thinned_out(void **state)
{
    struct rig rig;
    size_t sent = 0;

    (void)state;
    configure(&rig);
    rig.board[0].status_period_ns = 10000000;
    rig_start(&rig);
    make_idle(&rig, 0x001);
    for (int t = 0; t < 100; t++) {
        target(&rig, "00 00");
        sent += rig_sent(&rig, 0, 0x113);
        assert_int_equal(rig_sent(&rig, 0, 0x110), 1);
    }
    assert_int_equal(sent, 10);
    rig_stop(&rig);
}

static void the_temperature_comes_every_200_ms_of_board_1(void **state)
{
    struct rig rig;
    size_t one = 0, three = 0;

    (void)state;
    start(&rig);
    rig.sense[0].winding_c = 41.5;
    for (int t = 0; t < 1200; t++) {
        rig_tick(&rig);
        one += rig_sent(&rig, 0, 0x11c);
        three += rig_sent(&rig, 0, 0x13c);
        if (rig_sent(&rig, 0, 0x11c)) {
            rig_expect(&rig, 0, 0x11c, "00 00 9F 01");
        }
    }
    assert_int_equal(one, 6);
    assert_int_equal(three, 3);
    rig_stop(&rig);
}

static void wrong_lengths_are_refused(void **state)
{
    static const char *const frames[] = {"09",
                                         "09 50 00",
                                         "48 00 00 00",
                                         "48 00 A0 0F 40 1F",
                                         "65 01",
                                         "65 01 00 00 00 00 00 00 00",
                                         "77 01 00 10 00 00",
                                         "79 00",
                                         "7D 00 02",
                                         "5B",
                                         "5B 01",
                                         "02 01 00",
                                         "72 00",
                                         "17 00 00",
                                         "65 03 00 00 80 3F",
                                         "7D 03 02 00 00 00 80 3F",
                                         "7D 00 01 00 00 00 80 3F",
                                         "65 01 00 00 C0 7F" /* not a number */,
                                         "02 09 00 00 80 3F",
                                         "32 00"};
    struct rig rig;

    (void)state;
    start(&rig);
    for (size_t i = 0; i < sizeof frames / sizeof *frames; i++) {
        struct bus_frame frame = {.id = 0x001};
        uint64_t before = rig_counters(&rig).malformed;

        frame.len = rig_bytes(frames[i], frame.data);
        if (frame.len <= 8) {
            boards_receive(rig.boards, 0, &frame);
            if (rig_counters(&rig).malformed != before + 1) {
                fail_msg("%s was taken", frames[i]);
            }
        }
    }
    rig_stop(&rig);
}

static void restarting_forgets_the_configuration(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig_send(&rig, 0, 0x701, "00");
    target(&rig, "00 00");
    assert_int_equal(rig_sent(&rig, 0, 0x110), 0);
    rig_ticks(&rig, 5001);
    target(&rig, "00 00");
    assert_int_equal(rig_find(&rig, 0, 0x113)->data[0], 0xb0);
    rig_stop(&rig);
}

static void another_personality_on_another_bus_is_not_disturbed(void **state)
{
    struct rig rig;

    (void)state;
    start(&rig);
    rig_send(&rig, 1, 0x10f, "00 10 00 10 00 10 00 10"); /* no such frame among iCub boards */
    assert_int_equal(rig_counters(&rig).foreign, 1);
    rig_send(&rig, 1, 0x001, "09 50");
    rig_send(&rig, 1, 0x001, "72 35 05");
    rig_tick(&rig);
    assert_near(rig.motor[3].voltage_v, SUPPLY_V, 1e-9);
    assert_false(rig.motor[0].bridge_on);
    rig_stop(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_target_is_answered_by_every_board_with_two_frames),
        cmocka_unit_test(velocity_is_in_icubdeg_a_millisecond),
        cmocka_unit_test(a_board_is_idle_only_when_it_has_everything),
        cmocka_unit_test(only_the_very_protocol_is_acknowledged),
        cmocka_unit_test(discovery_tells_a_2foc_and_asks_of_more_are_not_answered),
        cmocka_unit_test(open_loop_is_a_share_of_the_supply_up_to_95_percent),
        cmocka_unit_test(a_mode_begins_with_set_point_0),
        cmocka_unit_test(modes_that_a_2foc_has_not_are_refused),
        cmocka_unit_test(a_set_point_expires_after_50_ms),
        cmocka_unit_test(faults_have_their_bits),
        cmocka_unit_test(the_current_law_is_the_firmware_s),
        cmocka_unit_test(open_loop_holds_the_current_at_its_peak),
        cmocka_unit_test(floats_set_the_same_gains_as_integers),
        cmocka_unit_test(position_mode_counts_from_where_it_began),
        cmocka_unit_test(the_index_calibrates_the_encoder),
        cmocka_unit_test(status_can_be_thinned_out),
        cmocka_unit_test(the_temperature_comes_every_200_ms_of_board_1),
        cmocka_unit_test(wrong_lengths_are_refused),
        cmocka_unit_test(restarting_forgets_the_configuration),
        cmocka_unit_test(another_personality_on_another_bus_is_not_disturbed),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
