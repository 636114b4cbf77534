/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modes, faults, time-outs and periodic frames of the motor boards, against the protocol's rules.
 */
#include "tests/unit/boards/board_bench.h"

#include <pthread.h>
#include <stdatomic.h>

#define POLICY_7F "49 7F 00 00 00"

static uint8_t mode_of(struct board_bench *bench)
{
    const struct bus_frame *reply;

    bench_send(bench, 0, 0x001, "07");
    bench_tick(bench);
    reply = bench_find(bench, 0, 0x010);
    assert_non_null(reply);
    return reply->data[1];
}

static void set_mode(struct board_bench *bench, unsigned mode)
{
    char text[16];

    snprintf(text, sizeof text, "09 %02X", mode);
    bench_send(bench, 0, 0x001, text);
}

/* Runs until the tick that sent slot 3, so that the next one is slot 0. */
static void to_slot_0(struct board_bench *bench)
{
    bench_ticks(bench, (int)((4 - bench->sensors.time_ns / 1000000 % 4) % 4));
}

static const unsigned running[] = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x50};
enum { RUNNING = sizeof running / sizeof *running };

/* ---- mode rules ---- */

static void any_running_mode_is_entered_from_idle_with_the_bridge_on(void **state)
{
    (void)state;
    for (size_t i = 0; i < RUNNING; i++) {
        struct board_bench bench;

        bench_configure(&bench);
        bench_start(&bench);
        bench_tick(&bench);
        assert_false(bench.motor[0].bridge_on);
        set_mode(&bench, running[i]);
        assert_int_equal(mode_of(&bench), running[i]);
        assert_true(bench.motor[0].bridge_on);
        assert_false(bench.motor[1].bridge_on);
        assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
        set_mode(&bench, i % 2 ? 0x00 : 0x09);
        assert_int_equal(mode_of(&bench), 0x00);
        assert_false(bench.motor[0].bridge_on);
        bench_stop(&bench);
    }
}

static void one_running_mode_follows_another_directly(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    for (size_t i = 0; i < RUNNING; i++) {
        for (size_t j = 0; j < RUNNING; j++) {
            set_mode(&bench, running[i]);
            set_mode(&bench, running[j]);
            assert_int_equal(mode_of(&bench), running[j]);
            assert_true(bench.motor[0].bridge_on);
        }
    }
    bench_stop(&bench);
}

static void values_that_are_no_mode_are_refused(void **state)
{
    struct board_bench bench;
    unsigned refused = 0;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    for (unsigned mode = 0; mode < 256; mode++) {
        bool known = mode <= 0x09 || mode == 0x50;

        if (!known) {
            set_mode(&bench, mode);
            refused++;
        }
    }
    assert_int_equal(mode_of(&bench), 0x00);
    assert_int_equal(bench_counters(&bench).malformed, refused);
    bench_stop(&bench);
}

static void only_force_idle_leaves_a_fault(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    set_mode(&bench, 0x50);
    bench_tick(&bench);
    bench.sense[0].current_a = -60.0;
    bench_ticks(&bench, 2);
    bench.sense[0].current_a = 0.0;
    assert_int_equal(mode_of(&bench), 0xa0);
    for (size_t i = 0; i < RUNNING; i++) {
        set_mode(&bench, running[i]);
        assert_int_equal(mode_of(&bench), 0xa0);
    }
    set_mode(&bench, 0x00);
    assert_int_equal(mode_of(&bench), 0xa0);
    bench_send(&bench, 0, 0x001, "04 03 00 00 01 00 00 00");
    assert_int_equal(mode_of(&bench), 0xa0);
    assert_false(bench.motor[0].bridge_on);
    set_mode(&bench, 0x09);
    assert_int_equal(mode_of(&bench), 0x00);
    assert_false(bench.motor[0].bridge_on);
    set_mode(&bench, 0x50);
    assert_int_equal(mode_of(&bench), 0x50);
    bench_stop(&bench);
}

static void a_mode_change_clears_the_voltage_and_holds_the_position(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01"); /* kept in any mode ... */
    bench_ask(&bench, "73", "73 4D 01");
    bench.sense[0].q = 0.5;
    bench_tick(&bench);
    set_mode(&bench, 0x50); /* ... and cleared by a change */
    bench_ask(&bench, "73", "73 00 00");
    bench_ask(&bench, "16", "16 88 13 00 00"); /* 5000 */
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, SUPPLY_V * 333.0 / 1333.0, 1e-12);
    set_mode(&bench, 0x01);
    bench_ask(&bench, "73", "73 00 00");
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench_send(&bench, 0, 0x001, "72 4D 01"); /* acts in mode 0x50 only */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench_stop(&bench);
}

static void discovery_stops_motors_when_asked_to(void **state)
{
    (void)state;
    for (int stops = 0; stops < 2; stops++) {
        struct board_bench bench;

        bench_configure(&bench);
        bench.board[0].discovery_stops_motors = stops;
        bench_start(&bench);
        bench_send(&bench, 0, 0x001, POLICY_7F);
        set_mode(&bench, 0x50);
        bench_tick(&bench);
        bench_send(&bench, 0, 0x70f, "FF");
        bench_tick(&bench);
        assert_int_equal(bench.motor[0].bridge_on, !stops);
        to_slot_0(&bench);
        bench_tick(&bench);
        assert_int_equal(bench_sent(&bench, 0, 0x111), !stops);
        bench_stop(&bench);
    }
}

/* ---- voltage ---- */

static void voltage_is_the_reference_over_1333_of_the_supply(void **state)
{
    static const int references[] = {0, 1, -1, 333, -333, 1332, 1333, -1333, 1334, 32767, -32768};
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    set_mode(&bench, 0x50);
    for (size_t i = 0; i < sizeof references / sizeof *references; i++) {
        int counts = references[i] > 1333 ? 1333 : references[i] < -1333 ? -1333 : references[i];
        char text[32];

        snprintf(text, sizeof text, "72 %02X %02X", references[i] & 0xff,
                 references[i] >> 8 & 0xff);
        bench_send(&bench, 0, 0x001, text);
        bench_tick(&bench);
        assert_near(bench.motor[0].voltage_v, counts / 1333.0 * SUPPLY_V, 1e-12);
    }
    bench.sensors.supply_v = 40.0; /* PWM is a ratio: the voltage follows the supply */
    bench_send(&bench, 0, 0x001, "72 35 05");
    bench_tick(&bench);
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 40.0, 1e-12);
    bench_stop(&bench);
}

static void the_pwm_limit_cuts_the_voltage(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "2F 64 00");
    bench_send(&bench, 0, 0x001, POLICY_7F);
    set_mode(&bench, 0x50);
    bench_send(&bench, 0, 0x001, "72 38 FF"); /* -200 */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, -100.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_tick(&bench); /* slot 1: what was asked for and what it became */
    bench_expect(&bench, 0, 0x112, "38 FF 00 00 9C FF 00 00");
    bench_send(&bench, 0, 0x001, "2F FF FF"); /* a negative limit lets nothing through */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench_stop(&bench);
}

static void joints_without_a_board_are_left_alone(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.config.nboard = 4;
    bench.motor[3] =
        (struct motor_command){.bridge_on = true, .voltage_v = 7.0, .pretension_m = 0.25};
    bench.motor[0].pretension_m = 0.5;
    bench_start(&bench);
    set_mode(&bench, 0x50);
    bench_send(&bench, 0, 0x002, "89 50"); /* the spare axis may run, too */
    bench_send(&bench, 0, 0x002, "F2 35 05");
    bench_ticks(&bench, 10);
    assert_true(bench.motor[3].bridge_on);
    assert_near(bench.motor[3].voltage_v, 7.0, 0.0);
    assert_near(bench.motor[0].pretension_m, 0.5, 0.0);
    boards_shut_down(bench.boards, bench.now_ns, &bench.command);
    assert_false(bench.motor[0].bridge_on);
    assert_true(bench.motor[3].bridge_on);
    bench_stop(&bench);
}

/* ---- time-outs ---- */

static void count_to_timeout(bool strict, int64_t timeout_ns, int *ticks)
{
    struct board_bench bench;

    bench_configure(&bench);
    bench.board[0].strict = strict;
    bench.board[0].command_timeout_ns = timeout_ns;
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "5B 01 06");
    bench_send(&bench, 0, 0x001, "52 00 00 00 00 00 00 00");
    bench_send(&bench, 0, 0x001, "54 00 00 35 05 35 05");
    set_mode(&bench, 0x50);
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    for (*ticks = 0; *ticks < 10000; ++*ticks) {
        bench_tick(&bench);
        if (bench.motor[0].voltage_v == 0.0) {
            break;
        }
    }
    assert_int_equal(bench_counters(&bench).timeouts, *ticks < 10000);
    assert_true(bench.motor[0].bridge_on);
    bench_stop(&bench);
}

/* ---- strict boards ---- */

static void ask_mode(struct board_bench *bench, const char *mode, const char *told, bool on)
{
    bench_send(bench, 0, 0x001, mode);
    bench_ask(bench, "07", told);
    assert_int_equal(bench->motor[0].bridge_on, on);
}

static void a_strict_board_drives_only_when_it_knows_host_and_gains(void **state)
{
    static const char *const pids[] = {"1E 01 00", "20 00 00", "22 00 00", "24 00 00",
                                       "26 00 00", "28 00 00", "2A 35 05"};
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.board[0].strict = true;
    bench_start(&bench);
    ask_mode(&bench, "09 50", "07 50 00", false); /* no protocol */
    ask_mode(&bench, "09 00", "07 00 00", false);
    bench_send(&bench, 0, 0x001, "5B 01 06");
    bench_tick(&bench);
    for (int i = 0; i < 7; i++) {
        ask_mode(&bench, "09 50", "07 50 00", false);
        ask_mode(&bench, "09 00", "07 00 00", false);
        bench_send(&bench, 0, 0x001, pids[i]);
    }
    ask_mode(&bench, "09 50", "07 50 00", true);
    /* what it does not have resets a running axis, and from idle leads to position mode */
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_ask(&bench, "73", "73 4D 01");
    ask_mode(&bench, "09 06", "07 50 00", true);
    bench_ask(&bench, "73", "73 00 00");
    ask_mode(&bench, "09 09", "07 00 00", false);
    ask_mode(&bench, "09 0A", "07 01 00", true);
    bench_stop(&bench);
}

static void a_strict_board_prints_what_the_firmware_prints(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.board[0].strict = true;
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 20 00 00 00");
    bench_send(&bench, 0, 0x001, "09 0A"); /* no protocol, no such mode: a fault */
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x116), 4 + 3);
    bench_expect_frame(bench_find(&bench, 0, 0x116), 0x116, "06 10 63 61 6E 20 70 72");
    bench_ask(&bench, "07", "07 A0 00");
    bench_stop(&bench);
}

static void modes_of_the_table_that_no_firmware_has_are_refused(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    ask_mode(&bench, "09 0A", "07 00 00", false);
    ask_mode(&bench, "09 0B", "07 00 00", false);
    ask_mode(&bench, "09 60", "07 00 00", false);
    assert_int_equal(bench_counters(&bench).malformed, 3);
    bench_stop(&bench);
}

static void calibration_is_that_of_the_absolute_encoder(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "04 00 00 00 01 00 00 00"); /* hard stops: not on this board */
    assert_int_equal(bench_counters(&bench).malformed, 1);
    bench_ask(&bench, "07", "07 00 00");
    bench_send(&bench, 0, 0x001, "04 03 00 00 00 00 00 00"); /* p2 = 0 */
    bench_ask(&bench, "07", "07 A0 00");
    assert_int_equal(bench_counters(&bench).malformed, 1);
    bench_stop(&bench);
}

static void a_stale_voltage_becomes_zero_after_our_time_out(void **state)
{
    int ticks;

    (void)state;
    count_to_timeout(false, 100000000, &ticks);
    assert_int_equal(ticks, 100);
    count_to_timeout(false, 0, &ticks); /* off */
    assert_int_equal(ticks, 10000);
    count_to_timeout(true, 100000000, &ticks); /* a strict board drives on */
    assert_int_equal(ticks, 10000);
}

static void a_fresh_voltage_resumes_after_the_time_out(void **state)
{
    struct board_event event;
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.board[0].command_timeout_ns = 50000000;
    bench_start(&bench);
    set_mode(&bench, 0x50);
    for (int i = 0; i < 500; i++) { /* fresh often enough: no time-out */
        if (i % 40 == 0) {
            bench_send(&bench, 0, 0x001, "72 4D 01");
        }
        bench_tick(&bench);
        assert_true(bench.motor[0].voltage_v > 11.0);
    }
    assert_int_equal(bench_counters(&bench).timeouts, 0);
    bench_ticks(&bench, 60);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_counters(&bench).timeouts, 1);
    assert_true(bench_event(&bench, BOARD_EVENT_TIMEOUT, &event));
    assert_int_equal(event.a, 0x50);
    assert_int_equal(event.axis, 0);
    bench_ticks(&bench, 500); /* once, not again and again */
    assert_int_equal(bench_counters(&bench).timeouts, 1);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_tick(&bench);
    assert_true(bench.motor[0].voltage_v > 11.0);
    bench_stop(&bench);
}

static void a_velocity_without_fresh_commands_becomes_zero(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "56 64 00"); /* 100 ms */
    set_mode(&bench, 0x02);
    bench_send(&bench, 0, 0x001, "1C 20 00 00 01"); /* 32/16 = 2 ticks/ms, reached at once */
    bench_ticks(&bench, 50);
    bench_ask(&bench, "3A", "3A 20 00");
    bench_send(&bench, 0, 0x001, "1C 20 00 00 01");
    bench_ticks(&bench, 101);
    bench_ask(&bench, "18", "18 00 00");
    assert_int_equal(bench_counters(&bench).timeouts, 1);
    bench_ask(&bench, "3A", "3A 00 00");
    assert_int_equal(mode_of(&bench), 0x02);
    bench_stop(&bench);
}

static void a_silent_torque_source_disables_torque_modes(void **state)
{
    static const unsigned modes[] = {0x03, 0x04, 0x05};
    struct board_event event;

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        struct board_bench bench;

        bench_configure(&bench);
        bench_start(&bench);
        bench_send(&bench, 0, 0x20c, "07 00");                   /* the pseudo-STRAIN speaks */
        bench_send(&bench, 0, 0x001, "34 0C 01 00 00 00 00 00"); /* and the axis listens */
        bench_ticks(&bench, 10);
        set_mode(&bench, modes[i]);
        bench_ticks(&bench, 1000);
        assert_int_equal(mode_of(&bench), modes[i]);
        bench_send(&bench, 0, 0x20c, "07 01");
        bench_ticks(&bench, 190);
        assert_int_equal(mode_of(&bench), modes[i]);
        bench_ticks(&bench, 15);
        assert_int_equal(mode_of(&bench), 0x00);
        assert_false(bench.motor[0].bridge_on);
        assert_true(bench_event(&bench, BOARD_EVENT_SOURCE_LOST, &event));
        assert_int_equal(event.a, 0x0c);
        assert_int_equal(bench_counters(&bench).timeouts, 1);
        bench_stop(&bench);
    }
}

static void torque_of_real_strain_boards_on_the_bus_is_heard(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "34 05 04 00 00 00 00 00");
    bench_send(&bench, 0, 0x001, "49 00 01 00 00"); /* DEBUG */
    to_slot_0(&bench);
    bench_send(&bench, 0, 0x35b, "00 80 10 80 F0 7F"); /* channels 3 4 5 */
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x119, "10 00 00 00 00 00 00 00");
    bench_stop(&bench);
}

/* ---- faults ---- */

static void over_current_trips_once_and_is_told_once(void **state)
{
    static const char *const limit[] = {"48 E8 03 00 00", "C8 E8 03 00 00"}; /* 1000 mA */
    static const char *const run[] = {"09 50", "89 50"};
    static const char *const status[] = {"08 A0 00 00 00 00 00 00", "00 00 08 A0 00 00 00 00"};

    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        struct board_event event;
        struct board_bench bench;

        bench_configure(&bench);
        bench_start(&bench);
        bench_send(&bench, 0, 0x001, "49 04 00 00 00");
        bench_send(&bench, 0, 0x001, limit[axis]);
        bench_send(&bench, 0, 0x001, run[axis]);
        bench_ticks(&bench, 4);
        bench.sense[axis].current_a = 1.0; /* at the limit is not above it */
        bench_ticks(&bench, 1000);
        assert_int_equal(bench_counters(&bench).trips, 0);
        bench.sense[axis].current_a = -4.0;
        bench_tick(&bench);
        bench_tick(&bench);
        assert_false(bench.motor[axis].bridge_on);
        assert_near(bench.motor[axis].voltage_v, 0.0, 0.0);
        assert_int_equal(bench_counters(&bench).trips, 1);
        assert_true(bench_event(&bench, BOARD_EVENT_FAULT, &event));
        assert_int_equal(event.a, 0x08);
        assert_int_equal(event.axis, axis);
        bench_tick(&bench); /* slot 2 */
        bench_expect(&bench, 0, 0x113, status[axis]);
        for (int i = 0; i < 40; i++) {
            bench_tick(&bench);
            assert_int_equal(bench_sent(&bench, 0, 0x113), 0);
        }
        /* whatever is told later, the trip is not told again */
        bench_send(&bench, 0, 0x001, axis ? "89 09" : "09 09");
        bench_ticks(&bench, 4);
        bench_expect(&bench, 0, 0x113, "00 00 00 00 00 00 00 00");
        assert_int_equal(bench_counters(&bench).trips, 1);
        bench_stop(&bench);
    }
}

/* The integral of I^2 - limit^2 may reach limit^2 * 10 ms. */
static void over_current_is_measured_by_its_heat(void **state)
{
    static const double ratios[] = {1.05, 1.1, 1.5, 2.0, 3.0, 3.4};

    (void)state;
    for (size_t i = 0; i < sizeof ratios / sizeof *ratios; i++) {
        int expected = (int)floor(10.0 / (ratios[i] * ratios[i] - 1.0)) + 1, ticks = 0;
        struct board_bench bench;

        bench_configure(&bench);
        bench.sense[0].current_a = 12.0 * ratios[i];
        bench_start(&bench);
        set_mode(&bench, 0x50);
        for (; bench_counters(&bench).trips == 0 && ticks < 1000; ticks++) {
            bench_tick(&bench);
        }
        assert_int_equal(ticks, expected);
        bench_stop(&bench);
    }
}

/* COMAN's drive with a quarter of 48 V from standstill: 15 A, above 12 A for 3 ms. */
static void the_inrush_of_a_voltage_step_does_not_trip(void **state)
{
    static const double inrush_a[] = {14.88, 14.44, 12.17, 10.03, 8.27, 6.85};
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    set_mode(&bench, 0x50);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    for (size_t i = 0; i < sizeof inrush_a / sizeof *inrush_a; i++) {
        bench_tick(&bench);
        bench.sense[0].current_a = inrush_a[i];
    }
    bench_ticks(&bench, 100);
    assert_int_equal(bench_counters(&bench).trips, 0);
    bench_stop(&bench);
}

static void under_voltage_is_a_fault_as_long_as_it_lasts(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 04 00 00 00");
    set_mode(&bench, 0x50);
    bench_ticks(&bench, 4);
    bench.sensors.supply_v = 20.0;
    bench_ticks(&bench, 3);
    bench_expect(&bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    set_mode(&bench, 0x09);
    set_mode(&bench, 0x50); /* trips again at once */
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    bench.sensors.supply_v = 48.0;
    bench_ticks(&bench, 4);
    assert_int_equal(bench_sent(&bench, 0, 0x113), 0);
    bench_send(&bench, 0, 0x001, "09 09");
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x113, "00 00 00 00 00 00 00 00");
    bench_stop(&bench);
}

static void a_sensor_without_a_number_is_an_encoder_fault(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.sense[0].q = 0.25;
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 04 00 00 00");
    set_mode(&bench, 0x50);
    bench_ticks(&bench, 4);
    bench.sense[0].q = (double)NAN;
    bench_ticks(&bench, 3);
    bench_expect(&bench, 0, 0x113, "20 A0 00 00 00 00 00 00");
    bench_ask(&bench, "14", "14 C4 09 00 00 00 00"); /* the last that it knew */
    bench.sense[0].q = 0.25;
    bench.sense[0].current_a = (double)INFINITY;
    bench_ticks(&bench, 8);
    assert_int_equal(mode_of(&bench), 0xa0);
    bench_stop(&bench);
}

static void voltage_beyond_a_joint_limit_is_refused_both_ways(void **state)
{
    struct board_event event;
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 20 00 00 00"); /* PRINT */
    set_mode(&bench, 0x50);
    bench.sense[0].q = 2.5; /* at the limit */
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_ticks(&bench, 3);
    assert_true(bench.motor[0].voltage_v > 11.0);
    bench.sense[0].q = 2.5002;
    bench_tick(&bench);
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_sent(&bench, 0, 0x116), 3);
    bench_expect_frame(&bench.frame[0][0], 0x116, "06 10 4F 55 54 20 4F 46"); /* "OUT OF" */
    bench_expect_frame(&bench.frame[0][1], 0x116, "06 11 20 4C 49 4D 49 54"); /* " LIMIT" */
    bench_expect_frame(&bench.frame[0][2], 0x116, "86 12 53");                /* "S", the last */
    bench_ask(&bench, "73", "73 00 00");
    bench_send(&bench, 0, 0x001, "72 B3 FE"); /* back is refused, too */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_sent(&bench, 0, 0x116), 0); /* told once */
    assert_true(bench_event(&bench, BOARD_EVENT_LIMIT, &event));
    assert_false(bench_event(&bench, BOARD_EVENT_LIMIT, &event));
    bench.sense[0].q = -2.1;
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench.sense[0].q = 0.0;
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_tick(&bench);
    assert_true(bench.motor[0].voltage_v > 11.0);
    bench_stop(&bench);
}

/* ---- periodic frames ---- */

static void boards_are_silent_until_the_host_sets_a_policy(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    set_mode(&bench, 0x50);
    for (int i = 0; i < 6000; i++) {
        bench_tick(&bench);
        assert_int_equal(bench.count[0] + bench.count[1], 0);
    }
    bench_stop(&bench);
    bench_configure(&bench);
    bench.board[4].transmit_at_start = true;
    bench_start(&bench);
    bench_tick(&bench);
    bench_expect(&bench, 1, 0x111, "00 00 00 00 00 00 00 00");
    assert_int_equal(bench.count[0], 0);
    bench_stop(&bench);
}

static void frames_keep_their_slots_and_the_mask_decides(void **state)
{
    static const unsigned slot_of[13] = {9, 0, 1, 2, 3, 3, 3, 3, 3, 3, 3, 3, 2};
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    for (unsigned type = 1; type <= 11; type++) {
        unsigned mask = 1u << (type - 1);
        char text[32];

        /* the mask of one board; either axis bit sets it */
        snprintf(text, sizeof text, "%s %02X %02X 00 00", type % 2 ? "49" : "C9", mask & 0xff,
                 mask >> 8);
        bench_send(&bench, 0, 0x001, text);
        to_slot_0(&bench);
        set_mode(&bench, 0x50); /* STATUS has something to say */
        set_mode(&bench, 0x00);
        for (unsigned slot = 0; slot < 4; slot++) {
            bool event = type == 5 || type == 6; /* OVERFLOW and PRINT have no cause here */

            bench_tick(&bench);
            assert_int_equal(bench_sent(&bench, 0, 0x110 | type), slot == slot_of[type] && !event);
            /* nothing else but ADDITIONAL_STATUS with STATUS */
            assert_int_equal(bench.count[0], slot == slot_of[type] && !event ? 1 + (type == 3) : 0);
        }
    }
    bench_stop(&bench);
}

static void the_default_mask_gives_every_frame_each_4_ms(void **state)
{
    struct board_bench bench;
    unsigned sent[16] = {0};

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, POLICY_7F);
    for (int i = 0; i < 4000; i++) {
        bench_tick(&bench);
        for (size_t f = 0; f < bench.count[0]; f++) {
            assert_int_equal(bench.frame[0][f].id & 0x7f0, 0x110);
            assert_int_equal(bench.frame[0][f].len, 8);
            sent[bench.frame[0][f].id & 0xf]++;
        }
    }
    assert_int_equal(sent[1], 1000);
    assert_int_equal(sent[2], 1000);
    assert_int_equal(sent[4], 1000);
    assert_int_equal(sent[7], 1000);
    assert_int_equal(sent[3] + sent[5] + sent[6] + sent[8], 0);
    bench_stop(&bench);
}

static void status_follows_a_mode_change_in_the_next_slot_2(void **state)
{
    struct board_bench bench;

    (void)state;
    for (int phase = 0; phase < 4; phase++) {
        bench_configure(&bench);
        bench_start(&bench);
        bench_send(&bench, 0, 0x001, "49 04 00 00 00");
        bench_ticks(&bench, 4 + phase);
        set_mode(&bench, 0x50);
        for (int i = phase; i != 2; i = (i + 1) % 4) {
            bench_tick(&bench);
            assert_int_equal(bench.count[0], 0);
        }
        bench_tick(&bench);
        bench_expect(&bench, 0, 0x113, "00 50 00 00 00 00 00 00");
        bench_expect(&bench, 0, 0x11c, "00");
        bench_ticks(&bench, 4);
        assert_int_equal(bench.count[0], 0);
        bench_stop(&bench);
    }
}

static void status_comes_every_5_s_and_interaction_with_it(void **state)
{
    int64_t last = 0;
    int count = 0;
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 04 00 00 00");
    bench_send(&bench, 0, 0x001, "F4 01"); /* axis 1 compliant */
    bench_ticks(&bench, 3);
    bench_expect(&bench, 0, 0x11c, "10"); /* its change alone needs no STATUS */
    assert_int_equal(bench_sent(&bench, 0, 0x113), 0);
    for (int i = 0; i < 20000; i++) {
        bench_tick(&bench);
        if (bench.count[0]) {
            bench_expect_frame(&bench.frame[0][0], 0x113, "00 00 00 00 00 00 00 00");
            bench_expect_frame(&bench.frame[0][1], 0x11c, "10");
            assert_in_range(bench.sensors.time_ns - last, 5000000000 - 1, 5004000000);
            last = bench.sensors.time_ns;
            count++;
        }
    }
    assert_int_equal(count, 4);
    bench_stop(&bench);
}

static void positions_are_ticks_of_link_and_rotor(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 01 02 00 00");
    to_slot_0(&bench);
    bench.sense[0].q = 1.23456789;  /* 12346 = 0x303A */
    bench.sense[0].qm = 1.3;        /* 84500 = 0x14A14 */
    bench.sense[1].q = -0.00005001; /* -1 */
    bench.sense[1].qm = -1e9;       /* the counter ends */
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x111, "3A 30 00 00 FF FF FF FF");
    bench_ticks(&bench, 3);
    bench_expect(&bench, 0, 0x11a, "14 4A 01 00 00 00 00 80");
    bench_stop(&bench);
}

static void position_error_is_at_most_half_a_tick(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 01 00 00 00");
    to_slot_0(&bench);
    for (int i = 0; i < 500; i++) {
        double q = sin(0.1 * i) * 2.0;
        const struct bus_frame *frame;
        int32_t ticks;

        bench.sense[0].q = q;
        bench_tick(&bench);
        frame = bench_find(&bench, 0, 0x111);
        assert_non_null(frame);
        ticks = get_i32_le(frame->data);
        assert_true(fabs(ticks - q * TICKS_PER_RAD) <= 0.5 + 1e-9);
        bench_ticks(&bench, 3);
    }
    bench_stop(&bench);
}

static void current_is_milliamperes_and_saturates(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 08 00 00 00");
    bench.sense[0].current_a = 1.2345; /* 1235 after rounding (1234.5 up) */
    bench.sense[1].current_a = -2.0;
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x114, "D3 04 30 F8 00 00 00 00");
    bench.sense[0].current_a = 40.0;
    bench.sense[1].current_a = -40.0;
    bench_ticks(&bench, 4);
    bench_expect(&bench, 0, 0x114, "FF 7F 00 80 00 00 00 00");
    bench_stop(&bench);
}

/* 2 ticks/ms on link 0, 1/4 tick/ms^2 on link 1, 1 tick/ms^2 on rotor 0, nothing on rotor 1. */
static void velocities_are_scaled_by_the_estimator_shifts(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 40 04 00 00"); /* VELOCITY and MOTOR_SPEED */
    bench_send(&bench, 0, 0x001, "0E 03 00 00 00");
    for (int i = 1; i <= 400; i++) {
        bench.sense[0].q = 2.0 * i / TICKS_PER_RAD;
        bench.sense[0].qm = 0.5 * i * i / MOTOR_TICKS_PER_RAD;
        bench.sense[1].q = 0.125 * i * i / TICKS_PER_RAD;
        bench_tick(&bench);
    }
    /* axis 0: 2 * 2^3 = 16; axis 1 keeps its shifts of 5: the speed of 16 ms ago, 384/4 * 2^5 =
     * 3072, and 1/4 * 2^10 = 256 */
    bench_expect(&bench, 0, 0x117, "10 00 00 0C 00 00 00 01");
    /* 384 ticks/ms, 1 tick/ms^2 */
    bench_expect(&bench, 0, 0x11b, "80 01 00 00 01 00 00 00");
    bench_send(&bench, 0, 0x001, "0E FF FF FF FF"); /* absurd shifts saturate */
    for (int i = 401; i <= 404; i++) {
        bench.sense[0].q = 2.0 * i / TICKS_PER_RAD;
        bench.sense[0].qm = 0.5 * i * i / MOTOR_TICKS_PER_RAD;
        bench_tick(&bench);
    }
    assert_int_equal(bench_find(&bench, 0, 0x117)->data[1], 0x7f);
    assert_int_equal(bench_find(&bench, 0, 0x11b)->data[1], 0x7f);
    bench_stop(&bench);
}

/* ---- ticks of other lengths ---- */

static void slots_follow_the_time_whatever_the_tick(void **state)
{
    static const int64_t ticks_ns[] = {250000, 500000, 1000000, 2000000, 3000000, 10000000};

    (void)state;
    for (size_t t = 0; t < sizeof ticks_ns / sizeof *ticks_ns; t++) {
        struct board_bench bench;
        int sent = 0;

        bench_configure(&bench);
        bench.config.tick_ns = ticks_ns[t];
        bench_start(&bench);
        bench_send(&bench, 0, 0x001, "49 01 00 00 00");
        bench_ticks(&bench, (int)(1200000000 / ticks_ns[t]) - 1);
        for (int64_t ns = 0; ns < 1200000000; ns += ticks_ns[t]) {
            bench_tick(&bench);
            sent += (int)bench_sent(&bench, 0, 0x111);
        }
        assert_int_equal(sent, ticks_ns[t] <= 4000000 ? 300 : 120);
        bench_stop(&bench);
    }
}

static void too_little_room_delays_replies_and_loses_telemetry(void **state)
{
    struct bus_frame frame[4];
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 01 00 00 00");
    for (int i = 0; i < 6; i++) {
        bench_send(&bench, 0, 0x001, "33");
    }
    bench_control(&bench);
    assert_int_equal(boards_transmit(bench.boards, bench.now_ns, 0, frame, 4), 4);
    assert_int_equal(bench_counters(&bench).overflows, 1);
    bench_control(&bench);
    assert_int_equal(boards_transmit(bench.boards, bench.now_ns, 0, frame, 4), 2);
    bench_expect_frame(&frame[1], 0x010, "33 01");
    assert_int_equal(boards_transmit(bench.boards, bench.now_ns, 0, frame, 0), 0);
    assert_int_equal(boards_transmit(bench.boards, bench.now_ns, 9, frame, 4), 0);
    bench_stop(&bench);
}

/* ---- events ---- */

static void events_read_as_sentences(void **state)
{
    char text[256];
    struct board_event event;
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    bench_ticks(&bench, 1500);
    bench_send(&bench, 0, 0x001, "89 50");
    assert_true(bench_event(&bench, BOARD_EVENT_MODE, &event));
    assert_int_equal(event.a, 0x00);
    assert_int_equal(event.b, 0x50);
    board_event_format(bench.boards, &event, text, sizeof text);
    assert_string_equal(text, "1.500000 s: leg 1 (bus 0, address 1): axis 1 from idle to voltage "
                              "mode");
    bench.sense[1].current_a = 99.0;
    bench_ticks(&bench, 2);
    assert_true(bench_event(&bench, BOARD_EVENT_FAULT, &event));
    board_event_format(bench.boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "axis 1 has a fault: over-current"));
    assert_true(boards_fault(bench.boards));
    bench_send(&bench, 0, 0x001, "89 09");
    assert_false(boards_fault(bench.boards));
    bench_send(&bench, 1, 0x001, "6B");
    assert_true(bench_event(&bench, BOARD_EVENT_UNKNOWN, &event));
    board_event_format(bench.boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "arm 1 (bus 1, address 1): unknown command 0x6b (id 0x001)"));
    bench_stop(&bench);
}

static void every_kind_of_event_has_its_sentence(void **state)
{
    static const struct {
        struct board_event event;
        const char *text;
    } cases[] = {
        {{.kind = BOARD_EVENT_MODE, .axis = 1, .a = 0x01, .b = 0x02},
         "axis 1 from position to velocity mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x03, .b = 0x04},
         "axis 0 from torque to impedance position mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x05, .b = 0x06},
         "axis 0 from impedance velocity to current mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x07, .b = 0x08},
         "axis 0 from mixed to direct position mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x60, .b = 0xa0},
         "axis 0 from calibration to hardware fault mode"},
        {{.kind = BOARD_EVENT_FAULT, .a = 0x21},
         "axis 0 has a fault: under-voltage, absolute encoder"},
        {{.kind = BOARD_EVENT_TIMEOUT, .a = 0x50},
         "axis 0: the voltage command timed out, reference set to 0"},
        {{.kind = BOARD_EVENT_SOURCE_LOST, .a = 12},
         "axis 0: torque source 12 timed out, motor switched off"},
        {{.kind = BOARD_EVENT_LIMIT, .a = (uint32_t)-5},
         "axis 0 is beyond its position limit at -5 ticks, voltage set to 0"},
        {{.kind = BOARD_EVENT_MALFORMED, .a = 0x001, .b = 0x72},
         "wrong length or value in command 0x72 (id 0x001)"},
        {{.kind = BOARD_EVENT_ADDRESS, .a = 1, .b = 5}, "address changed from 1 to 5"},
        {{.kind = BOARD_EVENT_RESTART, .a = 1}, "bootloader entered"},
        {{.kind = BOARD_EVENT_RESTART, .a = 0}, "application started"},
        {{.kind = BOARD_EVENT_OVERFLOW, .a = 3}, "frames lost, 3 so far"},
        {{.kind = BOARD_EVENT_OVER_HEATED, .axis = 1, .a = 705},
         "axis 1 is too hot: 70.5 degree C"},
    };
    char text[256];
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *what;

        board_event_format(bench.boards, &cases[i].event, text, sizeof text);
        what = strstr(text, "): ");
        assert_non_null(what);
        assert_string_equal(what + 3, cases[i].text);
    }
    board_event_format(bench.boards, &cases[0].event, text, 10); /* cut, not overrun */
    assert_int_equal(strlen(text), 9);
    bench_stop(&bench);
}

static void events_that_nobody_reads_are_counted_as_lost(void **state)
{
    struct board_event event;
    struct board_bench bench;
    int read = 0;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    for (int i = 0; i < 3000; i++) {
        bench_send(&bench, 0, 0x001, "6B");
    }
    while (boards_next_event(bench.boards, &event)) {
        read++;
    }
    assert_true(read > 0);
    assert_int_equal((uint64_t)read + bench_counters(&bench).events_lost, 3000);
    bench_stop(&bench);
}

struct reader {
    struct boards *boards;
    atomic_bool done;
    uint64_t read;
    bool in_order;
};

static void *read_events(void *argument)
{
    struct reader *reader = argument;
    struct board_event event;
    uint32_t last = 0;
    bool done;

    do {
        done = atomic_load(&reader->done);
        while (boards_next_event(reader->boards, &event)) {
            char text[256];

            board_event_format(reader->boards, &event, text, sizeof text);
            reader->in_order &= event.kind != BOARD_EVENT_UNKNOWN || event.b >= last;
            last = event.kind == BOARD_EVENT_UNKNOWN ? event.b : last;
            reader->read++;
        }
    } while (!done);
    return NULL;
}

static void another_thread_reads_events_while_the_loop_runs(void **state)
{
    static const uint8_t unknown[] = {0x00, 0x01, 0x02, 0x35, 0x36, 0x38, 0x3b, 0x6b, 0x7b, 0x7f};
    struct reader reader = {.in_order = true};
    pthread_t thread;
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench_start(&bench);
    reader.boards = bench.boards;
    assert_int_equal(pthread_create(&thread, NULL, read_events, &reader), 0);
    for (int i = 0; i < 10000; i++) {
        struct bus_frame frame = {.id = 0x001, .len = 1, .data = {unknown[i / 1000]}};

        boards_receive(bench.boards, bench.now_ns, 0, &frame);
        bench_tick(&bench);
    }
    atomic_store(&reader.done, true);
    pthread_join(thread, NULL);
    assert_true(reader.in_order);
    assert_int_equal(reader.read + bench_counters(&bench).events_lost, 10000);
    bench_stop(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_running_mode_is_entered_from_idle_with_the_bridge_on),
        cmocka_unit_test(one_running_mode_follows_another_directly),
        cmocka_unit_test(values_that_are_no_mode_are_refused),
        cmocka_unit_test(only_force_idle_leaves_a_fault),
        cmocka_unit_test(a_mode_change_clears_the_voltage_and_holds_the_position),
        cmocka_unit_test(discovery_stops_motors_when_asked_to),
        cmocka_unit_test(voltage_is_the_reference_over_1333_of_the_supply),
        cmocka_unit_test(the_pwm_limit_cuts_the_voltage),
        cmocka_unit_test(joints_without_a_board_are_left_alone),
        cmocka_unit_test(a_strict_board_drives_only_when_it_knows_host_and_gains),
        cmocka_unit_test(a_strict_board_prints_what_the_firmware_prints),
        cmocka_unit_test(modes_of_the_table_that_no_firmware_has_are_refused),
        cmocka_unit_test(calibration_is_that_of_the_absolute_encoder),
        cmocka_unit_test(a_stale_voltage_becomes_zero_after_our_time_out),
        cmocka_unit_test(a_fresh_voltage_resumes_after_the_time_out),
        cmocka_unit_test(a_velocity_without_fresh_commands_becomes_zero),
        cmocka_unit_test(a_silent_torque_source_disables_torque_modes),
        cmocka_unit_test(torque_of_real_strain_boards_on_the_bus_is_heard),
        cmocka_unit_test(over_current_trips_once_and_is_told_once),
        cmocka_unit_test(over_current_is_measured_by_its_heat),
        cmocka_unit_test(the_inrush_of_a_voltage_step_does_not_trip),
        cmocka_unit_test(under_voltage_is_a_fault_as_long_as_it_lasts),
        cmocka_unit_test(a_sensor_without_a_number_is_an_encoder_fault),
        cmocka_unit_test(voltage_beyond_a_joint_limit_is_refused_both_ways),
        cmocka_unit_test(boards_are_silent_until_the_host_sets_a_policy),
        cmocka_unit_test(frames_keep_their_slots_and_the_mask_decides),
        cmocka_unit_test(the_default_mask_gives_every_frame_each_4_ms),
        cmocka_unit_test(status_follows_a_mode_change_in_the_next_slot_2),
        cmocka_unit_test(status_comes_every_5_s_and_interaction_with_it),
        cmocka_unit_test(positions_are_ticks_of_link_and_rotor),
        cmocka_unit_test(position_error_is_at_most_half_a_tick),
        cmocka_unit_test(current_is_milliamperes_and_saturates),
        cmocka_unit_test(velocities_are_scaled_by_the_estimator_shifts),
        cmocka_unit_test(slots_follow_the_time_whatever_the_tick),
        cmocka_unit_test(too_little_room_delays_replies_and_loses_telemetry),
        cmocka_unit_test(events_read_as_sentences),
        cmocka_unit_test(every_kind_of_event_has_its_sentence),
        cmocka_unit_test(events_that_nobody_reads_are_counted_as_lost),
        cmocka_unit_test(another_thread_reads_events_while_the_loop_runs),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
