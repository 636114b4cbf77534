/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Moves a reference to a goal with bounded rate and acceleration: it speeds up, moves at its
 * greatest rate, and slows down so that it comes to rest at the goal without overshoot. The goal
 * may change at any time, also to the other side. rad, s. RT-safe.
 */
#ifndef TASKS_MOTION_PROFILE_H
#define TASKS_MOTION_PROFILE_H

struct motion_profile {
    double angle_rad, rate_rad_s; /* the reference */
};

/* Moves the reference by one step of dt_s > 0. rate_rad_s, acceleration_rad_s2: its bounds, > 0. */
void motion_profile_step(struct motion_profile *profile, double goal_rad, double rate_rad_s,
                         double acceleration_rad_s2, double dt_s);

#endif
