/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What 2FOC boards remember and what they forget: the heat of an over-current in all modes, faults
 * that come twice, integrals while an axis is off. The two boards of the bus differ in their
 * currents: nominal, peak and overload are 4, 8, 20 A of board 1 and 3, 5, 9 A of board 3.
 */
#include "tests/unit/boards/foc/foc_bench.h"

enum { AXES = 2 };

static const uint32_t command_id[AXES] = {0x001, 0x003};
static const uint32_t status_id[AXES] = {0x113, 0x133};
static const double nominal_a[AXES] = {4.0, 3.0}, peak_a[AXES] = {8.0, 5.0},
                    overload_a[AXES] = {20.0, 9.0};

static void start_differently(struct board_bench *bench)
{
    start(bench);
    bench_send(bench, 0, 0x003, "48 00 B8 0B 88 13 28 23");
    for (int axis = 0; axis < AXES; axis++) {
        bench_send(bench, 0, command_id[axis], "09 50");
    }
    target(bench, "00 00 00 00 00 00 00 00");
}

/* The board sees this current from the coming tick on. */
static void show_current(struct board_bench *bench, int axis, double current_a)
{
    bench->sense[axis].current_a = current_a;
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
}

static void run_targets(struct board_bench *bench, int ticks)
{
    while (ticks-- > 0) {
        target(bench, "00 00 00 00 00 00 00 00");
    }
}

/* Ticks until the board trips; 20000 = it does not. */
static int ticks_to_trip(struct board_bench *bench)
{
    uint64_t before = bench_counters(bench).trips;
    int ticks = 0;

    while (ticks < 20000 && bench_counters(bench).trips == before) {
        run_targets(bench, 1);
        ticks++;
    }
    return ticks;
}

/* Says that the axis has this fault and no other, told once since the last time; the other axis
 * runs. */
static void expect_fault(struct board_bench *bench, int axis, uint32_t fault)
{
    struct board_event event;

    assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
    assert_int_equal(event.board, axis);
    assert_int_equal(event.a, fault);
    assert_false(bench_event(bench, BOARD_EVENT_FAULT, &event));
    run_targets(bench, 1);
    assert_int_equal(bench_find(bench, 0, status_id[axis])->data[0], ICUB_MODE_HARDWARE_FAULT);
    assert_int_equal(get_u32_le(bench_find(bench, 0, status_id[axis])->data + 4), fault);
    assert_false(bench->motor[axis].bridge_on);
    assert_true(bench->motor[1 - axis].bridge_on);
}

/* ---- the heat of an over-current ---- */

/* The square of the current above the nominal one heats, below it cools, never below zero; the
 * board trips at what the peak current gives in 10.24 s. */
TEST_ON(heat_cools_as_it_came, board_bench, bench)
{
    static const int rests[] = {0, 1000, 4000, 7000, 13000};

    for (int axis = 0; axis < AXES; axis++) {
        const double nominal2 = nominal_a[axis] * nominal_a[axis];
        const double most = (peak_a[axis] * peak_a[axis] - nominal2) * 10240.0;

        for (size_t i = 0; i < sizeof rests / sizeof *rests; i++) {
            const double current = peak_a[axis] + 1.0;
            const double rate = current * current - nominal2;
            const double left = fmax(1500.0 * rate - rests[i] * nominal2, 0.0);

            start_differently(bench);
            show_current(bench, axis, current);
            run_targets(bench, 1500);
            show_current(bench, axis, 0.0);
            run_targets(bench, rests[i]);
            show_current(bench, axis, -current);
            assert_near(ticks_to_trip(bench), floor((most - left) / rate) + 1.0, 3.0);
            expect_fault(bench, axis, UINT32_C(1) << 22); /* I2t */
        }
    }
}

BENCH(start_differently, struct board_bench, bench_stop)

/* As the firmware has it, heat counts in idle and in fault too: who switches on again at once trips
 * at once, who waits has what the waiting gave. */
TEST_ON(heat_stays_when_the_axis_is_switched_off, start_differently, bench)
{
    show_current(bench, 0, 12.0); /* 128 A^2 above the nominal one */
    assert_near(ticks_to_trip(bench), 3840.0, 3.0);
    expect_fault(bench, 0, UINT32_C(1) << 22);
    bench_send(bench, 0, 0x001, "09 09");
    assert_int_equal(ticks_to_trip(bench), 1);
    expect_fault(bench, 0, UINT32_C(1) << 22);

    show_current(bench, 0, 0.0); /* cools by 16 A^2: 1600 ms of it are 200 ms of the other */
    run_targets(bench, 1600);
    bench_send(bench, 0, 0x001, "09 09; 09 50");
    run_targets(bench, 1);
    assert_true(bench->motor[0].bridge_on);
    show_current(bench, 0, 12.0);
    assert_near(ticks_to_trip(bench), 200.0, 3.0);
}

/* ---- faults that come twice ---- */

TEST_ON(an_over_current_trips_again_after_it_was_enabled_again, board_bench, bench)
{
    for (int axis = 0; axis < AXES; axis++) {
        start_differently(bench);
        for (int time = 1; time <= 3; time++) {
            show_current(bench, axis, time % 2 ? overload_a[axis] : -overload_a[axis]);
            run_targets(bench, 3); /* the limit itself is allowed */
            assert_true(bench->motor[axis].bridge_on);
            show_current(bench, axis, (time % 2 ? 1.0 : -1.0) * (overload_a[axis] + 0.001));
            assert_int_equal(ticks_to_trip(bench), 1);
            assert_int_equal(bench_counters(bench).trips, time);
            expect_fault(bench, axis, FOC_FAULT_OVER_CURRENT);
            bench_send(bench, 0, command_id[axis], "09 50"); /* not before FORCE_IDLE */
            bench_send(bench, 0, command_id[axis], "09 00");
            run_targets(bench, 2);
            assert_int_equal(bench_find(bench, 0, status_id[axis])->data[0],
                             ICUB_MODE_HARDWARE_FAULT);
            show_current(bench, axis, 0.0);
            bench_send(bench, 0, command_id[axis], "09 09; 09 50");
            run_targets(bench, 10);
            assert_true(bench->motor[axis].bridge_on);
            assert_int_equal(get_u32_le(bench_find(bench, 0, status_id[axis])->data + 4), 0);
        }
    }
}

/* A second cause while the first is latched is told, too; both are cleared together. */
TEST_ON(faults_gather_until_they_are_cleared, start_differently, bench)
{
    struct board_event event;

    bench->sensors.supply_v = nextafter(24.0, 0.0);
    run_targets(bench, 3);
    bench->sensors.supply_v = 24.0; /* at the limit there is none */
    run_targets(bench, 3);
    for (int axis = 0; axis < AXES; axis++) {
        assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
        assert_int_equal(event.a, FOC_FAULT_UNDER_VOLTAGE);
        assert_int_equal(get_u32_le(bench_find(bench, 0, status_id[axis])->data + 4),
                         FOC_FAULT_UNDER_VOLTAGE);
        bench_send(bench, 0, command_id[axis], "09 09; 09 50");
    }
    run_targets(bench, 3);
    assert_true(bench->motor[0].bridge_on && bench->motor[1].bridge_on);
    while (bench_event(bench, BOARD_EVENT_FAULT, &event)) {
        assert_int_equal(event.board, 4); /* the supply is that of all boards */
    }
    show_current(bench, 1, 9.5);
    assert_int_equal(ticks_to_trip(bench), 1);
    expect_fault(bench, 1, FOC_FAULT_OVER_CURRENT); /* of the under-voltage nothing is left */
}

/* ---- integrals ---- */

enum { STEPS = 6 };

/* A mode, what gives it an integral, the targets of boards 1 and 3 and the currents that make an
 * error; in open loop the limiter has the integral. */
struct law {
    const char *mode, *gains, *targets;
    double current_a;
};

static const struct law laws[] = {
    {"09 0A", "69 00 00 00 10 00 00 0E", "F4 01 00 00 0C FE", 0.0},
    {"09 0B", "65 00 00 00 10 00 00 0C", "32 00 00 00 CE FF", 0.0},
    {"09 01", "7D 02 03 00 00 00 80 3F", "F4 01 00 00 0C FE", 0.0},
    {"09 50", "65 00 00 00 01 00 00 0C", "80 3E 00 00 80 C1", 9.0},
};

static void send_to_both(struct board_bench *bench, const char *hex)
{
    for (int axis = 0; axis < AXES; axis++) {
        bench_send(bench, 0, command_id[axis], hex);
    }
}

/* Enters the mode and notes the voltages, or tenths of amperes, of its first ms. */
static void enter_law(struct board_bench *bench, const struct law *law, double volts[STEPS][AXES])
{
    send_to_both(bench, law->mode);
    for (int n = 0; n < STEPS; n++) {
        target(bench, law->targets);
        for (int axis = 0; axis < AXES; axis++) {
            const struct motor_command *motor = &bench->motor[axis];

            volts[n][axis] = motor->law.on ? 10.0 * motor->law.current_a : motor->voltage_v;
        }
        assert_true(bench->motor[0].bridge_on && bench->motor[1].bridge_on);
    }
}

/* Targets go on, bridges are open. */
static void expect_off(struct board_bench *bench, const struct law *law)
{
    for (int n = 0; n < 20; n++) {
        target(bench, law->targets);
        assert_true(bench->motor[0].voltage_v == 0.0 && bench->motor[1].voltage_v == 0.0);
        assert_false(bench->motor[0].bridge_on || bench->motor[1].bridge_on);
    }
}

/* The voltage changes from ms to ms, and again in the same way after the axis was off, entered once
 * more, or in fault: nothing is left of the integral, nothing came to it. */
TEST_ON(an_axis_begins_with_empty_integrals, board_bench, bench)
{
    for (size_t i = 0; i < sizeof laws / sizeof *laws; i++) {
        double first[STEPS][AXES], again[STEPS][AXES];

        start(bench);
        send_to_both(bench, laws[i].gains);
        show_current(bench, 0, laws[i].current_a);
        show_current(bench, 1, -laws[i].current_a);
        enter_law(bench, &laws[i], first);
        for (int axis = 0; axis < AXES; axis++) {
            assert_true(fabs(first[STEPS - 1][axis] - first[0][axis]) > 1.0);
            assert_true((first[STEPS - 1][axis] > 0.0) == (axis == 0));
        }

        send_to_both(bench, "09 00"); /* off */
        expect_off(bench, &laws[i]);
        enter_law(bench, &laws[i], again);
        assert_memory_equal(again, first, sizeof first);

        enter_law(bench, &laws[i], again); /* once more */
        assert_memory_equal(again, first, sizeof first);

        bench_ticks(bench, 60); /* the set-point expires */
        expect_off(bench, &laws[i]);
        send_to_both(bench, "09 09");
        enter_law(bench, &laws[i], again);
        assert_memory_equal(again, first, sizeof first);
    }
}
