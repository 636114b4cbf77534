/* SPDX-License-Identifier: Apache-2.0 */
/*
 * CPU time of a robot's generalized accelerations by number of degrees of freedom: what the
 * benchmarks dynamics and paper measure. Not RT-safe.
 */
#ifndef APP_BENCH_DYNAMICS_H
#define APP_BENCH_DYNAMICS_H

#include "app/bench/peers.h"
#include "app/report/svg.h"

enum { DYNAMICS_ENGINES = 8, DYNAMICS_SIZES = 4 };
#define DYNAMICS_ARENA_BYTES ((size_t)256 << 20)

/* An engine with a robot of one size, and its times. */
struct dynamics_cell {
    void *engine;
    size_t repeat;            /* runs through all states in one measurement */
    double *ns;               /* time of one evaluation, by round */
    double median, low, high; /* us; low and high: a tenth of the rounds lies beyond either */
    /* Average relative difference from the numeric implementation over the states. */
    double difference;
};

/* A measurement of all engines and sizes. */
struct dynamics_bench {
    size_t rounds;   /* at least 1 */
    bool whole_only; /* without the robot's parts */
    /* the rest is filled in */
    const struct robot *robot[DYNAMICS_SIZES]; /* the last one is the whole robot */
    size_t nsize, nengine;
    const struct peer_dynamics *peer[DYNAMICS_ENGINES]; /* ours first (app/bench/dynamics.h) */
    struct dynamics_cell cell[DYNAMICS_ENGINES][DYNAMICS_SIZES];
    double slope[DYNAMICS_ENGINES]; /* us a degree of freedom, least squares; 0 with one size */
};

/* Measures the robot of a file with our implementations and, unless peers is NULL, with theirs.
 * Memory from arena, at most DYNAMICS_ARENA_BYTES. dynamics_bench_end must follow, also after an
 * error. */
enum error_code dynamics_bench_run(struct dynamics_bench *bench, const char *file,
                                   const struct peers *peers, struct arena *arena,
                                   struct error *error);

/* Returns the engine that the paper compares with, Simbody; 0, our numeric one, when it is not
 * there. */
size_t dynamics_bench_reference(const struct dynamics_bench *bench);

/* A plot of the medians over the sizes, which refers to its own numbers. */
struct dynamics_plot {
    struct svg_plot panel;
    struct svg_series series[DYNAMICS_ENGINES];
    double x[DYNAMICS_SIZES], y[DYNAMICS_ENGINES][DYNAMICS_SIZES];
    char title[128];
};

/* Draws it. */
void dynamics_bench_draw(const struct dynamics_bench *bench, struct dynamics_plot *plot);

/* Destroys the engines. */
void dynamics_bench_end(struct dynamics_bench *bench);

/* ---- our engines (engines.c) ---- */

/* The implementations of struct dynamics, the numeric one first. The generated code is that built
 * in for the robot; otherwise create compiles it, which takes seconds. */
enum { BENCH_OURS = 2 };
extern const struct peer_dynamics bench_ours[BENCH_OURS];

enum { BENCH_NUMBERS = 1024 }; /* coordinates of a robot below, at most */

/* Makes a robot of the first njoint joints of another, whose parts it shares. Memory from arena. */
enum error_code bench_part(const struct robot *whole, size_t njoint, struct arena *arena,
                           const struct robot **part, struct error *error);

/* Puts PEER_SLOTS random states into an engine, the same ones for every engine: positions within
 * limits, moderate rates and torques. */
void bench_put_states(const struct peer_dynamics *peer, void *engine, const struct robot *robot);

/* Returns the average over the states of |a - b| / |b|, Euclidean norms of the accelerations that
 * two engines find; worst (may be NULL) receives the largest. Both engines hold the states of
 * bench_put_states. */
double bench_difference(const struct peer_dynamics *a, void *engine_a,
                        const struct peer_dynamics *b, void *engine_b, size_t nv, double *worst);

#endif
