/* SPDX-License-Identifier: Apache-2.0 */
/* The benchmarks, and what they share. Not RT-safe. */
#ifndef APP_BENCH_BENCH_H
#define APP_BENCH_BENCH_H

#include "app/bench/peers.h"
#include "app/report/report.h"
#include "app/report/signals.h"
#include "app/report/svg.h"
#include "base/arena.h"
#include "base/error.h"
#include "contact/contact.h"
#include "rig/rig.h"
#include "rt/loop.h"

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* ---- what the benchmarks share ---- */

/* Options, progress and other simulators, which the benchmarks share. */

#define BENCH_OUT_OPTION(folder, files)                                                            \
    {                                                                                              \
        .name = "--out", .type = OPTION_STRING, .argument = "DIR",                                 \
        .help = "write " files " into this folder, which is made if necessary", .value = (folder), \
        .letter = "-o"                                                                             \
    }

#define BENCH_PEERS_OPTION(path)                                                                   \
    {                                                                                              \
        .name = "--peers", .type = OPTION_STRING, .argument = "PATH",                              \
        .help = "the module with other simulators (default: see below)", .value = (path)           \
    }

/* Loads the module with other simulators. Without path a missing module is no error: library->peers
 * is NULL then, and a line on stderr says so and ends in consequence. */
enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error);

/* Shows the progress of a run on stderr when that is a terminal; clears the line at the end. */
void bench_progress(const char *name, size_t done, size_t all);

/* Returns the CPU time of the calling thread, s. */
double bench_cpu_s(void);

/* Sorts the values, ascending. */
void bench_sort(double *value, size_t count);

/* Returns the median of at least one value, of an even number the upper one of the middle; sorts
 * the values. */
double bench_median(double *value, size_t count);

/* ---- the benchmarks: argv[0] is the name; each returns an enum exit_status (base/options.h), and
 * prints its own manual for --help ---- */

int bench_contact(int argc, char **argv);
int bench_dynamics(int argc, char **argv);
int bench_latency(int argc, char **argv);
int bench_paper(int argc, char **argv);
int bench_throughput(int argc, char **argv);
int bench_ticks(int argc, char **argv);

/* ---- a robot alone ---- */

/*
 * A rig's robot without drives, boards, buses and controller, timed in our plant and in MuJoCo
 * (app/bench/peers.h): its bodies alone, from the rig's pose, or standing on its feet with springs
 * in its joints.
 */

/* How the robot moves, and in which engine. */
enum alone_way {
    ALONE_BODIES,
    ALONE_BODIES_IMPLICIT, /* MuJoCo, implicit in the rates */
    ALONE_BODIES_EULER,    /* MuJoCo's default */
    ALONE_STANDING,
    ALONE_STANDING_EULER,
    ALONE_WAYS
};

/* Returns the engine that can step, which is MuJoCo; NULL when there is none. */
const struct peer_dynamics *alone_find_mujoco(const struct peers *peers);

/* Measures the CPU time of so many simulated seconds. mujoco is used for its own ways. *cpu_s is
 * NAN for a robot that cannot stand, or is no longer where it stood at the end. */
enum error_code alone_measure(const char *rig, enum alone_way way,
                              const struct peer_dynamics *mujoco, double seconds, double *cpu_s,
                              struct error *error);

/* ---- contact scenes ---- */

/*
 * The contact scenes that are measured: the pairs of surfaces that a robot meets, the paper's five
 * bodies, and a foot on bumpy ground of more and more triangles. Shared by coman-hil-bench contact
 * and by the program that counts instructions.
 */

enum {
    BENCH_SURFACES = 8,
    BENCH_PAIRS = 8,
    BENCH_BODIES = 5,
    BENCH_SCENES = 10,
};

/* A contact scene, and the places where its bodies touch. */
struct bench_scene {
    const char *name;
    size_t faces;     /* triangles in all */
    double target_us; /* of an evaluation by the native engine; 0 = none is set */
    double place[BENCH_BODIES][3];
    struct contact_surface surface[BENCH_SURFACES];
    struct contact_pair pair[BENCH_PAIRS];
    struct contact_config config; /* refers to the two above, so the scene must not be moved */
};

/* Makes the scenes; meshes come from arena, which must outlive them, and so must foot. */
enum error_code bench_scenes_make(struct bench_scene scene[BENCH_SCENES], size_t *nscene,
                                  const struct mesh *foot, struct arena *arena,
                                  struct error *error);

/* Draws a motion of all bodies near their places: up to 10 mm aside, 0.3 mm up or down and 3
 * mrad turned, in slow motion. The same seed gives the same motion; it must not be 0, and is
 * advanced. */
void bench_scene_draw(const struct bench_scene *scene, uint64_t *seed,
                      struct body_motion motion[BENCH_BODIES]);

/* ---- accelerations ---- */

/*
 * CPU time of a robot's generalized accelerations by number of degrees of freedom: what the
 * benchmarks dynamics and paper measure.
 */

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
    const struct peer_dynamics *peer[DYNAMICS_ENGINES]; /* ours first */
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

/* ---- pendulums ---- */

/*
 * A single and a double pendulum in relative and in absolute coordinates: what the benchmarks
 * pendulum and paper measure.
 */

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

/* ---- the paper ---- */

/*
 * The parts of the benchmark paper: each measures some of the paper's experiments and writes its
 * sections of the report.
 */

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
    const char *titles; /* signals to record, separated by '|'; NULL = nothing is recorded */
    bool joints;        /* record the angle of every joint, too */
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

/* ---- allocations ---- */

/*
 * Counts allocations: the program's own malloc counts and calls the C library's, so that
 * allocations of shared libraries count too. Not with sanitizers, which have their own malloc.
 */

/* Whether this build counts allocations: with glibc, and without sanitizers. */
extern const bool bench_allocations_counted;

/* Returns the number of allocations by this thread so far; 0 where they are not counted.
 * RT-safe. */
size_t bench_allocations(void);

#endif
