/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint trajectories from a file. The first line has the titles: time_s, and JOINT_rad or JOINT_deg
 * for each moving joint. The rows are ordered by time. Between rows, a joint moves linearly or on a
 * cubic. A cubic never leaves the range of its two rows (monotone: Fritsch and Butland, A method
 * for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5,
 * 1984). The rate of the cubics is continuous, and 0 at both ends of the trajectory. Units: rad, s.
 */
#ifndef TASKS_TRAJECTORY_H
#define TASKS_TRAJECTORY_H

#include "base/arena.h"
#include "base/csv.h"

enum trajectory_interpolation { TRAJECTORY_CUBIC, TRAJECTORY_LINEAR };

/* Limits of a joint. */
struct trajectory_limit {
    const char *joint;
    double lower_rad, upper_rad;
    double rate_rad_s; /* 0 = unknown; the limit is then 1000 rad/s */
};

struct trajectory {
    const char *path;
    size_t njoint;
    const size_t *joint;  /* njoint indices into the array of limits */
    size_t count;         /* number of rows, 2 or more */
    const double *time_s; /* count times; the first is 0 */
    const double *angle;  /* count rows of njoint */
    const double *slope;  /* rates at the rows, in the order of angle; NULL = linear */
};

/* Reads an open file and closes it. Checks titles, times, angles, and rates between rows against
 * the limits of the robot's joints. Returns ERROR_INPUT with file:line, ERROR_SYSTEM or
 * ERROR_MEMORY. The trajectory is in the arena. The file's path must outlive it. Not RT-safe. */
enum error_code trajectory_read(struct csv *csv, enum trajectory_interpolation interpolation,
                                const struct trajectory_limit *limit, size_t nlimit,
                                struct arena *arena, const struct trajectory **trajectory,
                                struct error *error);

/* Returns the duration of the trajectory, s. RT-safe. */
double trajectory_length_s(const struct trajectory *trajectory);

/* Computes angle and rate of joint number `joint` of the trajectory. Before the first row and after
 * the last row, the joint is at rest. RT-safe. */
void trajectory_at(const struct trajectory *trajectory, size_t joint, double t_s, double *angle_rad,
                   double *rate_rad_s);

#endif
