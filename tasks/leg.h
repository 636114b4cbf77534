/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed-form kinematics of a leg with six joints: hip pitch, roll and yaw, whose axes meet in one
 * point; knee; ankle roll and pitch, whose axes meet too. Angles in rad in this order, lengths in
 * m; poses of the foot (its ankle pitch frame) in the frame of the pelvis. RT-safe but leg_find.
 *
 * With T the thigh's and S the shank's length, in the foot's frame the hip is at
 * Ry(-a2) Rx(-a1) (-T sin k, 0, S + T cos k) from the ankle: knee k from its distance, ankle roll
 * a1 from its y, ankle pitch a2 from the direction of the rest; what is left of the foot's rotation
 * is that of the hip, Ry Rx Rz (Siciliano et al., Robotics, 2009, sec. 2.12: spherical wrist).
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
    double hip[3];           /* where the hip's axes meet, in the pelvis */
    double thigh_m, shank_m; /* hip to knee, knee to ankle */
};

/* The links of a leg, from the hip's to the foot, and its lengths. side: BODY_RIGHT or BODY_LEFT.
 * ERROR_INPUT when the robot has no such leg, says what differs. */
enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error);

/* The foot's pose for joint angles. */
void leg_forward(const struct leg_geometry *leg, const double angle[LEG_JOINTS],
                 struct body_pose *foot);

/* Joint angles for a pose of the foot; the knee bends forward (k >= 0). When the foot is out of
 * reach the leg stretches or folds in its direction as far as least_knee and greatest_knee (rad)
 * allow, and the result is false. */
bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS]);

#endif
