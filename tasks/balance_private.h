/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the balance is made of: balance.c makes it and runs a period, balance_feet.c says what the
 * feet are to bear and where to be, balance_joints.c makes motor references of it. RT-safe.
 */
#ifndef TASKS_BALANCE_PRIVATE_H
#define TASKS_BALANCE_PRIVATE_H

#include "tasks/balance.h"
#include "tasks/leg.h"

struct balance_leg {
    int link[LEG_JOINTS], chain[LEG_JOINTS]; /* by enum leg_joint; from the pelvis to the foot */
    size_t axis[LEG_JOINTS];
    struct leg_geometry geometry;
    double inertia_kg_m2;      /* of the whole leg about its hip, in the posture */
    double sole_m[3];          /* of the sole in the foot's frame */
    struct gait_foothold foot; /* target of the sole */
    double touched_s;          /* how long it has borne a load */
    double turn[2];            /* of the foot by its center of pressure: roll, pitch */
    double stretch_m;          /* by the difference of the feet's forces */
    double cop_m[2];           /* wanted, in the sole's frame */
    double carries;
    double weight; /* share of the weight, wanted */
    double torque_nm[LEG_JOINTS];
    double motor_rad[LEG_JOINTS], rate_rad_s[LEG_JOINTS]; /* references of the motors */
};

struct balance {
    struct balance_config config;
    const struct body_model *model;
    struct host *host;
    struct servo *servo;
    struct estimator *estimator;
    struct gait gait;
    struct balance_leg leg[BODY_SIDES];
    const double *initial;
    struct servo_gains *gains; /* by axis */
    double *angle, *from;      /* by axis: references of the links; where they were at the start */
    struct body_pose *pose;    /* by link, of angle */
    double com_height_m, omega;
    double t_s;
    bool ready;
    double zmp[2];      /* wanted */
    double ground_m;    /* height under the pelvis */
    double pelvis_m[3]; /* wanted */
};

/* ---- balance_feet.c ---- */

/* What the gait is to know. */
void balance_measure(struct balance *balance, struct gait_measured *measured, double dt_s);

/* The wanted zero-moment point: the plan's, and against the error of the DCM. */
void balance_want_zmp(struct balance *balance);

/* Shares it among the feet: between them by weight, beside the line between them by their centers
 * of pressure. Each stays within its sole. */
void balance_share(struct balance *balance);

/* Turns the feet by what their moments are off, and stretches the legs by what the difference of
 * their forces is off. */
void balance_yield(struct balance *balance, double dt_s);

/* Leads the target of a foot to where the plan has it. */
void balance_target_foot(struct balance *balance, int side, double dt_s);

/* ---- balance_joints.c ---- */

/* Joint angles of a leg for a sole in the world under a pelvis in the world; false when it is out
 * of reach. */
bool balance_leg_angles(const struct balance_leg *leg, const double pelvis_R[9],
                        const double pelvis_p[3], const double sole_R[9], const double sole_p[3],
                        double angle[LEG_JOINTS]);

/* Where the center of mass is from the pelvis, in a frame turned by R, in the pose of the
 * references, which it places. */
void balance_com_offset(struct balance *balance, const double R[9], double offset[3]);

/* Pelvis and feet as they are to be, then the angles of the legs. */
void balance_pose_legs(struct balance *balance, double dt_s);

/* The torques of the legs when each foot bears its share of the weight at its wanted center of
 * pressure, along the line to the measured center of mass. */
void balance_load_legs(struct balance *balance);

/* And those that swing a leg. */
void balance_load_swing(struct balance *balance);

/* References of all motors: the link's angle and what the spring gives way by. take: how much of
 * the load, loose: how far from the pose at the start, 0 to 1. */
void balance_drive(struct balance *balance, double take, double loose, double dt_s);

#endif
