/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench pendulum: prints the paper's Table 1 and Fig. 3, and writes them as CSV files and
 * plots. */
#include "app/bench/benchmarks.h"

#include "app/bench/output.h"
#include "app/bench/pendulum.h"
#include "app/report/report_file.h"
#include "app/report/svg.h"
#include "base/array.h"
#include "base/options.h"
#include "manual/peers.h"
#include "manual/pendulum.h"

#include <math.h>

/* ---- Table 1 ---- */

/* Prints an error and the paper's. */
static void put_error(double value, double said)
{
    char text[64];

    snprintf(text, sizeof text, "%.1e [%.0e]", value, said);
    printf(" %-18s", text);
}

/* Prints a real-time factor and the paper's. */
static void put_factor(double value, double said)
{
    char text[64];

    snprintf(text, sizeof text, "%.*f [%g]", value < 10.0 ? 2 : 0, value, said);
    printf(" %-18s", text);
}

/* Prints a row of Table 1: n + 1 bodies, step k. */
static void pendulum_print_row(const struct pendulum_table *table, size_t n, size_t k)
{
    const struct pendulum_row *us = &table->ours[n][k], *them = &table->theirs[n][k];
    const struct peer_pendulum *absolute = table->absolute;
    const struct pendulum_paper_row *said = &pendulum_paper[n][k];

    printf("%-7zu%-6.0e| %2zu %3zu", n + 1, pendulum_step_sizes[k],
           (n + 1) * pendulum_ours.coordinates, (n + 1) * pendulum_ours.constraints);
    put_error(us->energy, said->robotran_energy);
    put_factor(us->rtf, said->robotran_rtf);
    if (absolute) {
        printf("| %2zu %3zu", (n + 1) * absolute->coordinates, (n + 1) * absolute->constraints);
        put_error(them->energy, said->ode_energy);
        put_error(them->constraint, said->ode_constraint);
        put_factor(them->rtf, said->ode_rtf);
    }
    printf("\n");
}

/* Prints Table 1, ours and with absolute coordinates. */
static void pendulum_print_table(const struct pendulum_table *table)
{
    const struct peer_pendulum *absolute = table->absolute;
    char title[64];

    printf(
        "Over %g time units: energy error, the largest |E(t) - E(0)| / E(t); constraint error, the "
        "largest relative\nerror of the distance from center of mass to axis; RTF, simulated time "
        "over CPU time. In brackets: the paper's.\n\n",
        PENDULUM_TABLE_UNITS);
    printf("%-13s| %-44s", "", "coman-hil, Runge-Kutta 4 [Robotran]");
    if (absolute) {
        snprintf(title, sizeof title, "%s %s [ODE]", absolute->name, absolute->version);
        printf("| %s", title);
    }
    printf("\n%-7s%-6s| #Q #AC %-18s %-18s", "bodies", "dt", "energy error", "RTF");
    if (absolute) {
        printf("| #Q #AC %-18s %-18s %-18s", "energy error", "constraint error", "RTF");
    }
    printf("\n");
    for (size_t n = 0; n < 2; n++) {
        for (size_t k = 0; k < table->nstep; k++) {
            pendulum_print_row(table, n, k);
        }
    }
}

/* Writes the rows of an engine as CSV. */
static void write_rows(FILE *out, const struct peer_pendulum *peer, size_t nstep,
                       const struct pendulum_row rows[2][PENDULUM_STEPS])
{
    for (size_t n = 0; n < 2; n++) {
        for (size_t k = 0; k < nstep; k++) {
            const struct pendulum_row *row = &rows[n][k];

            fprintf(out, "%s,%s,%zu,%g,%zu,%zu,%.3e,%.3e,%.4g\n", peer->name, peer->version, n + 1,
                    pendulum_step_sizes[k], (n + 1) * peer->coordinates,
                    (n + 1) * peer->constraints, row->energy, row->constraint, row->rtf);
        }
    }
}

/* Writes pendulum-table.csv into a folder. */
static enum error_code write_table(const struct pendulum_table *table, const char *folder,
                                   struct error *error)
{
    static const char name[] = "pendulum-table.csv";
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, name, error);

    if (code) {
        return code;
    }
    fprintf(file.whole.out,
            "engine,version,bodies,dt,coordinates,constraints,energy_error,constraint_error,"
            "real_time_factor\n");
    write_rows(file.whole.out, &pendulum_ours, table->nstep, table->ours);
    if (table->absolute) {
        write_rows(file.whole.out, table->absolute, table->nstep, table->theirs);
    }
    return report_file_close(&file, ERROR_NONE, error);
}

/* ---- Fig. 3 ---- */

/* Prints turns and periods of an engine's course. */
static void print_course(const struct pendulum_course *course, double period)
{
    double worst = 0.0;

    for (size_t i = 0; i < course->nturn; i++) {
        worst = fmax(worst, fabs(course->period[i] - period));
    }
    printf("  %-10s%4zu turns, period %.10f at first, %.10f at last, largest error %.1e\n",
           course->peer->name, course->nturn, course->period[0], course->period[course->nturn - 1],
           worst);
}

/* Prints all courses beside the analytic period, and when they part. */
static void print_courses(const struct pendulum_course *course, size_t count)
{
    double period = pendulum_analytic_period();

    printf("\nSynchronous double pendulum over %g time units, dt = %g; analytic period %.14f [the "
           "paper's 3.15]\n",
           PENDULUM_PERIOD_UNITS, PENDULUM_PERIOD_STEP, period);
    for (size_t i = 0; i < count; i++) {
        print_course(&course[i], period);
    }
    printf("  [Robotran: within 5e-9 of the analytic period; ODE: growing about linearly]\n");
    if (count > 1) {
        printf("  heights of the first center of mass differ by half of their range at %.1f "
               "[80], turning in antiphase from %.1f [124]\n",
               pendulum_apart_at(&course[0], &course[1], 1.0),
               pendulum_antiphase_at(&course[0], &course[1], period));
    }
}

/* Writes a plot beside the CSV file of the same name. */
static enum error_code write_plot_file(const char *folder, const char *name,
                                       const struct svg_plot *plot, struct error *error)
{
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, name, error);

    if (code) {
        return code;
    }
    return report_file_close(&file, svg_write(plot, file.whole.out, error), error);
}

/* Writes the periods of all turns as CSV and as a plot. */
static enum error_code write_periods(const struct pendulum_course *course, size_t count,
                                     const char *folder, struct error *error)
{
    static const char name[] = "pendulum-period.csv";
    const double period = pendulum_analytic_period(), ends[2] = {0.0, PENDULUM_PERIOD_UNITS},
                 flat[2] = {period, period};
    struct svg_series series[3] = {
        {.name = "analytic", .x = ends, .y = flat, .count = 2, .style = SVG_DASHED}};
    const struct svg_plot plot = {.title = "Synchronous double pendulum, dt = 0.01",
                                  .x = {.label = "time"},
                                  .y = {.label = "period of one turn"},
                                  .series = series,
                                  .nseries = count + 1};
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, name, error);

    if (code) {
        return code;
    }

    /* A row for each turn, and a series for each engine */
    fprintf(file.whole.out, "engine,turn,time,period,error\n");
    for (size_t i = 0; i < count; i++) {
        const struct pendulum_course *c = &course[i];

        for (size_t k = 0; k < c->nturn; k++) {
            fprintf(file.whole.out, "%s,%zu,%.9f,%.12f,%.3e\n", c->peer->name, k + 1, c->end[k],
                    c->period[k], c->period[k] - period);
        }
        series[i + 1] = (struct svg_series){
            .name = c->peer->name, .x = c->end, .y = c->period, .count = c->nturn};
    }
    code = report_file_close(&file, ERROR_NONE, error);
    return code ? code : write_plot_file(folder, "pendulum-period.svg", &plot, error);
}

/* Writes the heights of the first center of mass as CSV and as a plot. */
static enum error_code write_heights(const struct pendulum_course *course, size_t count,
                                     const char *folder, struct error *error)
{
    static const char name[] = "pendulum-height.csv";
    struct svg_series series[2];
    /* As far as the paper's figure reaches: antiphase at 124 */
    const struct svg_plot plot = {.title = "Synchronous double pendulum, dt = 0.01",
                                  .x = {.label = "time", .fixed = true, .min = 0.0, .max = 130.0},
                                  .y = {.label = "height of the first center of mass"},
                                  .series = series,
                                  .nseries = count,
                                  .width = 1200};
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, name, error);

    if (code) {
        return code;
    }

    /* A row for each sample, and a series for each engine */
    fprintf(file.whole.out, "engine,time,height\n");
    for (size_t i = 0; i < count; i++) {
        const struct pendulum_course *c = &course[i];

        for (size_t k = 0; k < c->nsample; k++) {
            fprintf(file.whole.out, "%s,%.2f,%.9f\n", c->peer->name, c->time[k], c->height[k]);
        }
        series[i] = (struct svg_series){.name = c->peer->name,
                                        .x = c->time,
                                        .y = c->height,
                                        .count = c->nsample,
                                        .style = i ? SVG_DASHED : SVG_LINE};
    }
    code = report_file_close(&file, ERROR_NONE, error);
    return code ? code : write_plot_file(folder, "pendulum-height.svg", &plot, error);
}

/* Measures and prints Table 1 and Fig. 3, and writes them when there is a folder. */
static enum error_code run_pendulums(struct pendulum_table *table, const char *folder,
                                     struct arena *arena, struct error *error)
{
    struct pendulum_course course[2];
    size_t count = table->absolute ? 2 : 1;
    enum error_code code = pendulum_measure_table(table, error);

    if (code) {
        return code;
    }
    pendulum_print_table(table);
    if ((code = pendulum_run_course(&pendulum_ours, &course[0], arena, error)) ||
        (table->absolute &&
         (code = pendulum_run_course(table->absolute, &course[1], arena, error)))) {
        return code;
    }
    print_courses(course, count);
    if (!folder) {
        return ERROR_NONE;
    }
    if ((code = write_table(table, folder, error)) ||
        (code = write_periods(course, count, folder, error))) {
        return code;
    }
    return write_heights(course, count, folder, error);
}

int bench_pendulum(int argc, char **argv)
{
    static const char *folder, *module;
    static bool quick;
    static const struct option_spec options[] = {
        {.name = "--quick",
         .type = OPTION_FLAG,
         .help = "leave out the step size 1e-6, which takes nearly all of the time",
         .value = &quick},
        BENCH_OUT_OPTION(&folder, "pendulum-table.csv, pendulum-period.csv and .svg, and "
                                  "pendulum-height.csv and .svg"),
        BENCH_PEERS_OPTION(&module),
    };
    static const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "pendulum",
        .summary = "A single and a double pendulum in relative and in absolute coordinates, the "
                   "paper's Table 1 and Fig. 3.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .manual = MANUAL_PENDULUM "\n\n" MANUAL_PEERS,
    };
    static struct pendulum_table table;
    struct peers_library library;
    struct arena arena;
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    code = bench_peers(module, "ours only", &library, &error);
    if (code) {
        goto end_peers;
    }
    code = arena_init(&arena, (size_t)1 << 24, &error);
    if (code) {
        goto end_peers;
    }

    /* Absolute coordinates are those of the module's first engine, if there is one */
    table = (struct pendulum_table){
        .absolute = library.peers && library.peers->npendulum ? &library.peers->pendulum[0] : NULL,
        .nstep = quick ? PENDULUM_STEPS - 1 : PENDULUM_STEPS};
    code = run_pendulums(&table, folder, &arena, &error);
    arena_fini(&arena);

end_peers:
    peers_close(&library);
    return options_end(&spec, code, &error);
}
