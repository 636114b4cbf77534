/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Control laws of the motor boards: the arithmetic alone against hand calculations, then whole
 * boards on a simple motor (first-order current, inertia, viscous friction) integrated here.
 */
#include "boards/axis.h"
#include "tests/unit/boards/board_bench.h"

/* ---- arithmetic ---- */

TEST(quantization_rounds_and_ends_at_32_bits)
{
    int32_t count = 7;

    assert_true(control_quantize(2.49, &count));
    assert_int_equal(count, 2);
    assert_true(control_quantize(-2.51, &count));
    assert_int_equal(count, -3);
    assert_true(control_quantize(1e300, &count));
    assert_int_equal(count, INT32_MAX);
    assert_true(control_quantize(-1e300, &count));
    assert_int_equal(count, INT32_MIN);
    assert_false(control_quantize((double)NAN, &count));
    assert_false(control_quantize((double)INFINITY, &count));
    assert_int_equal(count, INT32_MIN);
}

TEST(shifts_go_toward_zero)
{
    assert_int_equal(control_shift_right(-7, 1), -3);
    assert_int_equal(control_shift_right(7, 1), 3);
    assert_int_equal(control_shift_right(7, -5), 7);
    assert_int_equal(control_shift_right(INT64_C(1) << 40, 99), 1 << 10);
}

TEST(a_pid_is_its_three_parts)
{
    const struct pid_gains p = {.kp = 10, .shift = 3, .integral_limit = INT16_MAX};
    const struct pid_gains d = {.kd = 40, .shift = 2, .integral_limit = INT16_MAX};
    const struct pid_gains i = {.ki = 3, .shift = 1, .integral_limit = 50};
    struct pid pid;

    pid_reset(&pid);
    assert_int_equal(pid_step(&pid, &p, 100), 125);
    assert_int_equal(pid_step(&pid, &p, -101), -126);          /* -1010/8 toward zero */
    assert_int_equal(pid_step(&pid, &p, 1000000), 327670 / 8); /* the error saturates */

    pid_reset(&pid); /* a step of 20: 20*40/4 = 200, a tenth of it for ten milliseconds */
    for (int k = 0; k < 10; k++) {
        assert_int_equal(pid_step(&pid, &d, 20), 20);
    }
    assert_int_equal(pid_step(&pid, &d, 20), 0);

    pid_reset(&pid); /* 3*4/2 = 6 a millisecond, up to 50 and down again at once */
    for (int k = 1; k < 30; k++) {
        assert_int_equal(pid_step(&pid, &i, 4), 6 * k < 50 ? 6 * k : 50);
    }
    assert_int_equal(pid_step(&pid, &i, -4), 44);
    for (int k = 1; k < 30; k++) { /* and to the other bound */
        assert_int_equal(pid_step(&pid, &i, -4), 44 - 6 * k > -50 ? 44 - 6 * k : -50);
    }
    assert_int_equal(pid_step(&pid, &i, 4), -44);
}

TEST(a_trajectory_has_the_shape_of_minimum_jerk)
{
    struct trajectory trajectory;
    int64_t sum = 0;
    int steps = 0;

    trajectory_stop(&trajectory, 1000);
    trajectory_start(&trajectory, 21000, 2000); /* T = 100 * 20000 / 2000 = 1000 ms */
    while (trajectory.running) {
        double s = ++steps / 1000.0;
        double expected = 1000.0 + 20000.0 * (10 * pow(s, 3) - 15 * pow(s, 4) + 6 * pow(s, 5));

        sum += trajectory_step(&trajectory);
        assert_true(fabs(trajectory.position - expected) <= 0.5 + 1e-6);
    }
    assert_int_equal(steps, 1000);
    assert_int_equal(sum, 20000);
    assert_int_equal(trajectory_step(&trajectory), 0);
}

TEST(a_new_target_on_the_way_keeps_the_speed)
{
    struct trajectory trajectory;
    int32_t before, after = 0;

    trajectory_stop(&trajectory, 0);
    trajectory_start(&trajectory, 100000, 10000);
    for (int i = 0; i < 500; i++) {
        after = trajectory_step(&trajectory);
    }
    before = after; /* 187.5 ticks/ms in the middle */
    assert_in_range(before, 187, 188);
    trajectory_start(&trajectory, -50000, 10000);
    after = trajectory_step(&trajectory);
    assert_in_range(after, before - 2, before);
    for (int i = 0; i < 1100; i++) {
        trajectory_step(&trajectory);
    }
    assert_int_equal(trajectory.position, -50000);
    assert_false(trajectory.running);
}

TEST(absurd_moves_end_at_their_target)
{
    struct trajectory trajectory;

    trajectory_stop(&trajectory, INT32_MIN);
    trajectory_start(&trajectory, INT32_MAX, INT16_MAX);
    for (int i = 0; i < 1000; i++) {
        trajectory_step(&trajectory);
    }
    trajectory_start(&trajectory, INT32_MIN, -1);
    for (int i = 0; i < 1000; i++) {
        trajectory_step(&trajectory);
    }
    trajectory_start(&trajectory, trajectory.position, 1); /* no distance: at once */
    trajectory_step(&trajectory);
    assert_false(trajectory.running);
}

TEST(the_estimator_is_exact_for_constant_acceleration)
{
    struct speed_estimator estimator;

    estimator_reset(&estimator, 0);
    for (int t = 1; t <= 200; t++) {
        estimator_push(&estimator, 3 * t * t); /* 6 ticks/ms^2 */
    }
    assert_int_equal(estimator_speed(&estimator, 0), 6 * (200 - 16));
    assert_int_equal(estimator_acceleration(&estimator, 0), 6);
    assert_int_equal(estimator_acceleration(&estimator, 4), 96);
    estimator_reset(&estimator, INT32_MAX);
    for (int t = 0; t < 20; t++) {
        estimator_push(&estimator, INT32_MIN);
    }
    assert_true(estimator_speed(&estimator, 60) < INT16_MIN);
}

/* ---- boards on a motor ---- */

/* COMAN's drive, link side: R, L, N Kt, N Kw, J, Dm. A rigid joint, 20 sub-steps a millisecond. */
static void plant(struct board_bench *bench, int joint)
{
    const double R = 0.664, L = 0.00032, K = 4.1, J = 0.1387, D = 0.19958, h = 0.001 / 20;
    struct motor_sense *s = &bench->sense[joint];

    for (int i = 0; i < 20; i++) {
        double v = bench->motor[joint].voltage_v;

        assert_true(fabs(v) <= SUPPLY_V);
        assert_true(bench->motor[joint].bridge_on || v == 0.0);
        if (bench->motor[joint].bridge_on) {
            s->current_a += h * (v - R * s->current_a - K * s->qmd) / L;
        } else {
            s->current_a = 0.0;
        }
        s->qmd += h * (K * s->current_a - D * s->qmd) / J;
        s->qm += h * s->qmd;
    }
    s->q = s->qm;
    s->qd = s->qmd;
}

static void run(struct board_bench *bench, int ms)
{
    for (int i = 0; i < ms; i++) {
        bench_tick(bench);
        plant(bench, 0);
    }
}

static void start(struct board_bench *bench)
{
    bench_configure(bench);
    bench->board[0].axis[0].current_limit_a = 100.0;
    bench_start(bench);
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "52 E8 00 01 00 00 00 0A"); /* kp 232, ki 1 over 1024: 20 rad/s */
}

TEST_ON(without_gains_a_position_mode_has_no_voltage, bench_open, bench)
{
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "09 01; 1B 10 27 00 00 E8 03");
    for (int i = 0; i < 2000; i++) {
        bench_tick(bench);
        assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    }
}

BENCH(start, struct board_bench, bench_stop)

TEST_ON(position_mode_moves_to_its_target_and_stays, start, bench)
{
    bench_send(bench, 0, 0x001, "09 01");
    bench_send(bench, 0, 0x001, "1B 10 27 00 00 E8 03"); /* 10000 ticks at 1000/100 ms: 1 s */
    run(bench, 500);
    bench_ask(bench, "08", "08 00 00");
    assert_near(bench->sense[0].q, 0.5, 0.05); /* half way at half time */
    run(bench, 3000);
    bench_ask(bench, "08", "08 01 00");
    bench_ask(bench, "16", "16 10 27 00 00");
    assert_near(bench->sense[0].q, 1.0, 1e-3);           /* ten ticks */
    bench_send(bench, 0, 0x001, "1B 40 9C 00 00 D0 07"); /* 40000 is beyond the limit of 25000 */
    run(bench, 5000);
    assert_near(bench->sense[0].q, 2.5, 1e-3);
}

TEST_ON(direct_mode_jumps_and_only_there, start, bench)
{
    bench_send(bench, 0, 0x001, "09 01; 3E E8 03 00 00");
    bench_ask(bench, "39", "39 00 00 00 00");
    bench_send(bench, 0, 0x001, "09 08; 3E E8 03 00 00");
    bench_ask(bench, "39", "39 E8 03 00 00");
    run(bench, 2000);
    assert_near(bench->sense[0].q, 0.1, 1e-3);
}

TEST_ON(velocity_mode_keeps_the_commanded_speed, start, bench)
{
    double before;

    bench_send(bench, 0, 0x001, "1C 50 00 01 00"); /* not in this mode */
    bench_ask(bench, "18", "18 00 00");
    bench_send(bench, 0, 0x001, "09 02");
    /* 80/16 = 5 ticks/ms = 0.5 rad/s; the ramp of 1/16 tick/ms^2 takes 80 ms */
    bench_send(bench, 0, 0x001, "1C 50 00 01 00");
    run(bench, 40);
    bench_ask(bench, "3A", "3A 28 00");
    run(bench, 960);
    before = bench->sense[0].q;
    run(bench, 500);
    assert_near(bench->sense[0].q - before, 0.25, 0.002);
    run(bench, 400);
    bench_send(bench, 0, 0x001, "2E"); /* stop; the integral part takes its time */
    run(bench, 2000);
    before = bench->sense[0].q;
    run(bench, 300);
    assert_near(bench->sense[0].q, before, 2e-3);
}

TEST_ON(velocity_stops_at_the_joint_limit, start, bench)
{
    bench_send(bench, 0, 0x001, "42 E8 03 00 00"); /* 1000 ticks */
    bench_send(bench, 0, 0x001, "09 02; 1C 50 00 00 00");
    run(bench, 1500);
    bench_ask(bench, "39", "39 E8 03 00 00");
    bench_ask(bench, "18", "18 00 00");
    assert_near(bench->sense[0].q, 0.1, 5e-3);
}

TEST_ON(mixed_mode_adds_move_and_velocity, start, bench)
{
    bench_send(bench, 0, 0x001, "09 07; 1B E8 03 00 00 E8 03"); /* 1000 ticks in 100 ms */
    bench_send(bench, 0, 0x001, "1C 10 00 00 00");              /* 1 tick/ms */
    run(bench, 500);
    bench_ask(bench, "39", "39 DC 05 00 00"); /* 1000 + 500 */
}

TEST_ON(current_mode_reaches_its_milliamperes, start, bench)
{
    bench_send(bench, 0, 0x001, "09 06; 2C C4 09 00 00"); /* 2500 mA */
    bench_tick(bench);
    assert_near(bench_lacking_a(bench, 0), 2.5, 1e-12);
}

TEST_ON(torque_mode_reaches_its_counts, start, bench)
{
    bench_send(bench, 0, 0x001, "4E 00 00 02 00 00 00 0A; 09 03");
    bench_send(bench, 0, 0x001, "2C A3 17 00 00"); /* 6051 counts of 0x8000 = 55 Nm: 10.16 Nm */
    for (int i = 0; i < 400; i++) {
        bench_tick(bench);
        bench->sense[0].torque_nm = bench->motor[0].voltage_v / 0.664 * 4.1;
    }
    assert_near(bench->sense[0].torque_nm, 10.16, 0.23); /* one PWM count is 0.22 Nm */
}

/* A held shaft off its reference feels stiffness * error, for the torque loop follows. */
TEST_ON(impedance_is_a_spring_around_the_reference, board_bench, bench)
{
    static const char *const modes[] = {"09 04", "09 05", "09 01"};

    for (int m = 0; m < 3; m++) {
        start(bench);
        bench_send(bench, 0, 0x001, "4E 00 00 02 00 00 00 0A");
        bench_send(bench, 0, 0x001, "57 06 00 00 00 00 00 00");  /* 6 counts a tick */
        bench_send(bench, 0, 0x001, m == 2 ? "74 01" : "74 00"); /* a compliant position mode */
        bench_say(bench, 0, 0x001, modes[m]);
        bench->sense[0].q = 0.05; /* 500 ticks: -3000 counts = -5.04 Nm */
        for (int i = 0; i < 400; i++) {
            bench_tick(bench);
            bench->sense[0].torque_nm = bench->motor[0].voltage_v / 0.664 * 4.1;
        }
        assert_near(bench->sense[0].torque_nm, -5.04, 0.23);
    }
}

TEST_ON(limits_of_the_pid_cut_its_output, start, bench)
{
    bench_send(bench, 0, 0x001, "2A C8 00"); /* 200 */
    bench_say(bench, 0, 0x001, "09 08; 3E 20 4E 00 00");
    assert_near(bench->motor[0].voltage_v, 200.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_say(bench, 0, 0x001, "2F 64 00");
    assert_near(bench->motor[0].voltage_v, 100.0 / 1333.0 * SUPPLY_V, 1e-12);
}

TEST_ON(offset_and_stiction_add_to_the_position_loop, bench_open, bench)
{
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "26 0A 00");       /* offset 10 */
    bench_send(bench, 0, 0x001, "5D 14 00 E2 FF"); /* 20 up, -30 down */
    bench_say(bench, 0, 0x001, "09 01");
    assert_near(bench->motor[0].voltage_v, 10.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_say(bench, 0, 0x001, "1B E8 03 00 00 E8 03");
    assert_near(bench->motor[0].voltage_v, 30.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_ticks(bench, 200);
    assert_near(bench->motor[0].voltage_v, 10.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_say(bench, 0, 0x001, "1B 00 00 00 00 E8 03");
    assert_near(bench->motor[0].voltage_v, -20.0 / 1333.0 * SUPPLY_V, 1e-12);
}
