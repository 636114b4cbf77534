/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint trajectories from a file: a line of titles, time_s and a column JOINT_rad or JOINT_deg for
 * each joint that moves, then rows in the order of time. Between the rows a joint moves linearly or
 * on cubics that never leave the range of two neighboring rows (monotone: Fritsch and Butland, A
 * method for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat. Comput.
 * 5, 1984), with a continuous rate that is 0 at both ends. Units: rad, s.
 */
#ifndef TASKS_TRAJECTORY_H
#define TASKS_TRAJECTORY_H

#include "base/arena.h"
#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

enum trajectory_interpolation { TRAJECTORY_CUBIC, TRAJECTORY_LINEAR };

/* Limits of a joint. */
struct trajectory_limit {
    const char *joint;
    double lower_rad, upper_rad;
    double rate_rad_s; /* 0: not known, 1000 is the limit */
};

struct trajectory {
    const char *path;
    size_t njoint;
    const size_t *joint;  /* njoint: which of the limits */
    size_t count;         /* rows, 2 or more */
    const double *time_s; /* count, the first is 0 */
    const double *angle;  /* count rows of njoint */
    const double *slope;  /* rates at the rows, in the order of angle; NULL: linear */
};

/* Reads and checks a file against the limits of the robot's joints: titles, times, angles, and the
 * rate between rows. ERROR_INPUT with file:line, ERROR_SYSTEM, ERROR_MEMORY. path must outlive the
 * trajectory, which is the arena's. Not RT-safe. */
enum error_code trajectory_read(const char *path, enum trajectory_interpolation interpolation,
                                const struct trajectory_limit *limit, size_t nlimit,
                                struct arena *arena, const struct trajectory **trajectory,
                                struct error *error);

/* The same from size bytes of memory, which messages call path. */
enum error_code trajectory_read_memory(const char *path, const void *bytes, size_t size,
                                       enum trajectory_interpolation interpolation,
                                       const struct trajectory_limit *limit, size_t nlimit,
                                       struct arena *arena, const struct trajectory **trajectory,
                                       struct error *error);

/* Returns the duration of the trajectory, s. RT-safe. */
double trajectory_length_s(const struct trajectory *trajectory);

/* Computes angle and rate of the joint-th of its joints; before the first row and after the last
 * it rests there. RT-safe. */
void trajectory_at(const struct trajectory *trajectory, size_t joint, double t_s, double *angle_rad,
                   double *rate_rad_s);

#endif
