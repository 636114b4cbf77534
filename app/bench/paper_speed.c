/* SPDX-License-Identifier: Apache-2.0 */
/* Measures all times of the paper: Fig. 4, and the real-time factors of Table 1 and section 6. */
#include "app/bench/bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

enum { ROUNDS = 5, DYNAMICS_ROUNDS = 100, QUICK_DYNAMICS_ROUNDS = 5 };

/* ---- the machine ---- */

/* Adds a description of the machine on which the times were measured. */
static void put_machine(struct report *report)
{
    struct utsname system;
    char name[128];
    double load[3] = {NAN, NAN, NAN};
    FILE *file = fopen("/proc/cpuinfo", "r");
    char line[512];

    /* Read the processor's name from /proc/cpuinfo */
    snprintf(name, sizeof name, "unknown processor");
    while (file && fgets(line, sizeof line, file)) {
        char *colon = strchr(line, ':');

        if (colon && !strncmp(line, "model name", strlen("model name"))) {
            line[strcspn(line, "\n")] = '\0';
            snprintf(name, sizeof name, "%s", colon + 1 + strspn(colon + 1, " "));
            break;
        }
    }
    if (file) {
        fclose(file);
    }
    uname(&system);
    getloadavg(load, 3);
    report_text(
        report,
        "Measured on %s, %ld processors, %s %s %s; compiler %s, coman-hil %s; %.1f processes were "
        "running on average in the last minute. Real-time factor: simulated time over CPU time of "
        "the loop's thread, and over time on the clock, which is longer when others use the "
        "machine. Medians of interleaved runs. Only this section differs from run to run.",
        name, sysconf(_SC_NPROCESSORS_ONLN), system.sysname, system.release, system.machine,
        __VERSION__, HIL_VERSION, load[0]);
    report_text(report, "The paper: a processor of 6 cores and 3.5 GHz by AMD.");
}

/* ---- section 6 ---- */

static const struct setting {
    const char *what, *rig;
    enum loop_clock clock;
    double said; /* the paper's real-time factor; NAN = none */
} settings[PAPER_SPEEDS] = {
    {"rk4, dt 0.1 ms, five bodies in contact", "grasp-paper", LOOP_CLOCK_FREE, 0.013},
    {"rk4, dt 0.1 ms, feet locked", "grasp-locked", LOOP_CLOCK_FREE, 0.033},
    {"rk4, dt 0.9 ms, feet locked", "grasp-coarse", LOOP_CLOCK_FREE, 0.28},
    {"implicit, dt 1 ms, five bodies in contact", "grasp", LOOP_CLOCK_FREE, NAN},
    {"implicit, dt 1 ms, five bodies, lockstep", "grasp", LOOP_CLOCK_LOCKSTEP, NAN},
};

/* Runs all settings in each round, so that changes of the machine's speed affect all of them. */
static enum error_code measure_settings(struct paper *paper, struct error *error)
{
    double cpu[PAPER_SPEEDS][ROUNDS], wall[PAPER_SPEEDS][ROUNDS]; /* real-time factors */
    size_t rounds = paper->quick ? 1 : ROUNDS;

    for (size_t round = 0; round < rounds; round++) {
        for (size_t i = 0; i < PAPER_SPEEDS; i++) {
            const struct paper_order order = {
                .rig = settings[i].rig, .task = "grasp", .clock = settings[i].clock};
            struct paper_run run;
            enum error_code code;

            paper_progress(paper, settings[i].what);
            code = paper_run(paper, &order, &run, error);
            cpu[i][round] = run.seconds / run.cpu_s;
            wall[i][round] = run.seconds / run.wall_s;
            paper_run_end(paper, &run);
            if (code) {
                return code;
            }
        }
    }

    /* Adds the table of real-time factors, with the medians of all rounds */
    report_table(&paper->report, "real-time-factors",
                 "The manipulation task with its controller, 23 motor axes and 4 F/T boards on "
                 "five buses inside the process.",
                 "settings|rig|paper|here, CPU time|here, clock|times the paper's");
    for (size_t i = 0; i < PAPER_SPEEDS; i++) {
        const double median = bench_median(cpu[i], rounds);
        char said[32] = "-", times[32] = "-";

        if (isfinite(settings[i].said)) {
            snprintf(said, sizeof said, "%g", settings[i].said);
            snprintf(times, sizeof times, "%.0f", median / settings[i].said);
        }
        report_row(&paper->report, "%s|%s|%s|%.2f|%.2f|%s", settings[i].what, settings[i].rig, said,
                   median, bench_median(wall[i], rounds), times);
        report_finding(&paper->report, true, "real-time factor, grasp, %s|%s|%.1f|",
                       settings[i].what, said, median);
    }
    return ERROR_NONE;
}

/* ---- Fig. 4 ---- */

/* Adds Fig. 4 and the table of all engines with the whole robot. */
static void put_dynamics(struct report *report, const struct dynamics_bench *bench)
{
    size_t last = bench->nsize - 1, reference = dynamics_bench_reference(bench);
    struct dynamics_plot plot;

    /* The figure, then one row per engine for the whole robot */
    dynamics_bench_draw(bench, &plot);
    report_figure(report, "figure-4",
                  "Paper: time grows linearly with the degrees of freedom, Robotran's symbolic "
                  "code with half of Simbody's slope and 3.5 times as fast at 29. Here: the same "
                  "parts of the robot, 12, 18, 21 and 29 degrees of freedom, on a logarithmic "
                  "axis. Other simulators as installed: Debian builds Simbody with assertions on, "
                  "without them it is some 1.8 times as fast.",
                  &plot.panel, 1);
    report_table(report, "accelerations", "One evaluation of the whole robot's accelerations.",
                 "program|version|us, median|slope, us a freedom|average relative difference from "
                 "the first");
    for (size_t e = 0; e < bench->nengine; e++) {
        char slope[32] = "-";

        if (bench->nsize > 1) {
            snprintf(slope, sizeof slope, "%.4f", bench->slope[e]);
        }
        report_row(report, "%s|%s|%.3f|%s|%.1e", bench->peer[e]->name, bench->peer[e]->version,
                   bench->cell[e][last].median, slope, bench->cell[e][last].difference);
    }

    /* The paper's statement about Simbody can be compared only if Simbody was measured */
    if (reference == 0) {
        report_text(report, "Simbody was not available (libhil-peers.so): ours only.");
        return;
    }
    report_finding(report, true,
                   "accelerations, 29 degrees of freedom: symbolic code against Simbody|3.5 times "
                   "as fast|%.0f times as fast|Symbolic code evaluates with vector instructions, "
                   "parts of the robot side by side; see the caption for Simbody.",
                   bench->cell[reference][last].median / bench->cell[1][last].median);
    report_finding(report, true,
                   "average relative difference of the accelerations|1.9e-13|%.1e|Simbody against "
                   "our numeric implementation.",
                   bench->cell[reference][last].difference);
    if (bench->nsize > 1) {
        report_finding(report, false, "Simbody's slope over the symbolic code's|about 2|%.0f|",
                       bench->slope[reference] / bench->slope[1]);
    }
}

/* ---- Table 1 ---- */

enum error_code paper_speed(struct paper *paper, const struct pendulum_table *table,
                            struct error *error)
{
    struct report *report = &paper->report;
    enum error_code code;

    report_section(report, "speed", "Speed: Fig. 4, Table 1 and section 6");
    put_machine(report);
    code = measure_settings(paper, error);
    if (!code) {
        static struct dynamics_bench bench;
        const struct rig *rig;
        struct arena arena;

        /* Measure the accelerations of COMAN with all engines */
        code = arena_init(&arena, DYNAMICS_ARENA_BYTES, error);
        bench = (struct dynamics_bench){.rounds =
                                            paper->quick ? QUICK_DYNAMICS_ROUNDS : DYNAMICS_ROUNDS,
                                        .whole_only = paper->quick};
        paper_progress(paper, "accelerations");
        if (!code && !(code = rig_load("coman", &arena, &rig, error))) {
            code = dynamics_bench_run(&bench, rig->robot->file, paper->peers, &arena, error);
        }
        if (!code) {
            put_dynamics(&paper->report, &bench);
        }
        dynamics_bench_end(&bench);
        arena_fini(&arena);
    }
    if (!code) {
        /* Adds the real-time factors of Table 1 */
        report_table(report, "table-1-speed",
                     "Table 1: real-time factors, simulated time units over seconds of CPU time.",
                     "bodies|dt|Robotran (paper)|coman-hil|ODE (paper)|ODE here");
        for (size_t n = 0; n < 2; n++) {
            for (size_t k = 0; k < table->nstep; k++) {
                char theirs[32] = "-";

                if (table->absolute) {
                    snprintf(theirs, sizeof theirs, "%.3g", table->theirs[n][k].rtf);
                }
                report_row(report, "%zu|%g|%g|%.3g|%g|%s", n + 1, pendulum_step_sizes[k],
                           pendulum_paper[n][k].robotran_rtf, table->ours[n][k].rtf,
                           pendulum_paper[n][k].ode_rtf, theirs);
            }
        }
        report_finding(report, true, "real-time factor, double pendulum, dt %g|%g|%.0f|",
                       pendulum_step_sizes[1], pendulum_paper[1][1].robotran_rtf,
                       table->ours[1][1].rtf);
        report_compared(report);
    }
    return code;
}
