/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The paper's manipulation scene (section 6) on Simbody's contact: the box comes to rest on the
 * table with its weight, and the reference poses bring the wrists to where they touch, press and
 * hold it.
 */
#include "rig/rig.h"

#include <math.h>
#include <string.h>

#include "model/spatial.h"
#include "tests/physics/near.h"
#include "tests/test.h"

enum { JOINTS = 32, PAIRS = 5, PAIR_TABLE = 2, PAIR_RIGHT = 3, PAIR_LEFT = 4 };

static const double weight = 1.5 * 9.81;

/* Poses of the right arm by the data's inverse kinematics (shoulder pitch, roll, yaw, elbow; rad):
 * the wrist beside the box's middle, 2 cm (the sphere's radius) from its side; and 1 cm nearer. */
static const double touch[4] = {0.0216, 0.1044, 0.1494, -1.0912};
static const double squeeze[4] = {0.0117, 0.1281, 0.1647, -1.0706};

struct scene {
    struct arena arena;
    const struct rig *rig;
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
};

/* The scene of config/rigs/grasp-paper.yaml with the robot clamped; with_table false: the pair of
 * table and box left out. */
static void scene_init(struct scene *scene, bool with_table)
{
    struct contact_pair pair[PAIRS];
    struct contact_config contact;
    struct plant_config config;
    struct error error = {0};

    assert_int_equal(arena_init(&scene->arena, 64 << 20, &error), ERROR_NONE);
    if (rig_load(HIL_SOURCE_DIR "/config/rigs/grasp-paper.yaml", &scene->arena, &scene->rig,
                 &error)) {
        fail_msg("%s", error.text);
    }
    contact = scene->rig->contact;
    assert_int_equal(contact.npair, PAIRS);
    memcpy(pair, contact.pair, sizeof pair);
    if (!with_table) {
        pair[PAIR_TABLE] = pair[PAIR_LEFT]; /* so that the right one keeps its number */
        contact.npair--;
    }
    contact.pair = pair;
    assert_int_equal(contact_simbody_create(&contact, &scene->contact, &error), ERROR_NONE);
    assert_int_equal(dynamics_generic(scene->rig->robot, &scene->arena, &scene->dynamics, &error),
                     ERROR_NONE);
    config = (struct plant_config){.robot = scene->rig->robot,
                                   .dynamics = &scene->dynamics,
                                   .free = scene->rig->free,
                                   .nfree = scene->rig->nfree,
                                   .contact = scene->contact,
                                   .contact_body = scene->rig->contact_body,
                                   .ncontact = contact.nbody,
                                   .substep_ns = scene->rig->substep_ns,
                                   .supply_v = 48.0};
    assert_int_equal(plant_create(&config, &scene->arena, &scene->plant, &error), ERROR_NONE);
    plant_clamp(scene->plant, true);
}

static void scene_fini(struct scene *scene)
{
    scene->contact->ops->destroy(scene->contact);
    arena_fini(&scene->arena);
}

/* Both arms alike, but shoulder roll and yaw mirrored. */
static void pose_arms(struct scene *scene, const double right[4])
{
    static const char *const names[2][4] = {{"RShSag", "RShLat", "RShYaw", "RElbj"},
                                            {"LShSag", "LShLat", "LShYaw", "LElbj"}};
    const struct rig *rig = scene->rig;
    double joint[JOINTS];

    memcpy(joint, rig->joint, rig->robot->njoint * sizeof *joint);
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 4; k++) {
            int j = robot_find_joint(rig->robot, names[side][k]);

            assert_true(j >= 0);
            joint[j] = side == 1 && (k == 1 || k == 2) ? -right[k] : right[k];
        }
    }
    assert_int_equal(plant_reset(scene->plant, rig->base_position, rig->base_quaternion, joint),
                     ERROR_NONE);
}

/* Center of a surface of the robot, world frame. */
static void surface_center(const struct scene *scene, const char *name, double center[3])
{
    const struct contact_config *contact = &scene->rig->contact;

    for (size_t i = 0; i < contact->nsurface; i++) {
        const struct contact_surface *s = &contact->surface[i];
        const struct body_motion *motion;

        if (strcmp(s->name, name) == 0) {
            motion = &plant_motion(scene->plant)[scene->rig->contact_body[s->body]];
            mat3_apply(motion->R, s->position, center);
            for (int k = 0; k < 3; k++) {
                center[k] += motion->p[k];
            }
            return;
        }
    }
    fail_msg("no surface %s", name);
}

/* Force of a pair on its second surface, the box; zero when it does not touch. */
static double pair_force(struct scene *scene, int pair, int axis)
{
    struct contact_patch patch[16];
    size_t count = scene->contact->ops->patches(scene->contact, patch, 16);

    assert_true(count <= 16);
    for (size_t i = 0; i < count; i++) {
        if (patch[i].pair == pair) {
            return patch[i].force[axis];
        }
    }
    return 0.0;
}

TEST(box_comes_to_rest_on_the_table_with_its_weight)
{
    struct scene scene;
    const struct body_motion *box;
    double transient = 0.0, *values;
    size_t count;

    scene_init(&scene, true);
    assert_int_equal(plant_reset(scene.plant, scene.rig->base_position, scene.rig->base_quaternion,
                                 scene.rig->joint),
                     ERROR_NONE);
    box = plant_free_motion(scene.plant);
    for (int ms = 0; ms < 400; ms++) {
        double force;

        assert_int_equal(plant_step(scene.plant, scene.rig->substeps), ERROR_NONE);
        assert_int_equal(plant_sample(scene.plant), ERROR_NONE);
        force = plant_contact_wrenches(scene.plant)[4].force[2];
        transient = fmax(transient, fabs(force - weight));
        if (ms >= 200) { /* relaxed before 0.2 s, says the paper */
            assert_near(force, weight, 0.02 * weight);
        }
    }
    print_message("# %.6f N of %.6f after a transient of %.1f N; %.3f mm deep, tilted by %.1e\n",
                  plant_contact_wrenches(scene.plant)[4].force[2], weight, transient,
                  1e3 * (0.55 - box->p[2]), sqrt(box->R[2] * box->R[2] + box->R[5] * box->R[5]));
    assert_near(plant_contact_wrenches(scene.plant)[4].force[2], weight, 1e-3 * weight);
    assert_near(box->p[0], 0.20, 1e-6);
    assert_near(box->p[1], 0.0, 1e-6);
    assert_true(box->p[2] < 0.55 && box->p[2] > 0.5498); /* 0.13 mm on an exact foundation */
    assert_near(box->R[8], 1.0, 1e-9);
    values = plant_state(scene.plant, &count);
    assert_near(values[2], 0.52, 0.0); /* the robot is where it was */
    scene_fini(&scene);
}

TEST(reference_poses_touch_and_squeeze_the_box)
{
    struct scene scene;
    double center[3], right, left, expected;

    scene_init(&scene, true);
    pose_arms(&scene, touch);
    surface_center(&scene, "right_wrist", center);
    assert_near(center[0], 0.20, 1e-4);
    assert_near(center[1], -0.095, 1e-4);
    assert_near(center[2], 0.55, 1e-4);
    surface_center(&scene, "left_wrist", center);
    assert_near(center[0], 0.20, 1e-4);
    assert_near(center[1], 0.095, 1e-4);
    assert_near(center[2], 0.55, 1e-4);
    assert_true(fabs(pair_force(&scene, PAIR_RIGHT, 1)) < 1e-3);
    pose_arms(&scene, squeeze);
    right = pair_force(&scene, PAIR_RIGHT, 1);
    left = pair_force(&scene, PAIR_LEFT, 1);
    /* A sphere's exact foundation: k pi (R - d) d^2; the engine counts triangles of 2 cm */
    expected = 5e6 * M_PI * (0.02 - 0.01) * 0.01 * 0.01;
    print_message("# 1 cm deep the wrists press with %.3f and %.3f N, exact would be %.3f N\n",
                  right, left, expected);
    assert_near(right, expected, 0.25 * expected);
    assert_near(right, -left, 1e-3 * right);
    scene_fini(&scene);
}

/* Without a table, between clamped wrists: friction carries the box, which creeps (a law without
 * stiction) at a part of the transition velocity. */
TEST(grip_of_both_wrists_holds_the_box)
{
    struct scene scene;
    const struct body_motion *box;

    scene_init(&scene, false);
    pose_arms(&scene, squeeze);
    for (int ms = 0; ms < 300; ms++) {
        assert_int_equal(plant_step(scene.plant, scene.rig->substeps), ERROR_NONE);
    }
    assert_int_equal(plant_sample(scene.plant), ERROR_NONE);
    box = plant_free_motion(scene.plant);
    print_message("# carried with %.4f N, pressed with %.2f N; creeps by %.2f mm/s, %.2f mm below "
                  "its start\n",
                  plant_contact_wrenches(scene.plant)[4].force[2],
                  pair_force(&scene, PAIR_RIGHT, 1), -1e3 * box->v[2], 1e3 * (0.55 - box->p[2]));
    assert_near(plant_contact_wrenches(scene.plant)[4].force[2], weight, 0.01 * weight);
    assert_true(box->v[2] <= 0.0 && box->v[2] > -scene.rig->contact.transition_velocity_m_s);
    scene_fini(&scene);
}
