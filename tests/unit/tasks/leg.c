/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What tasks know of the robot's body, against the model that simulates it: where the links are and
 * the center of mass; inverse kinematics of both legs; static torques against the
 * potential energy.
 */
#include "tasks/leg.h"

#include "base/vec3.h"
#include "rig/rig.h"
#include "tests/test.h"

enum { POSES = 500, LINKS = 64 };

struct bench {
    struct arena arena;
    const struct rig *rig, *walkman;
    double angle[LINKS], joint[LINKS]; /* by axis, by joint of the robot */
    struct body_pose pose[LINKS];
    struct body_motion truth[LINKS];
    uint64_t random;
};

static double draw(struct bench *b, double low, double high)
{
    b->random = b->random * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * (double)(b->random >> 11) / 9007199254740992.0;
}

FIXTURE(setup)
{
    static struct bench bench;
    struct error error;

    bench.random = 1;
    if (arena_init(&bench.arena, 1 << 26, &error) ||
        rig_load(HIL_SOURCE_DIR "/config/rigs/coman-compact-imu.yaml", &bench.arena, &bench.rig,
                 &error) ||
        rig_load(HIL_SOURCE_DIR "/config/rigs/walk-walkman.yaml", &bench.arena, &bench.walkman,
                 &error)) {
        print_error("%s\n", error.text);
        return -1;
    }
    *test_state = &bench;
    return 0;
}

FIXTURE(teardown)
{
    struct bench *bench = *test_state;

    arena_fini(&bench->arena);
    return 0;
}

/* A pose within the joints' limits, knees bent, for the task's tree and for the model's. */
static void pose_rig_at_random(struct bench *b, const struct rig *rig)
{
    static const double origin[3] = {0}, upright[4] = {1, 0, 0, 0};
    const struct robot *robot = rig->robot;

    for (size_t i = 0; i < rig->naxis; i++) {
        const struct host_axis *axis = &rig->axis[i];
        int joint = robot_find_joint(robot, axis->joint);
        double low = strstr(axis->joint, "Knee") ? 0.05 : axis->lower_rad;

        b->angle[i] = draw(b, fmax(low, -1.4), fmin(axis->upper_rad, 1.8));
        b->joint[joint] = b->angle[i];
    }
    robot_place_bodies(robot, origin, upright, b->joint, b->truth);
    body_place(&rig->body, b->angle, b->pose);
}

static void pose_at_random(struct bench *b)
{
    pose_rig_at_random(b, b->rig);
}

static double far_apart(const double *x, const double *y, int count)
{
    double worst = 0;

    for (int i = 0; i < count; i++) {
        worst = fmax(worst, fabs(x[i] - y[i]));
    }
    return worst;
}

TEST(links_and_center_of_mass_are_those_of_the_model)
{
    struct bench *b = *test_state;
    const struct robot *robot = b->rig->robot;

    for (int n = 0; n < POSES; n++) {
        double com[3], truth[3] = {0};

        pose_at_random(b);
        for (size_t i = 0; i < robot->nbody; i++) {
            double arm[3];

            assert_true(far_apart(b->pose[i].p, b->truth[i].p, 3) < 1e-13);
            assert_true(far_apart(b->pose[i].R, b->truth[i].R, 9) < 1e-13);
            mat3_apply(b->truth[i].R, robot->body[i].inertia.com, arm);
            vec3_add_scaled(arm, 1, b->truth[i].p, arm);
            vec3_add_scaled(truth, robot->body[i].inertia.mass / robot->total_mass, arm, truth);
        }
        body_center_of_mass(&b->rig->body, b->pose, com);
        assert_true(far_apart(com, truth, 3) < 1e-13);
    }
}

TEST(inverse_kinematics_give_the_angles_back)
{
    struct bench *b = *test_state;
    double worst = 0;

    for (int side = 0; side < BODY_SIDES; side++) {
        struct leg_geometry leg;
        struct error error;
        int link[LEG_JOINTS];

        assert_ok(leg_find(&b->rig->body, side, link, &leg, &error));
        assert_true(fabs(leg.thigh_m - b->rig->squat.thigh_m) < 1e-12);
        assert_true(fabs(leg.shank_m - b->rig->squat.shank_m) < 1e-12);
        for (int n = 0; n < POSES; n++) {
            double angle[LEG_JOINTS], back[LEG_JOINTS];
            struct body_pose foot;
            const struct body_motion *truth;

            pose_at_random(b);
            truth = &b->truth[link[LEG_ANKLE_PITCH]];
            for (int j = 0; j < LEG_JOINTS; j++) {
                angle[j] = b->angle[b->rig->body.link[link[j]].axis];
            }
            memcpy(foot.p, truth->p, sizeof foot.p);
            memcpy(foot.R, truth->R, sizeof foot.R);
            assert_true(leg_inverse(&leg, &foot, 0, 3, back));
            worst = fmax(worst, far_apart(angle, back, LEG_JOINTS));
        }
    }
    print_message("# worst angle off by %g rad\n", worst);
    assert_true(worst < 1e-12);
}

/* WALK-MAN's: roll first, with the other hip axes away from it. Where the sole is turned by more
 * than pi/2, or the hip is below the ankle as the foot sees it, other angles give the same pose. */
TEST(a_leg_that_rolls_first_gives_its_angles_back_too)
{
    struct bench *b = *test_state;
    double worst = 0;
    int judged = 0;

    for (int n = 0; n < BODY_SIDES * POSES; n++) {
        int link[LEG_JOINTS], side = n % BODY_SIDES;
        double angle[LEG_JOINTS], back[LEG_JOINTS], turn, above;
        const struct body_motion *truth;
        struct leg_geometry leg;
        struct body_pose foot;
        struct error error;

        assert_ok(leg_find(&b->walkman->body, side, link, &leg, &error));
        assert_true(leg.roll_first && leg.thigh_m == 0.356 && leg.shank_m == 0.4);
        pose_rig_at_random(b, b->walkman);
        truth = &b->truth[link[LEG_ANKLE_ROLL]];
        for (int j = 0; j < LEG_JOINTS; j++) {
            angle[j] = b->angle[b->walkman->body.link[link[j]].axis];
        }
        memcpy(foot.p, truth->p, sizeof foot.p);
        memcpy(foot.R, truth->R, sizeof foot.R);
        turn = angle[LEG_HIP_PITCH] + angle[LEG_KNEE] + angle[LEG_ANKLE_PITCH];
        above = leg.shank_m * cos(angle[LEG_ANKLE_PITCH]) - leg.offset[2] * cos(turn) +
                leg.thigh_m * cos(angle[LEG_ANKLE_PITCH] + angle[LEG_KNEE]);
        if (fabs(turn) < 1.5 && above > 0.01) {
            assert_true(leg_inverse(&leg, &foot, 0, 3, back));
            worst = fmax(worst, far_apart(angle, back, LEG_JOINTS));
            judged++;
        }
    }
    print_message("# worst angle of %d poses off by %g rad\n", judged, worst);
    assert_true(judged > POSES && worst < 1e-11);
}

TEST(a_foot_out_of_reach_is_pointed_at)
{
    struct bench *b = *test_state;
    struct body_pose foot = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const struct body_pose *got;
    struct leg_geometry leg;
    struct error error;
    int link[LEG_JOINTS];
    double angle[LEG_JOINTS], to[3], reached[3];

    assert_ok(leg_find(&b->rig->body, BODY_LEFT, link, &leg, &error));
    vec3_add_scaled(leg.hip, 1, (const double[]){0.2, 0.1, -0.5}, foot.p);
    assert_false(leg_inverse(&leg, &foot, 0.1, 2, angle));
    assert_true(fabs(angle[LEG_KNEE] - 0.1) < 1e-12);
    for (int j = 0; j < LEG_JOINTS; j++) {
        b->angle[b->rig->body.link[link[j]].axis] = angle[j];
    }
    body_place(&b->rig->body, b->angle, b->pose);
    got = &b->pose[link[LEG_ANKLE_PITCH]];
    vec3_sub(foot.p, leg.hip, to);
    vec3_sub(got->p, leg.hip, reached);
    assert_true(fabs(vec3_dot(to, reached) / vec3_norm(to) / vec3_norm(reached) - 1) < 1e-12);
    assert_true(far_apart(got->R, foot.R, 9) < 1e-12);
}

TEST(a_leg_with_other_axes_is_refused)
{
    struct bench *b = *test_state;
    struct body_link link[LINKS];
    struct body_model model = b->rig->body;
    struct leg_geometry leg;
    struct error error;
    int found[LEG_JOINTS];

    memcpy(link, model.link, model.nlink * sizeof *link);
    model.link = link;
    link[body_find_link(&model, "LKneeSag")].origin[0] = 0.01;
    assert_ok(leg_find(&model, BODY_RIGHT, found, &leg, &error));
    assert_int_equal(leg_find(&model, BODY_LEFT, found, &leg, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "LKneeSag"));
    link[body_find_link(&model, "RHipYaw")].axis = -1;
    assert_int_equal(leg_find(&model, BODY_RIGHT, found, &leg, &error), ERROR_INPUT);
}

/* Work of the weights of a leg's links and of a force that the foot bears, by a turn of a joint. */
static double leg_work(struct bench *b, const int link[LEG_JOINTS], int j, const double force[3],
                       double turn)
{
    int axis = b->rig->body.link[link[j]].axis;
    double before = b->angle[axis], work = 0;

    b->angle[axis] = before + turn;
    body_place(&b->rig->body, b->angle, b->pose);
    for (int k = 0; k < LEG_JOINTS; k++) {
        const struct body_link *at = &b->rig->body.link[link[k]];
        double arm[3];

        mat3_apply(b->pose[link[k]].R, at->com_m, arm);
        work -= at->mass_kg * b->rig->body.gravity_m_s2 * (arm[2] + b->pose[link[k]].p[2]);
    }
    work += vec3_dot(force, b->pose[link[LEG_ANKLE_PITCH]].p);
    b->angle[axis] = before;
    body_place(&b->rig->body, b->angle, b->pose);
    return work;
}

/* Virtual work: the torque that holds is minus the derivative of the work. */
TEST(static_torques_hold_weight_and_force)
{
    static const double force[3] = {20, -30, 280}, down[3] = {0, 0, -1};
    const double turn = 1e-5;
    struct bench *b = *test_state;
    struct leg_geometry leg;
    struct error error;
    int link[LEG_JOINTS];

    assert_ok(leg_find(&b->rig->body, BODY_RIGHT, link, &leg, &error));
    for (int n = 0; n < 20; n++) {
        pose_at_random(b);
        for (int j = 0; j < LEG_JOINTS; j++) {
            double slope =
                (leg_work(b, link, j, force, turn) - leg_work(b, link, j, force, -turn)) /
                (2 * turn);
            double torque =
                body_static_torque(&b->rig->body, b->pose, link + j, (size_t)(LEG_JOINTS - j),
                                   force, b->pose[link[LEG_ANKLE_PITCH]].p, down);

            assert_true(fabs(torque + slope) < 1e-6);
        }
    }
}

TEST_GROUP(setup, teardown)
