/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Estimates the state of a walking robot, only from its boards. The inertial board gives the
 * attitude of the pelvis. Leg odometry gives the position of the pelvis, from the link encoders and
 * the loaded feet. The masses of the links and the forces of the feet give the center of mass. The
 * force-torque sensors give the centers of pressure.
 *
 * World frame: z up; origin between the soles, and heading of the robot, at the start. The
 * estimated position drifts, as with any odometry. SI units. RT-safe after creation.
 */
#ifndef TASKS_ESTIMATE_H
#define TASKS_ESTIMATE_H

#include "tasks/host.h"

struct estimate_foot {
    struct body_pose sole; /* pose of the sole in the world */
    double force_n[3];     /* force of the ground on the foot, world frame */
    /* center of pressure in the sole's frame; 0 while the foot is unloaded */
    double cop_m[2];
    bool loaded;
    /* position of the standing sole in the world; for a foot in the air, its present position */
    double anchor[3];
    double yaw_rad;
};

struct estimate {
    double R[9];          /* rotation from pelvis to world */
    double rate_rad_s[3]; /* angular velocity of the pelvis in its own frame */
    double pitch_rad, roll_rad, yaw_rad;
    double pelvis_m[3]; /* origin of the pelvis in the world */
    double com_m[3], com_m_s[3];
    struct estimate_foot foot[BODY_SIDES];
    double zmp_m[2]; /* zero-moment point of both feet together, in the world */
};

struct estimator;

/* Creates the estimator in the arena. Returns ERROR_INPUT if the inertial board is missing, or a
 * foot's force-torque board or sole. */
enum error_code estimator_create(const struct estimate_config *config,
                                 const struct body_model *model, struct host *host,
                                 struct arena *arena, struct estimator **estimator,
                                 struct error *error);

/* Sets the origin of the world. The robot must stand on both feet. */
void estimator_start(struct estimator *estimator);

/* Advances the estimate by dt_s. walks: the robot is commanded to walk, at speed_m_s (>= 0). */
void estimator_update(struct estimator *estimator, bool walks, double speed_m_s, double dt_s);

const struct estimate *estimator_read(const struct estimator *estimator);

#endif
