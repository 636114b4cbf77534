/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed-form kinematics of a leg with six joints. Angles in rad, in the order of enum leg_joint
 * whatever the leg's own order is; lengths in m; poses of the foot (the frame of its last joint) in
 * the frame of the pelvis. RT-safe but leg_find.
 *
 * Legs of two kinds. T is the thigh's and S the shank's length, k the knee's angle.
 *
 * Hip pitch, roll, yaw with axes that meet in one point; knee; ankle roll, pitch, whose axes meet
 * too (COMAN). In the foot's frame the hip is at Ry(-a2) Rx(-a1) (-T sin k, 0, S + T cos k) from
 * the ankle: k from its distance, ankle roll a1 from its y, ankle pitch a2 from the direction of
 * the rest; what is left of the foot's rotation is that of the hip, Ry Rx Rz (Siciliano et al.,
 * Robotics, 2009, sec. 2.12: spherical wrist).
 *
 * Hip roll; yaw and pitch, whose axes meet at d from a point of the roll axis; knee; ankle pitch,
 * roll (WALK-MAN). Three axes in a row are parallel (ibid.), so ankle and foot's x axis f stay in
 * the plane through yaw and pitch that Rx(h1) Rz(h2) turns. With a the ankle from that point of
 * the roll axis and ' for Rx(-h1), f'y (a'x - dx) = f'x (a'y - dy), where a'x and f'x are those of
 * the pelvis's frame:
 *
 *     (fx ay - fy (ax - dx)) cos h1 + (fx az - fz (ax - dx)) sin h1 = fx dy
 *
 * gives h1, the direction of f' yaw h2, and in the plane remain two links and what is left of the
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
    bool roll_first;                  /* the second kind */
    enum leg_joint chain[LEG_JOINTS]; /* from the pelvis to the foot */
    double hip[3];           /* point where the hip's last axes meet, at zero angles, in the
                              * pelvis's frame */
    double offset[3];        /* second kind: from the roll axis to there */
    double thigh_m, shank_m; /* hip to knee, knee to ankle */
};

/* Finds the links of a leg, by enum leg_joint, and its geometry; link[leg->chain[LEG_JOINTS -
 * 1]] is the foot. side: BODY_RIGHT or BODY_LEFT. ERROR_INPUT when the robot has no such leg,
 * says what differs. */
enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error);

/* Computes the joint angles for a pose of the foot; the knee bends forward (k >= 0). When the
 * foot is out of reach the leg stretches or folds in its direction as far as least_knee and
 * greatest_knee (rad) allow, and the result is false. Of the second kind the foot's pitch
 * against the pelvis, hip + knee + ankle, is within pi/2, and the hip above the ankle as seen
 * from the foot. */
bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS]);

#endif
