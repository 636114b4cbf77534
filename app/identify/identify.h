/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Identifies a drive from recordings of it, says how far that can be trusted, and judges drives on
 * recordings that no identification has seen. Not RT-safe.
 */
#ifndef APP_IDENTIFY_IDENTIFY_H
#define APP_IDENTIFY_IDENTIFY_H

#include "app/report/report.h"
#include "base/arena.h"
#include "base/enum_names.h"
#include "base/error.h"
#include "base/yaml.h"
#include "model/robot.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* ---- numbers ---- */

/*
 * The numbers that an identification may change: those of an electric drive by their keys in a
 * drive's file, and those of the bench around it. SI units, link side.
 */

enum { IDENTIFY_FREE_MAX = 24 };

/* A number of the drive or of its bench; its index stands for it. */
enum { IDENTIFY_NONE = -1 };

/* Returns the index of the parameter of that key, or IDENTIFY_NONE. */
int parameter_find(const char *key);

/* Does the same; an unknown key is ERROR_INPUT, with the nearest one. */
enum error_code parameter_check(const char *key, int *parameter, struct error *error);

/* Returns the number of parameters, the key of one ("R_ohm"), and what it is for a reader. */
size_t parameter_count(void);
const char *parameter_key(int parameter);
const char *parameter_meaning(int parameter);

/* What surrounds the drive in a simulated recording, beside the robot's own description. */
struct bench_numbers {
    double offset_rad; /* the joint's angle where the recording says 0 */
    double delay_s;    /* of the command, until it acts */
    double arm_kg;     /* of a uniform rod between the axis and the center of mass it carries */
};

/* A robot of one driven joint that may be changed: a copy, in memory of its own. */
struct trial_robot {
    struct robot robot;
    struct robot_body body[2];
    struct robot_joint joint;
    struct robot_effects effects;
    struct bench_numbers bench;
};

/* Copies a robot; one of other than one joint with an electric drive is refused. */
enum error_code trial_robot_copy(const struct robot *robot, struct trial_robot *trial,
                                 struct error *error);

/* Return and set a number. Setting one sets those that follow it too, unless they are in the list
 * of the free ones: NKw_v_s_rad follows NKt_nm_a in proportion, load_external load_motor,
 * load_external_stribeck load_motor_stribeck, breakaway_nm is no less than coulomb_nm. */
double parameter_get(const struct trial_robot *trial, int parameter);
void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count);

/* Computes bounds within which a parameter is looked for, from what the drive is like. */
void parameter_bounds(const struct trial_robot *trial, int parameter, double supply_v,
                      double *lower, double *upper);

/* Returns whether a key of a drive's file is used by that drive. */
bool parameter_is_written(const struct trial_robot *trial, int parameter);

/* ---- benches and their recordings ---- */

/*
 * Measured benches (config/validation): what a recording's columns mean, the law by which the
 * drive's own firmware turned goals into voltages, which numbers are free, the recordings with
 * their source, and what others have reached with them.
 */

/* Titles of a recording's columns; NULL = there is none. One of goal, voltage and torque is
 * there. */
struct bench_columns {
    struct yaml_mark mark;
    const char *time, *position; /* s; rad, of the joint */
    const char *goal, *voltage;  /* rad; V at the terminals */
    const char *torque;          /* N m of the motor on the gear, as its current loop holds it */
    const char *enabled;         /* of the bridge: more than 0.5 is on */
    const char *supply;          /* V; its mean is the voltage that duties are of */
    const char *gain_word;       /* the number behind it in the file's comments is the gain */
    bool voltage_before; /* a row's voltage was on until its time, as "run --record" has it */
};

/* duty = duty_per_rad gain (goal - position), clipped to duty_max; voltage = duty supply. */
struct bench_law {
    struct yaml_mark mark;
    double duty_per_rad, duty_max;
};

/* What of a steady state is known, or is asked for. */
enum point_quantity {
    POINT_VOLTAGE,
    POINT_CURRENT,
    POINT_MOTOR, /* N m of the motor on the gear */
    POINT_SPEED,
    POINT_LOAD,
    POINT_QUANTITIES
};

/* Their keys. */
extern const struct word point_words[];

/* A figure of a steady state: two known quantities, and the value of a third as measured. */
struct bench_point {
    struct yaml_mark mark;
    const char *what;
    double known[POINT_QUANTITIES]; /* V, A, N m, rad/s, N m; NAN = not known */
    bool backdriven;                /* the load turns the motor back */
    int find;                       /* enum point_quantity */
    double value;
};

/* A number that may change. */
struct bench_free {
    struct yaml_mark mark;
    const char *key;
    double start, lower, upper, expected, sigma; /* the last two: a prior */
    int parameter;
};

/* A recording by its file; those of one group share what an identification could fit to. */
struct bench_recording {
    struct yaml_mark mark;
    const char *file;
    const char *crc32; /* of the file's bytes, hexadecimal; NULL = not checked */
    const char *group; /* "" = none */
    bool judge;        /* identifications do not see it */
};

/* What others reach: their mean error on the recordings that are judged, rad, or on the points,
 * as a share. */
struct bench_published {
    struct yaml_mark mark;
    const char *what;
    double error_rad, error_share;
};

struct bench {
    struct yaml_mark mark;
    const char *name, *description, *source, *license, *supports;
    const char *rig, *drive; /* one of them is NULL; a drive has points alone */
    struct bench_columns columns;
    struct bench_law law;
    double robust_rad;  /* errors beyond it count linearly; 0 = all squared */
    double limit_rad;   /* mean error that the judged recordings must not exceed */
    double limit_share; /* the same of the points */
    double
        diagram_nm; /* motor's torque up to which a drive/back-drive diagram is drawn; 0 = none */
    struct bench_free *free;
    struct bench_recording *recording;
    struct bench_point *point; /* a bench has recordings or points */
    struct bench_published *published;
    size_t nfree, nrecording, npoint, npublished;
    struct yaml_real_entry *number; /* of drive and bench, in the place of the rig's */
    size_t nnumber;
};

/* A recording in memory. */
struct recording {
    const char *file, *group;
    bool judge;
    size_t count; /* rows, 2 or more, in the order of time */
    double *time, *position, *goal, *voltage;
    bool *enabled;
    double gain, supply; /* supply 0: the rig's */
    bool voltage_before;
    bool is_torque; /* voltage holds torques, N m */
};

/* Reads a bench's file. Everything lives in arena; errors carry file:line:column. */
enum error_code bench_read(const char *path, struct arena *arena, struct bench *bench,
                           struct error *error);

/* Makes the bench of a recording of "coman-hil run --record" of that joint. */
enum error_code bench_of_own(const char *joint, struct arena *arena, struct bench *bench,
                             struct error *error);

/* Reads a recording; lines at its begin that start with # are comments. crc32 may be NULL. */
enum error_code recording_read(const struct bench *bench, const char *path, const char *crc32,
                               struct arena *arena, struct recording *recording,
                               struct error *error);

/* Makes room for the rows of a recording whose file is set. ERROR_MEMORY. */
enum error_code recording_alloc(struct recording *r, size_t count, struct arena *arena,
                                struct error *error);

/* ---- recordings that are logs of candump (log.c) ---- */

/* Returns whether a file begins as a log does: with the time of a frame. */
bool recording_is_log(const char *path);

/* Reads a log: a row for each frame that tells the joint's angle, with the mean of the commands
 * since the last. The columns position, and voltage or torque, name signals of coman-hil dbc;
 * without such names, or with those of other columns, they are found by joint and unit. Frames of
 * other interfaces are skipped. ERROR_INPUT says what is missing. */
enum error_code recording_read_log(const struct rig *rig, const char *joint,
                                   const struct bench_columns *columns, const char *path,
                                   struct arena *arena, struct recording *recording,
                                   struct error *error);

/* ---- fits ---- */

/*
 * Fits free numbers so that free-running simulations follow recordings (output error): least
 * squares by Levenberg and Marquardt's method (MINPACK) with derivatives by differences, bounds by
 * a change of variables, priors as measurements of their own.
 */

/* A number that is looked for. */
struct fit_free {
    int parameter;
    double start, lower, upper;
    double expected, sigma; /* prior; sigma 0 = none */
};

struct fit_problem {
    const struct rig *rig;
    const struct trial_robot *trial; /* what it starts from; the free ones' start goes first */
    const struct bench_law *law;
    const struct recording *recording; /* those that are fitted to: use[i] */
    const bool *use;                   /* NULL = all */
    size_t nrecording, nfree;
    struct fit_free free[IDENTIFY_FREE_MAX];
    double robust_rad;
    int steps; /* most iterations */
    void (*progress)(void *context, int step, double rms_rad);
    void *context;
};

/* What is known of a number after a fit. */
enum fit_verdict {
    FIT_KNOWN, /* to better than FIT_KNOWN_SHARE of its value (2 sigma) */
    FIT_ROUGH, /* less well */
    FIT_BOUND, /* the fit ended at a bound: the recordings would have it beyond, or do not care */
    FIT_NOT_TOLD, /* 2 sigma is no less than its value or half of its bounds */
};
extern const struct word fit_verdict_words[];

#define FIT_KNOWN_SHARE 0.05

struct fit_result {
    double value[IDENTIFY_FREE_MAX];
    double sigma[IDENTIFY_FREE_MAX]; /* with the residual's own correlation in time */
    double correlation[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX];
    enum fit_verdict verdict[IDENTIFY_FREE_MAX];
    double rms_rad;   /* of what was fitted to */
    double coherence; /* rows that count as one independent measurement */
    int simulations;
    struct trial_robot trial; /* with the values set */
};

/* Prepares a problem: the free numbers of the bench, or with keys (nkey of them) those, with the
 * bench's bounds and priors where it has them. */
enum error_code fit_prepare(const struct bench *bench, const char *const *key, size_t nkey,
                            struct fit_problem *problem, struct error *error);

enum error_code fit_solve(const struct fit_problem *problem, struct fit_result *result,
                          struct error *error);

/* ---- simulations of recordings (simulate.c), which may run in several threads at once ---- */

/* Simulates a recording with the numbers of a trial from where it begins, at rest: position gets
 * the joint's angle at each of the recording's times, rad, as the recording counts it. A simulation
 * that diverges goes on with its last position. */
enum error_code simulate_recording(const struct rig *rig, const struct trial_robot *trial,
                                   const struct bench_law *law, const struct recording *recording,
                                   double *position, struct error *error);

/* Errors of a simulated recording, rad. */
struct simulation_error {
    double mean, rms, worst; /* mean of the absolute values */
};
struct simulation_error simulation_compare(const struct recording *recording,
                                           const double *position);

/* ---- identifications ---- */

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
