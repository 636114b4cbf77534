/* SPDX-License-Identifier: Apache-2.0 */
/* Each number of the robot files' bodies and joints against what is published: a digit that slips
 * in a file, an axis that is swapped or a row in the wrong place shows here. */
#include "base/array.h"
#include "tests/unit/model/coman.h"

static const struct robot *robot;

/* Unit vectors are made so when a file is read: published ones have nine digits. */
static void expect(const char *of, const char *what, double is, double published)
{
    if (!(fabs(is - published) <= 1e-9 * fabs(published))) {
        fail_msg("%s of %s is %.17g, published is %.17g", what, of, is, published);
    }
}

/* Checks an inertia against mass, center of mass and moments. */
static void check_inertia(const char *of, const struct robot_inertia *is, const double v[10])
{
    expect(of, "mass", is->mass, v[0]);
    for (int k = 0; k < 3; k++) {
        expect(of, "center of mass", is->com[k], v[1 + k]);
    }
    for (int k = 0; k < 6; k++) {
        expect(of, "inertia", is->I[k], v[4 + k]);
    }
}

/* Checks a joint against its row: axis, origin, yaw, lower, upper, torque, Ks, Ds. */
static void check_joint(const struct robot_joint *is, const double v[12])
{
    const double c = cos(v[6]), s = sin(v[6]);
    const double turned[9] = {c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0};

    assert_int_equal(is->type, JOINT_REVOLUTE);
    for (int k = 0; k < 3; k++) {
        expect(is->name, "axis", is->axis[k], v[k]);
        expect(is->name, "origin", is->origin[k], v[3 + k]);
    }
    for (int k = 0; k < 9; k++) {
        expect(is->name, "rotation", is->rotation[k], turned[k]);
    }
    expect(is->name, "lower limit", is->lower, v[7]);
    expect(is->name, "upper limit", is->upper, v[8]);
    expect(is->name, "torque limit", is->torque_limit, v[9]);
    expect(is->name, "spring", is->sea.Ks, v[10]);
    expect(is->name, "spring damping", is->sea.Ds, v[11]);
}

/* Checks the robot against its rows in published.txt. Returns the number of bodies. */
static size_t check_published(const char *name)
{
    FILE *in = fopen(HIL_SOURCE_DIR "/tests/unit/model/published.txt", "r");
    char line[512], of[32], what[16], text[3][32];
    size_t bodies = 0, joints = 0;

    assert_non_null(in);
    while (fgets(line, sizeof line, in)) {
        double v[12];
        int used = 0, count = 0;

        if (line[0] == '#' || sscanf(line, "%31s %15s %31s %n", of, what, text[0], &used) != 3 ||
            strcmp(of, name) != 0) {
            continue;
        }
        if (strcmp(what, "joint") == 0) {
            int more = 0;

            assert_int_equal(sscanf(line + used, "%31s %31s %n", text[1], text[2], &more), 2);
            used += more;
        }
        for (char *at = line + used, *end; count < 12; count++, at = end) {
            v[count] = strtod(at, &end);
            if (end == at) {
                break;
            }
        }
        if (strcmp(what, "joint") == 0) {
            const struct robot_joint *joint = &robot->joint[joints];
            const struct robot_body *child = &robot->body[++joints];

            assert_int_equal(count, 12);
            assert_true(joints <= robot->njoint);
            assert_string_equal(joint->name, text[0]);
            assert_string_equal(robot->body[child->parent].name, text[1]);
            assert_string_equal(child->name, text[2]);
            check_joint(joint, v);
        } else {
            assert_int_equal(count, 10);
            bodies++;
            check_inertia(text[0], &robot->body[robot_find_body(robot, text[0])].inertia, v);
        }
    }
    fclose(in);
    assert_int_equal(joints, robot->njoint);
    return bodies;
}

TEST_WITH(coman_is_as_published, open_arena, close_arena)
{
    robot = load_coman(NULL);
    assert_true(robot->floating);
    assert_int_equal(robot->nbody, 24);
    assert_true(fabs(robot->total_mass - 28.3574) < 1e-4);
    expect("COMAN", "gravity", robot->gravity[2], -9.81);
    assert_int_equal(check_published("coman"), 24);

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
    assert_int_equal(robot->nbody, check_published("walkman") + 3); /* two elbows, the neck */
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

/* Checks the inertia below a sensor; the sensors of the left side carry the mirror image. */
static void check_distal(const char *sensor, const double right[10])
{
    const double mirror = sensor[0] == 'l' ? -1.0 : 1.0;
    const double v[10] = {right[0],          right[1],          mirror * right[2], right[3],
                          right[4],          mirror * right[5], right[6],          right[7],
                          mirror * right[8], right[9]};

    for (size_t i = 0; i < robot->nft; i++) {
        if (strcmp(robot->ft[i].name, sensor) == 0) {
            check_inertia(sensor, &robot->ft[i].distal, v);
            return;
        }
    }
    fail_msg("no sensor %s", sensor);
}

/* Of a leg the part of the foot below the sensor, body RFoot of walkman_robotran_edu_2017's .mbs,
 * in the sensor's frame there; of an arm the URDF's link RSoftHandLink, whose frame is 0.0565 above
 * the sensor. */
TEST_WITH(walkman_sensors_carry_what_is_published, open_arena, close_arena)
{
    static const double foot[10] = {2.23134,   -3.027e-05, -0.00732204, -0.02652797, 0.00404802,
                                    4.015e-05, 4.5e-06,    0.01506731,  9.115e-05,   0.01850301};
    static const double hand[10] = {
        0.5, 0.011908576,       0.0021833446, -0.15361558 + 0.0565, 0.000683333333333, 0.0,
        0.0, 0.000683333333333, 0.0,          0.000533333333333};
    struct error error;

    assert_no_error(
        robot_load(HIL_SOURCE_DIR "/config/robots/walkman.yaml", NULL, &arena, &robot, &error),
        error.text);
    check_distal("r_leg_ft", foot);
    check_distal("l_leg_ft", foot);
    check_distal("r_arm_ft", hand);
    check_distal("l_arm_ft", hand);
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
    double all[10] = {0.0}, *mass = &all[0], *z = &all[3];
    struct error error;

    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        *mass += part[i].mass;
        *z -= part[i].mass * part[i].below;
    }
    *z /= *mass;
    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        const double off = -part[i].below - *z;

        all[4] += part[i].Ixx + part[i].mass * off * off;
        all[9] += part[i].Izz;
    }
    all[7] = all[4];
    assert_no_error(robot_load(COMAN, "forearms", &arena, &robot, &error), error.text);
    check_distal("r_arm_ft", all);
    check_distal("l_arm_ft", all);
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
