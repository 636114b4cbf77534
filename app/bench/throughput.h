/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How many simulated seconds a sweep gets out of a processor in an hour, by rig: cases with boards,
 * buses, contact and controller, run by coman-hil test as a sweep runs them. And the robot without
 * them, our plant beside MuJoCo: its bodies alone, and standing on its feet with springs in its
 * joints. CPU time, not time on a clock. Not RT-safe.
 */
#ifndef APP_BENCH_THROUGHPUT_H
#define APP_BENCH_THROUGHPUT_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum {
    THROUGHPUT_RIGS = 32,
    THROUGHPUT_ROUNDS = 99,
    THROUGHPUT_RANGE = 10, /* cases of the range whose start is measured */
    THROUGHPUT_FORMAT_VERSION = 1,
};

/* What one process cost: CPU seconds of it and of the processes that it waited for. */
struct throughput_cost {
    double cpu_s;
    double instructions; /* NAN where the machine does not count them */
    double resident_mb;  /* the largest resident set that any of them had, 1e6 bytes */
};

/* How the robot alone moves, and by whom. */
enum throughput_way {
    WAY_BODIES,
    WAY_BODIES_EULER, /* MuJoCo's default */
    WAY_BODIES_IMPLICIT,
    WAY_STANDING,
    WAY_STANDING_EULER,
    THROUGHPUT_WAYS
};

/* A round: a case of one tick run alone, a whole one alone, and THROUGHPUT_RANGE of one tick in a
 * range. */
struct throughput_sample {
    struct throughput_cost start, whole, range;
    double way_s[THROUGHPUT_WAYS]; /* CPU seconds for the simulated time of a case; NAN = none */
};

/* Median and ends over the rounds; NAN when a round has no value. */
struct throughput_spread {
    double median, low, high;
};

/* A rig under measurement. */
struct throughput_rig {
    const char *rig, *task;
    size_t nbus, nboard, naxis, nv;
    double tick_s, step_s;
    struct throughput_sample sample[THROUGHPUT_ROUNDS];
};

/* Figures that are derived from the samples. */
struct throughput_figures {
    struct throughput_spread rate; /* simulated seconds in an hour of a processor, without start */
    struct throughput_spread way[THROUGHPUT_WAYS]; /* the same of the robot alone */
    struct throughput_spread hourly; /* whole cases of a range in an hour of a processor */
    struct throughput_spread start_ms, range_ms,
        whole_ms; /* of a case; range_ms: its start there */
    struct throughput_spread start_mb, whole_mb;
    struct throughput_spread start_instructions, tick_instructions; /* of a tick without start */
};

/* The whole measurement. */
struct throughput {
    size_t rounds, nrig;
    double seconds;     /* simulated time of a case */
    const char *mujoco; /* version of MuJoCo; NULL = not found */
    struct throughput_rig rig[THROUGHPUT_RIGS];
};

/* Derives the figures of a rig. They are NAN where a whole case cost no more than its start, by
 * noise. */
void throughput_derive(const struct throughput *all, const struct throughput_rig *rig,
                       struct throughput_figures *figures);

/* Prints the tables. */
void throughput_print(const struct throughput *all, FILE *out);

/* Writes all figures as one JSON object. */
void throughput_write_json(const struct throughput *all, FILE *out);

/* Fills in what the rig's file says, and the task where it is NULL: walk or grasp where the file
 * has such a section, else hold. ERROR_INPUT and others of rig_load. */
enum error_code throughput_read_rig(struct throughput_rig *rig, struct error *error);

/* Finds the version of a MuJoCo in the module of other simulators (app/bench/peers.h), or "":
 * without path a missing module is no error. */
enum error_code throughput_find_mujoco(const char *path, char version[32], struct error *error);

/* Measures a round of a rig with program, the path of coman-hil, in folder, which holds nothing but
 * what earlier rounds of the same rig left. peers as in throughput_find_mujoco, used when mujoco is
 * wanted. */
enum error_code throughput_measure(const struct throughput *all, const struct throughput_rig *rig,
                                   const char *program, const char *folder, const char *peers,
                                   struct throughput_sample *sample, struct error *error);

#endif
