/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What breaks of hydraulic joints and of their supply, against closed forms: an accumulator that
 * empties, leaks, a relief valve that stays shut, valves that stick, shift or lose their current;
 * and an empty supply, whose pressure a drop of oil moves, against dopri5.
 */

#include "model/hydraulics/supply.h"
#include "tests/physics/near.h"
#include "tests/physics/oil_rig.h"

/* Volume of the gas at a pressure. */
static double gas_at(const struct robot_hydraulic_supply *s, double pressure)
{
    return s->accumulator * pow(s->precharge / pressure, 1.0 / 1.4);
}

/* Without the pump an accumulator that is drawn from evenly falls by p V^1.4, gives up the work of
 * its gas, and is empty when the oil is out. */
TEST(an_accumulator_empties_by_its_gas)
{
    const struct robot_hydraulic_supply s = real_supply();
    const struct hydraulic_supply_condition off = {.pump_loss = 1.0};
    const double Q = 2e-5, oil = gas_at(&s, s.precharge) - gas_at(&s, s.pressure);
    struct hydraulic_supply_power work = {0};
    double p = s.pressure, given = 0.0;
    int ms = 0;

    while (!hydraulic_supply_is_empty(&s, p)) {
        const double start = p;

        assert_near(
            p / (s.pressure *
                 pow(gas_at(&s, s.pressure) / (gas_at(&s, s.pressure) + 1e-3 * ms * Q), 1.4)),
            1.0, 1e-4);
        p = hydraulic_supply_advance(&s, &off, p, p, 1e-3 * Q, 1e-3, &work);
        given += 0.5 * (start + p) * 1e-3 * Q;
        ms++;
    }
    assert_near(1e-3 * ms * Q / oil, 1.0, 1e-3);
    assert_near(given / (hydraulic_supply_energy(&s, s.pressure) -
                         hydraulic_supply_energy(&s, s.precharge)),
                1.0, 1e-3);
    assert_true(work.pump == 0.0 && work.relief == 0.0 && work.leak == 0.0);

    /* a pump that gives half fills half as fast */
    for (int half = 0; half < 2; half++) {
        const struct hydraulic_supply_condition weak = {.pump_loss = 0.5 * half};

        assert_near(hydraulic_supply_derive(&s, &weak, 120.0 * BAR, 0.0, NULL),
                    1.4 * 120.0 * BAR / gas_at(&s, 120.0 * BAR) * s.pump * (half ? 0.5 : 1.0), 1.0);
    }
}

/* Past a held piston under full pressure a leak of conductance c takes the gas from V0 to
 * V^2.4 = V0^2.4 + 2.4 c p0 V0^1.4 t. */
TEST(a_leak_past_the_piston_empties_the_accumulator)
{
    struct robot_hydraulic_supply s = real_supply();
    const double c = 1e-6 / s.pressure, t = 1.0;
    struct toy_plant rig;
    double V;

    s.back = 0.0;
    oil_rig_begin(&rig, hyq_cylinder(), s);
    oil_rig_start(&rig, 0.0);
    plant_clamp(rig.plant, true);
    plant_command(rig.plant)->oil.pump_loss = 1.0;
    rig.motor->voltage_v = 10.0;
    rig.motor->piston_leak = c;
    step_oil(&rig, 100);
    V = gas_at(&s, rig.state[AT_SUPPLY]);
    V = pow(pow(V, 2.4) + 2.4 * c * rig.state[AT_SUPPLY] * pow(V, 1.4) * t, 1.0 / 2.4);
    step_oil(&rig, 1000);
    /* the chambers' oil expands by a thousandth of what has leaked */
    assert_near(rig.state[AT_SUPPLY] / (s.precharge * pow(s.accumulator / V, 1.4)), 1.0, 3e-5);
    assert_near((rig.state[AT_P1] - rig.state[AT_P2]) / rig.state[AT_SUPPLY], 1.0, 1e-3);
    arena_fini(&rig.arena);
}

/* Behind a closed valve the chambers of a held piston meet by beta c (1/V1 + 1/V2). */
TEST(a_leak_makes_both_chambers_even)
{
    const struct robot_hydraulic cylinder = hyq_cylinder();
    const double c = 1e-13, q = 0.2;
    struct toy_plant rig;
    double lever, x, rate, first;

    oil_rig_begin(&rig, cylinder, constant_supply());
    oil_rig_start(&rig, q);
    plant_clamp(rig.plant, true);
    x = hydraulic_length(&cylinder, q, &lever) - cylinder.closed;
    rate = cylinder.beta * c *
           (1.0 / (cylinder.dead + cylinder.A1 * x) +
            1.0 / (cylinder.dead + cylinder.A2 * (cylinder.stroke - x)));
    first = rig.state[AT_P2] - rig.state[AT_P1];
    assert_true(first > 30.0 * BAR);
    rig.motor->piston_leak = c;
    step_oil(&rig, 20);
    assert_near((rig.state[AT_P2] - rig.state[AT_P1]) / (first * exp(-0.02 * rate)), 1.0, 1e-4);
    arena_fini(&rig.arena);
}

/* A leak of the supply holds it where it takes all that the pump gives. */
TEST(a_leaking_supply_comes_to_what_the_pump_can_hold)
{
    const struct robot_hydraulic_supply s = real_supply();
    const struct hydraulic_supply_condition above = {.leak = s.pump / (100.0 * BAR)};
    const struct hydraulic_supply_condition below = {.leak = s.pump / (40.0 * BAR)};
    struct hydraulic_supply_power work = {0};
    double p = s.pressure;

    for (int ms = 0; ms < 60000; ms++) {
        p = hydraulic_supply_advance(&s, &above, p, p, 0.0, 1e-3, &work);
    }
    assert_near(p / (s.back + 100.0 * BAR), 1.0, 1e-6);
    assert_near((work.pump - work.relief - work.leak) /
                    (hydraulic_supply_energy(&s, p) - hydraulic_supply_energy(&s, s.pressure)),
                1.0, 1e-3);

    /* an empty accumulator stiffens it: by dopri5's own equations it comes to rest as well */
    p = s.pressure;
    for (int part = 0; part < 20000000 && p > s.back + 40.1 * BAR; part++) {
        p += 1e-6 * hydraulic_supply_derive(&s, &below, p, 0.0, NULL);
    }
    assert_near(p / (s.back + 40.0 * BAR), 1.0, 3e-3);
}

/* With the relief valve shut the pump presses the gas, p = p0 (V0 / (V0 - Q t))^1.4, until it
 * stalls at 1.5 times the relief valve's pressure. */
TEST(a_relief_valve_that_stays_shut_lets_the_pressure_rise)
{
    const struct robot_hydraulic_supply s = real_supply();
    const struct hydraulic_supply_condition shut = {.relief_shut = true};
    const double V0 = gas_at(&s, s.pressure);
    struct hydraulic_supply_power work = {0};
    double p = s.pressure;

    for (int ms = 0; ms < 500; ms++) {
        p = hydraulic_supply_advance(&s, &shut, p, p, 0.0, 1e-3, &work);
    }
    assert_near(p / (s.pressure * pow(V0 / (V0 - 0.5 * s.pump), 1.4)), 1.0, 1e-3);
    for (int ms = 0; ms < 20000; ms++) {
        p = hydraulic_supply_advance(&s, &shut, p, p, 0.0, 1e-3, &work);
    }
    assert_near(p / (1.5 * s.relief), 1.0, 1e-3);
    assert_true(work.relief == 0.0);
}

/* A spool stays where it stuck; without current it goes to the middle; one whose middle is off
 * stands as under a voltage. */
TEST(valves_stick_shift_and_close)
{
    double q[2];
    struct toy_plant rig;

    oil_rig_begin(&rig, hyq_cylinder(), constant_supply());
    oil_rig_start(&rig, -0.3);
    rig.motor->voltage_v = 2.0;
    step_oil(&rig, 30);
    assert_near(rig.state[AT_CYLINDER], 0.2, 1e-6);
    rig.motor->condition = DRIVE_VALVE_STUCK;
    rig.motor->voltage_v = -10.0;
    step_oil(&rig, 20);
    assert_near(rig.state[AT_CYLINDER], 0.2, 1e-6);
    rig.motor->condition = DRIVE_VALVE_OFF;
    step_oil(&rig, 30);
    assert_near(rig.state[AT_CYLINDER], 0.0, 1e-6);
    rig.motor->condition = 0;
    step_oil(&rig, 30);
    assert_near(rig.state[AT_CYLINDER], -1.0, 1e-6);
    arena_fini(&rig.arena);

    for (int shifted = 0; shifted < 2; shifted++) {
        oil_rig_begin(&rig, hyq_cylinder(), constant_supply());
        oil_rig_start(&rig, -0.3);
        rig.motor->voltage_v = shifted ? 0.5 : 1.5;
        rig.motor->valve_shift = shifted ? 0.1 : 0.0;
        step_oil(&rig, 100);
        q[shifted] = rig.state[0];
        arena_fini(&rig.arena);
    }
    assert_true(q[0] > -0.2);
    assert_near(q[1], q[0], 1e-12);
}

/* Speeds and pressures where the pump stops at 50 ms with valves open, until nothing is left. */
static void run_dry(struct toy_plant *rig, double *q, double *supply, size_t per_ms)
{
    oil_rig_start(rig, -0.6);
    for (int k = 0; k < 500; k++) {
        plant_command(rig->plant)->oil.pump_loss = k < 50 ? 0.0 : 1.0;
        rig->motor->voltage_v = k / 100 % 2 ? -3.0 : 3.0;
        step_oil(rig, per_ms);
        q[k] = rig->state[0];
        supply[k] = rig->state[AT_SUPPLY];
        assert_true(supply[k] >= rig->toy.robot.hydraulic_supply.back - 1.0);
    }
}

TEST(an_empty_supply_agrees_with_dopri5)
{
    static double q[3][500], supply[3][500];
    static const size_t parts[3] = {1, 4, 1};
    double angle[2] = {0.0}, pressure[2] = {0.0};
    struct toy_plant rig;

    for (int run = 0; run < 3; run++) {
        struct robot_hydraulic_supply s = real_supply();
        struct plant_energy energy;

        s.accumulator = 2e-5;
        s.line = 2e-6;
        oil_rig_begin(&rig, real_cylinder(), s);
        rig.config.integrator = run == 2 ? PLANT_DOPRI5 : PLANT_IMPLICIT;
        rig.config.substep_ns = MS / (int64_t)parts[run];
        run_dry(&rig, q[run], supply[run], parts[run]);
        assert_ok(plant_energy(rig.plant, &energy));
        print_message("# run %d: in %g J, balance %g, supply at the end %g bar\n", run,
                      energy.hydraulic_in, energy.balance, rig.state[AT_SUPPLY] / BAR);
        assert_true(fabs(energy.balance) < (run == 2 ? 1e-5 : run == 1 ? 1e-2 : 1.0));
        arena_fini(&rig.arena);
    }
    for (int k = 0; k < 500; k++) {
        for (int run = 0; run < 2; run++) {
            angle[run] = fmax(angle[run], fabs(q[run][k] - q[2][k]));
            pressure[run] = fmax(pressure[run], fabs(supply[run][k] - supply[2][k]));
        }
    }
    print_message("# angle off by %g, %g rad, supply by %g, %g bar at 1 and 0.25 ms\n", angle[0],
                  angle[1], pressure[0] / BAR, pressure[1] / BAR);
    assert_true(supply[2][499] < 10.0 * BAR);
    assert_true(angle[0] < 5e-3);
    assert_true(angle[1] < 0.5 * angle[0]);
    assert_true(pressure[0] < 25.0 * BAR && pressure[1] < 0.5 * pressure[0]);
}

/* Of a pump, a line and an accumulator twice as large, two links get what one does of the others,
 * also when nothing is left. */
TEST(two_links_on_twice_the_supply_move_as_one)
{
    enum { SUPPLY_OF_TWO = 4 + 2 * HYDRAULIC_STATE };
    static double q[500], supply[500];
    struct robot_hydraulic_supply s = real_supply();
    struct toy_plant rig;

    s.accumulator = 2e-5;
    s.line = 2e-6;
    oil_rig_begin(&rig, real_cylinder(), s);
    run_dry(&rig, q, supply, 1);
    arena_fini(&rig.arena);

    s.pump *= 2.0;
    s.accumulator *= 2.0;
    s.line *= 2.0;
    s.relief_flow *= 2.0;
    oil_rig_begin(&rig, real_cylinder(), s);

    /* Adds a second link like the first beside it */
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.3, 0.0, 0.0, 0.3, 0.0, 0.3};
    const size_t second = toy_add(&rig.toy, 0, JOINT_REVOLUTE, z, none, 5.0, none, I);

    rig.toy.joint[second].hydraulic = rig.toy.joint[0].hydraulic;
    rig.toy.joint[second].lower = rig.toy.joint[0].lower;
    rig.toy.joint[second].upper = rig.toy.joint[0].upper;
    toy_finish(&rig.toy);
    oil_rig_start(&rig, -0.6);
    for (int k = 0; k < 500; k++) {
        plant_command(rig.plant)->oil.pump_loss = k < 50 ? 0.0 : 1.0;
        rig.motor[0].voltage_v = rig.motor[1].voltage_v = k / 100 % 2 ? -3.0 : 3.0;
        step_oil(&rig, 1);
        assert_near(rig.state[0], q[k], 1e-6);
        assert_near(rig.state[1], q[k], 1e-6);
        assert_near(rig.state[SUPPLY_OF_TWO] / BAR, supply[k] / BAR, 1e-3);
    }
    arena_fini(&rig.arena);
}
