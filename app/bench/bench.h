/* SPDX-License-Identifier: Apache-2.0 */
/* The benchmarks and their common functions. Not RT-safe. */
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

/* Common options, progress output, and access to other simulators. */

#define BENCH_OUT_OPTION(folder, files)                                                            \
    {                                                                                              \
        "--out", OPTION_STRING, "DIR",                                                             \
            "write " files " into this folder, which is made if necessary", .value = (folder),     \
                                                                            .letter = "-o"         \
    }

#define BENCH_PEERS_OPTION(path)                                                                   \
    {                                                                                              \
        .name = "--peers", .type = OPTION_STRING, .argument = "PATH",                              \
        .help = "the module with other simulators (default: see below)", .value = (path)           \
    }

/* Loads the module with other simulators. A missing module is an error only if path is given.
 * Without path it sets library->peers to NULL and prints a line on stderr that ends in
 * consequence. */
enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error);

/* Finds coman-hil: the same name in this program's folder, without "-bench". ERROR_SYSTEM. */
enum error_code bench_find_program(char path[PATH_MAX], struct error *error);

/* Shows the progress of a run on stderr if stderr is a terminal. Clears the line at the end. */
void bench_progress(const char *name, size_t done, size_t all);

/* Returns the CPU time of the calling thread, s. */
double bench_cpu_s(void);

/* Sorts the values, ascending. */
void bench_sort(double *value, size_t count);

/* Sorts the values and returns their median; the upper one of the two middle values for an even
 * count. count must be at least 1. */
double bench_median(double *value, size_t count);

/* ---- the benchmarks: argv[0] is the name; each returns an enum exit_status (base/options.h), and
 * prints its own manual for --help ---- */

int bench_contact(int argc, char **argv);
int bench_dynamics(int argc, char **argv);
int bench_latency(int argc, char **argv);
int bench_paper(int argc, char **argv);
int bench_throughput(int argc, char **argv);
int bench_ticks(int argc, char **argv);

/* Measures and prints the latency of `count` answers of each protocol, with simulators that it
 * starts by the file `program` (answers.c). */
enum error_code bench_answers(const char *program, size_t count, struct error *error);

/* ---- a robot alone ---- */

/*
 * Measures a rig's robot without drives, boards, buses and controller, in our plant and in MuJoCo
 * (app/bench/peers.h). The robot either moves freely from the rig's pose, or stands on its feet
 * with springs in its joints.
 */

/* Motion of the robot and engine. */
enum alone_way {
    ALONE_BODIES,
    ALONE_BODIES_IMPLICIT, /* MuJoCo, implicit in the velocities */
    ALONE_BODIES_EULER,    /* MuJoCo, Euler, its default */
    ALONE_STANDING,
    ALONE_STANDING_EULER,
    ALONE_WAYS
};

/* Returns the engine that can step (MuJoCo), or NULL if there is none. */
const struct peer_dynamics *alone_find_mujoco(const struct peers *peers);

/* Measures the CPU time, s, of a simulation of this many seconds. mujoco is needed for the MuJoCo
 * ways only. *cpu_s is NAN if the robot cannot stand, or has left its place at the end. */
enum error_code alone_measure(const char *rig, enum alone_way way,
                              const struct peer_dynamics *mujoco, double seconds, double *cpu_s,
                              struct error *error);

/* ---- contact scenes ---- */

/*
 * The measured contact scenes: pairs of surfaces that robots have, the paper's five bodies, and a
 * foot on bumpy ground with an increasing number of triangles. The benchmark contact and the
 * program that counts instructions use them.
 */

enum {
    BENCH_SURFACES = 8,
    BENCH_PAIRS = 8,
    BENCH_BODIES = 5,
    BENCH_SCENES = 10,
};

/* A contact scene, and the positions at which its bodies touch. */
struct bench_scene {
    const char *name;
    size_t faces;     /* number of triangles */
    double target_us; /* target for one evaluation by the native engine; 0 = none */
    double place[BENCH_BODIES][3];
    struct contact_surface surface[BENCH_SURFACES];
    struct contact_pair pair[BENCH_PAIRS];
    struct contact_config config; /* points to surface and pair, so do not move the scene */
};

/* Makes the scenes. They use arena and foot, which must outlive them. */
enum error_code bench_scenes_make(struct bench_scene scene[BENCH_SCENES], size_t *nscene,
                                  const struct mesh *foot, struct arena *arena,
                                  struct error *error);

/* Draws a random slow motion of all bodies near their places: up to 10 mm sideways, 0.3 mm
 * vertically and 3 mrad in rotation. The same seed gives the same motion. The seed must not be 0;
 * the function advances it. */
void bench_scene_draw(const struct bench_scene *scene, uint64_t *seed,
                      struct body_motion motion[BENCH_BODIES]);

/* ---- accelerations ---- */

/*
 * Measures the CPU time of a robot's generalized accelerations by number of degrees of freedom. The
 * benchmarks dynamics and paper use it.
 */

enum { DYNAMICS_ENGINES = 8, DYNAMICS_SIZES = 4 };
#define DYNAMICS_ARENA_BYTES ((size_t)256 << 20)

/* One engine with a robot of one size, and its measured times. */
struct dynamics_cell {
    void *engine;
    size_t repeat;            /* evaluations of all states per measurement */
    double *ns;               /* time of one evaluation in each round */
    double median, low, high; /* us; low and high: 10th and 90th percentile of the rounds */
    /* Mean relative difference from the numeric implementation, over all states. */
    double difference;
};

/* A measurement of all engines and sizes. */
struct dynamics_bench {
    size_t rounds;   /* at least 1 */
    bool whole_only; /* measure the whole robot only, not its parts */
    /* dynamics_bench_run sets the members below */
    const struct robot *robot[DYNAMICS_SIZES]; /* the last one is the whole robot */
    size_t nsize, nengine;
    const struct peer_dynamics *peer[DYNAMICS_ENGINES]; /* our implementations first */
    struct dynamics_cell cell[DYNAMICS_ENGINES][DYNAMICS_SIZES];
    double slope[DYNAMICS_ENGINES]; /* us per degree of freedom; 0 with one size */
};

/* Measures the robot in a file with our implementations and, if peers is not NULL, with other
 * simulators. Uses at most DYNAMICS_ARENA_BYTES of arena. Call dynamics_bench_end afterwards, even
 * after an error. */
enum error_code dynamics_bench_run(struct dynamics_bench *bench, const char *file,
                                   const struct peers *peers, struct arena *arena,
                                   struct error *error);

/* Returns the index of the reference engine: Simbody, as in the paper, else 0 (our numeric
 * implementation). */
size_t dynamics_bench_reference(const struct dynamics_bench *bench);

/* A plot of the medians over the sizes. It points to its own numbers, so do not move it. */
struct dynamics_plot {
    struct svg_plot panel;
    struct svg_series series[DYNAMICS_ENGINES];
    double x[DYNAMICS_SIZES], y[DYNAMICS_ENGINES][DYNAMICS_SIZES];
    char title[128];
};

/* Fills the plot. */
void dynamics_bench_draw(const struct dynamics_bench *bench, struct dynamics_plot *plot);

/* Destroys the engines. */
void dynamics_bench_end(struct dynamics_bench *bench);

/* ---- our engines (engines.c) ---- */

/* Our implementations of struct dynamics; the numeric one is first, the generated code second.
 * create uses the generated code that is built in, else compiles it, which takes seconds. */
enum { BENCH_OURS = 2 };
extern const struct peer_dynamics bench_ours[BENCH_OURS];

enum { BENCH_NUMBERS = 1024 }; /* upper bound of a robot's number of coordinates */

/* Makes a robot of the first njoint joints of `whole`. It shares the parts of `whole`; its memory
 * is from arena. */
enum error_code bench_part(const struct robot *whole, size_t njoint, struct arena *arena,
                           const struct robot **part, struct error *error);

/* Stores PEER_SLOTS random states in an engine: positions within the limits, moderate velocities
 * and torques. All engines get the same states. */
void bench_put_states(const struct peer_dynamics *peer, void *engine, const struct robot *robot);

/* Returns the mean over the states of |a - b| / |b|, with Euclidean norms of the accelerations of
 * two engines. *worst receives the maximum; it may be NULL. Call bench_put_states for both engines
 * first. */
double bench_difference(const struct peer_dynamics *a, void *engine_a,
                        const struct peer_dynamics *b, void *engine_b, size_t nv, double *worst);

/* ---- pendulums ---- */

/*
 * Simulates a single and a double pendulum in relative and in absolute coordinates. The benchmark
 * paper uses it.
 */

enum { PENDULUM_STEPS = 3, PENDULUM_TURNS_MAX = 256 };

#define PENDULUM_START_SPEED 2.1    /* rad per time unit */
#define PENDULUM_TABLE_UNITS 10.0   /* duration for a row of the table, time units */
#define PENDULUM_PERIOD_UNITS 300.0 /* duration for Fig. 3, time units */
#define PENDULUM_PERIOD_STEP 1e-2

extern const double pendulum_step_sizes[PENDULUM_STEPS];
extern const struct peer_pendulum pendulum_ours;

/* The paper's Table 1, by number of bodies and step size. Errors are relative; rtf is a real-time
 * factor. */
struct pendulum_paper_row {
    double robotran_energy, robotran_rtf, ode_energy, ode_constraint, ode_rtf;
};
extern const struct pendulum_paper_row pendulum_paper[2][PENDULUM_STEPS];

/* A measured row of the table. */
struct pendulum_row {
    double energy, constraint, rtf; /* largest relative errors; simulated time per computing time */
};

/* The measured table, by number of bodies and step size. */
struct pendulum_table {
    const struct peer_pendulum *absolute; /* NULL = none */
    size_t nstep;                         /* number of pendulum_step_sizes to measure */
    struct pendulum_row ours[2][PENDULUM_STEPS], theirs[2][PENDULUM_STEPS];
};

/* Measures the rows. Set absolute and nstep first. */
enum error_code pendulum_measure_table(struct pendulum_table *table, struct error *error);

/* The motion of the synchronous double pendulum in one engine. */
struct pendulum_course {
    const struct peer_pendulum *peer;
    size_t nturn, nsample;
    /* Time at which each turn ends, and its period. */
    double end[PENDULUM_TURNS_MAX], period[PENDULUM_TURNS_MAX];
    double *time, *height; /* of the first center of mass, at every tenth step */
};

/* Simulates the synchronous double pendulum for PENDULUM_PERIOD_UNITS. Memory is from arena. */
enum error_code pendulum_run_course(const struct peer_pendulum *peer,
                                    struct pendulum_course *course, struct arena *arena,
                                    struct error *error);

/* Returns the analytic period of the synchronous motion, from the elliptic integral, time units. */
double pendulum_analytic_period(void);

/* Returns the first time at which the two heights differ by `difference`, or NAN. */
double pendulum_apart_at(const struct pendulum_course *a, const struct pendulum_course *b,
                         double difference);

/* Returns the end time of the first turn in which the slower pendulum is half a period late, or
 * NAN. */
double pendulum_antiphase_at(const struct pendulum_course *a, const struct pendulum_course *b,
                             double period);

/* ---- the paper ---- */

/*
 * The parts of the benchmark paper. Each one measures some of the paper's experiments and writes
 * its sections of the report.
 */

enum { PAPER_SPEEDS = 5 };

/* A running paper benchmark, with its report. */
struct paper {
    struct report report;
    const char *folder;
    bool quick;
    const struct peers *peers; /* NULL = none */
    size_t step, nstep;        /* for the progress line */
};

/* Shows the next step in the progress line on a terminal. */
void paper_progress(struct paper *paper, const char *what);

/* ---- runs of a rig ---- */

/* The result of a run of a task on a rig. */
struct paper_run {
    struct arena arena;
    struct rig rig; /* the loaded rig; valid until paper_run_end */
    double seconds; /* virtual time at which the task ended */
    double cpu_s;   /* CPU time of the loop's thread */
    double wall_s;
    struct signals signals;
    char message[160]; /* the last message of the task */
};

/* The settings of a run. */
struct paper_order {
    const char *rig, *task;
    enum loop_clock clock;
    const char *titles; /* signals to record, separated by '|'; NULL = record nothing */
    bool joints;        /* also record the angle of every joint */
    int64_t row_ms;
    bool one_cycle; /* run one cycle of the squat only */
};

/* Loads and runs a rig with the paper's friction model. If the order has titles, it records the
 * signals and reads them back. The recorded frames stay in the folder .recording until
 * paper_run_end. Returns an error if the task fails. Call paper_run_end afterwards, even after an
 * error. */
enum error_code paper_run(const struct paper *paper, const struct paper_order *order,
                          struct paper_run *run, struct error *error);
void paper_run_end(const struct paper *paper, struct paper_run *run);

/* Writes the path of a file in the recording's folder, or of the folder itself if name is "". */
void paper_recorded_path(const struct paper *paper, const char *name, char path[PATH_MAX]);

/* ---- numbers from series ---- */

/* paper_over returns mean, minimum and maximum of y over the rows with from <= x < to; NAN if there
 * is no such row. */
struct paper_range {
    double mean, least, most;
};
struct paper_range paper_over(const double *x, const double *y, size_t count, double from,
                              double to);

/* ---- the parts ---- */

/* Measures Table 1 and Fig. 3, and stores the times in table. */
enum error_code paper_pendulums(struct paper *paper, struct pendulum_table *table,
                                struct error *error);
/* Measures Table 2 and Figs. 9 to 11. */
enum error_code paper_grasp(struct paper *paper, struct error *error);
/* Measures Fig. 12. */
enum error_code paper_squat(struct paper *paper, struct error *error);
/* Measures all times: Fig. 4 and the real-time factors of Table 1 and section 6. */
enum error_code paper_speed(struct paper *paper, const struct pendulum_table *table,
                            struct error *error);

#endif
