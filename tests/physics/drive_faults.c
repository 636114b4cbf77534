/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Broken drives and a weak supply against their closed solutions, with each integrator. The links
 * are clamped, so that a drive is alone with its spring, or fall in the air, for the balance.
 */
#include "tests/physics/plant_rig.h"

enum { HIP = 0, SUBSTEP_NS = 100000, STEPS_A_MS = 10 };

static const enum plant_integrator integrators[] = {PLANT_RK4, PLANT_IMPLICIT, PLANT_DOPRI5};
enum { INTEGRATORS = sizeof integrators / sizeof integrators[0] };

static void assert_close(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) {
        fail_msg("found %.12g, expected %.12g within %g", value, expected, tolerance);
    }
}

static const struct motor_sense *hip(const struct plant_rig *rig)
{
    return &plant_sensors(rig->plant)->motor[HIP];
}

/* Of SUBSTEP_NS each */
static void run(struct plant_rig *rig, int milliseconds)
{
    assert_ok(plant_step(rig->plant, (size_t)(milliseconds * STEPS_A_MS)));
    assert_ok(plant_sample(rig->plant));
}

/* Starts a rig with the hip's bridge on at this voltage. Returns the hip's command. */
static struct motor_command *start(struct plant_rig *rig, enum plant_integrator integrator,
                                   double voltage_v)
{
    struct motor_command *motor;

    plant_rig_walker_with(rig, false, integrator, SUBSTEP_NS, 0.0);
    plant_clamp(rig->plant, true);
    plant_rig_reset(rig, 1.0);
    motor = &plant_command(rig->plant)->motor[HIP];
    motor->bridge_on = true;
    motor->voltage_v = voltage_v;
    return motor;
}

/* The implicit integrator is of first order here. With h R/L = 0.2 a step of rk4 errs by 0.2^5/120
 * of what the winding's current has still to go. */
static double tolerance(enum plant_integrator integrator, double loose)
{
    return integrator == PLANT_IMPLICIT ? loose : integrator == PLANT_RK4 ? 1e-4 : 1e-6;
}

TEST(open_phase_carries_no_current_whatever_the_bridge_does)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 10.0);
        double qm;

        run(&rig, 5);
        assert_true(hip(&rig)->current_a > 1.0);
        motor->condition = DRIVE_OPEN_PHASE;
        run(&rig, 1);
        assert_true(hip(&rig)->current_a == 0.0 && hip(&rig)->voltage_v == 0.0);
        run(&rig, 4000);
        qm = hip(&rig)->qm;
        assert_true(hip(&rig)->current_a == 0.0);
        assert_close(qm, hip(&rig)->q, 2e-3); /* nothing holds the spring */
        motor->condition = 0;
        run(&rig, 5);
        assert_true(hip(&rig)->current_a > 1.0);
    }
}

/* J qm'' = -Dm qm' when the spring is gone and no current flows */
TEST(rotor_with_a_broken_spring_coasts_to_rest)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 10.0);
        const struct robot_sea sea = rig.toy.joint[HIP].sea;
        double speed;

        motor->condition = DRIVE_SPRING_BREAK;
        run(&rig, 100);
        speed = hip(&rig)->qmd;
        assert_true(speed > 2.0);
        assert_true(hip(&rig)->torque_nm == 0.0);
        motor->bridge_on = false;
        run(&rig, 200);
        assert_close(hip(&rig)->qmd, speed * exp(-sea.Dm / sea.J * 0.2),
                     tolerance(integrators[i], 1e-4));
    }
}

/* L I' = -R I - Kw qm', J qm'' = Kt I - Dm qm': two eigenvalues, the slow one is left after L/R */
TEST(shorted_winding_brakes_a_loose_rotor)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 10.0);
        const struct robot_sea sea = rig.toy.joint[HIP].sea;
        double a = sea.R / sea.L, b = sea.Dm / sea.J;
        double mean = 0.5 * (a + b), product = a * b + sea.Kt * sea.Kw / (sea.J * sea.L);
        double slow = mean - sqrt(mean * mean - product);
        double speed;

        motor->condition = DRIVE_SPRING_BREAK;
        run(&rig, 100);
        motor->condition |= DRIVE_SHORT;
        run(&rig, 10); /* twenty times L/R */
        speed = hip(&rig)->qmd;
        assert_true(hip(&rig)->current_a < 0.0); /* it generates */
        run(&rig, 5);
        assert_close(hip(&rig)->qmd / speed, exp(-slow * 0.005), tolerance(integrators[i], 1e-2));
    }
}

/* Shorted, the bridge may be off or on: the same */
TEST(short_does_not_ask_the_bridge)
{
    struct plant_rig rig;
    struct motor_command *motor;
    double speed[2];

    for (int on = 0; on < 2; on++) {
        motor = start(&rig, PLANT_RK4, 10.0);
        run(&rig, 5);
        motor->condition = DRIVE_SHORT;
        motor->bridge_on = on;
        run(&rig, 3);
        speed[on] = hip(&rig)->qmd;
        plant_rig_fini(&rig);
    }
    assert_true(speed[0] == speed[1]);
}

/* qm' = 0, so L I' = V - R I */
TEST(jammed_rotor_stays_to_the_last_bit_and_draws_the_stall_current)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 10.0);
        const struct robot_sea sea = rig.toy.joint[HIP].sea;
        double qm;

        run(&rig, 5);
        motor->voltage_v = 0.0;
        motor->condition = DRIVE_JAM;
        run(&rig, 20);
        qm = hip(&rig)->qm;
        assert_close(hip(&rig)->current_a, 0.0, 1e-9);
        motor->voltage_v = 6.64;
        run(&rig, 1);
        assert_close(hip(&rig)->current_a, 10.0 * (1.0 - exp(-sea.R / sea.L * 1e-3)),
                     tolerance(integrators[i], 0.3));
        run(&rig, 20);
        assert_close(hip(&rig)->current_a, 10.0, 1e-6);
        assert_true(hip(&rig)->qm == qm);
        assert_close(hip(&rig)->qmd, 0.0, 1e-20);
        motor->condition = 0;
        run(&rig, 20);
        assert_true(hip(&rig)->qm != qm);
    }
}

/* 2 rad/s for 20 ms, against a spring that is wound up by a voltage; then as if it was jammed */
TEST(led_rotor_goes_its_way_whatever_loads_it)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 10.0);
        double qm;

        run(&rig, 5);
        qm = hip(&rig)->qm;
        motor->condition = DRIVE_IMPOSED;
        motor->rotor_rad_s = 2.0;
        for (int k = 1; k <= 20; k++) {
            run(&rig, 1);
            assert_close(hip(&rig)->qm, qm + 2e-3 * k, 1e-13);
            assert_true(hip(&rig)->qmd == 2.0);
        }

        /* A jam is stronger; no number is no speed; at the end it is free, and at rest at first */
        qm = hip(&rig)->qm;
        motor->condition = DRIVE_IMPOSED | DRIVE_JAM;
        run(&rig, 5);
        motor->condition = DRIVE_IMPOSED;
        motor->rotor_rad_s = NAN;
        run(&rig, 5);
        assert_true(hip(&rig)->qm == qm);
        motor->condition = 0;
        run(&rig, 1);
        assert_true(hip(&rig)->qm != qm && fabs(hip(&rig)->qm - qm) < 1e-3);
    }
}

TEST(energy_that_breaks_away_counts_as_friction)
{
    static const unsigned breaks[] = {DRIVE_JAM, DRIVE_SPRING_BREAK, DRIVE_OPEN_PHASE, DRIVE_SHORT,
                                      DRIVE_JAM | DRIVE_SPRING_BREAK};

    for (size_t k = 0; k < sizeof breaks / sizeof breaks[0]; k++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct plant_energy energy;
        struct plant_command *command;

        plant_rig_walker_with(&rig, false, PLANT_RK4, SUBSTEP_NS / 5, 0.0);
        plant_rig_reset(&rig, 1.0);
        command = plant_command(rig.plant);
        plant_rig_random_voltages(&rig, 15.0);
        run(&rig, 250); /* 50 ms of the short substeps */
        for (size_t j = 0; j < 4; j++) {
            command->motor[j].condition = breaks[k];
        }
        run(&rig, 250);
        for (size_t j = 0; j < 4; j++) {
            command->motor[j].condition = 0;
        }
        run(&rig, 250);
        assert_ok(plant_energy(rig.plant, &energy));
        assert_true(energy.electrical_in > 1.0);
        assert_close(energy.balance, 0.0, 1e-6);
    }
}

CLOSED_BENCH(plant_rig, struct plant_rig, plant_rig_fini)

TEST_ON(condition_ends_with_a_reset, plant_rig, rig)
{
    struct motor_command *motor = start(rig, PLANT_RK4, 10.0);
    uint64_t sound;

    run(rig, 5);
    sound = plant_hash(rig->plant);
    motor->condition = DRIVE_JAM | DRIVE_SPRING_BREAK;
    run(rig, 5);
    motor->condition = 0;
    plant_rig_reset(rig, 1.0);
    run(rig, 5);
    assert_true(plant_hash(rig->plant) == sound);
}

/* ---- the supply ---- */

static struct plant *make_weak(struct plant_rig *rig, double ohm)
{
    struct plant_config config = {.robot = &rig->toy.robot,
                                  .dynamics = &rig->dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = SUBSTEP_NS,
                                  .supply_v = 48.0,
                                  .supply_ohm = ohm};
    struct plant *plant;
    struct error error;

    assert_ok(plant_create(&config, &rig->arena, &plant, &error));
    plant_clamp(plant, true);
    return plant;
}

/* All drives jammed at V: P = sum of V^2/R, and the supply solves U = 48 - r P/U. */
TEST_ON(supply_sags_under_the_power_that_the_bridges_take, plant_rig, rig)
{
    static const double joint[8] = {0}, position[3] = {0}, quaternion[4] = {1.0, 0, 0, 0};
    struct plant *plant;
    double power = 0.0, supply;

    plant_rig_walker_with(rig, false, PLANT_RK4, SUBSTEP_NS, 0.0);
    plant = make_weak(rig, 0.5);
    assert_ok(plant_reset(plant, position, quaternion, joint));
    assert_true(plant_sensors(plant)->supply_v == 48.0);
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        plant_command(plant)->motor[j] =
            (struct motor_command){.bridge_on = true, .voltage_v = 6.64, .condition = DRIVE_JAM};
        power += rig->toy.joint[j].sea.present ? 6.64 * 10.0 : 0.0;
    }
    assert_ok(plant_step(plant, 300));
    assert_ok(plant_sample(plant));
    supply = plant_sensors(plant)->supply_v;
    assert_true(supply < 44.0 && supply > 24.0);
    assert_close(supply, 48.0 - 0.5 * power / supply, 1e-6);
}

TEST_ON(terminal_voltage_is_clipped_to_the_sagging_source, plant_rig, rig)
{
    start(rig, PLANT_RK4, 40.0);
    plant_command(rig->plant)->supply_sag_v = 30.0;
    run(rig, 1);
    assert_true(plant_sensors(rig->plant)->supply_v == 18.0);
    assert_true(hip(rig)->voltage_v == 18.0);
    plant_command(rig->plant)->supply_sag_v = 0.0;
    run(rig, 1);
    assert_true(hip(rig)->voltage_v == 40.0);
}

/* Rotors at 5 rad/s have 20.5 V of back-EMF; bridges that keep 10 V across them feed the source. */
TEST_ON(braking_drives_lift_the_supply, plant_rig, rig)
{
    static const double joint[8] = {0}, position[3] = {0}, quaternion[4] = {1.0, 0, 0, 0};
    struct plant *plant;
    double power = 0.0, supply, *state;
    size_t count, drives;

    plant_rig_walker_with(rig, false, PLANT_RK4, SUBSTEP_NS, 0.0);
    plant = make_weak(rig, 0.5);
    assert_ok(plant_reset(plant, position, quaternion, joint));
    state = plant_state(plant, &count);
    drives = rig->toy.robot.nq + rig->toy.robot.nv;
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        plant_command(plant)->motor[j] =
            (struct motor_command){.bridge_on = true, .voltage_v = 10.0};
        if (rig->toy.joint[j].sea.present) {
            state[drives + 1] = 5.0;
            state[drives + 2] = (10.0 - 4.1 * 5.0) / 0.664;
            drives += 3;
        }
    }
    assert_ok(plant_step(plant, 1));
    assert_ok(plant_sample(plant));
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        power += 10.0 * plant_sensors(plant)->motor[j].current_a;
    }
    supply = plant_sensors(plant)->supply_v;
    assert_true(power < -900.0);
    assert_true(supply > 55.0);
    assert_close(supply, 48.0 - 0.5 * power / supply, 1e-9);
}

/* A loose rotor at w0 with V across it: while it slows down to V / Kw it gives back
 * V (integral of I) = V J (w0 - w) / Kt, less what friction takes, Dm V (angle turned) / Kt, and
 * the balance closes. */
TEST(a_braking_rotor_gives_energy_back)
{
    for (int i = 0; i < INTEGRATORS; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct motor_command *motor = start(&rig, integrators[i], 4.1);
        size_t drive = rig.toy.robot.nq + rig.toy.robot.nv;
        const struct robot_sea *sea = &rig.toy.joint[HIP].sea;
        struct plant_energy energy;
        double from, expected;

        motor->condition = DRIVE_SPRING_BREAK;
        rig.state[drive + DRIVE_MOTOR_SPEED] = 10.0;
        from = rig.state[drive + DRIVE_MOTOR_POSITION];
        assert_ok(plant_restart_energy(rig.plant));
        run(&rig, 20);
        assert_ok(plant_energy(rig.plant, &energy));
        expected = -4.1 / sea->Kt *
                   (sea->J * (10.0 - rig.state[drive + DRIVE_MOTOR_SPEED]) -
                    sea->Dm * (rig.state[drive + DRIVE_MOTOR_POSITION] - from));
        print_message("# integrator %d: %.6f J given, %.6f J by momentum, balance %.1e J\n", i,
                      energy.electrical_in, expected, energy.balance);
        assert_true(energy.electrical_in < -1.0);
        assert_close(energy.electrical_in, expected, 1e-5);
        assert_close(energy.balance, 0.0, 1e-4);
        assert_true(energy.joule_heat > 1.0 && energy.motor_friction > 0.0);
    }
}
