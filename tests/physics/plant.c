/* SPDX-License-Identifier: Apache-2.0 */
/* The plant as the loop uses it: creation, commands, repeatability, momentum. */

#include "tests/physics/plant_rig.h"

/* Creates with one thing wrong; the message must hold the words. */
static void assert_refused(const struct plant_config *config, const char *words)
{
    struct arena arena CLOSED_BY(arena_fini);
    struct plant *plant = NULL;
    struct error error = {0};

    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_int_equal(plant_create(config, &arena, &plant, &error), ERROR_INPUT);
    if (!strstr(error.text, words)) {
        fail_msg("\"%s\" does not say \"%s\"", error.text, words);
    }
    assert_null(plant);
}

TEST(refuses_what_cannot_run)
{
    static const int foot = TOY_RIGHT_FOOT, shank = 2, missing = 99, negative = -1;
    struct plant_rig rig CLOSED_BY(plant_rig_fini), other CLOSED_BY(plant_rig_fini);
    struct plant_config good = {.robot = &rig.toy.robot,
                                .dynamics = &rig.dynamics,
                                .contact = &rig.ground.world,
                                .contact_body = &foot,
                                .ncontact = 1,
                                .integrator = PLANT_RK4,
                                .substep_ns = 100000,
                                .supply_v = 48.0};
    struct plant_config bad;

    plant_rig_walker(&rig, false, 100000);
    plant_rig_walker(&other, false, 100000);
    bad = good;
    bad.substep_ns = 0;
    assert_refused(&bad, "substep is 0 ns");
    bad = good;
    bad.supply_v = -1.0;
    assert_refused(&bad, "supply is -1 V");
    bad.supply_v = (double)NAN;
    assert_refused(&bad, "supply is");
    bad = good;
    bad.contact_body = &missing;
    assert_refused(&bad, "bodies 0 to 8");
    bad.contact_body = &negative;
    assert_refused(&bad, "bodies 0 to 8");
    bad.contact_body = &shank;
    assert_refused(&bad, "does not mark as observed");
    bad = good;
    bad.contact = NULL;
    assert_refused(&bad, "with no contact engine");
    bad = good;
    bad.ncontact = 0;
    assert_refused(&bad, "with a contact engine");
    bad = good;
    bad.dynamics = &other.dynamics;
    assert_refused(&bad, "not those of robot");
    rig.toy.body[0].observed = false; /* the inertial sensor's */
    assert_refused(&good, "inertial sensor");
    rig.toy.body[0].observed = true;
    rig.toy.body[TOY_LEFT_FOOT].observed = false;
    assert_refused(&good, "force-torque sensor");
}

CLOSED_BENCH(plant_rig, struct plant_rig, plant_rig_fini)

TEST_ON(without_an_account_only_the_stored_energy_is_told, plant_rig, rig)
{
    struct plant_config config = {.robot = &rig->toy.robot,
                                  .dynamics = &rig->dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = 100000,
                                  .supply_v = 48.0};
    struct plant *plant;
    struct error error;
    struct plant_energy with, without;
    double *own;
    size_t count;

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    plant_rig_random_voltages(rig, 20.0);
    assert_ok(plant_step(rig->plant, 100));
    assert_ok(plant_energy(rig->plant, &with));
    assert_ok(plant_create(&config, &rig->arena, &plant, &error));
    own = plant_state(plant, &count);
    assert_true(count < rig->count);
    memcpy(own, rig->state, count * sizeof *own); /* the integrals come last */
    assert_ok(plant_energy(plant, &without));
    assert_near(without.stored, with.stored, 0.0);
    assert_true(with.joule_heat > 0.0);
    assert_near(fabs(without.joule_heat) + fabs(without.electrical_in) + fabs(without.balance), 0.0,
                0.0);
}

TEST_ON(reports_every_lack_of_memory, plant_rig, rig)
{
    struct plant_config config = {.robot = &rig->toy.robot,
                                  .dynamics = &rig->dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = 100000,
                                  .supply_v = 48.0};
    enum error_code code = ERROR_MEMORY;
    int refused = 0;

    plant_rig_walker(rig, false, 100000);
    for (size_t room = 0; code != ERROR_NONE; room += 512) {
        struct arena arena CLOSED_BY(arena_fini);
        struct error error = {0};
        struct plant *plant;

        assert_true(room < 1 << 20);
        assert_ok(arena_init(&arena, 1 << 20, &error));
        arena.capacity = room;
        code = plant_create(&config, &arena, &plant, &error);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        refused += code != ERROR_NONE;
        arena.capacity = 1 << 20;
    }
    assert_true(refused > 20);
}

TEST_ON(voltage_is_clipped_to_the_supply, plant_rig, rig)
{
    struct plant_command *command;
    const struct motor_sense *motor;

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    command = plant_command(rig->plant);
    motor = plant_sensors(rig->plant)->motor;
    plant_rig_random_voltages(rig, 0.0);
    command->motor[0].voltage_v = 1e9;
    command->motor[1].voltage_v = -1e9;
    command->motor[2].voltage_v = (double)NAN;
    command->motor[3].voltage_v = (double)INFINITY;
    command->motor[4].voltage_v = 12.5;
    assert_ok(plant_step(rig->plant, 10));
    assert_ok(plant_sample(rig->plant));
    assert_near(motor[0].voltage_v, 48.0, 0.0);
    assert_near(motor[1].voltage_v, -48.0, 0.0);
    assert_near(motor[2].voltage_v, 0.0, 0.0);
    assert_near(motor[3].voltage_v, 48.0, 0.0);
    assert_near(motor[4].voltage_v, 12.5, 0.0);
    assert_near(plant_sensors(rig->plant)->supply_v, 48.0, 0.0);
    assert_true(motor[0].current_a > 10.0 && motor[1].current_a < -10.0);
}

TEST_ON(joint_without_a_drive_reads_as_its_link, plant_rig, rig)
{
    const struct motor_sense *hand;

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    plant_rig_random_voltages(rig, 20.0);
    assert_ok(plant_step(rig->plant, 100));
    assert_ok(plant_sample(rig->plant));
    hand = &plant_sensors(rig->plant)->motor[TOY_HAND - 1];
    assert_true(hand->qd != 0.0);
    assert_near(hand->qm, hand->q, 0.0);
    assert_near(hand->qmd, hand->qd, 0.0);
    assert_near(hand->torque_nm, 0.0, 0.0);
    assert_near(hand->current_a, 0.0, 0.0);
    assert_near(hand->voltage_v, 0.0, 0.0);
}

TEST_ON(reset_is_at_rest_with_springs_relaxed, plant_rig, rig)
{
    uint64_t hash;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.6);
    hash = plant_hash(rig->plant);
    for (size_t j = 0; j < 8; j++) {
        const struct motor_sense *motor = &plant_sensors(rig->plant)->motor[j];

        assert_near(motor->qm, motor->q, 0.0);
        assert_near(motor->torque_nm, 0.0, 0.0);
        assert_near(fabs(motor->qd) + fabs(motor->qmd) + fabs(motor->current_a), 0.0, 0.0);
    }
    plant_rig_random_voltages(rig, 30.0);
    plant_set_push(rig->plant, 0, (const double[3]){9.0, 9.0, 9.0},
                   (const double[3]){0.0, 0.0, 0.0});
    assert_ok(plant_step(rig->plant, 100));
    assert_true(plant_hash(rig->plant) != hash);
    assert_int_equal(plant_time_ns(rig->plant), 10000000);
    plant_rig_reset(rig, 0.6);
    assert_true(plant_hash(rig->plant) == hash);
    assert_int_equal(plant_time_ns(rig->plant), 0);
}

/* Hash after 50 ticks of 10 substeps, in calls of `chunk`; one voltage may differ a little. */
static uint64_t run_hash(size_t chunk, bool nudge)
{
    struct plant_rig rig;
    uint64_t hash;

    plant_rig_walker(&rig, true, 100000);
    plant_rig_reset(&rig, 0.52);
    for (int k = 0; k < 50; k++) {
        plant_rig_random_voltages(&rig, 20.0);
        if (nudge && k == 10) {
            plant_command(rig.plant)->motor[3].voltage_v += 1e-9;
        }
        for (size_t done = 0; done < 10; done += chunk) {
            assert_ok(plant_step(rig.plant, chunk));
        }
        assert_ok(plant_sample(rig.plant));
    }
    hash = plant_hash(rig.plant);
    plant_rig_fini(&rig);
    return hash;
}

TEST(equal_runs_have_equal_hashes)
{
    uint64_t hash = run_hash(10, false);

    assert_true(run_hash(10, false) == hash);
    assert_true(run_hash(1, false) == hash); /* the ropes' pretensions do not move here */
    assert_true(run_hash(10, true) != hash);
}

/* Nothing moves, and yet it is later. */
TEST_ON(hash_tells_equal_states_at_different_times, plant_rig, rig)
{
    const double none[3] = {0.0, 0.0, 0.0};
    uint64_t hash;
    double before[128];

    plant_rig_walker(rig, false, 100000);
    memset(rig->toy.robot.gravity, 0, sizeof rig->toy.robot.gravity);
    for (size_t j = 0; j < 8; j++) {
        plant_command(rig->plant)->motor[j].pretension_m = 1.0; /* ropes slack */
    }
    plant_rig_reset(rig, 1.0);
    memcpy(rig->state + 3, (const double[4]){1.0, 0.0, 0.0, 0.0}, 4 * sizeof *rig->state);
    plant_set_push(rig->plant, 0, none, none);
    hash = plant_hash(rig->plant);
    memcpy(before, rig->state, rig->count * sizeof *before);
    assert_ok(plant_step(rig->plant, 1));
    assert_memory_equal(rig->state, before, rig->count * sizeof *before);
    assert_true(plant_hash(rig->plant) != hash);
}

/* Momentum after a fall of 10 ms; before that, with a push that a reset is to end. */
TEST_ON(reset_ends_every_push, plant_rig, rig)
{
    const double force[3] = {100.0, 50.0, 25.0}, none[3] = {0.0, 0.0, 0.0};
    double position[3], momentum[3];

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    plant_set_push(rig->plant, TOY_ARM, force, force);
    plant_rig_reset(rig, 1.0);
    plant_set_push(rig->plant, TOY_HAND, none, none);
    assert_ok(plant_step(rig->plant, 100));
    plant_center_of_mass(rig->plant, position, momentum);
    assert_near(momentum[0], 0.0, 1e-9);
    assert_near(momentum[1], 0.0, 1e-9);
    assert_near(momentum[2], -9.81 * 0.01 * rig->toy.robot.total_mass, 1e-9);
}

/* Of a clamped robot a drive works against its locked link, so the motor ends where the spring's
 * torque is the stall torque: Ks (qm - q) = Kt V / R. */
TEST_ON(clamped_links_stay_while_drives_live, plant_rig, rig)
{
    const double V = 0.5;
    const struct plant_sensors *sensors;
    const struct robot_sea *sea;
    double q;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.55);
    plant_clamp(rig->plant, true);
    assert_true(plant_is_clamped(rig->plant));
    sensors = plant_sensors(rig->plant);
    sea = &rig->toy.robot.joint[0].sea;
    q = sensors->motor[0].q;
    plant_command(rig->plant)->motor[0] = (struct motor_command){.bridge_on = true, .voltage_v = V};
    assert_ok(plant_step(rig->plant, 40000));
    assert_ok(plant_sample(rig->plant));
    assert_true(sensors->motor[0].q == q && sensors->motor[0].qd == 0.0);
    assert_near(sensors->motor[0].current_a, V / sea->R, 1e-6);
    assert_near(sensors->motor[0].torque_nm, sea->Kt * V / sea->R, 1e-6);
    assert_near(sensors->motor[0].qm - q, sea->Kt * V / sea->R / sea->Ks, 1e-8);
    for (size_t c = 0; c < 2; c++) {
        assert_true(plant_contact_wrenches(rig->plant)[c].force[2] == 0.0);
    }
    plant_clamp(rig->plant, false);
    assert_ok(plant_step(rig->plant, 100));
    assert_ok(plant_sample(rig->plant));
    assert_true(sensors->motor[0].q != q);
}

TEST_ON(sampling_and_asking_for_energy_change_nothing, plant_rig, rig)
{
    struct plant_energy energy;
    double position[3], momentum[3];
    uint64_t hash;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.52);
    plant_rig_random_voltages(rig, 20.0);
    assert_ok(plant_step(rig->plant, 100));
    hash = plant_hash(rig->plant);
    assert_ok(plant_sample(rig->plant));
    assert_ok(plant_energy(rig->plant, &energy));
    plant_center_of_mass(rig->plant, position, momentum);
    assert_true(plant_hash(rig->plant) == hash);
}

TEST_ON(pretension_moves_evenly_to_the_command, plant_rig, rig)
{
    const size_t knee = 8 + 7 + 14 + 21; /* after q (7 + 8), v (6 + 8) and seven drives */

    plant_rig_walker(rig, false, 100000);
    plant_rig_reset(rig, 1.0);
    plant_command(rig->plant)->motor[1].pretension_m = 0.01;
    for (int part = 1; part <= 10; part++) {
        struct plant_command *command = plant_command(rig->plant);

        command->motor[1].pretension_m = 0.001 * part;
        assert_ok(plant_step(rig->plant, 1));
        assert_near(rig->state[knee], 0.001 * part, 0.0);
    }
    plant_command(rig->plant)->motor[1].pretension_m = -0.03;
    assert_ok(plant_step(rig->plant, 10));
    assert_near(rig->state[knee], -0.03, 0.0);
}

/* The windings' L/R is 0.48 ms: no explicit scheme takes that in steps of 10 ms. */
TEST_ON(too_long_a_substep_is_an_error_and_not_a_nan, plant_rig, rig)
{
    enum error_code code = ERROR_NONE;

    plant_rig_walker(rig, false, 10000000);
    plant_rig_reset(rig, 1.0);
    plant_rig_random_voltages(rig, 40.0);
    for (int k = 0; k < 10000 && code == ERROR_NONE; k++) {
        code = plant_step(rig->plant, 1);
    }
    assert_int_equal(code, ERROR_INPUT);
    assert_non_null(strstr(plant_failure(rig->plant), "substep is too long"));
    for (size_t i = 0; i < rig->count; i++) {
        assert_true(isfinite(rig->state[i]));
    }
}

/* Total momentum about the world's origin: by whole-body kinematics, apart from the plant. */
static void total_momentum(struct plant_rig *rig, double linear[3], double angular[3])
{
    struct body_motion motion[TOY_BODIES];
    struct toy all = rig->toy;
    const struct robot *robot = &all.robot;
    struct dynamics dynamics;
    struct error error;

    all.robot.body = all.body;
    for (size_t b = 0; b < robot->nbody; b++) {
        all.body[b].observed = true;
    }
    assert_ok(dynamics_generic(robot, &rig->arena, &dynamics, &error));
    dynamics.ops->kinematics(&dynamics, rig->state, rig->state + robot->nq, motion);
    memset(linear, 0, 3 * sizeof *linear);
    memset(angular, 0, 3 * sizeof *angular);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        const double *I = inertia->I, *R = motion[b].R, *w = motion[b].w;
        const double tensor[9] = {I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5]};
        double c[3], v[3], wb[3], Lb[3], arm[3];

        for (int i = 0; i < 3; i++) {
            arm[i] = R[3 * i] * inertia->com[0] + R[3 * i + 1] * inertia->com[1] +
                     R[3 * i + 2] * inertia->com[2];
            c[i] = motion[b].p[i] + arm[i];
            wb[i] = R[i] * w[0] + R[3 + i] * w[1] + R[6 + i] * w[2];
        }
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;

            v[i] = motion[b].v[i] + w[j] * arm[k] - w[k] * arm[j];
            Lb[i] = tensor[3 * i] * wb[0] + tensor[3 * i + 1] * wb[1] + tensor[3 * i + 2] * wb[2];
        }
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;

            linear[i] += inertia->mass * v[i];
            angular[i] += inertia->mass * (c[j] * v[k] - c[k] * v[j]) + R[3 * i] * Lb[0] +
                          R[3 * i + 1] * Lb[1] + R[3 * i + 2] * Lb[2];
        }
    }
}

/* No gravity, a thrown and tumbling robot, random voltages: drives and ropes are inner forces. */
TEST_ON(drives_change_no_total_momentum, plant_rig, rig)
{
    double linear[3], angular[3], linear0[3], angular0[3], norm;

    plant_rig_walker(rig, false, 100000);
    memset(rig->toy.robot.gravity, 0, sizeof rig->toy.robot.gravity);
    plant_rig_reset(rig, 1.0);
    for (size_t i = 0; i < 6; i++) {
        rig->state[rig->toy.robot.nq + i] = 0.3 + 0.2 * (double)i;
    }
    total_momentum(rig, linear0, angular0);
    for (int k = 0; k < 500; k++) {
        plant_rig_random_voltages(rig, 20.0);
        assert_ok(plant_step(rig->plant, 10));
    }
    total_momentum(rig, linear, angular);
    norm = sqrt(angular0[0] * angular0[0] + angular0[1] * angular0[1] + angular0[2] * angular0[2]);
    print_message("# linear %.2e kg m/s of %.1f, angular %.2e kg m2/s of %.2f\n",
                  fabs(linear[0] - linear0[0]) + fabs(linear[1] - linear0[1]) +
                      fabs(linear[2] - linear0[2]),
                  fabs(linear0[0]),
                  fabs(angular[0] - angular0[0]) + fabs(angular[1] - angular0[1]) +
                      fabs(angular[2] - angular0[2]),
                  norm);
    for (int i = 0; i < 3; i++) {
        assert_near(linear[i], linear0[i], 1e-8 * fabs(linear0[i]));
        assert_near(angular[i], angular0[i], 1e-8 * norm);
    }
}

/* The center of mass against the sum over bodies, its momentum against the same. */
TEST_ON(centre_of_mass_moves_with_the_total_momentum, plant_rig, rig)
{
    double before[3], after[3], momentum[3], linear[3], angular[3];

    plant_rig_walker(rig, false, 1000);
    plant_rig_reset(rig, 1.0);
    for (size_t i = 0; i < rig->toy.robot.nv; i++) {
        rig->state[rig->toy.robot.nq + i] = 0.3 + 0.1 * (double)i;
    }
    plant_center_of_mass(rig->plant, before, momentum);
    total_momentum(rig, linear, angular);
    assert_ok(plant_step(rig->plant, 10));
    plant_center_of_mass(rig->plant, after, momentum);
    for (int i = 0; i < 3; i++) {
        double gravity = rig->toy.robot.gravity[i], t = 1e-5;
        double expected = linear[i] * t / rig->toy.robot.total_mass + 0.5 * gravity * t * t;

        assert_near(after[i] - before[i], expected, 1e-14);
        assert_near(momentum[i], linear[i] + rig->toy.robot.total_mass * gravity * t, 1e-10);
    }
}

/* A push of F accelerates the center of mass by F / m, wherever it is applied. */
TEST(push_accelerates_the_centre_of_mass)
{
    const double force[3] = {30.0, -20.0, 50.0}, moment[3] = {3.0, 1.0, -2.0};

    for (int body = 0; body <= TOY_HAND; body++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        double before[3], after[3], position[3];

        plant_rig_walker(&rig, false, 100000);
        plant_rig_reset(&rig, 1.0);
        plant_set_push(rig.plant, body, force, moment);
        plant_center_of_mass(rig.plant, position, before);
        assert_ok(plant_step(rig.plant, 100));
        plant_center_of_mass(rig.plant, position, after);
        for (int i = 0; i < 3; i++) {
            double weight = rig.toy.robot.total_mass * rig.toy.robot.gravity[i];

            assert_near(after[i] - before[i], 0.01 * (force[i] + weight), 1e-8);
        }
    }
}

/* The quaternion stays of unit length over 5 s of tumbling. */
TEST_ON(quaternion_keeps_its_length, plant_rig, rig)
{
    double norm;

    plant_rig_walker(rig, false, 1000000);
    plant_rig_reset(rig, 1.0);
    for (size_t i = 3; i < 6; i++) {
        rig->state[rig->toy.robot.nq + i] = 2.0 * (double)i;
    }
    for (int k = 0; k < 2000; k++) {
        assert_ok(plant_step(rig->plant, 1));
        norm = sqrt(rig->state[3] * rig->state[3] + rig->state[4] * rig->state[4] +
                    rig->state[5] * rig->state[5] + rig->state[6] * rig->state[6]);
        assert_near(norm, 1.0, 1e-15);
    }
}
