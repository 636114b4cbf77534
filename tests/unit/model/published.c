/* SPDX-License-Identifier: Apache-2.0 */
/* Each number of the robot files' bodies and joints against what is published: a digit that slips
 * in a file, an axis that is swapped or a row in the wrong place shows here. */
#include "tests/unit/model/published.h"
#include "base/array.h"
#include "tests/unit/model/coman.h"

#include <math.h>
#include <string.h>

static const struct robot *robot;

/* Unit vectors are made so when a file is read: published ones have nine digits. */
static void expect(const char *of, const char *what, double is, double published)
{
    if (!(fabs(is - published) <= 1e-9 * fabs(published))) {
        fail_msg("%s of %s is %.17g, published is %.17g", what, of, is, published);
    }
}

static void check_bodies(const struct published_body *body, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        int b = robot_find_body(robot, body[i].name);

        if (b < 0) {
            fail_msg("there is no body %s", body[i].name);
            return;
        }
        expect(body[i].name, "mass", robot->body[b].inertia.mass, body[i].mass);
        for (int k = 0; k < 3; k++) {
            expect(body[i].name, "center of mass", robot->body[b].inertia.com[k], body[i].com[k]);
        }
        for (int k = 0; k < 6; k++) {
            expect(body[i].name, "inertia", robot->body[b].inertia.I[k], body[i].I[k]);
        }
    }
}

/* Joints in this order, which is that of the generalized coordinates. */
static void check_joints(const struct published_joint *joint, size_t count)
{
    assert_int_equal(robot->njoint, count);
    for (size_t j = 0; j < count; j++) {
        const struct robot_joint *is = &robot->joint[j];
        const struct robot_body *child = &robot->body[j + 1];

        assert_string_equal(is->name, joint[j].name);
        assert_string_equal(child->name, joint[j].child);
        assert_string_equal(robot->body[child->parent].name, joint[j].parent);
        assert_int_equal(is->type, JOINT_REVOLUTE);
        for (int k = 0; k < 3; k++) {
            expect(is->name, "axis", is->axis[k], joint[j].axis[k]);
            expect(is->name, "origin", is->origin[k], joint[j].origin[k]);
        }
        for (int k = 0; k < 9; k++) {
            const double c = cos(joint[j].yaw), s = sin(joint[j].yaw);
            const double turned[9] = {c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0};

            expect(is->name, "rotation", is->rotation[k], turned[k]);
        }
        expect(is->name, "lower limit", is->lower, joint[j].lower);
        expect(is->name, "upper limit", is->upper, joint[j].upper);
        expect(is->name, "torque limit", is->torque_limit, joint[j].torque);
        expect(is->name, "spring", is->sea.Ks, joint[j].Ks);
        expect(is->name, "spring damping", is->sea.Ds, joint[j].Ds);
    }
}

TEST_WITH(coman_is_as_published, open_arena, close_arena)
{
    robot = load_coman(NULL);
    assert_true(robot->floating);
    assert_int_equal(robot->nbody, 24);
    assert_true(fabs(robot->total_mass - 28.3574) < 1e-4);
    expect("COMAN", "gravity", robot->gravity[2], -9.81);
    check_bodies(coman_bodies, ARRAY_COUNT(coman_bodies));
    check_joints(coman_joints, ARRAY_COUNT(coman_joints));

    /* One drive, link side of a gear of 100: CoManRobotranSimulator 6b3cc1b */
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_sea *sea = &robot->joint[j].sea;

        assert_int_equal(robot->joint[j].paper_index, j + 7);
        expect(robot->joint[j].name, "J", sea->J, (5.4e-6 + 8.47e-6) * 1e4);
        expect(robot->joint[j].name, "Dm", sea->Dm, 1.9958e-5 * 1e4);
        expect(robot->joint[j].name, "N", sea->N, 100.0);
        expect(robot->joint[j].name, "Kt", sea->Kt, 0.041 * 100.0);
        expect(robot->joint[j].name, "Kw", sea->Kw, 0.041 * 100.0);
        expect(robot->joint[j].name, "R", sea->R, 0.664);
        expect(robot->joint[j].name, "L", sea->L, 0.32e-3);
    }
}

TEST_WITH(walkman_is_as_published, open_arena, close_arena)
{
    struct error error;

    assert_no_error(
        robot_load(HIL_SOURCE_DIR "/config/robots/walkman.yaml", NULL, &arena, &robot, &error),
        error.text);
    assert_int_equal(robot->nbody, ARRAY_COUNT(walkman_bodies) + 3); /* two elbows, the neck */
    check_bodies(walkman_bodies, ARRAY_COUNT(walkman_bodies));
    check_joints(walkman_joints, ARRAY_COUNT(walkman_joints));
}

/* How far a capsule is from being the mirror image in y of another. Its axis is a line: its sense
 * does not matter. */
static double capsules_differ(const struct robot_capsule *a, const struct robot_capsule *b)
{
    static const double mirror[3] = {1.0, -1.0, 1.0};
    double apart = fabs(a->radius - b->radius) + fabs(a->length - b->length);
    double same = 0.0, opposite = 0.0;

    for (int k = 0; k < 3; k++) {
        double axis = mirror[k] * b->rotation[3 * k + 2];

        apart += fabs(a->position[k] - mirror[k] * b->position[k]);
        same += fabs(a->rotation[3 * k + 2] - axis);
        opposite += fabs(a->rotation[3 * k + 2] + axis);
    }
    return apart + fmin(same, opposite);
}

/* The distance of a left capsule from its image on the body of the right; -1 = it is not left. */
static double capsule_without_image(const struct robot_capsule *left)
{
    const char *body = robot->body[left->body].name;
    double nearest = (double)INFINITY;

    if (body[0] != 'L') {
        return -1.0;
    }
    for (size_t k = 0; k < robot->ncapsule; k++) {
        const struct robot_capsule *right = &robot->capsule[k];
        const char *other = robot->body[right->body].name;

        if (other[0] == 'R' && strcmp(other + 1, body + 1) == 0) {
            nearest = fmin(nearest, capsules_differ(left, right));
        }
    }
    return nearest;
}

/* The capsules are not published. COMAN's meshes, which they are laid about, differ by a
 * millimeter from left to right. */
TEST_WITH(left_capsules_mirror_right_ones, open_arena, close_arena)
{
    static const char *const files[] = {COMAN, HIL_SOURCE_DIR "/config/robots/walkman.yaml"};

    for (size_t f = 0; f < 2; f++) {
        struct error error;
        size_t left = 0;

        assert_ok(robot_load(files[f], NULL, &arena, &robot, &error));
        for (size_t c = 0; c < robot->ncapsule; c++) {
            double apart = capsule_without_image(&robot->capsule[c]);

            left += apart >= 0.0;
            if (apart > (f == 0 ? 1.1e-3 : 1e-6)) {
                fail_msg("%s is %g from the image of a right one", robot->capsule[c].name, apart);
            }
        }
        assert_true(left >= 7);
    }
}

/* The room of a spring is not published: as the files say, it carries the limit of its joint and a
 * tenth more, to the digits that are written. */
TEST_WITH(springs_carry_a_tenth_more_than_their_joints, open_arena, close_arena)
{
    static const char *const files[] = {COMAN, HIL_SOURCE_DIR "/config/robots/walkman.yaml"};

    for (size_t f = 0; f < 2; f++) {
        struct error error;

        assert_ok(robot_load(files[f], NULL, &arena, &robot, &error));
        for (size_t j = 0; j < robot->njoint; j++) {
            const struct robot_joint *joint = &robot->joint[j];
            const double room = joint->sea.deflection;
            const double wanted = 1.1 * joint->torque_limit / joint->sea.Ks;

            if (room != 0.0 && fabs(room - wanted) > 0.06 * wanted) { /* 0: without end */
                fail_msg("%s: %g rad, not %g", joint->name, room, wanted);
            }
        }
    }
}

/* ---- what hangs below the force-torque sensors ---- */

static void check_distal(const char *sensor, double mass, const double com[3], const double I[6])
{
    for (size_t i = 0; i < robot->nft; i++) {
        const struct robot_inertia *distal = &robot->ft[i].distal;

        if (strcmp(robot->ft[i].name, sensor) != 0) {
            continue;
        }
        expect(sensor, "mass", distal->mass, mass);
        for (int k = 0; k < 3; k++) {
            expect(sensor, "center of mass", distal->com[k], com[k]);
        }
        for (int k = 0; k < 6; k++) {
            expect(sensor, "inertia", distal->I[k], I[k]);
        }
        return;
    }
    fail_msg("no sensor %s", sensor);
}

/* The left one of a pair. */
static void check_mirrored_distal(const char *sensor, double mass, const double com[3],
                                  const double I[6])
{
    const double left_com[3] = {com[0], -com[1], com[2]};
    const double left_I[6] = {I[0], -I[1], I[2], I[3], -I[4], I[5]};

    check_distal(sensor, mass, left_com, left_I);
}

/* Of a leg the part of the foot below the sensor, body RFoot of walkman_robotran_edu_2017's .mbs,
 * in the sensor's frame there; of an arm the URDF's link RSoftHandLink, whose frame is 0.0565 above
 * the sensor. */
TEST_WITH(walkman_sensors_carry_what_is_published, open_arena, close_arena)
{
    static const double foot_com[3] = {-3.027e-05, -0.00732204, -0.02652797};
    static const double foot_I[6] = {0.00404802, 4.015e-05, 4.5e-06,
                                     0.01506731, 9.115e-05, 0.01850301};
    static const double hand_com[3] = {0.011908576, 0.0021833446, -0.15361558 + 0.0565};
    static const double hand_I[6] = {0.000683333333333, 0.0, 0.0,
                                     0.000683333333333, 0.0, 0.000533333333333};
    struct error error;

    assert_no_error(
        robot_load(HIL_SOURCE_DIR "/config/robots/walkman.yaml", NULL, &arena, &robot, &error),
        error.text);
    check_distal("r_leg_ft", 2.23134, foot_com, foot_I);
    check_mirrored_distal("l_leg_ft", 2.23134, foot_com, foot_I);
    check_distal("r_arm_ft", 0.5, hand_com, hand_I);
    check_mirrored_distal("l_arm_ft", 0.5, hand_com, hand_I);
}

/* Forearm, wrist (two bodies) and hand of coman_urdf/urdf/parts/{forearms,soft_hand}.urdf.xacro,
 * one below the other on the sensor's axis: mass, where its center is below the sensor, Ixx = Iyy
 * and Izz about it. */
TEST_WITH(coman_s_sensors_carry_forearm_wrist_and_hand, open_arena, close_arena)
{
    static const struct {
        double mass, below, Ixx, Izz;
    } part[] = {
        {0.93351655, 0.0282, 0.001, 0.001},
        {0.26070556, 0.08688, 0.000132, 5.213e-05},
        {0.054007518, 0.08688, 2.16e-05, 2.16e-05},
        {0.3, 0.08688 + 0.07, 0.001, 0.001},
    };
    double mass = 0.0, com[3] = {0.0}, I[6] = {0.0};
    struct error error;

    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        mass += part[i].mass;
        com[2] -= part[i].mass * part[i].below;
    }
    com[2] /= mass;
    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        const double off = -part[i].below - com[2];

        I[0] += part[i].Ixx + part[i].mass * off * off;
        I[5] += part[i].Izz;
    }
    I[3] = I[0];
    assert_no_error(robot_load(COMAN, "forearms", &arena, &robot, &error), error.text);
    check_distal("r_arm_ft", mass, com, I);
    check_mirrored_distal("l_arm_ft", mass, com, I);
}

/* ---- the capsule about the waist's joints ---- */

/* Roll and pitch of COMAN's waist meet 0.04749999 below the yaw (coman_urdf/urdf/parts/
 * torso.urdf.xacro). The capsule about them lies across, holds that point well inside, the centers
 * of mass of both bodies between, and is no thicker than the trunk, which it joins. */
TEST_WITH(the_waist_s_capsule_is_where_its_axes_meet, open_arena, close_arena)
{
    static const double meet = -0.04749999;
    static const double centers[2][3] = {{0.00042999707, -0.0097650317, 0.033011157},   /* DWL */
                                         {-0.0021273416, 0.0033575235, -0.0010076896}}; /* DWS */
    const struct robot_capsule *capsule = NULL, *trunk = NULL;
    struct error error;
    double reach;

    assert_ok(robot_load(COMAN, NULL, &arena, &robot, &error));
    for (size_t c = 0; c < robot->ncapsule; c++) {
        capsule = strcmp(robot->capsule[c].name, "waist_joint") ? capsule : &robot->capsule[c];
        trunk = strcmp(robot->capsule[c].name, "trunk") ? trunk : &robot->capsule[c];
    }
    assert_true(capsule && trunk);
    assert_string_equal(robot->body[capsule->body].name, "DWYTorso");
    assert_true(fabs(capsule->rotation[2]) < 1e-3 && fabs(capsule->rotation[8]) < 1e-3);
    assert_true(fabs(capsule->position[0]) < 1e-4 && fabs(capsule->position[1]) < 1e-4);
    assert_true(fabs(capsule->position[2] - meet) < 0.01);
    for (int i = 0; i < 2; i++) {
        const double along = fmax(fabs(centers[i][1]) - 0.5 * capsule->length, 0.0);

        reach = sqrt(along * along + centers[i][0] * centers[i][0] +
                     pow(centers[i][2] + meet - capsule->position[2], 2.0));
        assert_true(reach < 0.75 * capsule->radius);
    }
    reach = 0.5 * capsule->length + capsule->radius;
    assert_true(fabs(reach - 0.0741) < 1e-3 && reach < trunk->radius); /* assumed: the housings */
    assert_true(capsule->position[2] + capsule->radius >
                trunk->position[2] - trunk->radius - 0.5 * trunk->length);
}
