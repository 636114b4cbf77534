/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A single and a double pendulum in relative and in absolute coordinates: what the benchmarks
 * pendulum and paper measure. Not RT-safe.
 */
#ifndef APP_BENCH_PENDULUM_H
#define APP_BENCH_PENDULUM_H

#include "app/bench/peers.h"
#include "base/arena.h"

enum { PENDULUM_STEPS = 3, PENDULUM_TURNS_MAX = 256 };

#define PENDULUM_START_SPEED 2.1    /* rad a time unit */
#define PENDULUM_TABLE_UNITS 10.0   /* time units of a row of the table */
#define PENDULUM_PERIOD_UNITS 300.0 /* time units of a course */
#define PENDULUM_PERIOD_STEP 1e-2

extern const double pendulum_step_sizes[PENDULUM_STEPS];
extern const struct peer_pendulum pendulum_ours;

/* The paper's Table 1, by number of bodies and step size: errors are relative, rtf are real-time
 * factors. */
struct pendulum_paper_row {
    double robotran_energy, robotran_rtf, ode_energy, ode_constraint, ode_rtf;
};
extern const struct pendulum_paper_row pendulum_paper[2][PENDULUM_STEPS];

/* A measured row of the table. */
struct pendulum_row {
    double energy, constraint, rtf; /* largest relative errors; simulated over computed time */
};

/* The measured table, by number of bodies and step size. */
struct pendulum_table {
    const struct peer_pendulum *absolute; /* NULL = none */
    size_t nstep;                         /* how many of pendulum_step_sizes */
    struct pendulum_row ours[2][PENDULUM_STEPS], theirs[2][PENDULUM_STEPS];
};

/* Measures the rows; absolute and nstep must be set. */
enum error_code pendulum_measure_table(struct pendulum_table *table, struct error *error);

/* The motion of the synchronous double pendulum by one engine. */
struct pendulum_course {
    const struct peer_pendulum *peer;
    size_t nturn, nsample;
    /* Time at the end of each turn, and its period. */
    double end[PENDULUM_TURNS_MAX], period[PENDULUM_TURNS_MAX];
    double *time, *height; /* of the first center of mass, at every tenth step */
};

/* Runs the synchronous double pendulum over PENDULUM_PERIOD_UNITS. Memory from arena. */
enum error_code pendulum_run_course(const struct peer_pendulum *peer,
                                    struct pendulum_course *course, struct arena *arena,
                                    struct error *error);

/* Returns the period of the synchronous motion by the elliptic integral, time units. */
double pendulum_analytic_period(void);

/* Returns the first time at which the heights differ by as much, or NAN. */
double pendulum_apart_at(const struct pendulum_course *a, const struct pendulum_course *b,
                         double difference);

/* Returns the first end of a turn that the slower one reaches half a period late, or NAN. */
double pendulum_antiphase_at(const struct pendulum_course *a, const struct pendulum_course *b,
                             double period);

#endif
