/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The supply that rises (model/drives/supply.h): closed forms of the bus alone, and a rotor that is
 * braked into it.
 */

#include "tests/physics/near.h"
#include "tests/unit/arena_fixture.h"
#include "tests/physics/toy_plant.h"

enum { MS = 1000000 };

static const struct supply_bus capacitor = {.capacitance_f = 0.01};
static const struct supply_bus chopper = {
    .capacitance_f = 0.01, .on_v = 56.0, .off_v = 54.0, .brake_ohm = 2.0};

/* ---- the bus alone ---- */

/* From below the source charges it through its resistance; from above the diode blocks. */
TEST(a_source_charges_and_does_not_discharge)
{
    double low[SUPPLY_STATE] = {30.0, 0.0}, high[SUPPLY_STATE] = {50.0, 0.0};
    double work[3] = {0.0}, none[3] = {0.0};

    for (int k = 1; k <= 10; k++) {
        supply_advance(&capacitor, 48.0, 0.5, 0.0, 1e-3, low, work);
        supply_advance(&capacitor, 48.0, 0.5, 0.0, 1e-3, high, none);
        assert_near(low[SUPPLY_VOLTAGE], 48.0 - 18.0 * exp(-1e-3 * k / 0.005), 1e-3);
        assert_true(high[SUPPLY_VOLTAGE] == 50.0);
    }
    assert_true(none[0] == 0.0 && none[1] == 0.0 && none[2] == 0.0);
    assert_near(work[0] - work[1], 0.5 * 0.01 * (low[SUPPLY_VOLTAGE] * low[SUPPLY_VOLTAGE] - 900.0),
                1e-11);
}

/* A battery takes energy back: the bus falls to it as it rises to it. */
TEST(a_battery_takes_back_what_a_source_does_not)
{
    const struct supply_bus bus = {.capacitance_f = 0.01, .returns = true};
    double state[SUPPLY_STATE] = {50.0, 0.0}, work[3] = {0.0};

    for (int k = 1; k <= 10; k++) {
        supply_advance(&bus, 48.0, 0.5, 0.0, 1e-3, state, work);
        assert_near(state[SUPPLY_VOLTAGE], 48.0 + 2.0 * exp(-1e-3 * k / 0.005), 1e-4);
    }
    assert_true(work[0] < 0.0 && work[1] > 0.0);
    assert_near(work[0] - work[1],
                0.5 * 0.01 * (state[SUPPLY_VOLTAGE] * state[SUPPLY_VOLTAGE] - 2500.0), 1e-11);
}

/* Energy that comes back stays in C V^2/2 to the last bit but a few. */
TEST(energy_that_comes_back_lifts_the_bus)
{
    double state[SUPPLY_STATE] = {48.0, 0.0}, work[3] = {0.0};

    supply_advance(&capacitor, 48.0, 0.5, -3.0, 1e-3, state, work);
    assert_near(state[SUPPLY_VOLTAGE], sqrt(48.0 * 48.0 + 2.0 * 3.0 / 0.01), 1e-12);
}

/* The chopper burns exponentially, from on down to off, and no further. */
TEST(the_chopper_burns_down_to_its_threshold)
{
    double state[SUPPLY_STATE] = {56.0, 0.0}, work[3] = {0.0};

    supply_switch_chopper(&chopper, state);
    assert_true(state[SUPPLY_CHOPPING] == 1.0);
    supply_advance(&chopper, 48.0, 0.5, 0.0, 5e-4, state, work);
    assert_near(state[SUPPLY_VOLTAGE], 56.0 * exp(-5e-4 / 0.02), 1e-6);
    for (int k = 0; k < 10; k++) {
        supply_advance(&chopper, 48.0, 0.5, 0.0, 1e-3, state, work);
    }
    assert_true(state[SUPPLY_CHOPPING] == 0.0);
    assert_true(state[SUPPLY_VOLTAGE] <= 54.0 && state[SUPPLY_VOLTAGE] > 53.8);
    assert_near(work[2], 0.5 * 0.01 * (56.0 * 56.0 - state[SUPPLY_VOLTAGE] * state[SUPPLY_VOLTAGE]),
                1e-11);
}

/* More than the source can give: the bus is down, and finite. */
TEST(a_bus_that_is_asked_too_much_stays_finite)
{
    double state[SUPPLY_STATE] = {48.0, 0.0}, work[3] = {0.0};

    for (int k = 0; k < 100; k++) {
        supply_advance(&capacitor, 48.0, 5.0, 10.0, 1e-3, state, work);
        assert_true(state[SUPPLY_VOLTAGE] >= SUPPLY_LEAST_V * 0.999);
    }
    assert_near(work[0] - work[1] - 100 * 10.0,
                0.5 * 0.01 * (state[SUPPLY_VOLTAGE] * state[SUPPLY_VOLTAGE] - 48.0 * 48.0), 1e-8);
}

/* ---- a rotor that is braked into it ---- */

struct brake_run {
    double most, end; /* voltage of the bus */
    struct plant_energy energy;
};

/* A flywheel of the rotor alone at 10 rad/s, its bridge at a voltage below what it makes. */
static void brake_rotor(enum plant_integrator integrator, const struct supply_bus *bus,
                        struct brake_run *run)
{
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.02, 0.0, 0.0, 0.02, 0.0, 0.02};
    const bool implicit = integrator == PLANT_IMPLICIT;
    static struct toy_plant p;
    struct robot_sea sea = toy_drive(0.0);
    double *state;

    toy_plant_begin(&p, integrator, implicit ? MS : MS / 50);
    p.config.rtol = p.config.atol = 1e-9;
    p.config.supply_ohm = 0.1;
    p.config.bus = *bus;
    toy_begin(&p.toy, false, 1.0, none, I);
    sea.Ds = sea.Dm = 0.0;
    p.toy.joint[toy_add(&p.toy, 0, JOINT_REVOLUTE, z, none, 2.0, none, I)].sea = sea;
    toy_plant_open(&p);
    assert_ok(plant_reset(p.plant, NULL, NULL, (const double[1]){0.0}));
    plant_clamp(p.plant, true);
    state = p.state;
    state[2 + DRIVE_MOTOR_SPEED] = 10.0;
    assert_ok(plant_restart_energy(p.plant));
    run->most = 0.0;
    for (int k = 0; k < 300; k++) {
        /* held a little below what the rotor makes, which brakes it evenly; then it stands */
        double V = fmax(0.0, 4.1 * state[2 + DRIVE_MOTOR_SPEED] - 5.0);

        p.motor[0] = (struct motor_command){.bridge_on = true, .voltage_v = V};
        assert_ok(plant_step(p.plant, implicit ? 1 : 50));
        assert_ok(plant_sample(p.plant));
        run->end = plant_sensors(p.plant)->supply_v;
        run->most = fmax(run->most, run->end);
    }
    assert_ok(plant_energy(p.plant, &run->energy));
    arena_fini(&p.arena);
}

TEST(braking_lifts_the_bus_by_its_energy)
{
    const double kinetic = 0.5 * 0.1387 * 100.0;
    struct brake_run exact, found;

    brake_rotor(PLANT_DOPRI5, &capacitor, &exact);
    brake_rotor(PLANT_IMPLICIT, &capacitor, &found);
    print_message("# bus to %.3f V (dopri5 %.3f), joule %.3f J of %.3f, balance %.1e (%.1e)\n",
                  found.most, exact.most, found.energy.joule_heat, kinetic, found.energy.balance,
                  exact.energy.balance);
    assert_near(found.most, exact.most, 0.02);
    assert_near(exact.energy.balance, 0.0, 1e-6 * kinetic);
    assert_near(found.energy.balance, 0.0, 1e-3 * kinetic);
    /* nothing goes back to the source: what is not heat of the winding is in the bus */
    assert_near(0.5 * 0.01 * (found.end * found.end - 48.0 * 48.0),
                kinetic - found.energy.joule_heat, 1e-3 * kinetic);
    assert_true(found.most > 58.0);
}

/* The source fails while a jammed motor takes power. The bus falls to its least voltage. There the
 * missing power counts as power of the source. */
TEST(a_bus_without_source_stays_at_its_least_voltage)
{
    static const enum plant_integrator integrators[] = {PLANT_IMPLICIT, PLANT_RK4, PLANT_DOPRI5};
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.02, 0.0, 0.0, 0.02, 0.0, 0.02};

    for (size_t i = 0; i < 6; i++) {
        const bool implicit = i % 3 == 0, law = i / 3 == 1;
        struct plant_energy energy;
        struct toy_plant p;

        toy_plant_begin(&p, integrators[i % 3], implicit ? MS : MS / 50);
        p.config.rtol = p.config.atol = 1e-9;
        p.config.supply_ohm = 0.1;
        p.config.bus = (struct supply_bus){.capacitance_f = 0.001};
        toy_begin(&p.toy, false, 1.0, none, I);
        p.toy.joint[toy_add(&p.toy, 0, JOINT_REVOLUTE, z, none, 2.0, none, I)].sea =
            toy_drive(400.0);
        toy_plant_open(&p);
        assert_ok(plant_reset(p.plant, NULL, NULL, none));
        p.motor[0] = (struct motor_command){.bridge_on = true,
                                            .voltage_v = 20.0,
                                            .condition = DRIVE_JAM,
                                            .law = {.on = law, .current_a = 20.0, .limit_a = 40.0}};
        for (int k = 0; k < 200; k++) {
            if (k == 20) {
                plant_set_source(p.plant, 0.0);
            }
            assert_ok(plant_step(p.plant, implicit ? 1 : 50));
            assert_ok(plant_sample(p.plant));
            assert_true(plant_sensors(p.plant)->supply_v >= 0.9 * SUPPLY_LEAST_V);
        }
        /* One volt remains at the winding */
        assert_near(p.state[2 + DRIVE_CURRENT], SUPPLY_LEAST_V / toy_drive(400.0).R, 0.05);
        assert_ok(plant_energy(p.plant, &energy));
        /* A step may miss the balance by the energy of the bus at twice its least voltage */
        assert_near(energy.balance, 0.0, 0.5 * 0.001 * pow(2.0 * SUPPLY_LEAST_V, 2.0));
        arena_fini(&p.arena);
    }
}

TEST(a_chopper_holds_the_bus)
{
    const double kinetic = 0.5 * 0.1387 * 100.0;
    struct brake_run exact, found;

    brake_rotor(PLANT_DOPRI5, &chopper, &exact);
    brake_rotor(PLANT_IMPLICIT, &chopper, &found);
    print_message("# bus to %.3f V (dopri5 %.3f), chopper %.3f J (%.3f), balance %.1e (%.1e)\n",
                  found.most, exact.most, found.energy.chopper_heat, exact.energy.chopper_heat,
                  found.energy.balance, exact.energy.balance);
    assert_true(found.most < 56.3);
    assert_near(found.energy.chopper_heat, exact.energy.chopper_heat, 0.02 * kinetic);
    assert_near(exact.energy.balance, 0.0, 1e-6 * kinetic);
    assert_near(found.energy.balance, 0.0, 1e-3 * kinetic);
}

/* Without a bus a supply of that kind gives all back to its source, and does not rise beyond its
 * resistance: as before. */
TEST_WITH(a_bus_needs_a_source_with_a_resistance, open_arena, close_arena)
{
    static struct toy toy;
    struct dynamics dynamics;
    struct plant_config config = {.robot = &toy.robot,
                                  .dynamics = &dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = MS,
                                  .supply_v = 48.0,
                                  .bus = capacitor};
    struct plant *plant;
    struct error error;

    toy_walker(&toy);
    assert_ok(dynamics_generic(&toy.robot, &arena, &dynamics, &error));
    assert_int_equal(plant_create(&config, &arena, &plant, &error), ERROR_INPUT);
    config.supply_ohm = 0.1;
    config.bus = chopper;
    config.bus.off_v = 47.0;
    assert_int_equal(plant_create(&config, &arena, &plant, &error), ERROR_INPUT);
    config.bus.off_v = 54.0;
    assert_ok(plant_create(&config, &arena, &plant, &error));
}
