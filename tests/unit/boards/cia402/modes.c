/* SPDX-License-Identifier: Apache-2.0 */
/* Modes of operation with a motor behind the bridge. Times and positions are those of the trapezoid
 * that CiA 402 describes. */
#include "tests/unit/boards/cia402/cia402_motor.h"

/* Ticks until a bit of the statusword is set. */
static int ticks_until(struct motor *motor, unsigned bit, int most)
{
    for (int t = 1; t < most; t++) {
        if (get(motor, 0x6041) & bit) {
            return t;
        }
    }
    return most;
}

/* ---- profile position ---- */

/* d = 1 rad, v = 1 rad/s, a = 10 rad/s2: v/a + d/v = 1.1 s */
TEST_WITH(a_profile_takes_the_time_of_its_trapezoid, NULL, motor_tear_down)
{
    double most = 0.0;
    int reached;

    enable(&the_motor, 1);
    put(&the_motor, 0x607a, 0, 4, 100000);
    put(&the_motor, 0x6040, 0, 2, 0x1f);
    assert_true(get(&the_motor, 0x6041) & 0x1000); /* acknowledged */
    put(&the_motor, 0x6040, 0, 2, 0x0f);
    assert_false(get(&the_motor, 0x6041) & 0x1400);
    for (int t = 0; t < 500; t++) {
        turn(&the_motor, 1);
        most = fmax(most, the_motor.velocity);
    }
    assert_near(most, 1.0, 0.05); /* twice the lag of 10 rad/s2 over half the time constant */
    assert_near(the_motor.angle, 0.45, 0.03);
    reached = 504 + ticks_until(&the_motor, 0x400, 1000);
    assert_near((double)reached, 1100.0, 40.0); /* within 10 mrad of the goal */
    turn(&the_motor, 200);
    assert_near(the_motor.angle, 1.0, 1e-3);
    assert_near((double)get(&the_motor, 0x6064), 100000.0, 100.0);
}

TEST(a_second_set_point_waits_or_is_taken_at_once)
{
    for (int at_once = 0; at_once < 2; at_once++) {
        struct motor motor;
        int first = 0;

        enable(&motor, 1);
        put(&motor, 0x607a, 0, 4, 50000);
        put(&motor, 0x6040, 0, 2, 0x1f);
        put(&motor, 0x6040, 0, 2, 0x0f);
        put(&motor, 0x607a, 0, 4, -20000);
        put(&motor, 0x6040, 0, 2, at_once ? 0x3f : 0x1f);
        put(&motor, 0x6040, 0, 2, 0x0f);
        assert_int_equal(get(&motor, 0x6041) >> 12 & 1, !at_once); /* the buffer is full */
        for (int t = 0; t < 2000; t++) {
            turn(&motor, 1);
            first += motor.angle > 0.499;
        }
        assert_int_equal(first > 0, !at_once);
        assert_near(motor.angle, -0.2, 1e-3);
        assert_true(get(&motor, 0x6041) & 0x400);
        bench_stop(&motor.bench);
    }
}

TEST_WITH(relative_goals_halt_and_limits, NULL, motor_tear_down)
{
    enable(&the_motor, 1);
    for (int i = 0; i < 2; i++) {
        put(&the_motor, 0x607a, 0, 4, 30000);
        put(&the_motor, 0x6040, 0, 2, 0x5f);
        control(&the_motor, 0x4f, 600);
    }
    assert_near(the_motor.angle, 0.6, 2e-3);

    /* a halt in the middle, and on */
    go(&the_motor, 120000, 0x1f, 200);
    control(&the_motor, 0x11f, 300);
    assert_near(the_motor.velocity, 0.0, 5e-3);
    assert_true(the_motor.angle > 0.7 && the_motor.angle < 1.0);
    assert_true(get(&the_motor, 0x6041) & 0x400);
    control(&the_motor, 0x1f, 1000);
    assert_near(the_motor.angle, 1.2, 2e-3);

    /* the software limit of 2.5 rad */
    put(&the_motor, 0x6040, 0, 2, 0x0f);
    go(&the_motor, 400000, 0x1f, 2500);
    assert_near(the_motor.angle, 2.5, 3e-3);
    assert_true(get(&the_motor, 0x6041) & 0x800);
}

TEST_WITH(a_following_error_is_a_fault, NULL, motor_tear_down)
{
    enable(&the_motor, 1);
    put(&the_motor, 0x6065, 0, 4, 5000);
    put(&the_motor, 0x6066, 0, 2, 20);
    the_motor.jammed = true;
    go(&the_motor, 100000, 0x1f, 500);
    assert_int_equal(get(&the_motor, 0x603f) & 0xffff, 0x8611);
    assert_int_equal(get(&the_motor, 0x6041) & 0x4f, 0x08);
}

/* ---- velocity ---- */

TEST_WITH(profile_velocity_ramps_and_carries_a_load, NULL, motor_tear_down)
{
    enable(&the_motor, 3);
    put(&the_motor, 0x6083, 0, 4, 500000);
    put(&the_motor, 0x60ff, 0, 4, 200000); /* 2 rad/s at 5 rad/s2: 0.4 s */
    turn(&the_motor, 200);
    assert_near(the_motor.velocity, 1.0, 0.03);
    turn(&the_motor, 220);
    assert_near(the_motor.velocity, 2.0, 0.02);
    assert_true(get(&the_motor, 0x6041) & 0x400);
    the_motor.load_nm = 20.0;
    turn(&the_motor, 300);
    assert_near(the_motor.velocity, 2.0, 0.01);
    the_motor.load_nm = 0.0;
    put(&the_motor, 0x6040, 0, 2, 0x10f); /* halt: 10 rad/s2 */
    turn(&the_motor, 260);
    assert_near(the_motor.velocity, 0.0, 0.01);
    assert_true(get(&the_motor, 0x6041) & 0x1000); /* stands */
}

TEST_WITH(cyclic_velocity_follows_at_once_with_its_offset, NULL, motor_tear_down)
{
    enable(&the_motor, 9);
    put(&the_motor, 0x60b1, 0, 4, 10000);
    for (int i = 0; i < 4; i++) {
        put(&the_motor, 0x60ff, 0, 4, 40000);
        turn(&the_motor, 10);
        assert_near(the_motor.velocity, 0.5, 0.05);
        turn(&the_motor, 20);
        assert_true(get(&the_motor, 0x6041) & 0x1000); /* follows the command */
    }
    assert_near(the_motor.velocity, 0.5, 0.005);
    turn(&the_motor, 100); /* the command is old: only the offset is left */
    assert_near(the_motor.velocity, 0.1, 0.01);
    assert_int_equal(get(&the_motor, 0x6041) & 0x1080, 0x80);
}

/* A motor's own greatest speed bounds as the profile's does: 6080h is in revolutions a minute. */
TEST_WITH(the_motor_s_speed_bounds_a_velocity, NULL, motor_tear_down)
{
    enable(&the_motor, 9);
    put(&the_motor, 0x6080, 0, 4, 3); /* no gear on this bench: 0.314 rad/s */
    for (int i = 0; i < 10; i++) {
        put(&the_motor, 0x60ff, 0, 4, 100000);
        turn(&the_motor, 40);
    }
    assert_near(the_motor.velocity, 0.314, 0.01);
    assert_true(get(&the_motor, 0x6041) & 0x800);
}

/* ---- cyclic position ---- */

TEST_WITH(cyclic_position_follows_a_sine, NULL, motor_tear_down)
{
    double worst = 0.0;

    enable(&the_motor, 8);
    put(&the_motor, 0x60c2, 1, 1, 2); /* a set-point every 2 ms */
    for (int t = 0; t < 1000; t++) {
        double wanted = 0.3 * (1.0 - cos(2.0 * M_PI * 2e-3 * t));

        put(&the_motor, 0x607a, 0, 4, lrint(wanted * 1e5));
        turn(&the_motor, 1);
        worst = fmax(worst, fabs(the_motor.angle - wanted));
    }
    assert_true(worst < 0.012); /* 1.9 rad/s: 6 ms */
}

/* What sways on the motor at 1 Hz must lose work to it, or it grows; a load is taken over */
TEST_WITH(a_held_position_damps_what_sways, NULL, motor_tear_down)
{
    double taken_j = 0.0;

    enable(&the_motor, 8);
    for (int t = 0; t < 10000; t++) {
        the_motor.load_nm = 10.0 * sin(2.0 * M_PI * t * 1e-3);
        turn(&the_motor, 1);
        taken_j += t < 5000 ? 0.0 : -the_motor.load_nm * the_motor.velocity * 1e-3;
    }
    /* Torque over speed is z = 2 b - 40 b / w^2 - j (81 b / w - J w) with b = Kw^2 / R; the work of
     * five cycles is 5/2 (10 / |z|)^2 Re z */
    assert_near(taken_j, 0.0586, 0.006);
    the_motor.load_nm = 20.0;
    turn(&the_motor, 10000);
    assert_near(the_motor.angle, 0.0, 1e-3);
}

TEST_WITH(a_stale_cyclic_position_is_approached_slowly, NULL, motor_tear_down)
{
    enable(&the_motor, 8);
    put(&the_motor, 0x607f, 0, 4, 50000); /* 0.5 rad/s */
    put(&the_motor, 0x607a, 0, 4, 100000);
    turn(&the_motor, 1000);
    assert_near(the_motor.angle, 0.5, 0.03);
    turn(&the_motor, 1200);
    assert_near(the_motor.angle, 1.0, 1e-3);
}

/* A cyclic axis moves to targets alone that came since it was switched off: not to 0, not to an old
 * one, not to the way of a relative move. */
TEST_WITH(a_cyclic_axis_without_a_target_holds_its_place, NULL, motor_tear_down)
{
    memset(&the_motor, 0, sizeof the_motor);
    configure(&the_motor.bench);
    the_motor.angle = the_motor.bench.sense[0].q = the_motor.bench.sense[0].qm = 0.4;
    start_motor(&the_motor, 8);
    turn(&the_motor, 300);
    assert_near(the_motor.angle, 0.4, 1e-3);
    assert_near((double)get(&the_motor, 0x6062), 40000.0, 100.0);
    put(&the_motor, 0x607a, 0, 4, 60000);
    turn(&the_motor, 500);
    assert_near(the_motor.angle, 0.6, 1e-3);

    /* Off, moved by hand, on again */
    put(&the_motor, 0x6040, 0, 2, 0x06);
    the_motor.angle = 0.1;
    the_motor.velocity = 0.0;
    turn(&the_motor, 20);
    put(&the_motor, 0x6040, 0, 2, 0x07);
    control(&the_motor, 0x0f, 300);
    assert_near(the_motor.angle, 0.1, 2e-3);

    /* A quick stop ends the target, too; so does another mode */
    put(&the_motor, 0x605a, 0, 2, 6);
    go(&the_motor, 90000, 0x02, 300);
    control(&the_motor, 0x0f, 300);
    assert_true(the_motor.angle < 0.3);
    put(&the_motor, 0x6060, 0, 1, 1);
    put(&the_motor, 0x607a, 0, 4, 20000);
    put(&the_motor, 0x6040, 0, 2, 0x5f); /* relative */
    turn(&the_motor, 1000);
    put(&the_motor, 0x6060, 0, 1, 8);
    {
        const double before = the_motor.angle;

        turn(&the_motor, 300);
        assert_near(the_motor.angle, before, 2e-3);
    }
}

/* A target that is written before the axis is switched on counts. */
TEST_WITH(a_cyclic_target_may_come_before_the_axis_is_on, NULL, motor_tear_down)
{
    memset(&the_motor, 0, sizeof the_motor);
    configure(&the_motor.bench);
    bench_start(&the_motor.bench);
    turn(&the_motor, 1);
    put(&the_motor, 0x607a, 0, 4, 30000);
    put(&the_motor, 0x6060, 0, 1, 8);
    turn(&the_motor, 5);
    for (int word = 6; word <= 0x0f; word += word == 6 ? 1 : 8) {
        put(&the_motor, 0x6040, 0, 2, word);
    }
    turn(&the_motor, 500);
    assert_near(the_motor.angle, 0.3, 1e-3);
}

/* ---- torque and voltage ---- */

TEST(torque_follows_its_slope_and_the_cyclic_one_at_once)
{
    for (int mode = 4; mode <= 10; mode += 6) {
        struct motor motor;

        enable(&motor, mode);
        motor.jammed = true;
        put(&motor, 0x6087, 0, 4, 5000); /* 500 % a second */
        put(&motor, 0x6071, 0, 2, 500);  /* 50 % of 12 A */
        turn(&motor, 20);
        assert_near(motor.current, mode == 4 ? 1.3 : 6.0, 0.2);
        put(&motor, 0x6071, 0, 2, 500);
        turn(&motor, 40);
        put(&motor, 0x6071, 0, 2, 500);
        turn(&motor, 40);
        assert_near(motor.current, 6.0, 0.05);
        assert_near((double)get(&motor, 0x6077), 500.0, 5.0);

        /* no more than the limit; nothing without a fresh command */
        put(&motor, 0x6072, 0, 2, 250);
        put(&motor, 0x6071, 0, 2, 900);
        turn(&motor, 40);
        put(&motor, 0x6071, 0, 2, 900);
        turn(&motor, 40);
        assert_near(motor.current, 3.0, 0.05);
        assert_true(get(&motor, 0x6041) & 0x800);
        turn(&motor, 250);
        assert_near(motor.current, 0.0, 0.01);
        assert_int_equal(bench_counters(&motor.bench).timeouts, 1);
        bench_stop(&motor.bench);
    }
}

TEST_WITH(voltage_mode_is_the_bridge_and_leads_back_beyond_limits, NULL, motor_tear_down)
{
    enable(&the_motor, -1);
    put(&the_motor, 0x4000, 0, 2, 2500); /* 5 V */
    assert_near(the_motor.bench.motor[0].voltage_v, 5.0, 1e-12);
    assert_int_equal(get(&the_motor, 0x4001), 2500);
    the_motor.angle = 2.6; /* beyond 2.5 rad */
    turn(&the_motor, 2);
    assert_near(the_motor.bench.motor[0].voltage_v, 0.0, 1e-12);
    put(&the_motor, 0x4000, 0, 2, -2500);
    assert_near(the_motor.bench.motor[0].voltage_v, -5.0, 1e-12);
    put(&the_motor, 0x4000, 0, 2, -32768);
    assert_near(the_motor.bench.motor[0].voltage_v, -SUPPLY_V, 1e-12);
    turn(&the_motor, 60); /* time-out */
    assert_near(the_motor.bench.motor[0].voltage_v, 0.0, 1e-12);
}

/* ---- homing ---- */

TEST(homing_takes_the_present_position)
{
    for (int method = 35; method <= 37; method += 2) {
        struct motor motor;

        enable(&motor, 1);
        go(&motor, 70000, 0x1f, 1200);
        assert_near(motor.angle, 0.7, 1e-3);
        put(&motor, 0x6040, 0, 2, 0x0f);
        put(&motor, 0x6060, 0, 1, 6);
        put(&motor, 0x6098, 0, 1, method);
        put(&motor, 0x607c, 0, 4, 12345);
        assert_false(get(&motor, 0x6041) & 0x1000);
        control(&motor, 0x1f, 5);
        assert_true(get(&motor, 0x6041) & 0x1400);
        assert_near((double)get(&motor, 0x6064), -12345.0, 20.0); /* 0 is 0.12345 rad on */
        bench_stop(&motor.bench);
    }
}

TEST_WITH(homing_without_a_method_is_an_error, NULL, motor_tear_down)
{
    enable(&the_motor, 6);
    put(&the_motor, 0x6098, 0, 1, 0);
    put(&the_motor, 0x6040, 0, 2, 0x1f);
    assert_int_equal(get(&the_motor, 0x6041) & 0x3000, 0x2000);
}

TEST_WITH(a_mode_change_while_enabled_does_not_jump, NULL, motor_tear_down)
{
    static const int modes[] = {1, 8, 9, 10, 4, 3, 6, 0, 1};

    enable(&the_motor, 1);
    go(&the_motor, 20000, 0x1f, 800);
    for (size_t i = 0; i < sizeof modes / sizeof *modes; i++) {
        put(&the_motor, 0x60ff, 0, 4, 0);
        put(&the_motor, 0x6060, 0, 1, modes[i]);
        turn(&the_motor, 100);
        assert_int_equal(get(&the_motor, 0x6061) & 0xff, modes[i]);
        assert_near(the_motor.angle, 0.2, 3e-3);
    }
}
