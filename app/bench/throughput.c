/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench throughput: measures how many simulated seconds a sweep computes per processor
 * and hour, by rig. It runs cases with coman-hil test, as a sweep does, and for comparison the
 * robot alone. coman-hil-bench ticks: measures the CPU time of each tick of a rig, by percentiles.
 */
#include "app/bench/bench.h"
#include "base/array.h"
#include "base/config.h"
#include "base/json_text.h"
#include "base/options.h"
#include "base/whole_file.h"
#include "manual/throughput.h"
#include "manual/ticks.h"
#include "rt/histogram.h"
#include "sim/simulator.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define ARENA_BYTES ((size_t)512 << 20) /* reserved address space */

/* Simulated time at the start that the benchmark ticks does not count, s: the caches fill. */
#define WARM_UP_S 0.1

enum {
    RIGS_MAX = 32,
    ROUNDS_MAX = 99,
    RANGE = 10, /* number of one-tick cases, which measure the start of a case */
    READINGS = 10001,
    FORMAT_VERSION = 2,
};

/* The quantities measured in a round. */
enum figure {
    FIGURE_RATE,
    FIGURE_ALONE,
    FIGURE_HOURLY = FIGURE_ALONE + ALONE_WAYS,
    FIGURE_START_MS,
    FIGURE_RANGE_MS,
    FIGURE_WHOLE_MS,
    FIGURE_WHOLE_MB,
    FIGURE_START_MB,
    FIGURES
};

/* Names of the figures in the JSON. */
static const char *const figure_names[FIGURES] = {
    [FIGURE_RATE] = "simulated_s_per_core_hour",
    [FIGURE_ALONE + ALONE_BODIES] = "bodies_s_per_core_hour",
    [FIGURE_ALONE + ALONE_BODIES_IMPLICIT] = "mujoco_implicit_s_per_core_hour",
    [FIGURE_ALONE + ALONE_BODIES_EULER] = "mujoco_s_per_core_hour",
    [FIGURE_ALONE + ALONE_STANDING] = "standing_s_per_core_hour",
    [FIGURE_ALONE + ALONE_STANDING_EULER] = "mujoco_standing_s_per_core_hour",
    [FIGURE_HOURLY] = "cases_per_core_hour",
    [FIGURE_START_MS] = "start_ms",
    [FIGURE_RANGE_MS] = "start_in_range_ms",
    [FIGURE_WHOLE_MS] = "case_ms",
    [FIGURE_START_MB] = "start_mb",
    [FIGURE_WHOLE_MB] = "case_mb",
};

/* A measured rig. */
struct measured_rig {
    const char *rig, *task;
    char file[PATH_MAX]; /* absolute path of the rig; "" if the rig is given by name */
    size_t nbus, nboard, naxis, nv;
    double tick_s, step_s;
    double figure[FIGURES][ROUNDS_MAX]; /* sorted after the last round; NAN = none */
};

/* The command line and the measurements. */
struct throughput {
    const char *task, *peers, *file;
    const char *const *rig;
    int64_t rounds;
    bool alone;     /* measures only the robot alone, no cases */
    double seconds; /* simulated time of a case, or of a rig for the benchmark ticks */
    struct peers_library library;
    const struct peer_dynamics *mujoco; /* NULL = not found */
    size_t nmeasured;
    struct measured_rig measured[RIGS_MAX];
};

/* The tasks of the shipped rigs, and the benchmark that measures each rig by default. */
static const struct shipped_rig {
    const char *rig, *task;
    bool throughput, ticks;
} shipped[] = {
    {"coman", "squat", true, true},         {"coman-fast", "squat", false, true},
    {"walk-flat", "walk", true, true},      {"walk-fast", "walk", false, true},
    {"walk-walkman", "walk", true, false},  {"grasp", "grasp", true, false},
    {"coman-cia402", "squat", true, false}, {"coman-compact", "squat", true, false},
    {"coman-foc", "squat", true, false},    {"hyq", "hold", true, false},
};

/* Chooses the rigs from the command line, else the shipped rigs. Takes the task from the command
 * line, else from the list, else leaves it NULL. */
static enum error_code choose_rigs(struct throughput *t, bool ticks, struct error *error)
{
    const size_t count = t->rig[0] ? SIZE_MAX : ARRAY_COUNT(shipped);

    for (size_t i = 0; i < count && (!t->rig[0] || t->rig[i]); i++) {
        struct measured_rig *rig = &t->measured[t->nmeasured];

        if (!t->rig[0] && !(ticks ? shipped[i].ticks : shipped[i].throughput)) {
            continue;
        }
        if (t->nmeasured == RIGS_MAX) {
            return error_set(error, ERROR_INPUT, "found more rigs than %d", RIGS_MAX);
        }
        t->nmeasured++;
        rig->rig = t->rig[0] ? t->rig[i] : shipped[i].rig;
        rig->task = t->task;
        for (size_t k = 0; !rig->task && k < ARRAY_COUNT(shipped); k++) {
            rig->task = strcmp(rig->rig, shipped[k].rig) == 0 ? shipped[k].task : NULL;
        }
    }
    return ERROR_NONE;
}

/* Reads the command line of the benchmark throughput or ticks, and runs it. */
static int run_benchmark(struct command_spec *spec, int argc, char **argv, struct throughput *t,
                         enum error_code (*measure)(struct throughput *, struct error *))
{
    const struct operand_spec operand = {"RIG", "rigs' files or names; without them the list below",
                                         .list = &t->rig, .noun = "rigs"};
    struct error error;
    enum error_code code;
    int status;

    spec->program = "coman-hil-bench";
    spec->operand = &operand;
    spec->noperand = 1;
    spec->many = true;
    if (options_read(spec, argc, argv, &status)) {
        code = measure(t, &error);
        status = options_end(spec, code, &error);
    }
    return status;
}

/* ---- cases ---- */

/* Resource use of a process and its finished child processes. */
struct cost {
    double cpu_s, resident_mb;
};

/* Runs coman-hil test with its arguments in folder, waits for it, and measures its cost. Returns an
 * error if a case does not pass, because the cost of a fallen robot cannot be compared. */
static enum error_code run_test(const char *program, const char *folder, const char *rig,
                                const char *const argument[4], struct cost *cost,
                                struct error *error)
{
    char path[PATH_MAX + 64], line[256] = "";
    struct rusage used;
    int status = 0, said;
    pid_t child;
    FILE *file;

    fflush(NULL);
    child = fork();
    if (child == 0) {
        if (!chdir(folder) &&
            (said = open("said", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)) >= 0 &&
            dup2(said, STDOUT_FILENO) >= 0 && dup2(said, STDERR_FILENO) >= 0) {
            execl(program, "coman-hil", "test", argument[0], argument[1], argument[2], argument[3],
                  (char *)NULL);
        }
        _exit(127);
    }
    if (child < 0 || wait4(child, &status, 0, &used) < 0 ||
        (WIFEXITED(status) && WEXITSTATUS(status) == 127)) {
        return error_set(error, ERROR_SYSTEM, "cannot run %s", program);
    }
    *cost = (struct cost){(double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                              1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec),
                          1024e-6 * (double)used.ru_maxrss};
    snprintf(path, sizeof path, "%s/said", folder);
    file = fopen(path, "r");
    if (file) {
        line[fread(line, 1, sizeof line - 1, file)] = '\0';
        fclose(file);
    }
    line[strcspn(line, "\n")] = '\0';
    return status || strstr(line, " failed") || strstr(line, " broken")
               ? error_set(error, ERROR_INPUT, "%s: %s", rig, line)
               : ERROR_NONE;
}

/* Writes a rig's name for a scenario in folder. A scenario can only name files below its folder,
 * and a rig file may refer to files beside it. Therefore it links the rig's whole tree into
 * folder. */
static void put_rig_name(const struct measured_rig *rig, const char *folder, FILE *scenario)
{
    char tree[PATH_MAX], link[PATH_MAX + 64], name[PATH_MAX];
    size_t end = strlen(rig->file);

    if (!rig->file[0]) {
        json_text_put(rig->rig, scenario);
        return;
    }

    /* The tree is the part of the path before the file's folder */
    for (int part = 0; part < 2; part++) {
        while (end > 0 && rig->file[--end] != '/') {
        }
    }
    snprintf(tree, sizeof tree, "%.*s/", (int)end, rig->file);
    snprintf(link, sizeof link, "%s/tree", folder);
    snprintf(name, sizeof name, "tree%.4000s", rig->file + end);
    (void)!symlink(tree, link);
    json_text_put(name, scenario);
}

/* Writes a scenario and a sweep over it. The first RANGE cases take one tick; the others are whole
 * cases. */
static enum error_code write_sweep(const struct throughput *t, const struct measured_rig *rig,
                                   const char *folder, struct error *error)
{
    char path[2][PATH_MAX + 64];
    FILE *scenario, *sweep;
    int failed;

    snprintf(path[0], sizeof path[0], "%s/case.yaml", folder);
    snprintf(path[1], sizeof path[1], "%s/sweep.yaml", folder);
    scenario = fopen(path[0], "w");
    sweep = fopen(path[1], "w");
    failed = !scenario || !sweep;
    if (scenario) {
        fputs("name: throughput\ndescription: A rig with its task.\nrig: ", scenario);
        put_rig_name(rig, folder, scenario);
        fprintf(scenario,
                "\ntask: %s\nduration_s: ${duration_s}\nparameters:\n"
                "  duration_s: {values: [1]}\n  number: {values: [0]}\nexpectations:\n"
                "  - {name: the task goes on, signal: task.status, between: [0, 1]}\n",
                rig->task);
        failed |= fclose(scenario);
    }

    /* A parameter without effect makes the samples of each duration */
    if (sweep) {
        fprintf(sweep,
                "name: throughput\nscenarios: [case.yaml]\nsamples: %d\nparameters:\n"
                "  duration_s: {grid: [%.9g, %.9g]}\n  number: {uniform: [0, 1]}\n",
                RANGE, rig->tick_s, t->seconds);
        failed |= fclose(sweep);
    }
    return failed ? error_set(error, ERROR_SYSTEM, "%s: cannot be written", folder) : ERROR_NONE;
}

/* Removes the results so that the cases run again. */
static void forget_results(const char *folder)
{
    char path[PATH_MAX + 64];

    for (int number = 1; number <= RANGE + 1; number++) {
        snprintf(path, sizeof path, "%s/cases.results/%d.json", folder, number);
        unlink(path);
    }
}

/* Measures one start and one whole case of a rig, in a folder that contains only the files of its
 * earlier rounds. */
static enum error_code measure_cases(const struct throughput *t, const struct measured_rig *rig,
                                     const char *program, const char *folder, double value[FIGURES],
                                     struct error *error)
{
    /* The first cases take one tick; the next one is the first whole case */
    static const char *const plan[4] = {"--plan", "sweep.yaml", "--output", "cases"};
    static const char *const one[4] = {"--case=1", "cases"};
    static const char *const many[4] = {"--case=1-10", "cases", "--jobs=1"};
    static const char *const full[4] = {"--case=11", "cases"};
    struct cost planning, start, range, whole;
    enum error_code code;
    double ticks_s;

    forget_results(folder);
    if ((code = write_sweep(t, rig, folder, error)) ||
        (code = run_test(program, folder, rig->rig, plan, &planning, error)) ||
        (code = run_test(program, folder, rig->rig, one, &start, error))) {
        return code;
    }

    /* The first case ran alone; remove its result so that it runs again in the range */
    forget_results(folder);
    if ((code = run_test(program, folder, rig->rig, many, &range, error)) ||
        (code = run_test(program, folder, rig->rig, full, &whole, error))) {
        return code;
    }

    /* Cost of the ticks: a whole case minus a one-tick case; no figure if noise makes it
     * negative */
    ticks_s = whole.cpu_s > start.cpu_s ? whole.cpu_s - start.cpu_s : (double)NAN;
    value[FIGURE_RATE] = 3600.0 * t->seconds / ticks_s;
    value[FIGURE_HOURLY] = 3600.0 / (range.cpu_s / RANGE + ticks_s);
    value[FIGURE_START_MS] = 1e3 * start.cpu_s;
    value[FIGURE_RANGE_MS] = 1e3 * range.cpu_s / RANGE;
    value[FIGURE_WHOLE_MS] = 1e3 * whole.cpu_s;
    value[FIGURE_START_MB] = start.resident_mb;
    value[FIGURE_WHOLE_MB] = whole.resident_mb;
    return ERROR_NONE;
}

/* Measures one round of a rig. */
static enum error_code measure_round(const struct throughput *t, struct measured_rig *rig,
                                     size_t round, const char *program, const char *folder,
                                     struct error *error)
{
    double value[FIGURES];
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < FIGURES; i++) {
        value[i] = NAN;
    }
    if (!t->alone && (code = measure_cases(t, rig, program, folder, value, error))) {
        return code;
    }
    for (int way = 0; way < ALONE_WAYS && !code; way++) {
        double cpu_s;

        code = alone_measure(rig->rig, (enum alone_way)way, t->mujoco, t->seconds, &cpu_s, error);
        value[FIGURE_ALONE + way] = 3600.0 * t->seconds / cpu_s;
    }
    for (size_t i = 0; i < FIGURES; i++) {
        rig->figure[i][round] = value[i];
    }
    return code;
}

/* Runs all rounds. Rigs take turns; each one has its own folder below a scratch folder. */
static enum error_code run_rounds(struct throughput *t, struct error *error)
{
    const char *parent = getenv("TMPDIR");
    const size_t all = (size_t)t->rounds * t->nmeasured;
    char program[PATH_MAX], scratch[PATH_MAX], folder[PATH_MAX + 32];
    enum error_code code = bench_find_program(program, error);

    if (code) {
        return code;
    }
    snprintf(scratch, sizeof scratch, "%.4000s/coman-hil-XXXXXX", parent ? parent : "/tmp");
    if (!mkdtemp(scratch)) {
        return error_set_file(error, errno, scratch, "cannot be made");
    }
    for (size_t n = 0; !code && n < all; n++) {
        snprintf(folder, sizeof folder, "%s/%zu", scratch, n % t->nmeasured);
        code = mkdir(folder, 0700) && errno != EEXIST
                   ? error_set_file(error, errno, folder, "cannot be made")
                   : measure_round(t, &t->measured[n % t->nmeasured], n / t->nmeasured, program,
                                   folder, error);
        bench_progress("throughput", n + 1, all);
    }
    folder_remove(scratch);
    return code;
}

/* ---- tables ---- */

/* Returns the median of a figure over the rounds, or NAN if a round has no value. */
static double median_of(const struct throughput *t, const struct measured_rig *rig, unsigned figure)
{
    return isfinite(rig->figure[figure][0]) ? rig->figure[figure][t->rounds / 2] : (double)NAN;
}

/* Prints a table of figures, one row per rig. It shows medians and ranges as "12345 (12000 ..
 * 13000)" with the ratio of the first to the last figure, or medians only. "-" = no value. */
static void print_table(const struct throughput *t, unsigned first, unsigned last, bool alone)
{
    for (size_t i = 0; i < t->nmeasured; i++) {
        const struct measured_rig *rig = &t->measured[i];
        const double ratio = median_of(t, rig, first) / median_of(t, rig, last);

        printf("%-21s", rig->rig);
        if (first == FIGURE_RATE) {
            printf(" %-6s %5zu %5zu", rig->task, rig->nbus, rig->naxis);
        }
        for (unsigned figure = first; figure <= last; figure++) {
            const double median = median_of(t, rig, figure);
            char text[64] = "-";

            if (isfinite(median)) {
                snprintf(text, sizeof text, alone ? "%.1f" : "%.0f (%.0f .. %.0f)", median,
                         rig->figure[figure][0], rig->figure[figure][t->rounds - 1]);
            }
            printf(" %*s", alone ? 9 : 26, text);
        }
        if (!alone && last > first) {
            printf(isfinite(ratio) ? " %9.2f" : "         -", ratio);
        }
        putchar('\n');
    }
}

static void write_json(const struct throughput *t, FILE *out)
{
    fprintf(out, "{\"format_version\": %d, \"version\": ", FORMAT_VERSION);
    json_text_put(HIL_VERSION, out);
    fprintf(out, ", \"case_s\": %.9g, \"rounds\": %d, \"range\": %d, \"mujoco\": ", t->seconds,
            (int)t->rounds, RANGE);
    if (t->mujoco) {
        json_text_put(t->mujoco->version, out);
    } else {
        fputs("null", out);
    }
    fputs(",\n \"rigs\": [", out);
    for (size_t i = 0; i < t->nmeasured; i++) {
        const struct measured_rig *rig = &t->measured[i];

        fprintf(out, "%s\n    {\"rig\": ", i ? "," : "");
        json_text_put(rig->rig, out);
        fputs(", \"task\": ", out);
        json_text_put(rig->task, out);
        fprintf(out, ", \"buses\": %zu, \"boards\": %zu, \"axes\": %zu, \"freedoms\": %zu",
                rig->nbus, rig->nboard, rig->naxis, rig->nv);
        fprintf(out, ", \"tick_s\": %.9g, \"step_s\": %.9g", rig->tick_s, rig->step_s);
        for (unsigned figure = 0; figure < FIGURES; figure++) {
            const double median = median_of(t, rig, figure);

            fprintf(out, ",\n     \"%s\": ", figure_names[figure]);
            if (isfinite(median)) {
                fprintf(out, "{\"median\": %.9g, \"low\": %.9g, \"high\": %.9g}", median,
                        rig->figure[figure][0], rig->figure[figure][t->rounds - 1]);
            } else {
                fputs("null", out);
            }
        }
        fputc('}', out);
    }
    fputs("\n]}\n", out);
}

/* Reads the rigs' files: fills in their data, and the tasks that are NULL. */
static enum error_code read_rigs(struct throughput *t, struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; !code && i < t->nmeasured; i++) {
        struct measured_rig *measured = &t->measured[i];
        const struct rig *rig;
        struct arena arena = {0};

        if (!(code = arena_init(&arena, ARENA_BYTES, error)) &&
            !(code = rig_load(measured->rig, &arena, &rig, error))) {
            if (!measured->task) {
                measured->task = rig->walk ? "walk" : rig->grasp.nphase ? "grasp" : "hold";
            }
            if (!realpath(measured->rig, measured->file)) {
                measured->file[0] = '\0';
            }
            measured->nbus = rig->nbus;
            measured->nboard = rig->boards.nboard;
            measured->naxis = rig->naxis;
            measured->nv = rig->robot->nv;
            measured->tick_s = 1e-9 * (double)rig->tick_ns;
            measured->step_s = 1e-9 * (double)rig->substep_ns;
        }
        arena_fini(&arena);
    }
    return code;
}

static enum error_code measure_throughput(struct throughput *t, struct error *error)
{
    struct whole_file file;
    enum error_code code;

    if ((code = choose_rigs(t, false, error)) || (code = read_rigs(t, error)) ||
        (code = bench_peers(t->peers, "MuJoCo is left out", &t->library, error))) {
        return code;
    }
    t->mujoco = alone_find_mujoco(t->library.peers);
    if (!(code = run_rounds(t, error))) {
        /* Sorts the figures of each rig */
        for (size_t i = 0; i < t->nmeasured * FIGURES; i++) {
            double *value = t->measured[i / FIGURES].figure[i % FIGURES], sum = 0.0;

            for (int64_t round = 0; round < t->rounds; round++) {
                sum += value[round];
            }
            bench_sort(value, (size_t)t->rounds);
            value[0] = isfinite(sum) ? value[0] : (double)NAN;
        }
        printf("cases of %g s; CPU time, median of %d rounds (least .. most)\n\n", t->seconds,
               (int)t->rounds);
        if (!t->alone) {
            printf("%-21s %-6s %5s %5s %26s\n", "simulated s/core-hour", "task", "buses", "axes",
                   "with boards and task");
            print_table(t, FIGURE_RATE, FIGURE_RATE, false);
            putchar('\n');
        }
        printf("%-21s %26s %26s %26s %9s\n", "bodies alone", "ours, implicit", "MuJoCo, implicit",
               "MuJoCo, Euler", "ratio");
        print_table(t, FIGURE_ALONE + ALONE_BODIES, FIGURE_ALONE + ALONE_BODIES_EULER, false);
        printf("\n%-21s %26s %26s %9s\n", "standing on its feet", "ours, implicit", "MuJoCo, Euler",
               "ratio");
        print_table(t, FIGURE_ALONE + ALONE_STANDING, FIGURE_ALONE + ALONE_STANDING_EULER, false);
        if (!t->alone) {
            printf("\n%-21s %9s %9s %9s %9s %9s\n", "a case", "an hour", "start ms", "in range",
                   "whole ms", "MB");
            print_table(t, FIGURE_HOURLY, FIGURE_WHOLE_MB, true);
            printf("an hour: whole cases in a range, on one processor\n");
        }
        printf(t->mujoco ? "bodies alone: at the rig's step, without contact, joint limits, "
                           "drives, boards or controller; standing: the same on the ground, with "
                           "springs in the joints; MuJoCo %s; ratio of ours to its default, Euler\n"
                         : "no MuJoCo was found\n",
               t->mujoco ? t->mujoco->version : "");
        if (t->file && !(code = whole_file_open(&file, t->file, error))) {
            write_json(t, file.out);
            code = whole_file_close(&file, ERROR_NONE, error);
        }
    }
    peers_close(&t->library);
    return code;
}

int bench_throughput(int argc, char **argv)
{
    static struct throughput t = {.rounds = 5, .seconds = 3.0};
    static const struct option_spec options[] = {
        {"--rounds", OPTION_INT, "N", "measurements of each, 5 by default", .value = &t.rounds,
         .min = 1, .max = ROUNDS_MAX},
        {"--seconds", OPTION_REAL, "S", "simulated time of a case, 3 by default",
         .value = &t.seconds, .min = 0.1, .max = 1000.0, .unit = "seconds"},
        {"--task", OPTION_STRING, "TASK",
         "of all rigs; by default that of the list below, else what the rig's file is for",
         .value = &t.task},
        {"--alone", OPTION_FLAG, NULL, "only the robots beside MuJoCo, without cases",
         .value = &t.alone},
        BENCH_PEERS_OPTION(&t.peers),
        {"--output", OPTION_STRING, "FILE", "write all figures into this file, as JSON",
         .value = &t.file, .letter = "-o"},
    };
    struct command_spec spec = {
        .name = "throughput",
        .summary = "Simulated seconds that a sweep gets out of a processor in an hour.",
        OPTION_TABLE(options),
        .manual = MANUAL_THROUGHPUT,
    };

    return run_benchmark(&spec, argc, argv, &t, measure_throughput);
}

/* ---- ticks ---- */

/* Measures the CPU time of ticks. */
struct ticks_timer {
    double begun_s;   /* CPU time at which the current tick began; negative = no tick yet */
    double reading_s; /* CPU time of one reading of the clock */
    int64_t from_ns;  /* virtual time from which ticks count */
    struct histogram histogram;
};

/* Ends the previous tick and begins the next; a callback of the loop's observer. */
static void time_tick(void *context, int64_t now_ns)
{
    struct ticks_timer *timer = context;
    const double now_s = bench_cpu_s();

    if (timer->begun_s >= 0.0 && now_ns > timer->from_ns) {
        histogram_add(&timer->histogram,
                      llround(1e9 * (now_s - timer->begun_s - timer->reading_s)));
    }
    timer->begun_s = now_s;
}

/* Runs a rig for WARM_UP_S plus the given time, and prints its row. */
static enum error_code time_rig(const struct throughput *t, const struct measured_rig *measured,
                                struct arena *arena, struct ticks_timer *timer, struct error *error)
{
    const struct simulator_observer observer = {.context = timer, .step = time_tick};
    struct simulator_config config = {
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .task = measured->task,
        .observer = &observer,
    };
    const struct histogram *times = &timer->histogram;
    struct realtime_report report;
    struct simulator *simulator;
    const struct rig *rig;
    double tick_us, mean_us;
    char notice[256];
    enum error_code code = rig_load(measured->rig, arena, &rig, error);

    if (code) {
        return code;
    }
    tick_us = 1e-3 * (double)rig->tick_ns;
    config.rig = rig;
    config.hold = rig->hold;
    config.settle = rig->settle;
    config.ticks = (uint64_t)ceil(1e6 * (WARM_UP_S + t->seconds) / tick_us);
    memset(timer, 0, sizeof *timer);
    timer->begun_s = -1.0;

    /* Measure the mean time of one reading of the CPU clock */
    const double begun_s = bench_cpu_s();

    for (int i = 1; i < READINGS; i++) {
        bench_cpu_s();
    }
    timer->reading_s = (bench_cpu_s() - begun_s) / READINGS;
    timer->from_ns = llround(1e9 * WARM_UP_S);
    if ((code = simulator_create(&config, arena, &simulator, notice, error))) {
        return code;
    }
    code = simulator_start(simulator, &report, error);
    if (!code && simulator_run(simulator) == LOOP_END_MODEL) {
        code = error_set(error, ERROR_UNSUPPORTED, "%s: %s", measured->rig,
                         simulator_parts(simulator).failure);
    }
    simulator_destroy(simulator);
    if (code) {
        return code;
    }
    mean_us = 1e-3 * (double)times->sum / (double)times->count;
    printf("%-16s %-8s %8.0f %8.1f %8.1f %8.1f %8.1f %8.1f %9.1f\n", measured->rig,
           measured->task ? measured->task : "-", tick_us, mean_us,
           1e-3 * (double)histogram_percentile(times, 0.5),
           1e-3 * (double)histogram_percentile(times, 0.99),
           1e-3 * (double)histogram_percentile(times, 0.999), 1e-3 * (double)times->max,
           tick_us / mean_us);
    return ERROR_NONE;
}

static enum error_code measure_ticks(struct throughput *t, struct error *error)
{
    static struct ticks_timer timer;
    enum error_code code = choose_rigs(t, true, error);

    printf("%-16s %-8s %8s %8s %8s %8s %8s %8s %9s\n", "CPU time, us", "task", "tick", "mean",
           "p50", "p99", "p99.9", "max", "tick/mean");
    for (size_t i = 0; !code && i < t->nmeasured; i++) {
        struct arena arena = {0};

        (void)((code = arena_init(&arena, ARENA_BYTES, error)) ||
               (code = time_rig(t, &t->measured[i], &arena, &timer, error)));
        arena_fini(&arena);
    }
    return code;
}

int bench_ticks(int argc, char **argv)
{
    static struct throughput t = {.seconds = 10.0};
    static const struct option_spec options[] = {
        {"--task", OPTION_STRING, "TASK",
         "of all rigs; by default that of the list below, else none", .value = &t.task},
        {"--seconds", OPTION_REAL, "S", "simulated time of each, 10 by default",
         .value = &t.seconds, .min = 0.1, .max = 1e5, .unit = "seconds"},
    };
    struct command_spec spec = {
        .name = "ticks",
        .summary = "CPU time of each tick of a rig.",
        OPTION_TABLE(options),
        .manual = MANUAL_TICKS,
    };

    return run_benchmark(&spec, argc, argv, &t, measure_ticks);
}
