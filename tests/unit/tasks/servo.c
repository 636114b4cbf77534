/* SPDX-License-Identifier: Apache-2.0 */
/* The servo's voltages, axis by axis, on a host that the test plays. */
#include "tasks/servo.h"

#include "tests/physics/near.h"
#include "tests/test.h"

enum { AXES = 2 };

struct host {
    struct host_config config;
    struct host_joint joint[AXES];
    double volts[AXES];
    int64_t now_ns;
};

const struct host_config *host_configuration(const struct host *host)
{
    return &host->config;
}

const struct host_joint *host_joint(const struct host *host, size_t axis)
{
    return &host->joint[axis];
}

int64_t host_time_ns(const struct host *host)
{
    return host->now_ns;
}

void host_set_voltage(struct host *host, size_t axis, double volts)
{
    host->volts[axis] = volts;
}

void host_set_reference(struct host *host, size_t axis, double rad, double rad_s)
{
    assert_true(isfinite(rad) && isfinite(rad_s));
    assert_non_null(host);
    assert_true(axis < AXES);
}

static const struct host_axis axes[AXES] = {{.joint_ticks_per_rad = 1e6},
                                            {.joint_ticks_per_rad = 1e6}};
static struct arena arena;
static struct host host;
static struct servo_gains gains[AXES];
static struct servo *servo;

FIXTURE(set_up)
{
    const struct servo_config config = {.gains = gains, .command_period_ns = 2000000};

    host = (struct host){.config = {.naxis = AXES, .axis = axes, .supply_v = 80}};
    for (int i = 0; i < AXES; i++) {
        gains[i] = (struct servo_gains){.kp_v_per_rad = 100};
    }
    if (arena_init(&arena, 1 << 16, NULL) || servo_create(&config, &host, &arena, &servo, NULL)) {
        return -1;
    }
    servo_start(servo);
    servo_update(servo);
    return 0;
}

FIXTURE(tear_down)
{
    arena_fini(&arena);
    return 0;
}

/* Time goes on by ms; the motors tell their angles. */
static void pass(int ms, double motor0, double motor1)
{
    host.now_ns += 1000000 * (int64_t)ms;
    host.joint[0].motor_rad = motor0;
    host.joint[1].motor_rad = motor1;
    host.joint[0].motor_time_ns = host.joint[1].motor_time_ns = host.now_ns;
    servo_update(servo);
}

TEST_WITH(each_axis_has_its_own_gains, set_up, tear_down)
{
    gains[1] = (struct servo_gains){.kp_v_per_rad = 300, .kw_v_s_per_rad = 5};
    servo_set(servo, 0, 0.1, 2);
    servo_set(servo, 1, 0.1, 2);
    pass(2, 0, 0);
    assert_near(host.volts[0], 10, 1e-12);
    assert_near(host.volts[1], 300 * 0.1 + 5 * 2, 1e-12);
}

TEST_WITH(a_drive_is_kept_to_its_limit_below_the_supply, set_up, tear_down)
{
    gains[1].limit_v = 40;
    servo_set(servo, 0, 2, 0);
    servo_set(servo, 1, -2, 0);
    pass(2, 0, 0);
    assert_near(host.volts[0], 80, 0);
    assert_near(host.volts[1], -40, 0);
}

TEST_WITH(an_integral_does_not_wind_up_at_the_limit, set_up, tear_down)
{
    gains[0] = (struct servo_gains){.kp_v_per_rad = 100, .ki_v_per_rad_s = 100, .limit_v = 40};
    servo_set(servo, 0, 1, 0);
    for (int i = 0; i < 1000; i++) {
        pass(2, 0, 0);
    }
    assert_near(host.volts[0], 40, 0);
    pass(2, 1, 0);
    assert_near(host.volts[0], 0, 1e-12);
}

TEST_WITH(the_rate_is_damped_to_the_references_rate, set_up, tear_down)
{
    gains[0] = (struct servo_gains){.kd_v_s_per_rad = 20};
    servo_set(servo, 0, 0, 0.5);
    pass(4, 0.004, 0);
    assert_near(host.volts[0], 20 * (0.5 - 1.0), 1e-12);
    /* no news: the last rate stands */
    host.now_ns += 2000000;
    servo_update(servo);
    assert_near(host.volts[0], 20 * (0.5 - 1.0), 1e-12);
}

TEST_WITH(an_excitation_is_added_to_the_voltage, set_up, tear_down)
{
    servo_set(servo, 0, 0.1, 0);
    servo_set(servo, 1, 0.1, 0);
    servo_excite(servo, 0, 3);
    pass(2, 0, 0);
    assert_near(host.volts[0], 10 + 3, 1e-12);
    assert_near(host.volts[1], 10, 1e-12);
    servo_excite(servo, 0, -4);
    pass(2, 0, 0);
    assert_near(host.volts[0], 10 - 4, 1e-12);
    servo_excite(servo, 0, 0);
    pass(2, 0, 0);
    assert_near(host.volts[0], 10, 1e-12);
}

/* At 1 rad/s the back-EMF is 4 V; 5 Nm of load are 10 V above or below it. */
TEST_WITH(a_torque_is_kept_to_its_limit_above_the_back_emf, set_up, tear_down)
{
    gains[0] = (struct servo_gains){
        .kp_v_per_rad = 100, .kw_v_s_per_rad = 4, .load_v_per_nm = 2, .torque_limit_nm = 5};
    servo_set(servo, 0, 0.5, 0);
    pass(4, 0.004, 0);
    assert_near(host.volts[0], 4 + 10, 1e-12);
    servo_set(servo, 0, -0.5, 0);
    pass(4, 0.008, 0);
    assert_near(host.volts[0], 4 - 10, 1e-12);
    servo_set(servo, 0, 0.012 + 0.05, 0);
    pass(4, 0.012, 0);
    assert_near(host.volts[0], 5, 1e-12);

    /* A load is compensated, below the limit */
    servo_set(servo, 0, 0.016, 0);
    servo_set_load(servo, 0, 3);
    pass(4, 0.016, 0);
    assert_near(host.volts[0], 2 * 3, 1e-12);
}

/* one came late, the next on time, a millisecond after it */
TEST_WITH(messages_in_quick_succession_make_no_spike_in_the_rate, set_up, tear_down)
{
    gains[0] = (struct servo_gains){.kd_v_s_per_rad = 20};
    pass(6, 0.006, 0);
    pass(1, 0.008, 0);
    pass(1, 0.008, 0);
    assert_near(host.volts[0], -20 * 0.002 / 0.002, 1e-9);
}

/* It comes back from the limit at once, and the integral goes on from what it was before it. */
TEST_WITH(a_voltage_at_its_limit_unwinds_when_the_error_turns, set_up, tear_down)
{
    gains[0] = (struct servo_gains){.kp_v_per_rad = 100, .ki_v_per_rad_s = 100, .limit_v = 40};
    servo_set(servo, 0, 0.2, 0);
    for (int i = 0; i < 50; i++) { /* 20 V, and 2 V of integral in 100 ms */
        pass(2, 0, 0);
    }
    assert_near(host.volts[0], 100 * 0.2 + 100 * 0.2 * 0.098, 1e-9); /* one step behind */
    servo_set(servo, 0, 1, 0);
    for (int i = 0; i < 50; i++) {
        pass(2, 0, 0);
        assert_near(host.volts[0], 40, 0);
    }
    pass(2, 1, 0); /* there: what is left is the integral of before */
    assert_near(host.volts[0], 2, 1e-9);

    /* Saturated by the integral: an error the other way takes from it all the same */
    gains[0].limit_v = 1;
    servo_set(servo, 0, 0.999, 0); /* -0.1 V, and 0.2 mV of integral a step */
    for (int i = 1; i <= 3; i++) {
        pass(2, 1, 0);
        assert_near(host.volts[0], 1, 0);
    }
    gains[0].limit_v = 40;
    pass(2, 1, 0);
    assert_near(host.volts[0], -0.1 + 2 - 3 * 100 * 0.001 * 0.002, 1e-9);
}

/* The trim follows the link's angle but for one tick of its encoder: ten ticks and one half are
 * nine and a half, less than one is nothing. */
TEST_WITH(the_trim_has_a_dead_zone_of_one_tick, set_up, tear_down)
{
    const double tick = 1 / axes[0].joint_ticks_per_rad;
    static const double ticks[] = {10.5, -10.5, 1.0, -1.0, 0.75, -0.75, 0, 1.25, -1.25};

    for (size_t i = 0; i < sizeof ticks / sizeof *ticks; i++) {
        double beyond = fmax(fabs(ticks[i]) - 1, 0), trim;

        gains[0] = (struct servo_gains){.kp_v_per_rad = 100, .trim_per_s = 2};
        gains[1] = (struct servo_gains){.kp_v_per_rad = 100, .trim_per_s = 5};
        host.joint[0].joint_rad = host.joint[1].joint_rad = 0.25;
        host.joint[0].motor_rad = host.joint[1].motor_rad = 0.375; /* the spring yields */
        servo_start(servo);
        servo_update(servo);
        assert_near(servo_wanted(servo, 0), 0.25, 0);
        assert_near(servo_reference(servo, 0), 0.375, 1e-15);
        host.joint[0].joint_rad = 0.25 - ticks[i] * tick;
        host.joint[1].joint_rad = 0.25 + ticks[i] * tick;
        for (int n = 0; n < 500; n++) { /* a second */
            pass(2, 0.375, 0.375);
        }
        trim = copysign(beyond * tick, ticks[i]);
        assert_near(servo_reference(servo, 0), 0.375 + 2 * trim, 1e-13);
        assert_near(servo_reference(servo, 1), 0.375 - 5 * trim, 1e-13);
    }
}

/* Without a trim the motor's angle itself is kept; the load at the start goes on being carried. */
TEST_WITH(a_start_keeps_what_it_finds, set_up, tear_down)
{
    gains[0] = (struct servo_gains){.kp_v_per_rad = 100, .load_v_per_nm = 0.5};
    gains[1] = (struct servo_gains){.kp_v_per_rad = 100, .load_v_per_nm = 0.25};
    host.joint[0] = (struct host_joint){.joint_rad = 0.1, .motor_rad = 0.3, .torque_nm = -8};
    host.joint[1] = (struct host_joint){.joint_rad = 0.2, .motor_rad = -0.4, .torque_nm = 20};
    servo_start(servo);
    pass(2, 0.3, -0.4);
    assert_near(servo_wanted(servo, 0), 0.3, 0);
    assert_near(host.volts[0], -4, 1e-12);
    assert_near(host.volts[1], 5, 1e-12);
}

/* Not before the command's period, and the first at once. */
TEST_WITH(commands_keep_their_period, set_up, tear_down)
{
    servo_set(servo, 0, 0.1, 0);
    host.now_ns += 1999999;
    servo_update(servo);
    assert_near(host.volts[0], 0, 0);
    host.now_ns += 1;
    servo_update(servo);
    assert_near(host.volts[0], 10, 1e-12);
}
