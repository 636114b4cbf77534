/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Measured benches (config/validation): what a recording's columns mean, the law by which the
 * drive's own firmware turned goals into voltages, which numbers are free, the recordings with
 * their source, and what others have reached with them. Not RT-safe.
 */
#ifndef APP_IDENTIFY_BENCH_H
#define APP_IDENTIFY_BENCH_H

#include "app/identify/parameters.h"
#include "base/arena.h"
#include "base/enum_names.h"
#include "base/error.h"
#include "base/yaml.h"
#include "rig/rig.h"

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
    double known[POINT_QUANTITIES]; /* V, A, N m, rad/s, N m */
    bool is_known[POINT_QUANTITIES];
    bool backdriven; /* the load turns the motor back */
    int find;        /* enum point_quantity */
    double value;
};

/* A number that may change. */
struct bench_free {
    struct yaml_mark mark;
    const char *key;
    double start, lower, upper, expected, sigma; /* the last two: a prior */
    bool has_start, has_lower, has_upper, has_expected, has_sigma;
    int parameter;
};

/* A recording by its file; those of one group share what an identification could fit to. */
struct bench_recording {
    struct yaml_mark mark;
    const char *file;
    struct yaml_mark file_mark;
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
    struct yaml_mark rig_mark, drive_mark;
    struct bench_columns columns;
    bool has_columns;
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

#endif
