/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What motor boards of the compact protocol remember and what they forget: the heat of an
 * over-current, faults that come twice, limits that are left twice, integrals while an axis is off.
 * The two axes of the board differ in everything: currents, ranges, windings.
 */
#include "tests/unit/boards/compact/compact_bench.h"

enum { AXES = 2 };

static const double limit_a[AXES] = {1.0, 2.5};
static const double lower_rad[AXES] = {-0.5, -1.25}, upper_rad[AXES] = {0.75, 2.0};
static const char *const off[AXES] = {"00 01 00 00 00", "00 02 00 00 00"};
static const char *const voltage_mode[AXES] = {"01 01 00 00 00", "01 02 00 00 00"};

/* Both axes in voltage mode. */
static void start_differently(struct board_bench *bench)
{
    configure(bench);
    for (int axis = 0; axis < AXES; axis++) {
        bench->board[0].axis[axis].current_limit_a = limit_a[axis];
        bench->board[0].axis[axis].lower_rad = lower_rad[axis];
        bench->board[0].axis[axis].upper_rad = upper_rad[axis];
        bench->board[0].axis[axis].winding_ohm = axis + 1.0;
        bench->board[0].axis[axis].winding_h = 1e-3 * (axis + 1.0);
    }
    bench->board[0].command_timeout_ns = 20000000;
    bench_start(bench);
    bench_send(bench, 0, 0x020, "01 03 00 00 00");
    bench_send(bench, 0, 0x040, "00 00 00 00");
    bench_tick(bench);
}

/* Ticks with set-points of 0 V for both axes. */
static void run_commands(struct board_bench *bench, int ticks)
{
    while (ticks-- > 0) {
        bench_send(bench, 0, 0x040, "00 00 00 00");
        bench_tick(bench);
    }
}

/* The board sees this current from the coming tick on. */
static void show_current(struct board_bench *bench, int axis, double ratio)
{
    bench->sense[axis].current_a = ratio * limit_a[axis];
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
}

/* Ticks until the board trips; 1000 = it does not. */
static int ticks_to_trip(struct board_bench *bench)
{
    uint64_t before = bench_counters(bench).trips;
    int ticks = 0;

    while (ticks < 1000 && bench_counters(bench).trips == before) {
        run_commands(bench, 1);
        ticks++;
    }
    return ticks;
}

static void expect_fault(struct board_bench *bench, int axis, uint32_t fault)
{
    struct board_event event;

    assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
    assert_int_equal(event.a, fault);
    assert_int_equal(event.axis, axis);
    assert_false(bench->motor[axis].bridge_on);
}

/* ---- the heat of an over-current ---- */

/* Twice the limit heats by 3 a ms of 10, no current cools by 1, never below zero. */
TEST(heat_cools_as_it_came)
{
    for (int axis = 0; axis < AXES; axis++) {
        for (int rest = 0; rest < 12; rest++) {
            int left = rest < 9 ? 9 - rest : 0;
            struct board_bench bench;

            start_differently(&bench);
            show_current(&bench, axis, 2.0);
            run_commands(&bench, 3);
            show_current(&bench, axis, 0.0);
            run_commands(&bench, rest);
            show_current(&bench, axis, -2.0);
            assert_int_equal(ticks_to_trip(&bench), (10 - left) / 3 + 1);
            assert_true(bench.motor[1 - axis].bridge_on);
            bench_stop(&bench);
        }
    }
}

TEST(an_axis_that_was_off_begins_cold)
{
    for (int axis = 0; axis < AXES; axis++) {
        struct board_bench bench;

        start_differently(&bench);
        show_current(&bench, axis, 2.0);
        run_commands(&bench, 3);
        bench_send(&bench, 0, 0x020, off[axis]);
        run_commands(&bench, 1);
        bench_send(&bench, 0, 0x020, voltage_mode[axis]);
        assert_int_equal(ticks_to_trip(&bench), 4);

        /* Driven from outside while it is off, it gathers none */
        bench_send(&bench, 0, 0x020, off[axis]);
        run_commands(&bench, 100);
        bench_send(&bench, 0, 0x020, voltage_mode[axis]);
        assert_int_equal(ticks_to_trip(&bench), 4);
        bench_stop(&bench);
    }
}

/* ---- faults that come twice ---- */

TEST(an_over_current_trips_again_after_it_was_enabled_again)
{
    for (int axis = 0; axis < AXES; axis++) {
        struct board_event event;
        struct board_bench bench;

        start_differently(&bench);
        for (int time = 1; time <= 3; time++) {
            show_current(&bench, axis, 2.0);
            assert_int_equal(ticks_to_trip(&bench), 4);
            run_commands(&bench, 20); /* in fault it trips no more */
            assert_int_equal(bench_counters(&bench).trips, time);
            expect_fault(&bench, axis, COMPACT_FAULT_OVER_CURRENT);
            assert_false(bench_event(&bench, BOARD_EVENT_FAULT, &event));
            bench_send(&bench, 0, 0x020, voltage_mode[axis]); /* not before OFF */
            run_commands(&bench, 1);
            assert_false(bench.motor[axis].bridge_on);
            assert_true(bench.motor[1 - axis].bridge_on);
            bench_send(&bench, 0, 0x020, off[axis]);
            show_current(&bench, axis, 1.0);
            bench_send(&bench, 0, 0x020, voltage_mode[axis]);
            run_commands(&bench, 200); /* the limit itself is allowed */
            assert_true(bench.motor[axis].bridge_on);
        }
        bench_stop(&bench);
    }
}

/* Under-voltage, then over-voltage, and so on: told each time, and gone after OFF. */
TEST(a_supply_out_of_range_is_told_each_time)
{
    static const double good_v[] = {24.0, 60.0};
    const double bad_v[] = {nextafter(24.0, 0.0), nextafter(60.0, 100.0)};
    struct board_event event;
    struct board_bench bench;

    start_differently(&bench);
    for (int time = 0; time < 4; time++) {
        bench.sensors.supply_v = bad_v[time % 2];
        run_commands(&bench, 5);
        for (int axis = 0; axis < AXES; axis++) {
            expect_fault(&bench, axis,
                         time % 2 ? COMPACT_FAULT_OVER_VOLTAGE : COMPACT_FAULT_UNDER_VOLTAGE);
        }
        while (bench_event(&bench, BOARD_EVENT_FAULT, &event)) {
            assert_int_not_equal(event.board, 0); /* the supply is that of all boards */
        }
        bench_send(&bench, 0, 0x020, "00 03 00 00 00"); /* while the cause lasts it comes back */
        bench_send(&bench, 0, 0x020, "01 03 00 00 00");
        run_commands(&bench, 2);
        assert_false(bench.motor[0].bridge_on || bench.motor[1].bridge_on);
        bench.sensors.supply_v = good_v[time % 2]; /* at the limit there is none */
        run_commands(&bench, 1);
        bench_send(&bench, 0, 0x020, "00 03 00 00 00");
        bench_send(&bench, 0, 0x020, "01 03 00 00 00");
        run_commands(&bench, 5);
        assert_true(bench.motor[0].bridge_on && bench.motor[1].bridge_on);
        while (bench_event(&bench, BOARD_EVENT_FAULT, &event)) {
        }
    }
    bench_stop(&bench);
}

TEST(a_stale_command_is_told_each_time)
{
    struct board_event event;
    struct board_bench bench;

    start_differently(&bench);
    for (int time = 1; time <= 3; time++) {
        bench_send(&bench, 0, 0x040, "E8 03"); /* axis 1 hears nothing any more */
        bench_tick(&bench);
        for (int t = 0; t < 60; t++) {
            bench_send(&bench, 0, 0x040, "E8 03");
            bench_tick(&bench);
            assert_near(bench.motor[0].voltage_v, 2.0, 1e-12);
        }
        assert_int_equal(bench_counters(&bench).timeouts, time);
        assert_true(bench_event(&bench, BOARD_EVENT_TIMEOUT, &event));
        assert_int_equal(event.axis, 1);
        assert_false(bench_event(&bench, BOARD_EVENT_TIMEOUT, &event));
        assert_true(bench.motor[1].bridge_on); /* it brakes */
        assert_true(bench.motor[1].voltage_v == 0.0);
        bench_send(&bench, 0, 0x040, "E8 03 18 FC");
        bench_tick(&bench);
        assert_near(bench.motor[1].voltage_v, -2.0, 1e-12);
    }
    bench_stop(&bench);
}

/* Each axis has its own range, and tells once each time that it leaves it. */
TEST(a_limit_is_told_each_time_that_it_is_left)
{
    static const char *const drive[AXES][2] = {{"E8 03 00 00", "18 FC 00 00"},
                                               {"00 00 E8 03", "00 00 18 FC"}};

    for (int axis = 0; axis < AXES; axis++) {
        struct board_event event;
        struct board_bench bench;

        start_differently(&bench);
        for (int time = 0; time < 4; time++) {
            const bool down = time % 2 != 0;
            const double at = down ? lower_rad[axis] : upper_rad[axis];
            const double tick = (down ? -1.0 : 1.0) / TICKS_PER_RAD;

            bench.sense[axis].q = at; /* at the limit is not beyond it */
            bench_tick(&bench);
            bench_send(&bench, 0, 0x040, drive[axis][down]);
            bench_tick(&bench);
            assert_near(bench.motor[axis].voltage_v, down ? -2.0 : 2.0, 1e-12);
            assert_false(bench_event(&bench, BOARD_EVENT_LIMIT, &event));
            bench.sense[axis].q = at + tick;
            bench_tick(&bench);
            for (int i = 0; i < 3; i++) {
                bench_send(&bench, 0, 0x040, drive[axis][down]);
                bench_tick(&bench);
                assert_true(bench.motor[axis].voltage_v == 0.0);
            }
            assert_true(bench_event(&bench, BOARD_EVENT_LIMIT, &event));
            assert_int_equal(event.axis, axis);
            assert_int_equal((int32_t)event.a, lround((at + tick) * 1e5));
            assert_false(bench_event(&bench, BOARD_EVENT_LIMIT, &event));
        }
        bench_stop(&bench);
    }
}

/* ---- integrals ---- */

enum { STEPS = 5 };

/* The current law of the factory: with R and L, kp = R a / (2 (1 - a)), a = exp(-1 ms R / L), and
 * ki = R / 2 a ms; here a is that of 1 for both axes. The bench's motors stand and draw nothing. */
static double current_law_v(int axis, double wanted_a, int ms)
{
    const double R = axis + 1.0, a = exp(-1.0);

    return wanted_a * (R * a / (2.0 * (1.0 - a)) + R / 2.0 * ms);
}

static void expect_current_mode(struct board_bench *bench)
{
    bench_send(bench, 0, 0x020, "02 03 00 00 00");
    bench_tick(bench);
    assert_true(bench->motor[0].voltage_v == 0.0 && bench->motor[1].voltage_v == 0.0);
    for (int n = 1; n <= STEPS; n++) {
        bench_send(bench, 0, 0x040, "F4 01 18 FC"); /* 0.5 A and -1 A */
        bench_tick(bench);
        assert_near(bench->motor[0].voltage_v, current_law_v(0, 0.5, n), 1e-3);
        assert_near(bench->motor[1].voltage_v, current_law_v(1, -1.0, n), 1e-3);
    }
}

/* What comes while an axis is off adds nothing, and what was before is forgotten, after off, after
 * another mode and after a fault. */
TEST(an_axis_that_was_off_begins_with_empty_integrals)
{
    struct board_bench bench;

    start_differently(&bench);
    expect_current_mode(&bench);
    bench_send(&bench, 0, 0x020, "00 03 00 00 00");
    for (int n = 0; n < 20; n++) {
        bench_send(&bench, 0, 0x040, "F4 01 18 FC");
        bench_tick(&bench);
        assert_false(bench.motor[0].bridge_on || bench.motor[1].bridge_on);
    }
    expect_current_mode(&bench);
    bench_send(&bench, 0, 0x020, "01 03 00 00 00");
    run_commands(&bench, 3);
    expect_current_mode(&bench);
    bench.sensors.supply_v = 20.0;
    run_commands(&bench, 3);
    bench.sensors.supply_v = SUPPLY_V;
    run_commands(&bench, 3);
    bench_send(&bench, 0, 0x020, "00 03 00 00 00");
    expect_current_mode(&bench);
    bench_stop(&bench);
}
