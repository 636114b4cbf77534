/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of the benchmark paper: each measures some of the paper's experiments and writes its
 * sections of the report. Not RT-safe.
 */
#ifndef APP_BENCH_PAPER_H
#define APP_BENCH_PAPER_H

#include "app/bench/peers.h"
#include "app/report/report.h"
#include "app/report/signals.h"
#include "rig/rig.h"
#include "rt/loop.h"

#include <limits.h>

enum { PAPER_SPEEDS = 5 };

/* The benchmark under way, with its report. */
struct paper {
    struct report report;
    const char *folder;
    bool quick;
    const struct peers *peers; /* NULL = none */
    size_t step, nstep;        /* for the progress line */
};

/* Shows a line of progress on a terminal: what comes now. */
void paper_progress(struct paper *paper, const char *what);

/* ---- runs of a rig ---- */

/* A finished run of a task on a rig. */
struct paper_run {
    struct arena arena;
    struct rig rig; /* as loaded; valid until paper_run_end */
    double seconds; /* virtual time at which the task ended */
    double cpu_s;   /* CPU time of the loop's thread */
    double wall_s;
    struct signals signals;
    char message[160]; /* of the task */
};

/* A run to be made. */
struct paper_order {
    const char *rig, *task;
    enum loop_clock clock;
    const char *const *title; /* signals to record; NULL = nothing is recorded */
    size_t ntitle;
    bool joints; /* record the angle of every joint, too */
    int64_t row_ms;
    bool one_cycle; /* run one cycle of the squat only */
};

/* Loads and runs a rig, always with the paper's friction. When it is recorded, reads the signals
 * back; the recorded frames stay in the folder's .recording until paper_run_end. A task that fails
 * is an error. paper_run_end must follow, also after an error. */
enum error_code paper_run(const struct paper *paper, const struct paper_order *order,
                          struct paper_run *run, struct error *error);
void paper_run_end(const struct paper *paper, struct paper_run *run);

/* Writes the path of the candump log of a recorded run. */
void paper_log_path(const struct paper *paper, char path[PATH_MAX]);

/* ---- kinematics from a recording ---- */

/* Computes the poses of all bodies in the world from the base's position and quaternion (base[7])
 * and the joint angles; place, m, and turn, body to world, have an entry for each body. */
void paper_place_bodies(const struct robot *robot, const double base[7], const double *q,
                        double (*place)[3], double (*turn)[9]);

/* Computes the height of the center of mass, m. */
double paper_mass_height(const struct robot *robot, double (*place)[3], double (*turn)[9]);

/* ---- numbers from series ---- */

/* Return mean, largest and smallest y over the rows with from <= x < to; not a number when there is
 * none. */
double paper_mean(const double *x, const double *y, size_t count, double from, double to);
double paper_largest(const double *x, const double *y, size_t count, double from, double to);
double paper_smallest(const double *x, const double *y, size_t count, double from, double to);

/* ---- the parts ---- */

/* Measures Table 1 and Fig. 3; the timings stay in table. */
struct pendulum_table;
enum error_code paper_pendulums(struct paper *paper, struct pendulum_table *table,
                                struct error *error);
/* Measures Table 2 and Figs. 8 to 11. */
enum error_code paper_grasp(struct paper *paper, struct error *error);
/* Measures Fig. 12. */
enum error_code paper_squat(struct paper *paper, struct error *error);
/* Measures every timing: Fig. 4, Table 1's real-time factors, those of section 6. */
enum error_code paper_speed(struct paper *paper, const struct pendulum_table *table,
                            struct error *error);

#endif
