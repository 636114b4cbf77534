/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench ticks: the CPU time of each tick of a rig, by percentiles. */
#include "app/bench/benchmarks.h"
#include "app/bench/output.h"
#include "app/bench/timing.h"
#include "base/count.h"
#include "base/options.h"
#include "manual/ticks.h"
#include "rt/histogram.h"
#include "sim/simulator.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ARENA_BYTES ((size_t)512 << 20) /* address space */

/* Simulated time that is not counted, s: caches warm up; a limp robot falls. */
#define WARM_UP_S 0.1
#define FALL_S 3.0

enum { READINGS = 10001 };

static const struct ticks_rig {
    const char *rig, *task;
} shipped[] = {
    {"coman", "squat"}, {"coman-fast", "squat"}, {"walk-flat", "walk"}, {"walk-fast", "walk"}};

/* The command line. */
struct ticks_command {
    const char *task;
    const char **rig;
    double seconds;
    bool limp;
};

/* Ticks under the clock. */
struct ticks_timer {
    double begun_s;   /* CPU time at which the present tick began; less than 0 = none */
    double reading_s; /* what reading the clock takes of it */
    int64_t from_ns;  /* virtual time from which they count */
    struct histogram *histogram;
};

/* Ends the tick before and begins the next; the observer's callback. */
static void time_tick(void *context, int64_t now_ns)
{
    struct ticks_timer *timer = context;
    const double now_s = bench_cpu_s();

    if (timer->begun_s >= 0.0 && now_ns > timer->from_ns) {
        histogram_add(timer->histogram, llround(1e9 * (now_s - timer->begun_s - timer->reading_s)));
    }
    timer->begun_s = now_s;
}

/* Returns the median time of reading the clock of CPU time, s. */
static double time_reading(void)
{
    double reading[READINGS];

    for (size_t i = 0; i < READINGS; i++) {
        const double begun_s = bench_cpu_s();

        reading[i] = bench_cpu_s() - begun_s;
    }
    return bench_median(reading, READINGS);
}

/* Returns the task of a rig: that of the command line, else of the list, else none. */
static const char *choose_task(const struct ticks_command *options, const char *rig)
{
    const char *task = options->task;

    for (size_t i = 0; !task && i < ARRAY_COUNT(shipped); i++) {
        task = strcmp(rig, shipped[i].rig) == 0 ? shipped[i].task : NULL;
    }
    return options->limp ? NULL : task;
}

/* Runs a rig for seconds beyond what is not counted, and fills the histogram. */
static enum error_code time_rig(const struct ticks_command *options, const char *name,
                                const struct rig *rig, struct arena *arena,
                                struct histogram *histogram, struct error *error)
{
    const double skipped_s = options->limp ? FALL_S : WARM_UP_S;
    struct ticks_timer timer = {.begun_s = -1.0,
                                .reading_s = time_reading(),
                                .from_ns = llround(1e9 * skipped_s),
                                .histogram = histogram};
    const struct simulator_observer observer = {.context = &timer, .step = time_tick};
    const struct simulator_config config = {
        .rig = rig,
        .clock = LOOP_CLOCK_FREE,
        .hold = options->limp ? RIG_HOLD_NONE : rig->hold,
        .settle = rig->settle,
        .transport = TRANSPORT_LOCAL,
        .task = choose_task(options, name),
        .observer = &observer,
        .ticks = (uint64_t)ceil(1e9 * (skipped_s + options->seconds) / (double)rig->tick_ns),
    };
    struct realtime_report report;
    struct simulator *simulator;
    char notice[256];
    enum error_code code = simulator_create(&config, arena, &simulator, notice, error);

    if (code) {
        return code;
    }
    code = simulator_start(simulator, &report, error);
    if (!code && simulator_run(simulator) == LOOP_END_MODEL) {
        code = error_set(error, ERROR_UNSUPPORTED, "%s: %s", name, simulator_failure(simulator));
    }
    simulator_destroy(simulator);
    return code;
}

/* Prints the row of a rig. */
static void print_row(const char *name, const char *task, double tick_us,
                      const struct histogram *histogram)
{
    const double mean_us = 1e-3 * (double)histogram->sum / (double)histogram->count;

    printf("%-16s %-8s %8.0f %8.1f %8.1f %8.1f %8.1f %8.1f %9.1f\n", name, task, tick_us, mean_us,
           1e-3 * (double)histogram_percentile(histogram, 0.5),
           1e-3 * (double)histogram_percentile(histogram, 0.99),
           1e-3 * (double)histogram_percentile(histogram, 0.999), 1e-3 * (double)histogram->max,
           tick_us / mean_us);
}

/* Times all rigs and prints a table. */
static enum error_code time_rigs(const struct ticks_command *options, struct error *error)
{
    const size_t count = options->rig[0] ? SIZE_MAX : ARRAY_COUNT(shipped);

    printf("%-16s %-8s %8s %8s %8s %8s %8s %8s %9s\n", "CPU time, us", "task", "tick", "mean",
           "p50", "p99", "p99.9", "max", "tick/mean");
    for (size_t i = 0; i < count && (count < SIZE_MAX || options->rig[i]); i++) {
        const char *name = options->rig[0] ? options->rig[i] : shipped[i].rig;
        const char *task = choose_task(options, name);
        struct histogram *histogram = calloc(1, sizeof *histogram);
        const struct rig *rig;
        struct arena arena = {0};
        enum error_code code =
            histogram ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory for a histogram");

        if (!code && !(code = arena_init(&arena, ARENA_BYTES, error)) &&
            !(code = rig_load(name, &arena, &rig, error)) &&
            !(code = time_rig(options, name, rig, &arena, histogram, error))) {
            print_row(name,
                      options->limp ? "limp"
                      : task        ? task
                                    : "-",
                      1e-3 * (double)rig->tick_ns, histogram);
        }
        arena_fini(&arena);
        free(histogram);
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

int bench_ticks(int argc, char **argv)
{
    static struct ticks_command o = {.seconds = 10.0};
    static const struct option_spec options[] = {
        {"--task", OPTION_STRING, "TASK",
         "of all rigs; by default that of the list below, else none", .value = &o.task},
        {"--seconds", OPTION_REAL, "S", "simulated time of each, 10 by default",
         .value = &o.seconds, .min = 0.1, .max = 1e5, .unit = "seconds"},
        {"--limp", OPTION_FLAG, NULL, "let the robot fall and time it on the ground",
         .value = &o.limp},
    };
    struct operand_spec operand = {"RIG", "rigs' files or names; without them the list below",
                                   .noun = "rigs"};
    const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "ticks",
        .summary = "CPU time of each tick of a rig.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = &operand,
        .noperand = 1,
        .many = true,
        .manual = MANUAL_TICKS,
    };
    struct error error;
    enum error_code code;
    int status;

    /* Room for as many rigs as there are words */
    o.rig = calloc((size_t)argc + 1, sizeof *o.rig);
    if (!o.rig) {
        code = error_set(&error, ERROR_MEMORY, "no memory left for the command line");
        return options_end(&spec, code, &error);
    }
    operand.value = o.rig;
    if (options_read(&spec, argc, argv, &status)) {
        code = time_rigs(&o, &error);
        status = options_end(&spec, code, &error);
    }
    free(o.rig);
    return status;
}
