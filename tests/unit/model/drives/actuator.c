/* SPDX-License-Identifier: Apache-2.0 */
/* The actuator equations as plain functions: signs, cases, powers. Motion: tests/physics. */
#include "model/drives/actuator.h"

#include "tests/physics/coman_drive.h"
#include "tests/physics/near.h"
#include "tests/test.h"

static const struct robot_parallel_spring rope = {
    .present = true,
    .enabled = true,
    .k_p = 2000.0,
    .d_p = 0.1,
    .r = 0.05,
    .s = 1.0,
};

TEST(motor_ahead_of_the_link_pulls_it_forward)
{
    struct sea_state ahead = {.qm = 0.3, .qmd = 0.0, .I = 0.0};
    struct sea_state faster = {.qm = 0.1, .qmd = 2.0, .I = 0.0};

    assert_near(sea_torque(&coman_drive, &ahead, 0.1, 0.0), 395.46 * 0.2, 1e-12);
    assert_near(sea_torque(&coman_drive, &faster, 0.1, 0.5), 0.198 * 1.5, 1e-12);
}

TEST(derivative_follows_equations_2_and_4)
{
    struct sea_state s = {.qm = 0.2, .qmd = -1.5, .I = 3.0}, d;
    double tau = 395.46 * (0.2 - 0.15) + 0.198 * (-1.5 - 0.4);

    sea_derivative(&coman_drive, &s, 0.15, 0.4, 12.0, true, &d);
    assert_near(d.qm, -1.5, 0.0);
    assert_near(0.1387 * d.qmd + 0.19958 * s.qmd + tau, 4.1 * s.I, 1e-12);
    assert_near(0.32e-3 * d.I + 0.664 * s.I + 4.1 * s.qmd, 12.0, 1e-12);
}

TEST(open_bridge_changes_no_current)
{
    struct sea_state s = {.qm = 0.2, .qmd = -1.5, .I = 0.0}, d;

    sea_derivative(&coman_drive, &s, 0.15, 0.4, 12.0, false, &d);
    assert_near(d.I, 0.0, 0.0);
    assert_near(d.qm, -1.5, 0.0);
}

/* Electrical power = heat + rate of the stored energy + power to the link, at any state; the rate
 * of the stored energy by central difference along the derivative. */
static void check_power_balance(const struct robot_sea *sea)
{
    const struct sea_state s = {.qm = 0.21, .qmd = -1.5, .I = 3.0};
    const double q = 0.15, qd = 0.4, V = 17.0, h = 1e-6;
    struct sea_state d, back, ahead;
    struct sea_power power;
    double stored, link;

    sea_derivative(sea, &s, q, qd, V, true, &d);
    sea_power(sea, &s, q, qd, V, &power);
    back = (struct sea_state){s.qm - h * d.qm, s.qmd - h * d.qmd, s.I - h * d.I};
    ahead = (struct sea_state){s.qm + h * d.qm, s.qmd + h * d.qmd, s.I + h * d.I};
    stored = (sea_energy(sea, &ahead, q + h * qd) - sea_energy(sea, &back, q - h * qd)) / (2.0 * h);
    link = sea_torque(sea, &s, q, qd) * qd;
    assert_near(power.electrical,
                power.joule + power.friction + power.spring_damping + stored + link, 1e-6);
}

TEST(powers_balance_at_any_state)
{
    struct robot_sea mismatched = coman_drive;

    check_power_balance(&coman_drive);
    mismatched.Kw = 3.7;
    check_power_balance(&mismatched);
}

TEST(slack_rope_exerts_nothing)
{
    /* x = p - r q > 0, and the limit x = 0 which the paper counts as slack, at any speed */
    assert_near(parallel_spring_torque(&rope, 0.01, 0.0, 0.1, 5.0), 0.0, 0.0);
    assert_near(parallel_spring_torque(&rope, 0.0, -1.0, 0.0, 5.0), 0.0, 0.0);
    assert_near(parallel_spring_energy(&rope, 0.01, 0.1), 0.0, 0.0);
    assert_near(parallel_spring_damping(&rope, 0.01, 0.0, 0.1, 5.0), 0.0, 0.0);
}

TEST(taut_rope_pulls_the_joint_back)
{
    /* x = 0.01 - 0.05 * 0.9 = -0.035 m, x' = 0.02 - 0.05 * 2 = -0.08 m/s */
    double expected = 0.05 * (2000.0 * -0.035 + 0.1 * -0.08);

    assert_near(parallel_spring_torque(&rope, 0.01, 0.02, 0.9, 2.0), expected, 1e-12);
    assert_true(expected < 0.0);
}

TEST(sense_mirrors_the_spring)
{
    struct robot_parallel_spring mirrored = rope;

    mirrored.s = -1.0;
    for (int i = -4; i <= 4; i++) {
        double q = 0.3 * i, qd = 1.0 - 0.4 * i;

        assert_near(parallel_spring_torque(&mirrored, 0.01, 0.02, -q, -qd),
                    -parallel_spring_torque(&rope, 0.01, 0.02, q, qd), 1e-15);
    }
}

TEST(rope_torque_is_the_slope_of_its_energy)
{
    struct robot_parallel_spring undamped = rope;
    const double h = 1e-5;

    undamped.d_p = 0.0;
    for (int i = 0; i < 2; i++) {
        double q = i ? -0.7 : 0.7;

        undamped.s = i ? -1.0 : 1.0;
        assert_near(parallel_spring_torque(&undamped, 0.01, 0.0, q, 0.0),
                    -(parallel_spring_energy(&undamped, 0.01, q + h) -
                      parallel_spring_energy(&undamped, 0.01, q - h)) /
                        (2.0 * h),
                    1e-8);
    }
}

/* What the winch of the pretension puts in goes to the joint, into the spring and into heat. */
TEST(rope_powers_balance)
{
    const double p = 0.01, pd = 0.03, q = 0.8, qd = -1.7, h = 1e-6;
    double winch = parallel_spring_force(&rope, p, pd, q, qd) * pd;
    double joint = parallel_spring_torque(&rope, p, pd, q, qd) * qd;
    double stored = (parallel_spring_energy(&rope, p + h * pd, q + h * qd) -
                     parallel_spring_energy(&rope, p - h * pd, q - h * qd)) /
                    (2.0 * h);

    assert_near(winch, joint + stored + parallel_spring_damping(&rope, p, pd, q, qd), 1e-8);
}
