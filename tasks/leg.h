/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed-form kinematics of a leg with six joints. Angles in rad, in the order of enum leg_joint
 * for every leg; lengths in m. The pose of the foot is the frame of its last joint in the frame of
 * the pelvis. RT-safe except leg_find.
 *
 * There are two kinds of legs. T is the length of the thigh, S of the shank, k the angle of the
 * knee.
 *
 * First kind (COMAN): hip pitch, roll, yaw with axes that meet in one point; knee; ankle pitch,
 * roll, with axes that meet in another. In the foot's frame, the hip is at Ry(-a2) Rx(-a1) (-T sin
 * k, 0, S + T cos k) from the ankle. The distance gives k, its y the ankle roll a1, the direction
 * of the rest the ankle pitch a2. The remaining rotation of the foot is the hip's, Ry Rx Rz
 * (Siciliano et al., Robotics, 2009, sec. 2.12: spherical wrist).
 *
 * Second kind (WALK-MAN): hip roll; yaw and pitch, with axes that meet at d from a point of the
 * roll axis; knee; ankle pitch, roll. Three consecutive axes are parallel (ibid.). Ankle and x axis
 * f of the foot therefore stay in the plane through yaw and pitch, which Rx(h1) Rz(h2) turns. Let a
 * be the ankle from that point of the roll axis, and ' mean Rx(-h1). Then f'y (a'x - dx) = f'x (a'y
 * - dy), where a'x and f'x are the values in the pelvis's frame:
 *
 *     (fx ay - fy (ax - dx)) cos h1 + (fx az - fz (ax - dx)) sin h1 = fx dy
 *
 * gives h1. The direction of f' gives the yaw h2. In the plane remain two links and the rest of the
 * foot's rotation, Ry Rx.
 */
#ifndef TASKS_LEG_H
#define TASKS_LEG_H

#include "base/error.h"
#include "tasks/body_model.h"

#include <stdbool.h>

enum leg_joint {
    LEG_HIP_PITCH,
    LEG_HIP_ROLL,
    LEG_HIP_YAW,
    LEG_KNEE,
    LEG_ANKLE_ROLL,
    LEG_ANKLE_PITCH,
    LEG_JOINTS
};

struct leg_geometry {
    bool roll_first;                  /* second kind */
    enum leg_joint chain[LEG_JOINTS]; /* from the pelvis to the foot */
    /* point where the last hip axes meet, at zero angles, in the pelvis's frame */
    double hip[3];
    double offset[3];        /* second kind: from the roll axis to this point */
    double thigh_m, shank_m; /* hip to knee, knee to ankle */
};

/* Finds the links of a leg, by enum leg_joint, and its geometry. link[leg->chain[LEG_JOINTS - 1]]
 * is the foot. side: BODY_RIGHT or BODY_LEFT. ERROR_INPUT says how the robot's leg differs. */
enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error);

/* Computes the joint angles for a pose of the foot; the knee bends forward (k >= 0). Returns false
 * when the foot is out of reach. The leg then points to the foot and stretches or folds as far as
 * least_knee and greatest_knee (rad) allow. Second kind: the foot's pitch against the pelvis, hip +
 * knee + ankle, is within pi/2, and the hip is above the ankle as seen from the foot. */
bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS]);

#endif
