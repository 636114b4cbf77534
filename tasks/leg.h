/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed-form inverse kinematics of a leg with six joints. Angles are in rad, in the order of enum
 * leg_joint for every leg. Lengths are in m. The pose of the foot is the frame of the last joint,
 * in the frame of the pelvis. RT-safe except leg_find.
 *
 * There are two kinds of legs. T is the length of the thigh, S the length of the shank, k the angle
 * of the knee.
 *
 * First kind (COMAN). The joints are hip pitch, roll and yaw, knee, ankle pitch and roll. The hip
 * axes meet in one point, and the ankle axes meet in another point. In the foot's frame, the vector
 * from ankle to hip is Ry(-a2) Rx(-a1) (-T sin k, 0, S + T cos k). Its length gives the knee's
 * angle k. Its y component gives the ankle roll a1. The direction of its x and z components gives
 * the ankle pitch a2. The hip's angles give the remaining rotation of the foot, Ry Rx Rz (Siciliano
 * et al., Robotics, 2009, sec. 2.12: spherical wrist).
 *
 * Second kind (WALK-MAN). The joints are hip roll, yaw and pitch, knee, ankle pitch and roll. The
 * yaw and pitch axes meet at the offset d from a point P of the roll axis. The three pitch axes are
 * parallel (ibid.). The ankle and the foot's x axis f therefore stay in one plane, which Rx(h1)
 * Rz(h2) turns. Let a be the vector from P to the ankle, and let ' mean multiplication by Rx(-h1).
 * Then f'y (a'x - dx) = f'x (a'y - dy). Rx does not change x components, so a'x = ax and f'x = fx.
 * The equation
 *
 *     (fx ay - fy (ax - dx)) cos h1 + (fx az - fz (ax - dx)) sin h1 = fx dy
 *
 * gives the roll h1. The direction of f' gives the yaw h2. The rest is a chain of two links in the
 * plane, and the remaining rotation of the foot, Ry Rx.
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
    double offset[3];        /* second kind: d, from the roll axis to `hip` */
    double thigh_m, shank_m; /* hip to knee, knee to ankle */
};

/* Finds the links of a leg, by enum leg_joint, and the leg's geometry. The foot is
 * link[leg->chain[LEG_JOINTS - 1]]. side: BODY_RIGHT or BODY_LEFT. Returns ERROR_INPUT, with a
 * description of the difference, if the leg is of neither kind. */
enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error);

/* Computes the joint angles for a pose of the foot. The knee bends forward (k >= 0). Returns false
 * if the foot is out of reach. The leg then points to the foot, and the knee is at its limit,
 * least_knee or greatest_knee (rad). Second kind: valid if the foot's pitch against the pelvis,
 * hip + knee + ankle, is within pi/2, and if the hip is above the ankle in the foot's frame. */
bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS]);

#endif
