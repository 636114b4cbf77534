/* SPDX-License-Identifier: Apache-2.0 */
/* The plant and its contact engine: failures, the memory of the last evaluation, its cost. */

#include "tests/physics/plant_rig.h"

/* The engine fails at its n-th evaluation, for every n of two substeps. The first stage of the
 * first substep is not one of them: the sensors have asked for it already. */
TEST(contact_failure_leaves_the_last_good_substep)
{
    for (size_t n = 1; n <= 7; n++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        static double good[128];
        int64_t expected = n <= 3 ? 0 : 100000;

        plant_rig_walker(&rig, true, 100000);
        plant_rig_reset(&rig, 0.52);
        memcpy(good, rig.state, rig.count * sizeof *good);
        if (n > 3) {
            assert_ok(plant_step(rig.plant, 1));
            memcpy(good, rig.state, rig.count * sizeof *good);
            plant_rig_reset(&rig, 0.52);
        }
        assert_string_equal(plant_failure(rig.plant), "");
        rig.ground.fail_at = rig.ground.evaluations + n;
        assert_int_equal(plant_step(rig.plant, 5), ERROR_SYSTEM);
        assert_string_equal(plant_failure(rig.plant), "the toy ground gave way");
        assert_int_equal(plant_time_ns(rig.plant), expected);
        assert_memory_equal(rig.state, good, rig.count * sizeof *good);
        assert_ok(plant_step(rig.plant, 5)); /* and it can go on */
    }
}

static int64_t scripted_now_ns(void *clock)
{
    return *(int64_t *)clock += 10;
}

CLOSED_BENCH(plant_rig, struct plant_rig, plant_rig_fini)

/* What is asked twice for one motion is evaluated once; and what was written is seen. */
TEST_ON(contact_is_evaluated_once_for_a_motion, plant_rig, rig)
{
    struct contact_wrench first[2];
    size_t before;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.45);
    before = rig->ground.evaluations;
    assert_int_equal(plant_contact_cost(rig->plant)->evaluations, before);
    memcpy(first, plant_contact_wrenches(rig->plant), sizeof first);
    assert_true(first[0].force[2] > 0.0);

    /* The sensors again, the energies, and the first of the four stages of a step */
    assert_ok(plant_sample(rig->plant));
    assert_ok(plant_restart_energy(rig->plant));
    assert_int_equal(rig->ground.evaluations, before);
    assert_memory_equal(plant_contact_wrenches(rig->plant), first, sizeof first);
    assert_ok(plant_step(rig->plant, 1));
    assert_int_equal(rig->ground.evaluations, before + 3);
    assert_int_equal(plant_contact_cost(rig->plant)->evaluations, before + 3);

    /* A motion that differs in one velocity */
    assert_ok(plant_sample(rig->plant));
    before = rig->ground.evaluations;
    rig->state[rig->toy.robot.nq + BASE_V_LINEAR] += 1e-9;
    assert_ok(plant_sample(rig->plant));
    assert_int_equal(rig->ground.evaluations, before + 1);
}

TEST_ON(contact_is_timed_by_the_clock_that_is_given, plant_rig, rig)
{
    static const int feet[2] = {TOY_RIGHT_FOOT, TOY_LEFT_FOOT};
    int64_t clock = 0;
    size_t size;
    struct error error;
    const struct plant_config config = {.robot = &rig->toy.robot,
                                        .dynamics = &rig->dynamics,
                                        .contact = &rig->ground.world,
                                        .contact_body = feet,
                                        .ncontact = 2,
                                        .integrator = PLANT_RK4,
                                        .substep_ns = 100000,
                                        .supply_v = 48.0,
                                        .now_ns = scripted_now_ns,
                                        .clock = &clock};

    plant_rig_walker(rig, true, 100000);
    assert_int_equal(plant_contact_cost(rig->plant)->spent_ns, 0);
    assert_ok(plant_create(&config, &rig->arena, &rig->plant, &error));
    plant_rig_reset(rig, 0.52);
    assert_int_equal(clock, 20);
    assert_ok(plant_step(rig->plant, 2));
    assert_int_equal(plant_contact_cost(rig->plant)->evaluations, 8);
    assert_int_equal(plant_contact_cost(rig->plant)->spent_ns, 80);

    /* The memory of it is one block within the arena */
    assert_true((unsigned char *)plant_contact_memory(rig->plant, &size) > rig->arena.memory);
    assert_true(size >= sizeof(struct plant_contact_cost) + 2 * sizeof(struct body_motion));
}

TEST_ON(contact_failure_reaches_sample_energy_and_reset, plant_rig, rig)
{
    const double position[3] = {0.0, 0.0, 1.0}, quaternion[4] = {1.0, 0.0, 0.0, 0.0};
    const double joint[8] = {0.0};
    struct plant_energy energy;

    plant_rig_walker(rig, true, 100000);
    plant_rig_reset(rig, 0.52);
    assert_ok(plant_step(rig->plant, 1));
    rig->ground.fail_at = rig->ground.evaluations + 1;
    assert_int_equal(plant_sample(rig->plant), ERROR_SYSTEM);
    assert_int_equal(plant_sensors(rig->plant)->time_ns, 0); /* the last good sample */
    rig->ground.fail_at = rig->ground.evaluations + 1;
    assert_int_equal(plant_energy(rig->plant, &energy), ERROR_SYSTEM);
    rig->ground.fail_at = rig->ground.evaluations + 1;
    assert_int_equal(plant_reset(rig->plant, position, quaternion, joint), ERROR_SYSTEM);
}
