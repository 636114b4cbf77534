/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whole robots that fall with their bridges open, thrown in all directions: their joints stay
 * within 0.02 rad of the limits, whatever hits the stops.
 */
#include "model/stop.h"

#include <math.h>
#include <stdio.h>

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"
#include "tests/test.h"

#define FARTHEST 0.02 /* rad past a limit */

/* The farthest that a joint was past a limit, and how many were. */
struct farthest {
    double depth;
    const char *joint;
    size_t stopped;
};

/* Uniform in [-1, 1), the same on every run (xorshift). */
static double thrown_random(uint64_t *random)
{
    *random ^= *random << 13;
    *random ^= *random >> 7;
    *random ^= *random << 17;
    return (double)(int64_t)*random / 9223372036854775808.0;
}

/* Lets go of the robot for so many milliseconds, moving and turning at random. */
static struct farthest fall(struct rig_scene *scene, int ms, uint64_t *random)
{
    const struct robot *robot = scene->robot;
    struct farthest farthest = {.joint = "none"};
    bool stopped[RIG_SCENE_JOINTS] = {false};
    double *state;
    size_t count;

    rig_scene_reset(scene);
    state = plant_state(scene->plant, &count);
    for (int i = 0; random && i < BASE_V_COUNT; i++) {
        state[robot->nq + (size_t)i] = (i < BASE_V_ANGULAR ? 1.0 : 3.0) * thrown_random(random);
    }
    assert_int_equal(plant_restart_energy(scene->plant), ERROR_NONE);
    for (int k = 0; k < ms; k++) {
        if (plant_step(scene->plant, scene->steps)) {
            fail_msg("at %d ms: %s", k, plant_failure(scene->plant));
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            const struct robot_joint *joint = &robot->joint[j];
            double q = state[robot->nq - robot->njoint + j];
            double depth = fabs(stop_depth(joint->lower, joint->upper, q));

            stopped[j] |= depth > 0.0;
            if (depth > farthest.depth) {
                farthest.depth = depth;
                farthest.joint = joint->name;
            }
        }
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        farthest.stopped += stopped[j];
    }
    return farthest;
}

static void assert_falls(const char *file, int falls)
{
    const struct rig_scene_choice choice = {
        .file = file, .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
    struct farthest most = {.joint = "none"};
    uint64_t random = 88172645463325252u;
    struct rig_scene scene;

    rig_scene_init(&scene, &choice);
    for (int k = 0; k < falls; k++) {
        struct farthest farthest = fall(&scene, 2000, k > 0 ? &random : NULL);

        assert_true(farthest.stopped >= 3);
        assert_true(farthest.depth < FARTHEST);
        most = farthest.depth > most.depth ? farthest : most;
    }
    print_message("# %s: the farthest of %d falls: %s %.4f rad\n", file, falls, most.joint,
                  most.depth);
    rig_scene_fini(&scene);
}

TEST(coman_stays_at_its_stops)
{
    assert_falls("coman.yaml", 12);
}

TEST(walkman_stays_at_its_stops)
{
    assert_falls("walkman.yaml", 6);
}

/* The oracle's fall: the depths are the model's, not the step's, and what stops, springs and
 * contacts lose is all that is lost. */
TEST(an_exact_fall_balances)
{
    const struct rig_scene_choice choice = {
        .file = "coman.yaml", .integrator = PLANT_DOPRI5, .substep_ns = 1000000, .tolerance = 1e-7};
    struct plant_energy energy;
    struct farthest farthest;
    struct rig_scene scene;
    double lost;

    rig_scene_init(&scene, &choice);
    farthest = fall(&scene, 1300, NULL);
    assert_int_equal(plant_energy(scene.plant, &energy), ERROR_NONE);
    lost = energy.motor_friction + energy.spring_damping + energy.stop_loss +
           energy.contact_dissipation;
    print_message("# %s %.4f rad past its limit; stops lost %.2f J of %.2f J, balance %.1e J\n",
                  farthest.joint, farthest.depth, energy.stop_loss, lost, energy.balance);
    assert_true(farthest.depth < FARTHEST);
    assert_true(energy.stop_loss > 1.0);
    assert_near(energy.balance, 0.0, 1e-4 * lost);
    rig_scene_fini(&scene);
}
