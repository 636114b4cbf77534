/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of the balance controller: balance.c creates it and runs a period, balance_feet.c
 * distributes the load and places the feet, balance_joints.c computes the motors' references.
 * RT-safe.
 */
#ifndef TASKS_BALANCE_PRIVATE_H
#define TASKS_BALANCE_PRIVATE_H

#include "tasks/balance.h"
#include "tasks/leg.h"

struct balance_leg {
    int link[LEG_JOINTS], chain[LEG_JOINTS]; /* link by enum leg_joint; links from the pelvis to
                                              * the foot */
    size_t axis[LEG_JOINTS];
    struct leg_geometry geometry;
    double inertia_kg_m2;      /* inertia of the whole leg about its hip, in the posture */
    double sole_m[3];          /* origin of the sole in the foot's frame */
    struct gait_foothold foot; /* target of the sole */
    double touched_s;          /* how long it has been loaded */
    double turn[2];            /* compliant tilt of the foot: roll, pitch, rad */
    double stretch_m;          /* compliant length of the leg */
    double cop_m[2];           /* wanted center of pressure, in the sole's frame */
    double carries;
    double weight; /* wanted share of the weight, 0 to 1 */
    double torque_nm[LEG_JOINTS];
    double motor_rad[LEG_JOINTS], rate_rad_s[LEG_JOINTS]; /* motor references */
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
    double ground_m;    /* ground height under the pelvis, smoothed */
    double pelvis_m[3]; /* wanted */
};

/* ---- balance_feet.c ---- */

/* Fills what the gait measures: footholds, contact, vertical forces, center of mass and DCM. */
void balance_measure(struct balance *balance, struct gait_measured *measured, double dt_s);

/* Computes the wanted zero-moment point: the plan's, plus feedback on the error of the DCM. */
void balance_want_zmp(struct balance *balance);

/* Distributes it to the feet: along the line between them by their shares of the weight, across
 * it by their centers of pressure, each limited to its sole. */
void balance_share(struct balance *balance);

/* Makes the feet comply: tilts the soles by the errors of their moments and changes the legs'
 * lengths by the error of the difference of their forces. */
void balance_yield(struct balance *balance, double dt_s);

/* Moves the target of a foot toward the plan. */
void balance_target_foot(struct balance *balance, int side, double dt_s);

/* ---- balance_joints.c ---- */

/* Computes the joint angles of a leg from the poses of pelvis and sole in the world. Returns
 * false when the sole is out of reach; the angles are then the nearest. */
bool balance_leg_angles(const struct balance_leg *leg, const double pelvis_R[9],
                        const double pelvis_p[3], const double sole_R[9], const double sole_p[3],
                        double angle[LEG_JOINTS]);

/* Places the links in the pose of the references and computes the vector from the pelvis to the
 * center of mass, in a frame turned by R. */
void balance_com_offset(struct balance *balance, const double R[9], double offset[3]);

/* Computes the poses of pelvis and feet for this period, then the joint angles of the legs. */
void balance_pose_legs(struct balance *balance, double dt_s);

/* Computes the static torques of the legs when each foot carries its share of the weight at its
 * wanted center of pressure, the force pointing along the line to the center of mass. */
void balance_load_legs(struct balance *balance);

/* Adds the torques that accelerate the swinging leg. */
void balance_load_swing(struct balance *balance);

/* Sets the references of all motors: the link's angle plus the deflection of the spring under
 * its load. take: fraction of the load, loose: fraction of the way from the pose at the start, 0
 * to 1. */
void balance_drive(struct balance *balance, double take, double loose, double dt_s);

#endif
