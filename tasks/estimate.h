/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state of a walking robot from its boards alone: attitude of the pelvis from the inertial
 * board, pose by leg odometry through the link encoders of the loaded feet, center of mass from the
 * masses of the links and the feet's forces, centers of pressure from the force-torque sensors.
 *
 * World: z up, origin between the soles and heading as at the start; it drifts as odometry does.
 * SI units. RT-safe after creation.
 */
#ifndef TASKS_ESTIMATE_H
#define TASKS_ESTIMATE_H

#include "tasks/body_model.h"
#include "tasks/host.h"

#include <stdbool.h>

struct estimate_foot {
    struct body_pose sole; /* its pose in the world */
    double force_n[3];     /* force of the ground on the foot, world */
    double cop_m[2];       /* center of pressure in the sole's frame; 0 while it is not loaded */
    bool loaded;
    double anchor[3]; /* position where the sole stands, world; of a foot in the air: where it is */
    double yaw_rad;
};

struct estimate {
    double R[9];          /* rotation pelvis to world */
    double rate_rad_s[3]; /* angular velocity of the pelvis, in its own frame */
    double pitch_rad, roll_rad, yaw_rad;
    double pelvis_m[3]; /* origin of the pelvis, world */
    double com_m[3], com_m_s[3];
    struct estimate_foot foot[BODY_SIDES];
    double zmp_m[2]; /* zero-moment point of both feet together, world */
};

struct estimator;

/* Creates the estimator in the arena. Needs the inertial board, both feet's force-torque boards
 * and soles; ERROR_INPUT otherwise. */
enum error_code estimator_create(const struct estimate_config *config,
                                 const struct body_model *model, struct host *host,
                                 struct arena *arena, struct estimator **estimator,
                                 struct error *error);

/* Sets the origin of the world. The robot must stand on both feet. */
void estimator_start(struct estimator *estimator);

/* Updates the estimate by one control period, dt_s. walks: the robot is told to walk, at
 * speed_m_s (not negative). */
void estimator_update(struct estimator *estimator, bool walks, double speed_m_s, double dt_s);

const struct estimate *estimator_read(const struct estimator *estimator);

#endif
