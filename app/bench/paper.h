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

struct paper {
    struct report report;
    const char *folder;
    bool quick;
    const struct peers *peers; /* NULL = none */
    size_t step, nstep;        /* of the progress line */
};

/* One line of progress on a terminal: what comes now. */
void paper_progress(struct paper *paper, const char *what);

/* ---- runs of a rig ---- */

/* What a task on a rig came to. */
struct paper_run {
    struct arena arena;
    struct rig rig; /* as loaded; valid until paper_run_end */
    double seconds; /* virtual, when the task had ended */
    double cpu_s;   /* of the loop's thread */
    double wall_s;
    struct signals signals;
    char message[160]; /* of the task */
};

/* How a rig is run. */
struct paper_order {
    const char *rig, *task;
    enum loop_clock clock;
    const char *const *title; /* of the signals to record; NULL = nothing is recorded */
    size_t ntitle;
    bool joints; /* after them the angle of every joint */
    int64_t row_ms;
    bool one_cycle; /* of the squat */
};

/* Loads and runs a rig, with the paper's friction whatever the rig's, and, when it is recorded,
 * reads the signals back; the recorded frames stay in the folder's .recording until paper_run_end.
 * A task that fails is an error. paper_run_end must follow, also after an error. */
enum error_code paper_run(const struct paper *paper, const struct paper_order *order,
                          struct paper_run *run, struct error *error);
void paper_run_end(const struct paper *paper, struct paper_run *run);

/* The path of the candump log of a recorded run. */
void paper_log_path(const struct paper *paper, char path[PATH_MAX]);

/* ---- kinematics from a recording ---- */

/* Poses of all bodies in the world from the base's position and quaternion (base[7]) and the joint
 * angles; place and turn have an entry a body. */
void paper_place_bodies(const struct robot *robot, const double base[7], const double *q,
                        double (*place)[3], double (*turn)[9]);

/* Height of the center of mass. */
double paper_mass_height(const struct robot *robot, double (*place)[3], double (*turn)[9]);

/* ---- numbers from series ---- */

/* Over the rows with from <= x < to; NAN when there is none. */
double paper_mean(const double *x, const double *y, size_t count, double from, double to);
double paper_largest(const double *x, const double *y, size_t count, double from, double to);
double paper_smallest(const double *x, const double *y, size_t count, double from, double to);

/* ---- the parts ---- */

/* Table 1 and Fig. 3; the timings stay in table. */
struct pendulum_table;
enum error_code paper_pendulums(struct paper *paper, struct pendulum_table *table,
                                struct error *error);
/* Table 2 and Figs. 8 to 11. */
enum error_code paper_grasp(struct paper *paper, struct error *error);
/* Fig. 12. */
enum error_code paper_squat(struct paper *paper, struct error *error);
/* Every timing: Fig. 4, Table 1's real-time factors, those of section 6. */
enum error_code paper_speed(struct paper *paper, const struct pendulum_table *table,
                            struct error *error);

#endif
