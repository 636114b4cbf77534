/* SPDX-License-Identifier: Apache-2.0 */
/* What robot_finish fills in and what it refuses. */
#include "model/robot.h"
#include "model/spatial.h"
#include "tests/test.h"

static struct error error;

/* A free trunk with an upper and a lower arm, a frame, a sensor and a pose, all of it sound. */
struct sample {
    struct robot robot;
    struct robot_body body[3];
    struct robot_joint joint[2];
    struct robot_frame frame;
    struct robot_ft_sensor ft;
    struct robot_pose pose;
    double position[2];
};

static const struct robot_inertia block = {
    1.5, {0.1, 0.0, -0.2}, {0.03, 0.0, 0.0, 0.04, 0.0, 0.05}};

static void fill(struct sample *s)
{
    *s = (struct sample){0};
    for (int b = 0; b < 3; b++) {
        static const char *const name[] = {"trunk", "upper", "lower"};

        s->body[b] = (struct robot_body){.name = name[b], .parent = b - 1, .inertia = block};
    }
    for (int j = 0; j < 2; j++) {
        struct robot_joint *joint = &s->joint[j];

        *joint = (struct robot_joint){.name = j ? "elbow" : "shoulder",
                                      .axis = {0.0, 1.0, 0.0},
                                      .origin = {0.0, 0.0, -0.3},
                                      .lower = -1.0,
                                      .upper = 1.0};
        mat3_identity(joint->rotation);
    }
    s->frame = (struct robot_frame){.name = "hand", .body = 2};
    mat3_identity(s->frame.rotation);
    s->ft = (struct robot_ft_sensor){.name = "wrist", .frame = 0};
    s->pose = (struct robot_pose){.name = "zero", .base_quaternion = {1.0}, .joint = s->position};
    s->robot = (struct robot){.name = "sample",
                              .floating = true,
                              .gravity = {0.0, 0.0, -9.81},
                              .nbody = 3,
                              .njoint = 2,
                              .nframe = 1,
                              .nft = 1,
                              .npose = 1,
                              .body = s->body,
                              .joint = s->joint,
                              .frame = &s->frame,
                              .ft = &s->ft,
                              .pose = &s->pose,
                              .imu_frame = -1};
}

static void assert_refused(struct sample *s, const char *why)
{
    assert_int_equal(robot_finish(&s->robot, &error), ERROR_INPUT);
    if (!strstr(error.text, why)) {
        fail_msg("found \"%s\", expected it to say \"%s\"", error.text, why);
    }
    fill(s);
}

static void assert_accepted(struct sample *s)
{
    assert_no_error(robot_finish(&s->robot, &error), error.text);
}

TEST(finish_counts_and_adds_up)
{
    struct sample s;

    fill(&s);
    assert_accepted(&s);
    assert_int_equal(s.robot.nq, 9);
    assert_int_equal(s.robot.nv, 8);
    assert_true(fabs(s.robot.total_mass - 4.5) < 1e-15);
    assert_false(s.body[1].observed);
    assert_true(s.body[2].observed);

    fill(&s);
    s.robot.floating = false;
    assert_accepted(&s);
    assert_int_equal(s.robot.nq, 2);
    assert_int_equal(s.robot.nv, 2);
}

TEST(names_are_found_or_not)
{
    struct sample s;

    fill(&s);
    assert_int_equal(robot_find_body(&s.robot, "lower"), 2);
    assert_int_equal(robot_find_body(&s.robot, "hand"), -1);
    assert_int_equal(robot_find_joint(&s.robot, "elbow"), 1);
    assert_int_equal(robot_find_joint(&s.robot, "knee"), -1);
    assert_int_equal(robot_find_frame(&s.robot, "hand"), 0);
    assert_int_equal(robot_find_frame(&s.robot, ""), -1);
    assert_int_equal(robot_find_pose(&s.robot, "zero"), 0);
    assert_int_equal(robot_find_pose(&s.robot, "home"), -1);
}

static uint64_t hash_of(struct sample *s)
{
    assert_accepted(s);
    return s->robot.hash;
}

TEST(the_hash_follows_the_equations_of_motion_and_nothing_else)
{
    struct sample s;
    uint64_t hash;

    fill(&s);
    hash = hash_of(&s);

    /* Names, poses, limits, drives and a signed zero change nothing */
    s.robot.name = s.body[1].name = s.joint[1].name = "other";
    s.robot.npose = 0;
    s.joint[0].upper = 2.0;
    s.joint[0].axis[0] = -0.0;
    s.joint[0].sea = (struct robot_sea){.present = true, .J = 1.0, .L = 1.0, .N = 1.0};
    assert_true(hash_of(&s) == hash);

    fill(&s);
    s.robot.gravity[2] = -9.80665;
    assert_true(hash_of(&s) != hash);
    fill(&s);
    s.body[2].inertia.com[0] += 1e-15;
    assert_true(hash_of(&s) != hash);
    fill(&s);
    s.body[2].parent = 0;
    assert_true(hash_of(&s) != hash);
    fill(&s);
    s.joint[1].origin[1] = 1e-9;
    assert_true(hash_of(&s) != hash);
    fill(&s);
    s.joint[1].type = JOINT_PRISMATIC;
    assert_true(hash_of(&s) != hash);
    fill(&s);
    s.robot.floating = false;
    assert_true(hash_of(&s) != hash);
}

BENCH(fill, struct sample, assert_accepted)

TEST_ON(refuses_inertias_that_no_body_has, fill, s)
{
    s->body[1].inertia.mass = -1.0;
    assert_refused(s, "body upper: mass -1 kg is negative");
    s->body[1].inertia.com[2] = NAN;
    assert_refused(s, "body upper: a mass property is not finite");
    s->body[2].inertia.I[0] = 0.2;
    assert_refused(s, "the largest exceeds the sum of the others");
    s->body[2].inertia.I[1] = 0.06;
    assert_refused(s, "inertia is not positive");
    s->body[0].inertia.mass = 0.0;
    assert_refused(s, "body trunk: inertia without mass");
    s->ft.distal.mass = -0.1;
    assert_refused(s, "below sensor wrist: mass -0.1 kg is negative");

    /* A thin plate, written with six digits, is one */
    memcpy(s->body[2].inertia.I, (double[]){0.0123457, 0.0, 0.0, 0.0246913, 0.0, 0.03703705},
           sizeof s->body[2].inertia.I);
}

static const struct robot_inertia nothing = {0};
static const struct robot_inertia point_on_axis = {1.0, {0.0, 0.4, 0.0}, {0}};

TEST(refuses_what_would_make_the_dynamics_singular)
{
    struct sample s;

    fill(&s);
    s.body[2].inertia = nothing;
    assert_refused(&s, "joint elbow moves nothing that has inertia about its axis");
    s.body[2].inertia = point_on_axis;
    assert_refused(&s, "joint elbow moves nothing that has inertia about its axis");

    /* Two joints about one line, nothing between them */
    s.body[1].inertia = nothing;
    memset(s.joint[1].origin, 0, sizeof s.joint[1].origin);
    assert_refused(&s, "joint shoulder moves nothing that has inertia about its axis");

    /* A free base that only its joints hold */
    s.body[0].inertia = s.body[1].inertia = nothing;
    assert_refused(&s, "the floating base has no inertia of its own");
}

TEST(accepts_massless_bodies_that_something_hangs_on)
{
    struct sample s;

    fill(&s);
    s.body[1].inertia = nothing;
    s.joint[1].axis[0] = 1.0;
    s.joint[1].axis[1] = 0.0;
    assert_accepted(&s);

    /* A mass point far from the axis, on a slider anywhere */
    fill(&s);
    s.joint[1].type = JOINT_PRISMATIC;
    s.body[2].inertia = point_on_axis;
    assert_accepted(&s);
}
