/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Simulates a single and a double pendulum, as in the paper's section 3.1. Our plant uses relative
 * coordinates with Runge-Kutta 4. Another simulator uses absolute coordinates with constraints.
 *
 * Quantities are dimensionless. Gravity, the first mass and the distance of its center from the
 * axis are 1. The inertias of the bodies are 5.5 and 2. The second axis is at distance 2 from the
 * first, and the second center of mass at distance 2.5 from the second axis. The paper omits the
 * second mass m2. The bodies stay in line only if both equations of motion give the same
 * acceleration:
 *     first:   (5.5 + 1 + 4 m2 + 5 m2) a'' = -(1 + 2 m2) sin a
 *     second:       (2 + 6.25 m2 + 5 m2) a'' = -2.5 m2 sin a
 * The only solution is m2 = 2, with a'' = -(5/24.5) sin a. With initial speed w0 = 2.1 the bodies
 * turn over with the period 4 K(m)/w0, m = 4 (5/24.5)/w0^2. K is the complete elliptic integral of
 * the first kind.
 */
#include "app/bench/bench.h"

#include "model/plant.h"

#include <math.h>
#include <stdlib.h>

#define TIMED_S 0.2 /* a short run is repeated until it has taken this CPU time */

/* Most repetitions of a timed run; most checks of a row; steps between samples of a motion. */
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

/* The single and the double pendulum of the paper: number of bodies, gravity, masses, inertias,
 * centers of mass, distance between the axes, initial rate. */
static const struct peer_chain chain_of[2] = {
    {1, 1.0, {1.0}, {5.5}, {1.0}, 0.0, PENDULUM_START_SPEED},
    {2, 1.0, {1.0, 2.0}, {5.5, 2.0}, {1.0, 2.5}, 2.0, PENDULUM_START_SPEED},
};

/* ---- ours, in the terms of the others ---- */

/* Our plant, as an engine for the chain. */
struct ours {
    struct arena arena;
    struct robot robot;
    struct robot_body body[3];
    struct robot_joint joint[2];
    struct dynamics dynamics;
    struct plant *plant;
    const struct peer_chain *chain;
    double *state; /* joint angles, then joint rates; memory of the plant */
};

/* Describes the chain as a robot with hinges about y. */
static void pendulum_describe_robot(struct ours *ours)
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
    /* Add a fixed base, then a hinge and a body for each body of the chain */
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

/* Builds the plant of the chain with Runge-Kutta 4 and step dt. It starts hanging, with the initial
 * rate. */
static enum error_code pendulum_build_plant(struct ours *ours, double dt, struct error *error)
{
    static const double hanging[2];
    struct plant_config config = {.robot = &ours->robot,
                                  .dynamics = &ours->dynamics,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = llround(dt * 1e9),
                                  .supply_v = 1.0};
    enum error_code code = arena_init(&ours->arena, (size_t)1 << 22, error);
    size_t count;

    pendulum_describe_robot(ours);
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

/* Creates our engine. Returns NULL with the reason in message if this fails. */
static void *ours_create(const struct peer_chain *chain, double dt, char *message, size_t size)
{
    struct ours *ours = calloc(1, sizeof *ours);
    struct error error = {.text = "no memory"};

    if (ours) {
        ours->chain = chain;
    }
    if (!ours || pendulum_build_plant(ours, dt, &error)) {
        snprintf(message, size, "%s", error.text);
        if (ours) {
            ours_destroy(ours);
        }
        return NULL;
    }
    return ours;
}

/* Steps the plant. A step without contact cannot fail. */
static void ours_step(void *engine, size_t steps)
{
    plant_step(((struct ours *)engine)->plant, steps);
}

/* Computes the bodies' motions in the plane from the joints' angles and rates. */
static void ours_get(void *engine, struct peer_chain_body *out)
{
    const struct ours *ours = engine;
    double x = 0.0, z = 0.0, vx = 0.0, vz = 0.0, angle = 0.0, rate = 0.0;

    for (size_t b = 0; b < ours->chain->count; b++) {
        double com = ours->chain->com[b], reach = ours->chain->reach, sine, cosine;

        /* In relative coordinates, angles and rates add up along the chain, and so do the positions
         * of the axes */
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

/* Computes the kinetic plus potential energy of the chain. */
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

/* Computes the largest relative error of the distances between the centers of mass and their
 * axes. */
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

/* Creates an engine. Ours fails only without memory. */
static enum error_code pendulum_create_engine(const struct peer_pendulum *peer,
                                              const struct peer_chain *chain, double dt,
                                              void **engine, struct error *error)
{
    char message[512];

    *engine = peer->create(chain, dt, message, sizeof message);
    return *engine ? ERROR_NONE
                   : error_set(error, peer == &pendulum_ours ? ERROR_MEMORY : ERROR_UNSUPPORTED,
                               "%s: %s", peer->name, message);
}

/* Measures the median CPU time, s, of a run that only steps. */
static enum error_code pendulum_time_run(const struct peer_pendulum *peer,
                                         const struct peer_chain *chain, double dt, double *seconds,
                                         struct error *error)
{
    double spent[TIMED_MAX], sum = 0.0;
    size_t n = 0;

    while (n == 0 || (n < TIMED_MAX && sum < TIMED_S)) {
        void *engine;
        double start;
        enum error_code code = pendulum_create_engine(peer, chain, dt, &engine, error);

        if (code) {
            return code;
        }
        start = bench_cpu_s();
        peer->step(engine, (size_t)llround(PENDULUM_TABLE_UNITS / dt));
        spent[n] = bench_cpu_s() - start;
        sum += spent[n++];
        peer->destroy(engine);
    }
    *seconds = bench_median(spent, n);
    return ERROR_NONE;
}

/* Measures a row of Table 1: the largest errors, and the real-time factor. */
static enum error_code pendulum_measure_row(const struct peer_pendulum *peer,
                                            const struct peer_chain *chain, double dt,
                                            struct pendulum_row *row, struct error *error)
{
    size_t steps = (size_t)llround(PENDULUM_TABLE_UNITS / dt);
    size_t stride = steps > CHECKS_MAX ? steps / CHECKS_MAX : 1;
    struct peer_chain_body body[2];
    double start, seconds;
    void *engine;
    enum error_code code = pendulum_create_engine(peer, chain, dt, &engine, error);

    if (code) {
        return code;
    }
    *row = (struct pendulum_row){0};
    peer->get(engine, body);
    start = energy_of(chain, body);

    /* Check the errors at up to CHECKS_MAX times; measure the speed in a separate run without
     * checks */
    for (size_t k = 0; k < steps; k += stride) {
        double energy;

        peer->step(engine, stride);
        peer->get(engine, body);
        energy = energy_of(chain, body);
        row->energy = fmax(row->energy, fabs((energy - start) / energy));
        row->constraint = fmax(row->constraint, constraint_error(chain, body));
    }
    peer->destroy(engine);
    code = pendulum_time_run(peer, chain, dt, &seconds, error);
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
            code = pendulum_measure_row(&pendulum_ours, &chain_of[n], pendulum_step_sizes[k],
                                        &table->ours[n][k], error);
            if (!code && table->absolute) {
                code = pendulum_measure_row(table->absolute, &chain_of[n], pendulum_step_sizes[k],
                                            &table->theirs[n][k], error);
            }
            bench_progress("pendulum, table", ++done, all);
        }
    }
    return code;
}

/* ---- Fig. 3 ---- */

double pendulum_analytic_period(void)
{
    double m = 4.0 * (5.0 / 24.5) / (PENDULUM_START_SPEED * PENDULUM_START_SPEED), a = 1.0,
           b = sqrt(1.0 - m);

    /* K(m) = pi / (2 agm(1, sqrt(1 - m))), from the arithmetic-geometric mean */
    for (int i = 0; i < 8; i++) {
        double mean = 0.5 * (a + b);

        b = sqrt(a * b);
        a = mean;
    }
    return 4.0 * M_PI / (2.0 * a) / PENDULUM_START_SPEED;
}

/* Computes the fraction of the step at which the angle reaches goal. Applies Newton's method to the
 * cubic that fits angle and rate at both ends. */
static double turn_end_fraction(const double before[2], const double after[2], double goal)
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

enum error_code pendulum_run_course(const struct peer_pendulum *peer,
                                    struct pendulum_course *course, struct arena *arena,
                                    struct error *error)
{
    size_t steps = (size_t)llround(PENDULUM_PERIOD_UNITS / PENDULUM_PERIOD_STEP);
    struct peer_chain_body body[2];
    double before[2], after[2], end = 0.0;
    enum error_code code;
    void *engine;

    *course = (struct pendulum_course){.peer = peer};
    course->time = arena_alloc(arena, steps / SAMPLE + 1, sizeof(double));
    course->height = arena_alloc(arena, steps / SAMPLE + 1, sizeof(double));
    if (!course->time || !course->height) {
        return error_set(error, ERROR_MEMORY, "no memory for %zu samples", steps / SAMPLE);
    }
    code = pendulum_create_engine(peer, &chain_of[1], PENDULUM_PERIOD_STEP, &engine, error);
    if (code) {
        return code;
    }

    /* At every step, unwrap the angle and detect the end of a turn */
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
        /* Unwrap the engine's angle, which may jump by a turn */
        after[0] = before[0] + remainder(body[0].angle - before[0], 2.0 * M_PI);
        after[1] = body[0].rate;
        if (after[0] >= goal && course->nturn < PENDULUM_TURNS_MAX) {
            double now = (double)k + turn_end_fraction(before, after, goal);

            course->end[course->nturn] = PENDULUM_PERIOD_STEP * now;
            course->period[course->nturn] = course->end[course->nturn] - end;
            end = course->end[course->nturn++];
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
