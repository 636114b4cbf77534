/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Hydraulic joints with the numbers of HyQ's leg (bore 16 mm, rod 10 mm, stroke 80 mm, 160 bar)
 * against closed forms, and the default integrator at its step of 1 ms against dopri5.
 */

#include "tests/physics/near.h"
#include "tests/physics/oil_rig.h"

/* The leg's forces are those that are published. */
TEST(areas_and_forces_are_those_of_the_leg)
{
    const struct robot_hydraulic c = hyq_cylinder();

    assert_near(c.A1 * 1e4, 2.0106, 1e-4);
    assert_near(c.A2 * 1e4, 1.2252, 1e-4);
    assert_near(160.0 * BAR * c.A1, 3217.0, 0.5);
    assert_near(160.0 * BAR * c.A2, 1960.0, 0.5);
}

/* Behind a piston that is held, p' = beta Q / V, at the valve's full flow. */
TEST(a_blocked_piston_is_pressed_at_beta_q_by_v)
{
    const struct robot_hydraulic c = hyq_cylinder();
    const struct robot_hydraulic_supply s = constant_supply();
    double y[HYDRAULIC_STATE], rate[HYDRAULIC_STATE], lever, V[2], x, p[2];
    struct hydraulic_port port = {.voltage = 10.0, .supply = s.pressure};

    hydraulic_rest(&c, &s, y);
    y[HYDRAULIC_SPOOL] = 1.0;
    x = hydraulic_length(&c, 0.0, &lever) - c.closed;
    V[0] = c.dead + c.A1 * x;
    V[1] = c.dead + c.A2 * (c.stroke - x);
    p[0] = y[HYDRAULIC_P1];
    p[1] = y[HYDRAULIC_P2];
    hydraulic_derive(&c, y, &port, rate, NULL);
    assert_near(rate[HYDRAULIC_P1] / (c.beta * c.K * sqrt(s.pressure - p[0]) / V[0]), 1.0, 1e-4);
    assert_near(rate[HYDRAULIC_P2] / (-c.beta * c.K * sqrt(p[1]) / V[1]), 1.0, 1e-4);

    /* the same over a time that is short beside the valve's */
    hydraulic_advance(&c, &port, 1e-6, y, NULL, NULL);
    assert_near((y[HYDRAULIC_P1] - p[0]) / (1e-6 * rate[HYDRAULIC_P1]), 1.0, 5e-3);
}

/* A held piston comes to supply and return pressure and stays: no step is too long. */
TEST(a_blocked_piston_comes_to_supply_and_return)
{
    struct toy_plant rig;

    oil_rig_begin(&rig, hyq_cylinder(), constant_supply());
    oil_rig_start(&rig, 0.0);
    plant_clamp(rig.plant, true);
    rig.motor->voltage_v = 10.0;
    step_oil(&rig, 200);
    assert_near(rig.state[AT_P1] / (160.0 * BAR), 1.0, 1e-9);
    assert_near(rig.state[AT_P2] / (160.0 * BAR), 0.0, 1e-9);
    rig.motor->voltage_v = -10.0;
    step_oil(&rig, 200);
    assert_near(rig.state[AT_P1] / (160.0 * BAR), 0.0, 1e-9);
    assert_near(rig.state[AT_P2] / (160.0 * BAR), 1.0, 1e-9);
    arena_fini(&rig.arena);
}

/* Without load the piston runs out at K sqrt(P A1 / (A1^3 + A2^3)). */
TEST(the_speed_without_load_is_the_closed_form)
{
    const struct robot_hydraulic c = hyq_cylinder();
    const double P = 160.0 * BAR, cubes = c.A1 * c.A1 * c.A1 + c.A2 * c.A2 * c.A2;
    const double out = c.K * sqrt(P * c.A1 / cubes), in = c.K * sqrt(P * c.A2 / cubes);
    struct toy_plant rig;
    double lever, q, qd;

    for (int way = 1; way >= -1; way -= 2) {
        /* a valve that opens by a tenth: slow, so that the link's inertia takes nothing */
        oil_rig_begin(&rig, c, constant_supply());
        oil_rig_start(&rig, -0.3 * way);
        rig.motor->voltage_v = way * 1.0;
        step_oil(&rig, 250);
        q = rig.state[0];
        qd = rig.state[1];
        hydraulic_length(&c, q, &lever);
        assert_near(lever * qd / (0.1 * (way > 0 ? out : -in)), 1.0, 3e-2);
        arena_fini(&rig.arena);
    }
}

/* Behind a closed valve the oil is a spring of beta (A1^2/V1 + A2^2/V2). */
TEST(a_closed_valve_makes_a_spring)
{
    const struct robot_hydraulic c = hyq_cylinder();
    struct toy_plant rig;
    double lever, x, stiffness, w, slope, y[HYDRAULIC_STATE], first = 0.0, last = 0.0;
    int turns = 0;
    struct hydraulic_port port = {.qd = 1e-3, .supply = 160.0 * BAR};

    x = hydraulic_length(&c, 0.0, &lever) - c.closed;
    stiffness =
        lever * lever * c.beta *
        (c.A1 * c.A1 / (c.dead + c.A1 * x) + c.A2 * c.A2 / (c.dead + c.A2 * (c.stroke - x)));

    /* the slope that the integrator takes for a way in a time */
    y[HYDRAULIC_SPOOL] = y[HYDRAULIC_SPOOL_RATE] = 0.0;
    y[HYDRAULIC_P1] = y[HYDRAULIC_P2] = 50.0 * BAR;
    hydraulic_advance(&c, &port, 1e-4, y, NULL, &slope);
    assert_near(slope / (-stiffness * 1e-4), 1.0, 1e-3);

    /* the link swings on it, by dopri5 */
    oil_rig_begin(&rig, c, constant_supply());
    rig.config.integrator = PLANT_DOPRI5;
    rig.config.substep_ns = MS / 10;
    oil_rig_start(&rig, 0.0);
    rig.state[1] = 0.01;
    w = sqrt(stiffness / 0.3);
    for (int k = 0; k < 4000 && turns < 11; k++) {
        const double before = rig.state[1];

        step_oil(&rig, 1);
        if (before < 0.0 && rig.state[1] >= 0.0) {
            last = 1e-4 * (k + before / (before - rig.state[1]));
            first = turns++ == 0 ? last : first;
        }
    }
    assert_true(turns == 11);
    assert_near((last - first) / 10.0 * w / (2.0 * M_PI), 1.0, 2e-3);
    arena_fini(&rig.arena);
}

TEST(steps_of_voltage_agree_with_dopri5)
{
    static double q[3][400], p[3][400];
    static const size_t parts[3] = {1, 4, 1};
    double error[2] = {0.0}, pressure[2] = {0.0};
    struct toy_plant rig;

    for (int run = 0; run < 3; run++) {
        struct plant_energy energy;

        oil_rig_begin(&rig, real_cylinder(), real_supply());
        rig.config.integrator = run == 2 ? PLANT_DOPRI5 : PLANT_IMPLICIT;
        rig.config.substep_ns = MS / (int64_t)parts[run];

        /* What a load of the cylinder does in 0.4 s of steps of voltage */
        oil_rig_start(&rig, -0.4);
        for (int k = 0; k < 400; k++) {
            rig.motor->voltage_v = k < 120 ? 3.0 : k < 160 ? 0.0 : k < 300 ? -2.0 : 1.0;
            step_oil(&rig, parts[run]);
            q[run][k] = rig.state[0];
            p[run][k] = rig.state[AT_P1];
        }
        assert_ok(plant_energy(rig.plant, &energy));
        print_message("# run %d: in %g J, orifices %g, leakage %g, friction %g, relief %g, balance "
                      "%g, supply %g bar\n",
                      run, energy.hydraulic_in, energy.orifice_loss, energy.leakage_loss,
                      energy.cylinder_friction, energy.relief_loss, energy.balance,
                      rig.state[AT_SUPPLY] / BAR);
        assert_true(energy.hydraulic_in > 100.0);
        assert_true(fabs(energy.balance) < (run == 2   ? 1e-6
                                            : run == 1 ? 5e-4
                                                       : 2e-3) *
                                               energy.hydraulic_in);
        arena_fini(&rig.arena);
    }
    for (int k = 0; k < 400; k++) {
        for (int run = 0; run < 2; run++) {
            error[run] = fmax(error[run], fabs(q[run][k] - q[2][k]));
            pressure[run] = fmax(pressure[run], fabs(p[run][k] - p[2][k]));
        }
    }
    print_message("# angle off by %g, %g rad, pressure by %g, %g bar at 1 and 0.25 ms\n", error[0],
                  error[1], pressure[0] / BAR, pressure[1] / BAR);
    assert_true(error[0] < 1e-3);
    assert_true(error[1] < error[0] / 4.0);
    assert_true(pressure[0] < 2.0 * BAR && pressure[1] < pressure[0] / 4.0);
}

/* A cylinder on the other side of its joint pulls where the first pushes: a positive voltage turns
 * either joint positively, by the same angle where the areas are equal. */
TEST(a_positive_voltage_turns_the_joint_positively)
{
    struct robot_hydraulic c = hyq_cylinder();
    struct toy_plant rig;
    double q[2];

    c.A2 = c.A1;
    for (int side = 0; side < 2; side++) {
        c.offset = side ? -0.5 * M_PI : 0.5 * M_PI;
        assert_true(hydraulic_direction(&c, -0.85, 0.85) == (side ? -1.0 : 1.0));
        oil_rig_begin(&rig, c, constant_supply());
        oil_rig_start(&rig, 0.0);
        rig.motor->voltage_v = 3.0;
        step_oil(&rig, 20);
        q[side] = rig.state[0];
        assert_ok(plant_sample(rig.plant));
        assert_near(plant_sensors(rig.plant)->motor[0].voltage_v, 3.0, 1e-12);
        assert_true(plant_sensors(rig.plant)->motor[0].valve_opening * (side ? -1.0 : 1.0) > 0.25);
        arena_fini(&rig.arena);
    }
    assert_true(q[0] > 0.05);
    assert_near(q[1] / q[0], 1.0, 0.05); /* the levers turn the other way */
}

/* The constant by which position loops foresee a valve's voltage: without load the joint turns by
 * it, slower out than in by the ratio that the areas give. */
TEST(the_speed_constant_is_that_of_the_middle)
{
    const struct robot_hydraulic c = hyq_cylinder();
    const struct robot_hydraulic_supply s = constant_supply();
    const double constant = hydraulic_speed_constant(&c, &s, -0.85, 0.85);
    struct toy_plant rig;
    double mean = 0.0;

    for (int way = -1; way <= 1; way += 2) {
        oil_rig_begin(&rig, c, s);
        oil_rig_start(&rig, -0.1 * way);
        rig.motor->voltage_v = way;
        while (rig.state[0] * way < 0.0) {
            step_oil(&rig, 1);
        }
        mean += 0.5 * fabs(rig.state[1]);
        arena_fini(&rig.arena);
    }
    assert_near(mean * constant, 1.0, 2e-2);
}

/* Settled pressures carry the load between supply and return, or say that they cannot. */
TEST(loads_at_rest_are_carried_between_supply_and_return)
{
    const struct robot_hydraulic c = hyq_cylinder();
    const struct robot_hydraulic_supply s = {.pressure = 160.0 * BAR, .back = 2.0 * BAR};
    double y[HYDRAULIC_STATE] = {0.0, 0.0, 1.0, 2.0}, lever;

    hydraulic_length(&c, 0.3, &lever);
    for (double force = -1920.0; force < 3190.0; force += 10.0) {
        assert_true(hydraulic_rest_loaded(&c, &s, 0.3, force * lever, y));
        assert_near(y[HYDRAULIC_P1] * c.A1 - y[HYDRAULIC_P2] * c.A2, force, 1e-9);
        for (int side = HYDRAULIC_P1; side <= HYDRAULIC_P2; side++) {
            assert_true(y[side] >= s.back - 1e-6 && y[side] <= s.pressure + 1e-6);
        }
    }
    assert_false(hydraulic_rest_loaded(&c, &s, 0.3, 3200.0 * lever, y));
    assert_false(hydraulic_rest_loaded(&c, &s, 0.3, -1930.0 * lever, y));
}
