/* SPDX-License-Identifier: Apache-2.0 */
/* Runs rigs for the report, and computes values from their recordings. */
#include "app/bench/bench.h"

#include "sim/simulator.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ARENA_BYTES ((size_t)512 << 20) /* reserved address space; unused pages cost nothing */

void paper_recorded_path(const struct paper *paper, const char *name, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%s/.recording%s%s", paper->folder, name[0] ? "/" : "", name);
}

/* Runs until the task ends, and stores the times. Returns an error if the task fails. */
static enum error_code paper_run_to_task_end(struct simulator *simulator,
                                             const struct paper_order *order, struct paper_run *run,
                                             struct error *error)
{
    struct realtime_report report;
    struct recorder_counters counters;
    struct task_runner_status status;
    const struct loop_stats *stats = simulator_stats(simulator);
    enum error_code code = simulator_start(simulator, &report, error);
    enum loop_end end;
    double begin;

    if (code) {
        return code;
    }

    /* Measure only the loop, without start and end of the run */
    begin = bench_cpu_s();
    end = simulator_run(simulator);
    run->cpu_s = bench_cpu_s() - begin;
    run->wall_s = 1e-9 * (double)(stats->end_ns - stats->start_ns);
    run->seconds = 1e-9 * (double)stats->time_ns;
    if (end == LOOP_END_MODEL) {
        return error_set(error, ERROR_UNSUPPORTED, "%s: %s", order->rig,
                         simulator_parts(simulator).failure);
    }
    task_runner_read(simulator_task_runner(simulator), &status);
    memcpy(run->message, status.message, sizeof run->message);
    if (status.status != TASK_DONE) {
        return error_set(error, ERROR_UNSUPPORTED, "%s: task %s: %s", order->rig, order->task,
                         status.message);
    }
    return simulator_finish_recording(simulator, &counters, error);
}

/* Creates the simulator, runs it and destroys it. */
static enum error_code paper_run_simulate(const struct paper *paper,
                                          const struct paper_order *order, struct paper_run *run,
                                          struct error *error)
{
    char directory[PATH_MAX], notice[256];
    struct simulator_config config = {
        .rig = &run->rig,
        .clock = order->clock,
        .hold = run->rig.hold,
        .settle = run->rig.settle,
        .overrun = run->rig.realtime.overrun,
        .transport = TRANSPORT_LOCAL,
        .task = order->task,
        .record = order->titles ? directory : NULL,
        .overwrite = true,
        .row_period_ns = order->row_ms * CLOCK_MS,
    };
    struct simulator *simulator;
    enum error_code code;

    paper_recorded_path(paper, "", directory);
    code = simulator_create(&config, &run->arena, &simulator, notice, error);
    if (code) {
        return code;
    }

    /* Close the recording before the simulator is destroyed */
    code = paper_run_to_task_end(simulator, order, run, error);
    simulator_destroy(simulator);
    return code;
}

/* Reads the recorded signals, and the joint angles if the order asks for them. */
static enum error_code read_signals(const struct paper *paper, const struct paper_order *order,
                                    struct paper_run *run, struct error *error)
{
    const struct robot *robot = run->rig.robot;
    const char *title[SIGNALS_MAX];
    char name[SIGNALS_MAX][80], titles[1024], *at = titles, path[PATH_MAX];
    size_t count = 0;

    snprintf(titles, sizeof titles, "%s", order->titles);
    while (at) {
        title[count++] = strsep(&at, "|");
    }

    if (order->joints && count + robot->njoint > SIGNALS_MAX) {
        return error_set(error, ERROR_INPUT, "%s: found %zu joints, expected at most %zu",
                         order->rig, robot->njoint, SIGNALS_MAX - count);
    }
    for (size_t j = 0; order->joints && j < robot->njoint; j++) {
        snprintf(name[j], sizeof name[j], "q_%s_rad", robot->joint[j].name);
        title[count++] = name[j];
    }
    paper_recorded_path(paper, "signals.csv", path);
    return signals_read(path, title, count, 0.0, INFINITY, &run->signals, error);
}

enum error_code paper_run(const struct paper *paper, const struct paper_order *order,
                          struct paper_run *run, struct error *error)
{
    const struct rig *rig;
    enum error_code code;

    *run = (struct paper_run){.seconds = 0.0};
    if ((code = arena_init(&run->arena, ARENA_BYTES, error)) ||
        (code = rig_load(order->rig, &run->arena, &rig, error))) {
        return code;
    }
    run->rig = *rig;
    run->rig.contact.friction = CONTACT_FRICTION_REGULARIZED; /* as in the paper */
    if (order->one_cycle) {
        run->rig.squat.cycles = 1;
    }
    code = paper_run_simulate(paper, order, run, error);
    if (!code && order->titles) {
        code = read_signals(paper, order, run, error);
    }
    return code;
}

void paper_run_end(const struct paper *paper, struct paper_run *run)
{
    char path[PATH_MAX];

    paper_recorded_path(paper, "", path);
    folder_remove(path);
    signals_free(&run->signals);
    arena_fini(&run->arena);
}

/* ---- numbers from series ---- */

struct paper_range paper_over(const double *x, const double *y, size_t count, double from,
                              double to)
{
    struct paper_range range = {NAN, NAN, NAN};
    double sum = 0.0, n = 0.0;

    for (size_t i = 0; i < count; i++) {
        if (x[i] >= from && x[i] < to) {
            sum += y[i];
            range.mean = sum / ++n;
            range.least = fmin(range.least, y[i]);
            range.most = fmax(range.most, y[i]);
        }
    }
    return range;
}
