/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on drives as real ones are, rig coman-drives: it stands on gears that hold, and moves with
 * an account of its energy that closes.
 */

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

static struct rig_scene scene;
static const struct rig_scene_choice real = {
    .file = "coman-drives.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};

/* In equilibrium the load on each rotor is less than its gear holds: none moves, by no bit. */
TEST(gears_hold_a_robot_that_stands)
{
    double start[RIG_SCENE_JOINTS];
    const struct motor_sense *motor;

    rig_scene_init(&scene, &real);
    rig_scene_settle(&scene);
    motor = plant_sensors(scene.plant)->motor;
    for (size_t j = 0; j < scene.robot->njoint; j++) {
        start[j] = motor[j].qm;
    }
    plant_clamp(scene.plant, false);
    for (int k = 0; k < 1000; k++) {
        rig_scene_hold(&scene);
        for (size_t j = 0; j < scene.robot->njoint; j++) {
            assert_true(motor[j].qm == start[j] && motor[j].qmd == 0.0);
        }
    }
    assert_near(rig_scene_feet(&scene), -scene.robot->total_mass * scene.robot->gravity[2], 0.05);
    rig_scene_fini(&scene);
}

/* Two seconds of arms that swing and knees that bend; the hash of the end. */
static uint64_t swing_robot(struct plant_energy *energy)
{
    double hottest = 0.0, most = 0.0, least = 1e3;
    uint64_t hash;

    rig_scene_init(&scene, &real);
    rig_scene_settle(&scene);
    plant_clamp(scene.plant, false);
    assert_ok(plant_restart_energy(scene.plant));
    for (int k = 0; k < 2000; k++) {
        double swing = 2e-3 * sin(2.0 * M_PI * 2.0 * 1e-3 * k);

        scene.reference[robot_find_joint(scene.robot, "RShSag")] += swing;
        scene.reference[robot_find_joint(scene.robot, "LShSag")] -= swing;
        scene.reference[robot_find_joint(scene.robot, "RElbj")] += 0.5 * swing;
        rig_scene_hold(&scene);
        most = fmax(most, plant_sensors(scene.plant)->supply_v);
        least = fmin(least, plant_sensors(scene.plant)->supply_v);
        for (size_t j = 0; j < scene.robot->njoint; j++) {
            hottest = fmax(hottest, plant_sensors(scene.plant)->motor[j].winding_c);
        }
    }
    assert_ok(plant_energy(scene.plant, energy));
    hash = plant_hash(scene.plant);
    print_message(
        "# bus %.2f to %.2f V, windings to %.2f degree C; gear friction %.3f J, hysteresis "
        "%.3f J, windings %.2f J, balance %.1e J\n",
        least, most, hottest, energy->gear_friction, energy->gear_hysteresis, energy->joule_heat,
        energy->balance);
    assert_true(least > 40.0 && least < most && most < 57.0);
    assert_true(hottest > 25.01 && hottest < 60.0);
    rig_scene_fini(&scene);
    return hash;
}

TEST(a_moving_robot_keeps_its_account)
{
    struct plant_energy energy;
    uint64_t hash = swing_robot(&energy);

    assert_true(energy.gear_friction > 0.1);
    assert_true(energy.gear_hysteresis > 0.0);
    assert_near(energy.balance, 0.0, 1e-3 * energy.joule_heat);
    assert_true(swing_robot(&energy) == hash);
}
