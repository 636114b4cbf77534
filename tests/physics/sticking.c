/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Friction that sticks, in a rig as it is: COMAN on a slope for a minute, its motors holding.
 */

#include "model/plant_private.h"
#include "tests/figure.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { FEET = 2, SECOND = 1000 };

static const struct rig_scene_choice coman = {.file = "coman.yaml",
                                              .integrator = PLANT_IMPLICIT,
                                              .substep_ns = 1000000,
                                              .slope_rad = 5.0 * 3.14159265358979323846 / 180.0};

/* Where the feet are, m. */
static void find_feet(const struct rig_scene *scene, double at[FEET][3])
{
    for (int f = 0; f < FEET; f++) {
        memcpy(at[f], plant_motion(scene->plant)[scene->rig->contact_body[f]].p, sizeof at[f]);
    }
}

/* The furthest that a foot moves along an axis in a minute, m. */
static double creep_in_a_minute(struct rig_scene *scene)
{
    double before[FEET][3], after[FEET][3], crept = 0.0;

    find_feet(scene, before);
    for (int k = 0; k < 60 * SECOND; k++) {
        rig_scene_hold(scene);
    }
    find_feet(scene, after);
    for (int f = 0; f < FEET; f++) {
        for (int i = 0; i < 3; i++) {
            crept = fmax(crept, fabs(after[f][i] - before[f][i]));
        }
    }
    return crept;
}

CLOSED_BENCH(rig_scene, struct rig_scene, rig_scene_fini)

/* Settled, it stands from the first tick on: nothing jerks, nothing creeps. */
TEST_ON(coman_settles_on_a_slope_and_stays_for_a_minute, rig_scene, scene)
{
    struct settled settled;
    double crept, jerk = 0.0, weight;

    rig_scene_init(scene, &coman);
    settled = rig_scene_settle(scene);
    weight = scene->robot->total_mass * vec3_norm(scene->robot->gravity);
    for (int k = 0; k < SECOND; k++) {
        double force[3] = {0.0, 0.0, 0.0};

        rig_scene_hold(scene);
        for (int f = 0; f < FEET; f++) {
            const struct contact_wrench *foot =
                rig_scene_wrench(scene, robot_find_body(scene->robot, f ? "LFoot" : "RFoot"));

            vec3_add_scaled(force, 1.0, foot->force, force);
        }
        vec3_add_scaled(force, scene->robot->total_mass, scene->robot->gravity, force);
        jerk = fmax(jerk, vec3_norm(force));
    }
    crept = creep_in_a_minute(scene);
    print_message("# %zu iterations, tilt %.3f mrad; feet off by %.1e N of %.0f N at most in the "
                  "first second; they crept by %.1e m in 60 s\n",
                  settled.iterations, 1e3 * settled.tilt_rad, jerk, weight, crept);
    assert_true(jerk < 1e-6 * weight);
    assert_true(crept < 1e-9);
}

/* Put on its feet with relaxed springs it sways, on legs that hardly damp it; once that has faded,
 * after 80 s, it stays. Before, its feet bend the layers that they stand on to and fro. */
TEST_ON(coman_that_came_down_on_a_slope_stays_for_a_minute, rig_scene, scene)
{
    double crept;

    rig_scene_init(scene, &coman);
    for (size_t j = 0; j < scene->robot->njoint; j++) {
        scene->reference[j] = scene->rig->joint[j];
    }
    for (int k = 0; k < 80 * SECOND; k++) {
        rig_scene_hold(scene);
    }
    crept = creep_in_a_minute(scene);
    print_message("# the feet crept by %.2e m in 60 s\n", crept);
    assert_true(crept < 1e-6);
    figure_hold("slope_creep_m", crept);
}

/* Sways by 0.02 rad and squats by 0.03 rad, a quarter of a cycle apart, at 3 Hz. */
static void refer_to_a_swaying_squat(struct rig_scene *scene,
                                     const double settled[RIG_SCENE_JOINTS], double t)
{
    static const struct {
        const char *name;
        double sway, squat;
    } joint[] = {
        {"RHipLat", 1, 0},  {"LHipLat", 1, 0},  {"RAnkLat", -1, 0}, {"LAnkLat", -1, 0},
        {"RHipSag", 0, -1}, {"LHipSag", 0, -1}, {"RKneeSag", 0, 2}, {"LKneeSag", 0, 2},
        {"RAnkSag", 0, -1}, {"LAnkSag", 0, -1},
    };
    const double turn = 2.0 * M_PI * 3.0 * t, fade = fmin(1.0, t);

    for (size_t i = 0; i < sizeof joint / sizeof joint[0]; i++) {
        int j = robot_find_joint(scene->robot, joint[i].name);

        assert_true(j >= 0);
        scene->reference[j] = settled[j] + fade * (0.02 * joint[i].sway * sin(turn) +
                                                   0.03 * joint[i].squat * cos(turn));
    }
}

/* The loads of both feet swing, well inside of what friction can hold, and their edges lift: they
 * do not walk. Legs that hardly damp it let the start's own sway fade for half a minute. */
TEST_ON(coman_that_sways_and_squats_does_not_walk, rig_scene, scene)
{
    static const struct rig_scene_choice flat = {
        .file = "coman.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
    double settled[RIG_SCENE_JOINTS], before[FEET][3], after[FEET][3], most = 0.0, worst = 0.0;

    rig_scene_init(scene, &flat);
    rig_scene_settle(scene);
    memcpy(settled, scene->reference, sizeof settled);
    for (int k = 0; k <= 96 * SECOND; k++) {
        refer_to_a_swaying_squat(scene, settled, 1e-3 * k);
        rig_scene_hold(scene);
        if (k == 36 * SECOND) {
            find_feet(scene, before);
        }
        for (int f = 0; f < FEET; f++) {
            const double *force =
                rig_scene_wrench(scene, robot_find_body(scene->robot, f ? "LFoot" : "RFoot"))
                    ->force;

            most = fmax(most, hypot(force[0], force[1]) / force[2]);
        }
    }
    find_feet(scene, after);
    for (int f = 0; f < FEET; f++) {
        for (int i = 0; i < 2; i++) {
            worst = fmax(worst, fabs(after[f][i] - before[f][i]));
        }
    }
    print_message("# T/N up to %.2f; the feet moved by %.1e m in 60 s\n", most, worst);
    assert_true(most < 0.3);
    assert_true(worst < 1e-6);
}

/* Evaluates the present motion with bristles and time ahead; returns how many evaluations of the
 * engine that takes. */
static uint64_t evaluate(struct plant *plant, double ahead_s)
{
    const uint64_t before = plant_contact_cost(plant)->evaluations;
    struct plant_load load;

    plant_list_bristles(plant);
    assert_ok(
        plant_load_bodies(plant, plant->state, plant->state + plant->at.bristle, ahead_s, &load));
    return plant_contact_cost(plant)->evaluations - before;
}

/* The memory of the last evaluation answers for the same motion, bristles and time ahead only. */
TEST_ON(memory_of_contact_answers_for_the_same_bristles, rig_scene, scene)
{
    double *bristle;
    size_t count, other = 0;

    rig_scene_init(scene, &coman);
    rig_scene_settle(scene);
    rig_scene_hold(scene);
    bristle = plant_state(scene->plant, &count) + scene->plant->at.bristle;
    evaluate(scene->plant, 0.0);
    assert_int_equal(evaluate(scene->plant, 0.0), 0);
    assert_true(scene->plant->nlive >= FEET);

    /* Another time ahead, one bristle bent further, one more pair with bristles, one less */
    assert_int_equal(evaluate(scene->plant, 1e-4), 1);
    assert_int_equal(evaluate(scene->plant, 1e-4), 0);
    assert_int_equal(evaluate(scene->plant, 0.0), 1);
    bristle[CONTACT_BRISTLE * (size_t)scene->plant->live[0]] += 1e-9;
    assert_int_equal(evaluate(scene->plant, 0.0), 1);
    while (scene->plant->live[0] == (int)other || scene->plant->live[1] == (int)other) {
        other++;
    }
    bristle[CONTACT_BRISTLE * other] = 1e-9;
    assert_int_equal(evaluate(scene->plant, 0.0), 1);
    assert_int_equal(evaluate(scene->plant, 0.0), 0);
    bristle[CONTACT_BRISTLE * other] = 0.0;
    assert_int_equal(evaluate(scene->plant, 0.0), 1);
}
