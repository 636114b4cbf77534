/* SPDX-License-Identifier: Apache-2.0 */
/* WALK-MAN's file: structure, masses, geometry and drives against what is published. */
#include "model/dynamics.h"
#include "model/robot.h"
#include "model/spatial.h"
#include "tests/physics/near.h"
#include "tests/test.h"

enum { NUMBERS = 64 };

static struct arena arena;
static const struct robot *robot;
static struct dynamics dynamics;

FIXTURE(load)
{
    struct error error;

    if (arena_init(&arena, 1 << 24, &error) ||
        robot_load(HIL_SOURCE_DIR "/config/robots/walkman.yaml", NULL, &arena, &robot, &error) ||
        dynamics_generic(robot, &arena, &dynamics, &error)) {
        print_message("# %s\n", error.text);
        return -1;
    }
    return 0;
}

FIXTURE(unload)
{
    arena_fini(&arena);
    return 0;
}

/* The place of a frame in the world, in a pose. */
static void place(const char *pose_name, const char *frame_name, double p[3], double R[9])
{
    static struct body_motion motion[NUMBERS];
    int pose_at = robot_find_pose(robot, pose_name), at = robot_find_frame(robot, frame_name);
    const struct robot_frame *frame = &robot->frame[at];
    const struct robot_pose *pose = &robot->pose[pose_at];
    double q[NUMBERS], v[NUMBERS] = {0.0};

    assert_true(pose_at >= 0 && at >= 0);
    memcpy(q, pose->base_position, sizeof pose->base_position);
    memcpy(q + 3, pose->base_quaternion, sizeof pose->base_quaternion);
    memcpy(q + 7, pose->joint, robot->njoint * sizeof *q);
    dynamics.ops->kinematics(&dynamics, q, v, motion);
    mat3_apply(motion[frame->body].R, frame->position, p);
    for (int m = 0; m < 3; m++) {
        p[m] += motion[frame->body].p[m];
    }
    mat3_mul(motion[frame->body].R, frame->rotation, R);
}

/* 115.9623395 kg of moving bodies and 5.2353626 of what is fixed to them. */
TEST(nothing_of_its_mass_is_lost)
{
    assert_near(robot->total_mass, 121.1977021, 1e-7);
}

/* The sum over the elbow's five parts and the hand by hand, for one component: the first moment
 * about the elbow along z. */
TEST(what_hangs_on_the_elbow_is_added_exactly)
{
    const double forearm = -0.1955, hand = -0.1955 - 0.092, support = -0.1955 - 0.0505;
    const double moment = 0.86765385 * -0.043820396 + 2.2127686 * (forearm + 0.044717986) +
                          1.2838072 * (forearm - 0.080380065) +
                          1.3789343 * (support - 0.069076044) + 0.42801447 * (hand - 0.039669274) +
                          0.5 * (hand - 0.15361558);
    const struct robot_inertia *elbow = &robot->body[robot_find_body(robot, "RElb")].inertia;

    assert_near(elbow->mass, 0.86765385 + 2.2127686 + 1.2838072 + 1.3789343 + 0.42801447 + 0.5,
                1e-14);
    assert_near(elbow->mass * elbow->com[2], moment, 1e-14);
}

/* Published: the waist at 1.011324 m over the simulator's contact plane, 0.130 m below the
 * ankles. */
TEST(homing_has_the_published_height)
{
    double p[3], R[9];

    place("homing", "r_ankle", p, R);
    assert_near(robot->pose[robot_find_pose(robot, "homing")].base_position[2] - p[2] + 0.130,
                1.011324, 5e-7);
}

TEST(soles_stand_flat_on_the_ground_in_every_pose)
{
    static const char *const poses[] = {"zero", "homing", "squat_top", "squat_bottom"};
    static const char *const soles[] = {"r_sole", "l_sole"};
    double p[3], R[9];

    assert_int_equal(robot->npose, 4);
    for (size_t i = 0; i < 4; i++) {
        for (size_t k = 0; k < 2; k++) {
            place(poses[i], soles[k], p, R);
            assert_near(p[2], 0.0, 1e-15);
            assert_near(R[8], 1.0, 1e-15);
        }
    }
}

/* Section 7 of the paper: 30 cm down. */
TEST(the_squat_moves_the_waist_straight_down)
{
    double top[3], bottom[3], R[9];
    const struct robot_pose *pose = robot->pose;
    int high = robot_find_pose(robot, "squat_top"), low = robot_find_pose(robot, "squat_bottom");

    assert_near(pose[high].base_position[2] - pose[low].base_position[2], 0.3, 1e-14);
    place("squat_top", "r_ankle", top, R);
    place("squat_bottom", "r_ankle", bottom, R);
    for (int m = 0; m < 2; m++) {
        assert_near(top[m], bottom[m], 1e-14);
    }
    /* Below the hip axes, 0.017 m before the waist's origin */
    assert_near(top[0], 0.1059 - 0.0889, 1e-14);
    assert_near(top[2], bottom[2], 1e-14);
}

/* The back-EMF terms that the source has in its damping, by class; SMALL's and MEDIUM's also hold
 * the friction. */
TEST(drives_have_the_published_damping)
{
    static const struct {
        const char *joint;
        double damping; /* friction + back-EMF, N m s/rad */
        double assumed; /* of it assumed here */
        double Ks;
    } drive[] = {{"WaistLat", 385.1575, 0.0, 5000.0},
                 {"RHipYaw", 38.3489, 0.4, 1300.0},
                 {"NeckYawj", 25.52, 0.0, 500.0},
                 {"RKneeSag", 31.178, 0.8, 10000.0}};

    for (size_t i = 0; i < sizeof drive / sizeof drive[0]; i++) {
        const struct robot_sea *sea = &robot->joint[robot_find_joint(robot, drive[i].joint)].sea;

        assert_near(sea->Dm + sea->Kt * sea->Kw / sea->R - drive[i].assumed, drive[i].damping,
                    5e-3);
        assert_near(sea->Ks, drive[i].Ks, 0.0);
        assert_near(sea->L, 0.32e-3, 0.0);
    }
}

TEST_GROUP(load, unload)
