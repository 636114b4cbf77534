/* SPDX-License-Identifier: Apache-2.0 */
/* The plant allocates nothing once it is made. */

#include "tests/physics/counting_malloc.h"
#include "tests/physics/free_rig.h"
#include "tests/physics/plant_rig.h"

static void step_and_sample(enum plant_integrator integrator, bool coupled)
{
    const double force[3] = {5.0, 0.0, 0.0}, moment[3] = {0.0, 0.0, 1.0};
    double position[3], momentum[3];
    struct robot_coupling coupling[2];
    struct plant_rig rig CLOSED_BY(plant_rig_fini);
    struct plant_energy energy;
    enum error_code code = ERROR_NONE;
    size_t before;

    if (coupled) {
        plant_rig_coupled_walker(&rig, coupling, integrator, 100000);
    } else {
        plant_rig_walker_with(&rig, true, integrator, 100000, 0.0);
    }
    plant_rig_reset(&rig, 0.52);
    arena_seal(&rig.arena);
    before = counted_calls();
    for (int k = 0; k < 100 && code == ERROR_NONE; k++) {
        plant_rig_random_voltages(&rig, 20.0);
        plant_set_push(rig.plant, k % 9, force, moment);
        code = plant_step(rig.plant, 10);
        code = code == ERROR_NONE ? plant_sample(rig.plant) : code;
        code = code == ERROR_NONE ? plant_energy(rig.plant, &energy) : code;
        plant_center_of_mass(rig.plant, position, momentum);
        plant_hash(rig.plant);
    }
    assert_int_equal(counted_calls() - before, 0);
    assert_ok(code);
}

TEST(stepping_and_sampling_allocate_nothing)
{
    for (int coupled = 0; coupled < 2; coupled++) {
        step_and_sample(PLANT_RK4, coupled);
        step_and_sample(PLANT_IMPLICIT, coupled);
        step_and_sample(PLANT_DOPRI5, coupled);
    }
}

TEST(free_bodies_allocate_nothing)
{
    const double force[3] = {5.0, 0.0, 0.0}, moment[3] = {0.0, 0.0, 1.0};
    struct free_rig rig CLOSED_BY(free_rig_fini);
    struct plant_energy energy;
    enum error_code code = ERROR_NONE;
    double pose[7];
    size_t before;

    free_rig_walker_on_ground(&rig, 100000);
    rig.body[0].position[2] = 0.08;
    free_rig_start(&rig);
    arena_seal(&rig.arena);
    before = counted_calls();
    for (int k = 0; k < 100 && code == ERROR_NONE; k++) {
        plant_clamp(rig.plant, k % 3 == 0);
        plant_set_push(rig.plant, k % 10, force, moment);
        code = plant_step(rig.plant, 10);
        code = code == ERROR_NONE ? plant_sample(rig.plant) : code;
        code = code == ERROR_NONE ? plant_energy(rig.plant, &energy) : code;
        plant_free_pose(rig.plant, 0, pose);
        plant_hash(rig.plant);
    }
    assert_int_equal(counted_calls() - before, 0);
    assert_ok(code);
}
