/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The paper's manipulation scene with the implicit integrator at a millisecond: COMAN stands, takes
 * the box between its wrists and lifts it. Five bodies in contact, two of them with a third that
 * only they hold; series springs from the paper's soft elbow to bare harmonic drives.
 */
#include "rig/rig.h"

#include <math.h>
#include <string.h>

#include "tests/physics/near.h"
#include "tests/test.h"

enum { JOINTS = 32, SAMPLES = 600, FIRST = 200, ARM = 4 };
enum { RIGHT_FOOT = 0, LEFT_FOOT = 1 }; /* contact bodies, in the order of the rig's surfaces */

/* Right arm: shoulder pitch, roll, yaw, elbow; poses of the data's inverse kinematics. */
static const char *const arms[2][ARM] = {{"RShSag", "RShLat", "RShYaw", "RElbj"},
                                         {"LShSag", "LShLat", "LShYaw", "LElbj"}};
static const double touch[ARM] = {0.0216, 0.1044, 0.1494, -1.0912};
static const double lifted[ARM] = {0.1438, 0.1305, 0.1839, -1.4505}; /* 5 cm, 1 cm squeezed */

struct scene {
    struct arena arena;
    const struct rig *rig;
    struct robot robot;
    struct robot_joint joint[JOINTS];
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
    size_t steps; /* in a millisecond */
    double reference[JOINTS];
};

struct track {
    double q[SAMPLES][JOINTS], feet[SAMPLES], box[SAMPLES];
};

/* Both arms alike, but shoulder roll and yaw mirrored. */
static void set_arms(const struct scene *scene, const double right[ARM], double *joint)
{
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < ARM; k++) {
            int j = robot_find_joint(&scene->robot, arms[side][k]);

            assert_true(j >= 0);
            joint[j] = side == 1 && (k == 1 || k == 2) ? -right[k] : right[k];
        }
    }
}

/* elbow_Ks replaces the elbows' stiffness, other_Ks that of all other springs; 0 = as they are. */
static void scene_init(struct scene *scene, enum plant_integrator integrator, int64_t substep_ns,
                       double elbow_Ks, double other_Ks)
{
    struct plant_config config = {
        .supply_v = 48.0, .integrator = integrator, .substep_ns = substep_ns};
    struct error error = {0};

    assert_int_equal(arena_init(&scene->arena, 64 << 20, &error), ERROR_NONE);
    if (rig_load(HIL_SOURCE_DIR "/config/rigs/grasp-paper.yaml", &scene->arena, &scene->rig,
                 &error)) {
        fail_msg("%s", error.text);
    }
    scene->robot = *scene->rig->robot;
    assert_true(scene->robot.njoint <= JOINTS);
    memcpy(scene->joint, scene->robot.joint, scene->robot.njoint * sizeof *scene->joint);
    scene->robot.joint = scene->joint;
    for (size_t j = 0; j < scene->robot.njoint; j++) {
        bool elbow = strstr(scene->joint[j].name, "Elbj") != NULL;
        double Ks = elbow ? elbow_Ks : other_Ks;

        if (Ks > 0.0 && scene->joint[j].sea.present) {
            scene->joint[j].sea.Ks = Ks;
            scene->joint[j].sea.Ds = 5e-4 * Ks;
        }
    }
    assert_int_equal(contact_simbody_create(&scene->rig->contact, &scene->contact, &error),
                     ERROR_NONE);
    assert_int_equal(dynamics_generic(&scene->robot, &scene->arena, &scene->dynamics, &error),
                     ERROR_NONE);
    config.robot = &scene->robot;
    config.dynamics = &scene->dynamics;
    config.free = scene->rig->free;
    config.nfree = scene->rig->nfree;
    config.contact = scene->contact;
    config.contact_body = scene->rig->contact_body;
    config.ncontact = scene->rig->contact.nbody;
    assert_int_equal(plant_create(&config, &scene->arena, &scene->plant, &error), ERROR_NONE);
    memcpy(scene->reference, scene->rig->joint, scene->robot.njoint * sizeof *scene->reference);
    set_arms(scene, touch, scene->reference);
    assert_int_equal(plant_reset(scene->plant, scene->rig->base_position,
                                 scene->rig->base_quaternion, scene->reference),
                     ERROR_NONE);
    scene->steps = (size_t)(1000000 / substep_ns);
}

static void scene_fini(struct scene *scene)
{
    scene->contact->ops->destroy(scene->contact);
    arena_fini(&scene->arena);
}

/* Squeezes for 0.15 s, 3 cm beyond the box's side, then lifts; voltages from the motor angles. */
static void lift(struct scene *scene, int milliseconds, struct track *track)
{
    const struct motor_sense *motor = plant_sensors(scene->plant)->motor;

    for (int k = 0; k < milliseconds; k++) {
        const struct contact_wrench *wrench = plant_contact_wrenches(scene->plant);
        double squeeze = fmin(1.0, k / 150.0), up = fmax(0.0, (k - 150) / 450.0), right[ARM];

        for (int i = 0; i < ARM; i++) {
            right[i] = touch[i] + up * (lifted[i] - touch[i]) + (i == 1 ? 0.05 * squeeze : 0.0);
        }
        set_arms(scene, right, scene->reference);
        for (size_t j = 0; j < scene->robot.njoint; j++) {
            struct motor_command *command = &plant_command(scene->plant)->motor[j];

            command->bridge_on = true;
            command->voltage_v = 200.0 * (scene->reference[j] - motor[j].qm);
        }
        assert_int_equal(plant_step(scene->plant, scene->steps), ERROR_NONE);
        assert_int_equal(plant_sample(scene->plant), ERROR_NONE);
        for (size_t j = 0; j < scene->robot.njoint; j++) {
            track->q[k][j] = motor[j].q;
        }
        track->feet[k] = wrench[RIGHT_FOOT].force[2] + wrench[LEFT_FOOT].force[2];
        track->box[k] = plant_free_motion(scene->plant)[0].p[2];
    }
}

TEST(lifting_the_box_it_is_where_rk4_is)
{
    enum { END = 450 };
    static struct track reference, found;
    double worst = 0.0, force = 0.0, size = 0.0, box = 0.0;
    struct scene scene;
    size_t njoint;

    scene_init(&scene, PLANT_RK4, 100000, 0.0, 0.0);
    lift(&scene, END, &reference);
    scene_fini(&scene);
    scene_init(&scene, PLANT_IMPLICIT, 1000000, 0.0, 0.0);
    lift(&scene, END, &found);
    njoint = scene.robot.njoint;
    scene_fini(&scene);
    for (size_t j = 0; j < njoint; j++) {
        double sum = 0.0;

        for (int k = FIRST; k < END; k++) {
            sum += (found.q[k][j] - reference.q[k][j]) * (found.q[k][j] - reference.q[k][j]);
        }
        worst = fmax(worst, sqrt(sum / (END - FIRST)));
    }
    for (int k = FIRST; k < END; k++) {
        force += (found.feet[k] - reference.feet[k]) * (found.feet[k] - reference.feet[k]);
        size += reference.feet[k] * reference.feet[k];
        box = fmax(box, fabs(found.box[k] - reference.box[k]));
    }
    print_message(
        "# worst joint %.2e rad RMS, foot force %.2f %% RMS, box %.2f mm; it rose by %.1f "
        "mm\n",
        worst, 100.0 * sqrt(force / size), 1e3 * box, 1e3 * (found.box[END - 1] - found.box[0]));
    assert_true(worst < 2e-3);
    assert_true(sqrt(force / size) < 0.02);
    assert_true(box < 2e-3);
}

/* A soft elbow cannot lift; it and everything else must not upset the step. */
TEST(springs_of_any_stiffness_are_stable_in_the_grip)
{
    const double stiffness[][2] = {{1.2e-3, 0.0}, {120.0, 0.0}, {8400.0, 8400.0}};
    static struct track found;

    for (int n = 0; n < 3; n++) {
        double weight, feet, jump = 0.0;
        struct scene scene;

        scene_init(&scene, PLANT_IMPLICIT, 1000000, stiffness[n][0], stiffness[n][1]);
        lift(&scene, SAMPLES, &found);
        weight = 9.81 * (scene.robot.total_mass + scene.rig->free[0].inertia.mass);
        feet = found.feet[SAMPLES - 1];
        for (int k = FIRST + 1; k < SAMPLES; k++) {
            jump = fmax(jump, fabs(found.feet[k] - found.feet[k - 1]));
        }
        print_message("# elbow %g, others %g N m/rad: box rose by %.1f mm, feet carry %.1f N of "
                      "%.1f N with the box, which changes by up to %.2f N a step\n",
                      stiffness[n][0], stiffness[n][1],
                      1e3 * (found.box[SAMPLES - 1] - found.box[0]), feet, weight, jump);
        assert_near(feet, weight, 0.15 * weight);
        assert_true(jump < 0.05 * weight);
        assert_true(n == 0 || found.box[SAMPLES - 1] - found.box[0] > 5e-3);
        scene_fini(&scene);
    }
}
