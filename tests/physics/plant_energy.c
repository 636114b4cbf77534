/* SPDX-License-Identifier: Apache-2.0 */
/* The plant's energy balance closes to integration accuracy, whatever acts; and its order is 4. */

#include "tests/physics/plant_rig.h"

/* All energy that went anywhere: what a balance is to be small against. */
static double turnover(const struct plant_energy *energy)
{
    return fabs(energy->electrical_in) + fabs(energy->pretension_work) + fabs(energy->push_work) +
           energy->joule_heat + energy->motor_friction + energy->spring_damping +
           energy->parallel_damping + energy->stop_loss + fabs(energy->contact_dissipation);
}

static struct plant_energy energy_now(struct plant_rig *rig)
{
    struct plant_energy energy;

    assert_ok(plant_energy(rig->plant, &energy));
    print_message(
        "# in %.3f J, pretension %.4f, push %.4f; joule %.3f, friction %.4f, springs %.4f, "
        "ropes %.4f, stops %.4f, contact %.4f; stored %.3f; balance %.2e (%.1e of the turnover)\n",
        energy.electrical_in, energy.pretension_work, energy.push_work, energy.joule_heat,
        energy.motor_friction, energy.spring_damping, energy.parallel_damping, energy.stop_loss,
        energy.contact_dissipation, energy.stored, energy.balance,
        fabs(energy.balance) / turnover(&energy));
    return energy;
}

static void assert_balanced(const struct plant_energy *energy, double tolerance)
{
    assert_true(fabs(energy->balance) <= tolerance * turnover(energy));
}

/* Voltages as a servo gives them: at each millisecond the next value of a slow sine. */
static void run_ticks(struct plant_rig *rig, int ticks, size_t steps)
{
    struct plant_command *command = plant_command(rig->plant);

    for (int k = 0; k < ticks; k++) {
        for (size_t j = 0; j < command->njoint; j++) {
            command->motor[j].bridge_on = true;
            command->motor[j].voltage_v = 12.0 * sin((0.012 + 7e-4 * (double)j) * k);
        }
        assert_ok(plant_step(rig->plant, steps));
    }
}

CLOSED_BENCH(plant_rig, struct plant_rig, plant_rig_fini)

TEST_ON(falling_and_swinging_robot_balances, plant_rig, rig)
{
    struct plant_energy energy;

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    run_ticks(rig, 1000, 10);
    energy = energy_now(rig);
    assert_balanced(&energy, 1e-6);
    assert_true(energy.electrical_in > 1.0 && energy.joule_heat > 1.0);
    assert_true(energy.motor_friction > 0.0 && energy.spring_damping > 0.0);
}

TEST_ON(robot_dropped_on_the_ground_balances, plant_rig, rig)
{
    struct plant_energy energy;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.55);
    run_ticks(rig, 400, 10);
    energy = energy_now(rig);
    assert_balanced(&energy, 1e-6);
    assert_true(energy.contact_dissipation > 0.1);
}

/* White noise on the windings (a time constant of 0.48 ms) is the hardest thing to account at a
 * given step; the gap is the integration's and falls with the fourth power of the step. */
TEST(gap_of_the_balance_falls_with_the_fourth_power_of_the_step)
{
    double previous = 0.0;

    for (int64_t substep_ns = 100000; substep_ns >= 25000; substep_ns /= 2) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct plant_energy energy;
        double gap;

        plant_rig_walker(&rig, false, substep_ns);
        plant_rig_reset(&rig, 1.0);
        for (int k = 0; k < 300; k++) {
            plant_rig_random_voltages(&rig, 20.0);
            assert_ok(plant_step(rig.plant, (size_t)(1000000 / substep_ns)));
        }
        energy = energy_now(&rig);
        gap = fabs(energy.balance) / turnover(&energy);
        assert_true(gap < 1e-4);
        if (previous > 0.0) {
            assert_near(log2(previous / gap), 4.0, 0.5);
        }
        previous = gap;
    }
}

/* Drawn ropes, a push and bridges that open under current, all at once. */
static struct plant_energy pull_push_and_open(enum plant_integrator integrator, int64_t substep_ns)
{
    const double force[3] = {15.0, -20.0, 30.0}, moment[3] = {1.0, 2.0, -0.5};
    struct plant_rig rig;
    struct plant_command *command;
    struct plant_energy energy;

    plant_rig_walker_with(&rig, false, integrator, substep_ns, 0.0);
    command = plant_command(rig.plant);
    command->motor[1].pretension_m = 0.02; /* adopted by the reset: no work */
    plant_rig_reset(&rig, 1.0);
    plant_set_push(rig.plant, TOY_ARM, force, moment);
    for (int k = 0; k < 500; k++) {
        for (size_t j = 0; j < command->njoint; j++) {
            command->motor[j].bridge_on = (k / 20 + (int)j) % 5 != 0;
            command->motor[j].voltage_v = 12.0 * sin(0.012 * k + (double)j);
        }
        command->motor[1].pretension_m = 0.02 * cos(0.03 * k);
        command->motor[4].pretension_m = -0.01 * sin(0.02 * k);
        assert_ok(plant_step(rig.plant, (size_t)(1000000 / substep_ns)));
    }
    energy = energy_now(&rig);
    assert_true(fabs(energy.pretension_work) > 0.01 && fabs(energy.push_work) > 1.0);
    assert_true(energy.parallel_damping > 0.0);
    plant_rig_fini(&rig);
    return energy;
}

/* The energy that goes through the ropes is the same whatever integrates; the implicit one closes
 * the balance with its order, 2. */
TEST(pretension_push_and_opening_bridges_balance)
{
    struct plant_energy rk4 = pull_push_and_open(PLANT_RK4, 100000);
    struct plant_energy dopri5 = pull_push_and_open(PLANT_DOPRI5, 1000000);
    struct plant_energy coarse = pull_push_and_open(PLANT_IMPLICIT, 500000);
    struct plant_energy fine = pull_push_and_open(PLANT_IMPLICIT, 250000);

    assert_balanced(&rk4, 1e-6);
    assert_balanced(&dopri5, 1e-9);
    assert_balanced(&coarse, 2e-5);
    assert_near(coarse.balance / fine.balance, 4.0, 0.3);
    assert_near(dopri5.pretension_work, rk4.pretension_work, 1e-4);
    assert_near(coarse.pretension_work, rk4.pretension_work, 1e-4);
}

TEST_ON(opening_bridge_turns_its_magnetic_energy_to_heat, plant_rig, rig)
{
    struct plant_command *command;
    struct plant_energy before, after;
    double magnetic = 0.0;

    plant_rig_walker(rig, false, 1);
    command = plant_command(rig->plant);
    plant_rig_reset(rig, 1.0);
    for (size_t j = 0; j < 7; j++) {
        rig->state[rig->toy.robot.nq + rig->toy.robot.nv + 3 * j + 2] = 5.0 + (double)j;
        magnetic += 0.5 * 0.32e-3 * (5.0 + (double)j) * (5.0 + (double)j);
        command->motor[j].bridge_on = false;
        command->motor[j].voltage_v = 48.0;
    }
    assert_ok(plant_restart_energy(rig->plant));
    assert_ok(plant_energy(rig->plant, &before));
    assert_ok(plant_step(rig->plant, 1)); /* one nanosecond */
    assert_ok(plant_energy(rig->plant, &after));
    assert_near(after.joule_heat, magnetic, 1e-12);
    assert_near(after.electrical_in, 0.0, 0.0);
    assert_near(before.stored - after.stored, magnetic, 1e-9);
    assert_ok(plant_sample(rig->plant));
    for (size_t j = 0; j < 7; j++) {
        assert_near(plant_sensors(rig->plant)->motor[j].current_a, 0.0, 0.0);
        assert_near(plant_sensors(rig->plant)->motor[j].voltage_v, 0.0, 0.0);
    }
}

/* With the point springs' potential reported, what contact is said to dissipate only grows. */
TEST_ON(contact_dissipation_only_grows, plant_rig, rig)
{
    double last = 0.0;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.55);
    for (int k = 0; k < 300; k++) {
        struct plant_energy energy;

        assert_ok(plant_step(rig->plant, 10));
        assert_ok(plant_energy(rig->plant, &energy));
        assert_true(energy.contact_dissipation >= last - 1e-6);
        last = energy.contact_dissipation;
    }
    assert_true(last > 0.1);
}

/* State after 0.1 s of constant voltages, ropes off: everything smooth. */
static void smooth_run(int64_t substep_ns, double *state, size_t max)
{
    struct plant_rig rig CLOSED_BY(plant_rig_fini);

    plant_rig_walker(&rig, false, substep_ns);
    for (size_t j = 0; j < 7; j++) {
        plant_command(rig.plant)->motor[j] = (struct motor_command){
            .bridge_on = true, .voltage_v = j % 2 ? 12.0 : -9.0, .pretension_m = 1.0};
    }
    plant_rig_reset(&rig, 1.0);
    assert_ok(plant_step(rig.plant, (size_t)(100000000 / substep_ns)));
    assert_true(rig.count <= max);
    memcpy(state, rig.state, rig.count * sizeof *state);
}

TEST(coupled_system_converges_with_order_four)
{
    static double reference[128], run[128];
    double previous = 0.0;

    smooth_run(6250, reference, 128);
    for (int64_t substep_ns = 200000; substep_ns >= 50000; substep_ns /= 2) {
        double worst = 0.0;

        smooth_run(substep_ns, run, 128);
        for (size_t i = 0; i < 128; i++) {
            worst = fmax(worst, fabs(run[i] - reference[i]) / (1.0 + fabs(reference[i])));
        }
        print_message("# h = %lld us: error %.2e\n", (long long)(substep_ns / 1000), worst);
        if (previous > 0.0) {
            assert_near(log2(previous / worst), 4.0, 0.35);
        }
        previous = worst;
    }
}
