/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One squat of COMAN, 10 cm deep in 2 s, for the tests of the implicit integrator: references of
 * the legs' pitch joints in a rig_scene. Include after cmocka.
 */
#ifndef TESTS_PHYSICS_RIG_SQUAT_H
#define TESTS_PHYSICS_RIG_SQUAT_H

#include "tests/physics/rig_scene.h"

static const double squat_depth_m = 0.1, squat_period_s = 2.0;
static const double thigh_m = 0.2258, shank_m = 0.201;

/* Angles of hip, knee and ankle with the hips sunk by depth vertically over flat feet, trunk and
 * feet turned as at the start. */
static inline void rig_squat_angles(const double start[3], double depth, double angle[3])
{
    double lean = start[0] + start[1] + start[2], thigh = -(start[1] + start[2]);
    double height = thigh_m * cos(thigh) + shank_m * cos(thigh + start[1]) - depth;
    double ahead = thigh_m * sin(thigh) + shank_m * sin(thigh + start[1]);
    double square = height * height + ahead * ahead, turned;

    angle[1] = acos((square - thigh_m * thigh_m - shank_m * shank_m) / (2.0 * thigh_m * shank_m));
    turned =
        atan2(ahead, height) - atan2(shank_m * sin(angle[1]), thigh_m + shank_m * cos(angle[1]));
    angle[0] = turned + lean;
    angle[2] = -turned - angle[1];
}

/* Sets the references of the legs t s after the squat's begin, from those that keep the start;
 * before the begin and after the end the robot stands. */
static inline void rig_squat_refer(struct rig_scene *scene, const double settled[RIG_SCENE_JOINTS],
                                   double t)
{
    static const char *const pitch[2][3] = {{"RHipSag", "RKneeSag", "RAnkSag"},
                                            {"LHipSag", "LKneeSag", "LAnkSag"}};
    double depth;

    t = fmax(0.0, fmin(squat_period_s, t));
    depth = 0.5 * squat_depth_m * (1.0 - cos(2.0 * M_PI * t / squat_period_s));
    for (int side = 0; side < 2; side++) {
        double start[3], angle[3];
        int joint[3];

        for (int n = 0; n < 3; n++) {
            joint[n] = robot_find_joint(scene->robot, pitch[side][n]);
            assert_true(joint[n] >= 0);
            start[n] = scene->rig->joint[joint[n]];
        }
        rig_squat_angles(start, depth, angle);
        for (int n = 0; n < 3; n++) {
            scene->reference[joint[n]] = settled[joint[n]] + angle[n] - start[n];
        }
    }
}

#endif
