/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench pendulum: a single and a double pendulum in relative coordinates (ours, Runge-Kutta
 * 4 through the whole plant) and in absolute ones with constraints (another simulator), as in the
 * paper's section 3.1: its Table 1 and Fig. 3.
 *
 * Dimensionless: gravity, first mass and its distance from the axis are 1, both bodies' inertias 5.5
 * and 2, the second axis 2 from the first, the second center of mass 2.5 from that. The paper leaves
 * out the second mass; bodies that are to stay in line must be asked for the same acceleration by
 * both equations of motion,
 *     first:   (5.5 + 1 + 4 m2 + 5 m2) a'' = -(1 + 2 m2) sin a
 *     second:       (2 + 6.25 m2 + 5 m2) a'' = -2.5 m2 sin a
 * which only m2 = 2 does, with a'' = -(5/24.5) sin a. Started at speed w0 = 2.1 they turn over with
 * the period 4 K(m)/w0, m = 4 (5/24.5)/w0^2, K the complete elliptic integral of the first kind.
 */
#include "app/bench/output.h"
#include "app/bench/pendulum.h"
#include "app/bench/benchmarks.h"
#include "app/report/report_file.h"
#include "base/options.h"
#include "app/report/svg.h"

#include "model/plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define START_SPEED 2.1
#define TIMED_S 0.2 /* short runs are timed again and again for as long */

enum { TIMED_MAX = 51, CHECKS_MAX = 1000000, SAMPLE = 10 };

const double pendulum_step_sizes[PENDULUM_STEPS] = {1e-2, 1e-4, 1e-6};

const struct pendulum_paper_row pendulum_paper[2][PENDULUM_STEPS] = {
    {{3e-8, 800.0, 2e-3, 1e-3, 1e3},
     {1e-13, 31.0, 8e-6, 1e-7, 26.0},
     {1e-13, 0.3, 8e-8, 1e-11, 0.3}},
    {{3e-8, 500.0, 6e-3, 1e-3, 700.0},
     {1e-13, 18.0, 1e-5, 1e-7, 10.0},
     {1e-13, 0.2, 1e-7, 1e-11, 0.1}},
};

static const struct peer_chain chain_of[2] = {
    {.count = 1,
     .gravity = 1.0,
     .mass = {1.0},
     .inertia = {5.5},
     .com = {1.0},
     .speed = START_SPEED},
    {.count = 2,
     .gravity = 1.0,
     .mass = {1.0, 2.0},
     .inertia = {5.5, 2.0},
     .com = {1.0, 2.5},
     .reach = 2.0,
     .speed = START_SPEED},
};

/* ---- ours, in the terms of the others ---- */

struct ours {
    struct arena arena;
    struct robot robot;
    struct robot_body body[3];
    struct robot_joint joint[2];
    struct dynamics dynamics;
    struct plant *plant;
    const struct peer_chain *chain;
    double *state; /* angles of the joints, then their rates */
};

static void describe(struct ours *ours)
{
    static const struct robot_joint hinge = {
        .type = JOINT_REVOLUTE,
        .axis = {0.0, 1.0, 0.0},
        .rotation = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0},
        .lower = -1e6,
        .upper = 1e6,
        .torque_limit = 1.0,
    };
    const struct peer_chain *chain = ours->chain;

    ours->robot = (struct robot){.name = "pendulum",
                                 .file = "",
                                 .gravity = {0.0, 0.0, -chain->gravity},
                                 .nbody = chain->count + 1,
                                 .njoint = chain->count,
                                 .body = ours->body,
                                 .joint = ours->joint,
                                 .imu_frame = -1};
    ours->body[0] = (struct robot_body){.name = "base", .parent = -1};
    for (size_t b = 0; b < chain->count; b++) {
        double I = chain->inertia[b];

        ours->joint[b] = hinge;
        ours->joint[b].name = b ? "second" : "first";
        ours->joint[b].origin[2] = b ? -chain->reach : 0.0;
        ours->body[b + 1] = (struct robot_body){
            .name = ours->joint[b].name,
            .parent = (int)b,
            .inertia = {.mass = chain->mass[b],
                        .com = {0.0, 0.0, -chain->com[b]},
                        .I = {I, 0.0, 0.0, I, 0.0, I}},
        };
    }
}

static void ours_destroy(void *engine)
{
    struct ours *ours = engine;

    arena_fini(&ours->arena);
    free(ours);
}

static enum error_code build(struct ours *ours, double dt, struct error *error)
{
    static const double hanging[2];
    struct plant_config config = {.robot = &ours->robot,
                                  .dynamics = &ours->dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = llround(dt * 1e9),
                                  .supply_v = 1.0};
    enum error_code code = arena_init(&ours->arena, (size_t)1 << 22, error);
    size_t count;

    describe(ours);
    if (code || (code = robot_finish(&ours->robot, error)) ||
        (code = dynamics_generic(&ours->robot, &ours->arena, &ours->dynamics, error)) ||
        (code = plant_create(&config, &ours->arena, &ours->plant, error))) {
        return code;
    }
    plant_reset(ours->plant, NULL, NULL, hanging);
    ours->state = plant_state(ours->plant, &count);
    ours->state[ours->chain->count] = ours->chain->speed;
    return ERROR_NONE;
}

static void *ours_create(const struct peer_chain *chain, double dt, char *message, size_t size)
{
    struct ours *ours = calloc(1, sizeof *ours);
    struct error error = {.text = "no memory"};

    if (ours) {
        ours->chain = chain;
    }
    if (!ours || build(ours, dt, &error)) {
        snprintf(message, size, "%s", error.text);
        if (ours) {
            ours_destroy(ours);
        }
        return NULL;
    }
    return ours;
}

/* Without contact nothing in it can fail. */
static void ours_step(void *engine, size_t steps)
{
    plant_step(((struct ours *)engine)->plant, steps);
}

static void ours_get(void *engine, struct peer_chain_body *out)
{
    const struct ours *ours = engine;
    double x = 0.0, z = 0.0, vx = 0.0, vz = 0.0, angle = 0.0, rate = 0.0;

    for (size_t b = 0; b < ours->chain->count; b++) {
        double com = ours->chain->com[b], reach = ours->chain->reach, sine, cosine;

        angle += ours->state[b];
        rate += ours->state[ours->chain->count + b];
        sine = sin(angle);
        cosine = cos(angle);
        out[b] = (struct peer_chain_body){.x = x - com * sine,
                                          .z = z - com * cosine,
                                          .vx = vx - com * cosine * rate,
                                          .vz = vz + com * sine * rate,
                                          .angle = angle,
                                          .rate = rate};
        x -= reach * sine;
        z -= reach * cosine;
        vx -= reach * cosine * rate;
        vz += reach * sine * rate;
    }
}

const struct peer_pendulum pendulum_ours = {"coman-hil", HIL_VERSION,  1,         0,
                                            ours_create, ours_destroy, ours_step, ours_get};

/* ---- what is measured ---- */

static double energy_of(const struct peer_chain *chain, const struct peer_chain_body *body)
{
    double energy = 0.0;

    for (size_t b = 0; b < chain->count; b++) {
        energy += 0.5 * chain->mass[b] * (body[b].vx * body[b].vx + body[b].vz * body[b].vz) +
                  0.5 * chain->inertia[b] * body[b].rate * body[b].rate +
                  chain->mass[b] * chain->gravity * body[b].z;
    }
    return energy;
}

/* Relative errors of the distances between centers of mass and the axes they turn about. */
static double constraint_error(const struct peer_chain *chain, const struct peer_chain_body *body)
{
    double axis_x = 0.0, axis_z = 0.0, worst = 0.0;

    for (size_t b = 0; b < chain->count; b++) {
        double distance = hypot(body[b].x - axis_x, body[b].z - axis_z);

        worst = fmax(worst, fabs(distance / chain->com[b] - 1.0));
        axis_x = body[b].x - (chain->reach - chain->com[b]) * sin(body[b].angle);
        axis_z = body[b].z - (chain->reach - chain->com[b]) * cos(body[b].angle);
    }
    return worst;
}

static double cpu_s(void)
{
    struct timespec now;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static enum error_code create(const struct peer_pendulum *peer, const struct peer_chain *chain,
                              double dt, void **engine, struct error *error)
{
    char message[512];

    *engine = peer->create(chain, dt, message, sizeof message);
    return *engine ? ERROR_NONE
                   : error_set(error, peer == &pendulum_ours ? ERROR_MEMORY : ERROR_UNSUPPORTED,
                               "%s: %s", peer->name, message);
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Median CPU time of a run with nothing but steps. */
static enum error_code time_run(const struct peer_pendulum *peer, const struct peer_chain *chain,
                                double dt, double *seconds, struct error *error)
{
    double spent[TIMED_MAX], sum = 0.0;
    size_t n = 0;

    while (n == 0 || (n < TIMED_MAX && sum < TIMED_S)) {
        void *engine;
        double start;
        enum error_code code = create(peer, chain, dt, &engine, error);

        if (code) {
            return code;
        }
        start = cpu_s();
        peer->step(engine, (size_t)llround(PENDULUM_TABLE_UNITS / dt));
        spent[n] = cpu_s() - start;
        sum += spent[n++];
        peer->destroy(engine);
    }
    qsort(spent, n, sizeof *spent, by_size);
    *seconds = spent[n / 2];
    return ERROR_NONE;
}

static enum error_code measure_row(const struct peer_pendulum *peer, const struct peer_chain *chain,
                                   double dt, struct pendulum_row *row, struct error *error)
{
    size_t steps = (size_t)llround(PENDULUM_TABLE_UNITS / dt);
    size_t stride = steps > CHECKS_MAX ? steps / CHECKS_MAX : 1;
    struct peer_chain_body body[2];
    double start, seconds;
    void *engine;
    enum error_code code = create(peer, chain, dt, &engine, error);

    if (code) {
        return code;
    }
    *row = (struct pendulum_row){0};
    peer->get(engine, body);
    start = energy_of(chain, body);
    for (size_t k = 0; k < steps; k += stride) {
        double energy;

        peer->step(engine, stride);
        peer->get(engine, body);
        energy = energy_of(chain, body);
        row->energy = fmax(row->energy, fabs((energy - start) / energy));
        row->constraint = fmax(row->constraint, constraint_error(chain, body));
    }
    peer->destroy(engine);
    code = time_run(peer, chain, dt, &seconds, error);
    if (!code) {
        row->rtf = PENDULUM_TABLE_UNITS / seconds;
    }
    return code;
}

/* ---- Table 1 ---- */

enum error_code pendulum_measure_table(struct pendulum_table *table, struct error *error)
{
    size_t all = 2 * table->nstep, done = 0;
    enum error_code code = ERROR_NONE;

    for (size_t n = 0; n < 2; n++) {
        for (size_t k = 0; !code && k < table->nstep; k++) {
            code = measure_row(&pendulum_ours, &chain_of[n], pendulum_step_sizes[k],
                               &table->ours[n][k], error);
            if (!code && table->absolute) {
                code = measure_row(table->absolute, &chain_of[n], pendulum_step_sizes[k],
                                   &table->theirs[n][k], error);
            }
            bench_progress("pendulum, table", ++done, all);
        }
    }
    return code;
}

/* A measured figure and the paper's. */
static void put_error(double value, double said)
{
    char text[64];

    snprintf(text, sizeof text, "%.1e [%.0e]", value, said);
    printf(" %-18s", text);
}

static void put_factor(double value, double said)
{
    char text[64];

    snprintf(text, sizeof text, "%.*f [%g]", value < 10.0 ? 2 : 0, value, said);
    printf(" %-18s", text);
}

static void print_row(const struct pendulum_table *table, size_t n, size_t k)
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

static void print_table(const struct pendulum_table *table)
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
            print_row(table, n, k);
        }
    }
}

static enum error_code write_rows(FILE *out, const struct peer_pendulum *peer, size_t nstep,
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
    return ERROR_NONE;
}

static enum error_code write_table(const struct pendulum_table *table, const char *folder,
                                   struct error *error)
{
    static const char name[] = "pendulum-table.csv";
    FILE *out;
    enum error_code code = report_file_open(folder, name, &out, error);

    if (code) {
        return code;
    }
    fprintf(out, "engine,version,bodies,dt,coordinates,constraints,energy_error,constraint_error,"
                 "real_time_factor\n");
    write_rows(out, &pendulum_ours, table->nstep, table->ours);
    if (table->absolute) {
        write_rows(out, table->absolute, table->nstep, table->theirs);
    }
    return report_file_close(out, name, ERROR_NONE, error);
}

/* ---- Fig. 3 ---- */

double pendulum_analytic_period(void)
{
    double m = 4.0 * (5.0 / 24.5) / (START_SPEED * START_SPEED), a = 1.0, b = sqrt(1.0 - m);

    /* K(m) = pi / (2 agm(1, sqrt(1 - m))) */
    for (int i = 0; i < 8; i++) {
        double mean = 0.5 * (a + b);

        b = sqrt(a * b);
        a = mean;
    }
    return 4.0 * M_PI / (2.0 * a) / START_SPEED;
}

/* Part of the step at which the angle passes goal: Newton on the cubic that fits angles and rates
 * (angle, rate) at both ends. */
static double passing(const double before[2], const double after[2], double goal)
{
    double s = (goal - before[0]) / (after[0] - before[0]);

    for (int i = 0; i < 20; i++) {
        double a = before[0], b = after[0], u = PENDULUM_PERIOD_STEP * before[1],
               v = PENDULUM_PERIOD_STEP * after[1];
        double c2 = 3.0 * (b - a) - 2.0 * u - v, c3 = 2.0 * (a - b) + u + v;

        s -= (a + s * (u + s * (c2 + s * c3)) - goal) / (u + s * (2.0 * c2 + s * 3.0 * c3));
    }
    return s;
}

static void end_turn(struct pendulum_course *course, double now)
{
    double last = course->nturn ? course->end[course->nturn - 1] : 0.0;

    if (course->nturn < PENDULUM_TURNS_MAX) {
        course->end[course->nturn] = now;
        course->period[course->nturn++] = now - last;
    }
}

enum error_code pendulum_run_course(const struct peer_pendulum *peer,
                                    struct pendulum_course *course, struct arena *arena,
                                    struct error *error)
{
    size_t steps = (size_t)llround(PENDULUM_PERIOD_UNITS / PENDULUM_PERIOD_STEP);
    struct peer_chain_body body[2];
    double before[2], after[2];
    enum error_code code;
    void *engine;

    *course = (struct pendulum_course){.peer = peer};
    course->time = arena_alloc(arena, steps / SAMPLE + 1, sizeof(double));
    course->height = arena_alloc(arena, steps / SAMPLE + 1, sizeof(double));
    if (!course->time || !course->height) {
        return error_set(error, ERROR_MEMORY, "no memory for %zu samples", steps / SAMPLE);
    }
    code = create(peer, &chain_of[1], PENDULUM_PERIOD_STEP, &engine, error);
    if (code) {
        return code;
    }
    peer->get(engine, body);
    after[0] = body[0].angle;
    for (size_t k = 0; k < steps; k++) {
        double goal = 2.0 * M_PI * (double)(course->nturn + 1);

        if (k % SAMPLE == 0) {
            course->time[course->nsample] = PENDULUM_PERIOD_STEP * (double)k;
            course->height[course->nsample++] = body[0].z;
        }
        before[0] = after[0];
        before[1] = body[0].rate;
        peer->step(engine, 1);
        peer->get(engine, body);
        /* the angle goes on where the engine's own may jump by a turn */
        after[0] = before[0] + remainder(body[0].angle - before[0], 2.0 * M_PI);
        after[1] = body[0].rate;
        if (after[0] >= goal) {
            end_turn(course, PENDULUM_PERIOD_STEP * ((double)k + passing(before, after, goal)));
        }
    }
    peer->destroy(engine);
    return ERROR_NONE;
}

double pendulum_apart_at(const struct pendulum_course *a, const struct pendulum_course *b,
                         double difference)
{
    for (size_t i = 0; i < a->nsample; i++) {
        if (fabs(a->height[i] - b->height[i]) >= difference) {
            return a->time[i];
        }
    }
    return NAN;
}

double pendulum_antiphase_at(const struct pendulum_course *a, const struct pendulum_course *b,
                             double period)
{
    for (size_t i = 0; i < a->nturn && i < b->nturn; i++) {
        if (fabs(a->end[i] - b->end[i]) >= 0.5 * period) {
            return fmin(a->end[i], b->end[i]);
        }
    }
    return NAN;
}

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

static enum error_code write_periods(const struct pendulum_course *course, size_t count,
                                     const char *folder, struct error *error)
{
    static const char name[] = "pendulum-period.csv", plot_name[] = "pendulum-period.svg";
    const double period = pendulum_analytic_period(), ends[2] = {0.0, PENDULUM_PERIOD_UNITS},
                 flat[2] = {period, period};
    struct svg_series series[3] = {
        {.name = "analytic", .x = ends, .y = flat, .count = 2, .style = SVG_DASHED}};
    const struct svg_plot plot = {.title = "Synchronous double pendulum, dt = 0.01",
                                  .x = {.label = "time"},
                                  .y = {.label = "period of one turn"},
                                  .series = series,
                                  .nseries = count + 1};
    FILE *out;
    enum error_code code = report_file_open(folder, name, &out, error);

    if (code) {
        return code;
    }
    fprintf(out, "engine,turn,time,period,error\n");
    for (size_t i = 0; i < count; i++) {
        const struct pendulum_course *c = &course[i];

        for (size_t k = 0; k < c->nturn; k++) {
            fprintf(out, "%s,%zu,%.9f,%.12f,%.3e\n", c->peer->name, k + 1, c->end[k], c->period[k],
                    c->period[k] - period);
        }
        series[i + 1] = (struct svg_series){
            .name = c->peer->name, .x = c->end, .y = c->period, .count = c->nturn};
    }
    code = report_file_close(out, name, ERROR_NONE, error);
    if (!code) {
        code = report_file_open(folder, plot_name, &out, error);
    }
    return code ? code : report_file_close(out, plot_name, svg_write(&plot, out, error), error);
}

static enum error_code write_heights(const struct pendulum_course *course, size_t count,
                                     const char *folder, struct error *error)
{
    static const char name[] = "pendulum-height.csv", plot_name[] = "pendulum-height.svg";
    struct svg_series series[2];
    /* as far as the paper's figure tells of: antiphase at 124 */
    const struct svg_plot plot = {.title = "Synchronous double pendulum, dt = 0.01",
                                  .x = {.label = "time", .fixed = true, .min = 0.0, .max = 130.0},
                                  .y = {.label = "height of the first center of mass"},
                                  .series = series,
                                  .nseries = count,
                                  .width = 1200};
    FILE *out;
    enum error_code code = report_file_open(folder, name, &out, error);

    if (code) {
        return code;
    }
    fprintf(out, "engine,time,height\n");
    for (size_t i = 0; i < count; i++) {
        const struct pendulum_course *c = &course[i];

        for (size_t k = 0; k < c->nsample; k++) {
            fprintf(out, "%s,%.2f,%.9f\n", c->peer->name, c->time[k], c->height[k]);
        }
        series[i] = (struct svg_series){.name = c->peer->name,
                                        .x = c->time,
                                        .y = c->height,
                                        .count = c->nsample,
                                        .style = i ? SVG_DASHED : SVG_LINE};
    }
    code = report_file_close(out, name, ERROR_NONE, error);
    if (!code) {
        code = report_file_open(folder, plot_name, &out, error);
    }
    return code ? code : report_file_close(out, plot_name, svg_write(&plot, out, error), error);
}

static enum error_code run_bench(struct pendulum_table *table, const char *folder,
                                 struct arena *arena, struct error *error)
{
    struct pendulum_course course[2];
    size_t count = table->absolute ? 2 : 1;
    enum error_code code = pendulum_measure_table(table, error);

    if (!code) {
        print_table(table);
        code = pendulum_run_course(&pendulum_ours, &course[0], arena, error);
    }
    if (!code && table->absolute) {
        code = pendulum_run_course(table->absolute, &course[1], arena, error);
    }
    if (code) {
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
        .noption = sizeof options / sizeof options[0],
        .manual =
            "Ours are integrated by Runge-Kutta 4 through the whole plant, in one coordinate a "
            "body. "
            "The other engine is ODE: seven coordinates and six constraints a body, its own "
            "integrator (dWorldStep), constraint force mixing 1e-10, error reduction 0.2. All is "
            "dimensionless. The paper leaves out the second pendulum's mass: with 2, and no other, "
            "both bodies of its example stay in line for ever.\n"
            "\n" BENCH_PEERS_MANUAL,
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
    if (!code) {
        code = arena_init(&arena, (size_t)1 << 24, &error);
    }
    if (!code) {
        bool other = library.peers && library.peers->npendulum;

        table = (struct pendulum_table){.absolute = other ? &library.peers->pendulum[0] : NULL,
                                        .nstep = quick ? PENDULUM_STEPS - 1 : PENDULUM_STEPS};
        code = run_bench(&table, folder, &arena, &error);
        arena_fini(&arena);
    }
    peers_close(&library);
    return code ? command_fail(spec.name, &error) : STATUS_OK;
}
