/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What iCub motor boards remember and what they forget: the heat of an over-current, faults that
 * come twice, limits that are left twice, integrals while an axis is off. The two axes of the board
 * differ in everything: limits, gains, currents.
 */
#include "tests/unit/boards/icub/motor_bench.h"

enum { AXES = 2 };

static const double limit_a[AXES] = {1.0, 2.5};
static const char *const set_limit[AXES] = {"48 E8 03 00 00", "C8 C4 09 00 00"};
static const char *const open_loop[AXES] = {"09 50", "89 50"};
static const char *const idle[AXES] = {"09 00", "89 00"};
static const char *const force_idle[AXES] = {"09 09", "89 09"};

static void open_with_limits(struct board_bench *bench)
{
    bench_open(bench);
    for (int axis = 0; axis < AXES; axis++) {
        bench_send(bench, 0, 0x001, set_limit[axis]);
        bench_send(bench, 0, 0x001, open_loop[axis]);
    }
    bench_tick(bench);
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
        bench_tick(bench);
        ticks++;
    }
    return ticks;
}

/* ---- the heat of an over-current ---- */

/* Twice the limit heats by 3 a ms of 10, no current cools by 1, never below zero. */
TEST_ON(heat_cools_as_it_came, board_bench, bench)
{
    for (int axis = 0; axis < AXES; axis++) {
        for (int rest = 0; rest < 12; rest++) {
            int left = rest < 9 ? 9 - rest : 0;

            open_with_limits(bench);
            show_current(bench, axis, 2.0);
            bench_ticks(bench, 3);
            show_current(bench, axis, 0.0);
            bench_ticks(bench, rest);
            show_current(bench, axis, -2.0);
            assert_int_equal(ticks_to_trip(bench), (10 - left) / 3 + 1);
            assert_true(bench->motor[1 - axis].bridge_on);
        }
    }
}

TEST_ON(an_axis_that_was_off_begins_cold, board_bench, bench)
{
    for (int axis = 0; axis < AXES; axis++) {
        open_with_limits(bench);
        show_current(bench, axis, 2.0);
        bench_ticks(bench, 3);
        bench_say(bench, 0, 0x001, idle[axis]);
        bench_send(bench, 0, 0x001, open_loop[axis]);
        assert_int_equal(ticks_to_trip(bench), 4);

        /* Driven from outside while it is off, it gathers none */
        bench_send(bench, 0, 0x001, force_idle[axis]);
        bench_ticks(bench, 100);
        bench_send(bench, 0, 0x001, open_loop[axis]);
        assert_int_equal(ticks_to_trip(bench), 4);
    }
}

/* ---- faults that come twice ---- */

TEST_ON(an_over_current_trips_again_after_it_was_enabled_again, board_bench, bench)
{
    for (int axis = 0; axis < AXES; axis++) {
        struct board_event event;

        open_with_limits(bench);
        for (int time = 1; time <= 3; time++) {
            show_current(bench, axis, 2.0);
            assert_int_equal(ticks_to_trip(bench), 4);
            assert_int_equal(bench_counters(bench).trips, time);
            assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
            assert_int_equal(event.a, ICUB_FAULT_OVER_CURRENT);
            assert_int_equal(event.axis, axis);
            assert_false(bench_event(bench, BOARD_EVENT_FAULT, &event));
            bench_say(bench, 0, 0x001, open_loop[axis]); /* not before FORCE_IDLE */
            assert_false(bench->motor[axis].bridge_on);
            assert_true(bench->motor[1 - axis].bridge_on);
            bench_send(bench, 0, 0x001, force_idle[axis]);
            show_current(bench, axis, 1.0);
            bench_send(bench, 0, 0x001, open_loop[axis]);
            bench_ticks(bench, 200); /* the limit itself is allowed */
            assert_true(bench->motor[axis].bridge_on);
        }
    }
}

BENCH(open_with_limits, struct board_bench, bench_stop)

TEST_ON(a_supply_out_of_range_is_told_each_time, open_with_limits, bench)
{
    static const double good_v[] = {24.0, 60.0};
    const double bad_v[] = {nextafter(24.0, 0.0), nextafter(60.0, 100.0)};
    struct board_event event;

    for (int time = 0; time < 4; time++) {
        bench->sensors.supply_v = bad_v[time % 2];
        bench_ticks(bench, 5);
        for (int axis = 0; axis < AXES; axis++) {
            assert_false(bench->motor[axis].bridge_on);
            assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
            assert_int_equal(event.a,
                             time % 2 ? ICUB_FAULT_OVER_VOLTAGE : ICUB_FAULT_UNDER_VOLTAGE);
            assert_int_equal(event.axis, axis);
        }
        while (bench_event(bench, BOARD_EVENT_FAULT, &event)) {
            assert_int_not_equal(event.board, 0); /* the supply is that of all boards */
        }
        bench->sensors.supply_v = good_v[time % 2]; /* at the limit there is none */
        bench_tick(bench);
        for (int axis = 0; axis < AXES; axis++) {
            bench_send(bench, 0, 0x001, force_idle[axis]);
            bench_send(bench, 0, 0x001, open_loop[axis]);
        }
        bench_ticks(bench, 5);
        assert_true(bench->motor[0].bridge_on && bench->motor[1].bridge_on);
    }
}

/* Each axis has its own range, and tells once each time that it is driven out of it. */
TEST_ON(a_limit_is_told_each_time_that_it_is_left, board_bench, bench)
{
    static const char *const drive[AXES] = {"72 4D 01", "F2 4D 01"};
    static const double lower[AXES] = {-0.5, -1.25}, upper[AXES] = {0.75, 2.0};

    for (int axis = 0; axis < AXES; axis++) {
        struct board_event event;

        bench_configure(bench);
        for (int i = 0; i < AXES; i++) {
            bench->board[0].axis[i].lower_rad = lower[i];
            bench->board[0].axis[i].upper_rad = upper[i];
        }
        bench_start(bench);
        bench_send(bench, 0, 0x001, open_loop[axis]);
        for (int time = 0; time < 4; time++) {
            double at = time % 2 ? lower[axis] : upper[axis];
            double tick = (time % 2 ? -1.0 : 1.0) / TICKS_PER_RAD;

            bench->sense[axis].q = at; /* at the limit is not beyond it */
            bench_tick(bench);
            bench_send(bench, 0, 0x001, drive[axis]);
            bench_ticks(bench, 2);
            assert_true(bench->motor[axis].voltage_v > 11.0);
            assert_false(bench_event(bench, BOARD_EVENT_LIMIT, &event));
            bench->sense[axis].q = at + tick;
            for (int i = 0; i < 3; i++) {
                bench_send(bench, 0, 0x001, drive[axis]);
                bench_ticks(bench, 2);
                assert_true(bench->motor[axis].voltage_v == 0.0);
            }
            assert_true(bench_event(bench, BOARD_EVENT_LIMIT, &event));
            assert_int_equal(event.axis, axis);
            assert_int_equal((int32_t)event.a, lround((at + tick) * TICKS_PER_RAD));
            assert_false(bench_event(bench, BOARD_EVENT_LIMIT, &event));
        }
    }
}

/* ---- integrals ---- */

struct law {
    const char *mode;   /* of axis 0; that of axis 1 has bit 7 */
    unsigned pid, unit; /* the command of its gains; which sensor shows the error */
};

static const struct law laws[] = {
    {"08", 0x52, 0}, {"01", 0x52, 0}, {"03", 0x4e, 1}, {"04", 0x4e, 1}};

/* Makes an error of so many counts in the coming ticks. */
static void show_error(struct board_bench *bench, const struct law *law, int axis, int counts)
{
    struct motor_sense *sense = &bench->sense[axis];

    if (law->unit == 0) {
        sense->q -= counts / TICKS_PER_RAD;
    } else {
        sense->torque_nm = -counts * 55.0 / 32768.0;
    }
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
}

static void switch_axes(struct board_bench *bench, const char *mode)
{
    char text[16];

    snprintf(text, sizeof text, "09 %s", mode);
    bench_send(bench, 0, 0x001, text);
    snprintf(text, sizeof text, "89 %s", mode);
    bench_send(bench, 0, 0x001, text);
}

static void expect_pwm(const struct board_bench *bench, int axis, int pwm)
{
    assert_near(bench->motor[axis].voltage_v, pwm / 1333.0 * SUPPLY_V, 1e-9);
}

/* Pure integrators, of 1 and 2 counts a count and ms: after n ms with an error e the PWM is n e and
 * 2 n e. What comes while an axis is off adds nothing, and what was before is forgotten. */
TEST_ON(an_axis_that_was_off_begins_with_empty_integrals, board_bench, bench)
{
    for (size_t i = 0; i < sizeof laws / sizeof *laws; i++) {
        char text[64];

        bench_open(bench);
        for (unsigned axis = 0; axis < AXES; axis++) {
            snprintf(text, sizeof text, "%02X 00 00 %02X 00 00 00 00", laws[i].pid | axis << 7,
                     axis + 1);
            bench_send(bench, 0, 0x001, text);
            /* an integral may become as large as any; position and torque have such a limit */
            snprintf(text, sizeof text, "%02X 00 00 35 05 FF 7F",
                     (laws[i].pid == 0x4e ? 0x50U : 0x54U) | axis << 7);
            bench_send(bench, 0, 0x001, text);
        }
        bench_tick(bench);
        for (int time = 0; time < 3; time++) {
            switch_axes(bench, laws[i].mode);
            bench_tick(bench);
            expect_pwm(bench, 0, 0);
            expect_pwm(bench, 1, 0);
            show_error(bench, &laws[i], 0, 10);
            show_error(bench, &laws[i], 1, -7);
            for (int n = 1; n <= 5; n++) {
                bench_tick(bench);
                expect_pwm(bench, 0, 10 * n);
                expect_pwm(bench, 1, -7 * 2 * n);
            }
            switch_axes(bench, "00");
            for (int n = 0; n < 20; n++) {
                bench_tick(bench);
                expect_pwm(bench, 0, 0);
                expect_pwm(bench, 1, 0);
            }
            show_error(bench, &laws[i], 0, 0);
            show_error(bench, &laws[i], 1, 0);
        }
    }
}
