/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Identifies a drive from recordings of it, says how far that can be trusted, and judges drives on
 * recordings that no identification has seen. Not RT-safe.
 */
#ifndef APP_IDENTIFY_IDENTIFY_H
#define APP_IDENTIFY_IDENTIFY_H

#include "app/identify/bench.h"
#include "app/identify/fit.h"
#include "app/report/report.h"
#include "rig/rig.h"

enum { IDENTIFY_RECORDINGS_MAX = 64 };

/* A bench ready for simulations. */
struct identify_bench {
    struct bench bench;
    const struct rig *rig; /* NULL for a bench of a drive */
    struct trial_robot trial;
    struct recording *recording;
    size_t nrecording;
};

/* What follows from recordings. Errors of a recording that no fold leaves out are negative. */
struct identify_result {
    struct fit_result fit;
    double start[IDENTIFY_RECORDINGS_MAX];     /* mean error before, rad */
    double fitted[IDENTIFY_RECORDINGS_MAX];    /* by the fit to all that are not judged */
    double crossed[IDENTIFY_RECORDINGS_MAX];   /* by a fit that did not see its group */
    double *position[IDENTIFY_RECORDINGS_MAX]; /* simulated by the fit */
    size_t nfold;
    double spent_s;
};

/* Reads a bench with its rig and its recordings. */
enum error_code identify_open(const char *path, struct arena *arena, struct identify_bench *bench,
                              struct error *error);

/* Makes the bench of recordings of "run --record" of a rig: path of the rig, its joint or NULL. It
 * has no recordings yet. */
enum error_code identify_open_own(const char *rig, const char *joint, struct arena *arena,
                                  struct identify_bench *bench, struct error *error);

/* Takes other recordings, of files, in the place of the bench's own. ERROR_INPUT where a recording
 * of "run --record" has not a row each tick. */

enum error_code identify_take_files(struct identify_bench *bench, const char *const *file,
                                    size_t count, struct arena *arena, struct error *error);

/* Fits the problem's free numbers to the recordings that are not judged, and if crossed once more
 * for each group of them to the others: what has no group is one of its own. Memory is the
 * arena's. */
enum error_code identify_run(const struct identify_bench *bench, struct fit_problem *problem,
                             bool crossed, struct arena *arena, struct identify_result *result,
                             struct error *error);

/* Returns the mean of a recording's errors that are not negative, or a negative number. */
double identify_mean(const double *error, size_t count);

/* Writes the drive's file, with what was identified, from what and how well, behind each number. */
enum error_code identify_write_drive(const struct identify_bench *bench,
                                     const struct fit_problem *problem,
                                     const struct identify_result *result, const char *path,
                                     struct error *error);

/* Writes the page of an identification into a folder. */
enum error_code identify_write_page(const struct identify_bench *bench,
                                    const struct fit_problem *problem,
                                    const struct identify_result *result, const char *folder,
                                    struct error *error);

struct report;

/* Adds plots of a recording to a page: measured beside simulated, the residual and its spectrum. */
void identify_plot(struct report *report, const char *id, const struct recording *recording,
                   const double *position);

/* A bench judged by the rig as it is. */
struct validation {
    struct identify_bench bench;
    double error[IDENTIFY_RECORDINGS_MAX]; /* mean of a recording, rad */
    double *position[IDENTIFY_RECORDINGS_MAX];
    double *ours; /* of a bench of points, one a point */
    double mean;  /* of those that are judged, or of all when none is; of points a share */
    bool passed;
};

/* Returns the drive of a trial, effects included; those are the trial's. */
struct robot_sea trial_drive(const struct trial_robot *trial);

/* Simulates a bench's recordings, or computes its points, with its own drive. */
enum error_code validation_run(const char *path, struct arena *arena, struct validation *validation,
                               struct error *error);

/* Writes the page of benches into a folder. */
enum error_code validation_write_page(const struct validation *validation, size_t count,
                                      const char *folder, struct error *error);

/* ---- steady states (points.c) ---- */

/* Returns the figure that a point asks for, as the drive has it; NAN where there is no such state
 * (the motor stalls, or the gear locks itself). */
double point_compute(const struct robot_sea *sea, const struct bench_point *point);

/* Adds a drive's diagram to a page: the load that a motor's torque up to most turns, and that which
 * turns it back, at rest, with those points of the bench that say the same. */
void point_diagram(struct report *report, const char *id, const struct robot_sea *sea,
                   const struct bench *bench);

#endif
