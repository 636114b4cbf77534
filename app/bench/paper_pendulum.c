/* SPDX-License-Identifier: Apache-2.0 */
/* Reproduces the paper's Table 1 and Fig. 3: pendulums in relative and absolute coordinates. */
#include "app/bench/bench.h"

#include <math.h>

/* Adds a row of Table 1, with our errors and the paper's, for n + 1 bodies and step size k. */
static void pendulum_put_row(struct report *report, const char *who,
                             const struct peer_pendulum *peer, size_t n, size_t k,
                             const struct pendulum_row *row, double energy, double constraint)
{
    char distance[64] = "-|-";

    if (peer->constraints) {
        snprintf(distance, sizeof distance, "%.1e|%.0e", row->constraint, constraint);
    }
    report_row(report, "%s|%zu|%g|%zu|%zu|%.1e|%.0e|%s", who, n + 1, pendulum_step_sizes[k],
               (n + 1) * peer->coordinates, (n + 1) * peer->constraints, row->energy, energy,
               distance);
}

/* Adds the section on Table 1. */
static void put_table_1(struct paper *paper, const struct pendulum_table *table)
{
    struct report *report = &paper->report;

    report_section(report, "pendulums", "Table 1: relative and absolute coordinates");
    report_text(
        report,
        "A single and a double pendulum, dimensionless, in one coordinate a body through the "
        "whole plant with Runge-Kutta 4, and in seven coordinates and six constraints a body "
        "with ODE's own integrator (constraint force mixing 1e-10, error reduction 0.2). The "
        "paper leaves out the second body's mass: 2, for no other lets both bodies turn as one.");

    /* Add Table 1: our engine with relative coordinates, ODE with absolute coordinates */
    const struct peer_pendulum *absolute = table->absolute;
    char who[96];

    report_table(report, "table-1",
                 "Over 10 time units: the largest relative errors of the energy and, with absolute "
                 "coordinates, of the distance between center of mass and axis.",
                 "program|bodies|dt|coordinates|constraints|energy error|paper's energy error|"
                 "constraint error|paper's constraint error");
    for (size_t n = 0; n < 2; n++) {
        for (size_t k = 0; k < table->nstep; k++) {
            pendulum_put_row(report, "coman-hil (paper: Robotran)", &pendulum_ours, n, k,
                             &table->ours[n][k], pendulum_paper[n][k].robotran_energy, 0.0);
        }
    }
    for (size_t n = 0; absolute && n < 2; n++) {
        snprintf(who, sizeof who, "%s %s (paper: ODE)", absolute->name, absolute->version);
        for (size_t k = 0; k < table->nstep; k++) {
            pendulum_put_row(report, who, absolute, n, k, &table->theirs[n][k],
                             pendulum_paper[n][k].ode_energy, pendulum_paper[n][k].ode_constraint);
        }
    }

    /* Compare the energy errors with the paper's */
    static const char *const names[2] = {"single", "double"};

    for (size_t n = 0; n < 2; n++) {
        for (size_t k = 0; k < table->nstep; k++) {
            report_finding(
                report, k == 1, "energy error, %s pendulum, RK4, dt %g|%.0e|%.1e|%s", names[n],
                pendulum_step_sizes[k], pendulum_paper[n][k].robotran_energy,
                table->ours[n][k].energy,
                k == 0 ? "A third-order Runge-Kutta method gives the paper's number, RK4 does not."
                       : "The state is summed with compensation, so that rounding does not "
                         "add up over the steps: it is not the method that is better.");
        }
    }
    for (size_t n = 0; table->absolute && n < 2; n++) {
        report_finding(report, n == 1, "energy error, %s pendulum, ODE, dt %g|%.0e|%.1e|", names[n],
                       pendulum_step_sizes[1], pendulum_paper[n][1].ode_energy,
                       table->theirs[n][1].energy);
    }
    report_compared(report);
    if (table->nstep < PENDULUM_STEPS) {
        report_text(report, "The step %g was left out of this quick run.",
                    pendulum_step_sizes[PENDULUM_STEPS - 1]);
    }
    if (!table->absolute) {
        report_text(report, "ODE was not available (libhil-peers.so), so its half of the table is "
                            "missing here.");
    }
    report_text(report, "The real-time factors of Table 1 are timings: see Speed.");
}

/* Returns the largest difference between a turn's period and the analytic one, time units. */
static double worst_period(const struct pendulum_course *course, double period)
{
    double worst = 0.0;

    for (size_t i = 0; i < course->nturn; i++) {
        worst = fmax(worst, fabs(course->period[i] - period));
    }
    return worst;
}

/* Draws the periods and heights of all engines. */
static void put_courses(struct report *report, const struct pendulum_course *course, size_t count)
{
    const double period = pendulum_analytic_period(), ends[2] = {0.0, PENDULUM_PERIOD_UNITS},
                 flat[2] = {period, period};
    struct svg_series turns[3], heights[2];
    struct svg_plot panels[2] = {
        svg_panel("Period of one turn", "time, time units", "period, time units", turns, count + 1),
        svg_panel("Height of the first center of mass", "time, time units", "height, lengths",
                  heights, count)};

    /* One series per engine, and the analytic period as a horizontal line */
    for (size_t i = 0; i < count; i++) {
        const struct pendulum_course *one = &course[i];

        turns[i] = svg_line(one->peer->name, one->end, one->period, one->nturn, SVG_LINE);
        heights[i] = svg_line(one->peer->name, one->time, one->height, one->nsample, SVG_LINE);
    }
    turns[count] = svg_line("analytic", ends, flat, 2, SVG_DASHED);
    panels[1].x = (struct svg_axis){"time, time units", .fixed = true, .min = 60.0, .max = 140.0};
    report_figure(report, "figure-3",
                  "Paper: the period grows about linearly with ODE and fluctuates by about 5e-9 "
                  "with Robotran; the heights part and come to be in antiphase. Here: the same; "
                  "the second panel begins at 60 time units, where they begin to part.",
                  panels, 2);
}

enum error_code paper_pendulums(struct paper *paper, struct pendulum_table *table,
                                struct error *error)
{
    const struct peers *peers = paper->peers;
    struct pendulum_course course[2];
    struct arena arena;
    enum error_code code;

    *table = (struct pendulum_table){
        .absolute = peers && peers->npendulum ? &peers->pendulum[0] : NULL,
        .nstep = paper->quick ? PENDULUM_STEPS - 1 : PENDULUM_STEPS,
    };
    paper_progress(paper, "pendulums");
    code = pendulum_measure_table(table, error);
    if (code || (code = arena_init(&arena, (size_t)1 << 24, error))) {
        return code;
    }
    put_table_1(paper, table);
    paper_progress(paper, "synchronous pendulum");
    code = pendulum_run_course(&pendulum_ours, &course[0], &arena, error);
    if (!code && table->absolute) {
        code = pendulum_run_course(table->absolute, &course[1], &arena, error);
    }
    if (!code) {
        const size_t count = table->absolute ? 2 : 1;
        struct report *report = &paper->report;
        double period = pendulum_analytic_period();

        /* Add the section on Fig. 3; course[0] is ours. */
        report_section(report, "synchronous", "Fig. 3: the synchronous double pendulum");
        put_courses(report, course, count);
        report_finding(report, false,
                       "period from the elliptic integral, time units|about 3.15|%.8f|", period);
        report_finding(report, true,
                       "largest error of the period over %g time units, dt %g|about "
                       "5e-9|%.1e|Linear interpolation between steps gives the paper's error. Here "
                       "a cubic through angles and rates ends a turn.",
                       PENDULUM_PERIOD_UNITS, PENDULUM_PERIOD_STEP,
                       worst_period(&course[0], period));

        /* Findings that need an engine with absolute coordinates */
        if (count > 1) {
            report_finding(report, false,
                           "the same with ODE|grows about linearly, to be read off only|%.2f|",
                           worst_period(&course[1], period));
            report_finding(report, true,
                           "heights differ by half of their range after, time units|80|%.1f|Both "
                           "depend on ODE's drift alone, and that on its version and build; the "
                           "paper does not give them.",
                           pendulum_apart_at(&course[0], &course[1], 1.0));
            report_finding(report, true, "in antiphase after, time units|124|%.1f|as above",
                           pendulum_antiphase_at(&course[0], &course[1], period));
        }
        report_compared(report);
    }
    arena_fini(&arena);
    return code;
}
