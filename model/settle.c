/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds the static equilibrium of the plant. Lists the bodies with unknown positions at rest, finds
 * the causes of refusal, and sets the drive states that hold the equilibrium. settle_newton.c has
 * the steps of the iteration.
 */
#include "model/settle.h"

#include "base/portable_math.h"
#include "model/coupling.h"
#include "model/stop.h"
#include "model/settle_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

enum { ITERATIONS = 400, LEANINGS = 40 };

/* Limits of remaining forces, relative to the weight.
 * TARGET: end of the iteration.
 * STALLED: end of the iteration if steps no longer help, because friction yields on one side of
 * the equilibrium and sticks on the other.
 * ACCEPTED: largest force at an equilibrium.
 * SIDEWAYS: largest sideways force if friction holds nothing at rest.
 * LEVEL: smaller sideways forces count as zero. */
#define TARGET 1e-11
#define STALLED 1e-9
#define ACCEPTED 1e-7
#define SIDEWAYS 0.02
#define LEVEL 1e-9

/* Torque allowed on a joint without a drive, relative to the weight times 1 m. */
#define LEANING 1e-10

#define DEEPEST 0.2  /* limit of the search, m below the start */
#define FARTHEST 0.2 /* limit of the search, m sideways */
#define STEEPEST 0.2 /* limit of the search, rad from the start */

/* ---- the iteration ---- */

/* Returns the remaining force across gravity, N. */
static double find_push(const struct settle *s, const struct rest *rest)
{
    const double a = vec3_dot(rest->force, s->across[0]), b = vec3_dot(rest->force, s->across[1]);

    return sqrt(a * a + b * b);
}

/* Refuses an equilibrium in which a body would slide. */
static enum error_code refuse_sliding(const struct settle *s, const struct rest *rest,
                                      struct error *error)
{
    return error_set(
        error, ERROR_INPUT,
        "%s would slide: %.3g N are missing to hold it sideways, of its weight of %.4g N",
        rest->name, find_push(s, rest), rest->weight);
}

/* Refuses a body that has left the limits of the search. */
static enum error_code check_search_bounds(const struct settle *s, struct error *error)
{
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];
        double tilt = sqrt(vec3_dot(rest->tilt, rest->tilt));
        double lever = sqrt(vec3_dot(rest->moment, rest->moment)) / rest->weight;
        double carried = 1.0 + vec3_dot(rest->force, s->up) / rest->weight;

        if (tilt > STEEPEST) {
            return error_set(error, ERROR_INPUT,
                             "%s tips over: its support is %.3f m off its center of mass",
                             rest->name, lever);
        }
        if (rest->risen < -DEEPEST) {
            return error_set(error, ERROR_INPUT,
                             "%s is not supported: %.1f m below its start only %.1f %% of its "
                             "weight of %.4g N is carried",
                             rest->name, DEEPEST, 100.0 * fmax(0.0, carried), rest->weight);
        }
        if (rest->moved[0] * rest->moved[0] + rest->moved[1] * rest->moved[1] >
            FARTHEST * FARTHEST) {
            return refuse_sliding(s, rest, error);
        }
    }
    return ERROR_NONE;
}

/* Converts the contact engine's failure to an error. */
static enum error_code engine_failed(const struct settle *s, enum error_code code,
                                     struct error *error)
{
    return error_set(error, code, "%s", s->plant->failure);
}

/* Refuses an equilibrium that is not stable. */
static enum error_code refuse_toppling(const struct settle *s, struct error *error)
{
    return error_set(error, ERROR_INPUT,
                     "%s would topple: its support resists a tilt by less than its weight adds to "
                     "it, so the equilibrium is not stable",
                     s->rest[s->weak].name);
}

/* Prefixes an error with the note that the search did not converge, because its cause may be
 * wrong. */
static enum error_code not_converged(const struct settled *settled, struct error *error)
{
    return error_prefix(
        error, "the search did not converge in %zu iterations (%.2g of the weight is unbalanced)",
        settled->iterations, settled->residual);
}

/* Iterates to rest by damped Newton steps. Returns ERROR_INPUT if there is no equilibrium within
 * the limits. */
static enum error_code iterate_to_rest(struct settle *s, struct settled *settled,
                                       struct error *error)
{
    enum error_code code = settle_weigh(s, s->g);
    double before = INFINITY;
    size_t worst = 0;
    bool moved = true;

    if (code) {
        goto fail;
    }

    /* Take damped Newton steps until the residual is small or no step helps */
    for (settled->iterations = 0;; settled->iterations++) {
        double damping;

        settled->residual = settle_residual(s, s->g, &worst);
        if (settled->residual <= TARGET || !moved || settled->iterations == ITERATIONS ||
            (settled->residual <= STALLED && settled->residual > 0.5 * before)) {
            break;
        }
        before = settled->residual;
        if (check_search_bounds(s, error)) {
            return not_converged(settled, error);
        }
        if ((code = settle_differentiate(s))) {
            goto fail;
        }
        damping = fmin(1.0, fmax(LEAST_DAMPING, settled->residual));
        while (!settle_factorize(s, damping)) {
            damping *= 4.0;
        }
        settle_solve(s);
        if ((code = settle_advance(s, &moved))) {
            goto fail;
        }
    }

    /* Without an equilibrium, find the cause */
    if (settled->residual <= ACCEPTED) {
        return ERROR_NONE;
    }
    if (s->holds && find_push(s, &s->rest[worst]) > 0.5 * vec3_norm(s->rest[worst].force)) {
        refuse_sliding(s, &s->rest[worst], error);
    } else if (!settle_factorize(s, LEAST_DAMPING)) {
        refuse_toppling(s, error);
    } else {
        error_set(error, ERROR_INPUT, "%s: no equilibrium found", s->rest[worst].name);
    }
    return not_converged(settled, error);

fail:
    return engine_failed(s, code, error);
}

/* Refuses equilibria that the iteration accepts by mistake: unstable equilibria, and equilibria
 * with sideways forces when sideways motion is not an unknown. */
static enum error_code check_equilibrium(struct settle *s, struct settled *settled,
                                         struct error *error)
{
    enum error_code code;

    /* An equilibrium is stable if the tangent at rest is positive definite */
    if ((code = settle_differentiate(s)) || (code = settle_weigh(s, s->g))) {
        return engine_failed(s, code, error);
    }
    if (!settle_factorize(s, LEAST_DAMPING)) {
        return refuse_toppling(s, error);
    }

    /* Check that sideways forces are within the allowed friction */
    settled->sideways = 0.0;
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];
        double push = find_push(s, rest);
        double twist = fabs(vec3_dot(rest->moment, s->up)) / rest->radius;

        settled->sideways = fmax(settled->sideways, fmax(push, twist) / rest->weight);
        if (push > SIDEWAYS * rest->weight || twist > SIDEWAYS * rest->weight) {
            return error_set(error, ERROR_INPUT,
                             "%s would slide: %.3g N push it sideways and %.3g N m turn it, and "
                             "regularized friction carries nothing at rest",
                             rest->name, push, twist * rest->radius);
        }
    }
    return ERROR_NONE;
}

/* ---- the robot's drives ---- */

/* Returns the torque that the drive of joint j must exert, N m. */
static double drive_torque(const struct settle *s, size_t j)
{
    const struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;
    double coupled = 0.0, tau;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const double error = coupling_error(coupling, plant->state + plant->at.v - robot->njoint);
        const double force = coupling_force(coupling, error, 0.0);

        coupled -= coupling->follower == (int)j ? force : 0.0;
        coupled += coupling->leader == (int)j ? coupling->multiplier * force : 0.0;
    }
    tau = s->f[robot->nv - robot->njoint + j] - coupled;
    for (size_t k = 0; k < plant->nspring; k++) {
        if (plant->spring_joint[k] == j) {
            tau -= parallel_spring_torque(&robot->joint[j].spring,
                                          plant->state[plant->at.pretension + k], 0.0,
                                          plant_joint_position(plant, plant->state, j), 0.0);
        }
    }
    tau -=
        passive_torque(&robot->joint[j].passive, plant_joint_position(plant, plant->state, j), 0.0);
    return tau - stop_torque(&robot->joint[j].stop, plant_joint_depth(plant, plant->state, j), 0.0);
}

/* Returns whether joint j has a passive spring, but no drive and no coupling. Stops may hold it
 * too. */
static bool is_sprung(const struct settle *s, size_t j)
{
    const struct robot *robot = s->plant->config.robot;
    const struct robot_joint *joint = &robot->joint[j];

    return joint->passive.stiffness > 0.0 && !robot_joint_is_driven(joint) &&
           !robot_find_coupling(robot, j);
}

/* Moves joint j until its coupling or passive spring of this stiffness, with any pressed stop,
 * carries the remaining torque. s->f must be up to date. least: smaller torques do not move the
 * joint. Returns whether the joint has moved. */
static bool lean_on_spring(struct settle *s, size_t j, double stiffness, double least)
{
    struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;
    const double left = drive_torque(s, j);

    if (!(fabs(left) > least)) {
        return false;
    }
    if (plant_joint_depth(plant, plant->state, j) != 0.0) {
        stiffness += robot->joint[j].stop.stiffness;
    }
    plant->state[plant->at.v - robot->njoint + j] -= left / stiffness;
    return true;
}

/* Moves joints without a drive until their stops, couplings or passive springs carry the remaining
 * torque. plant->ext must have the wrenches at rest. Returns true if a joint has moved. */
static bool lean_on_stops(struct settle *s)
{
    struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;
    double least = LEANING * robot->total_mass * sqrt(vec3_dot(robot->gravity, robot->gravity));
    bool moved = false;

    settle_weigh_robot(s, NULL);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        moved |= lean_on_spring(s, (size_t)coupling->follower, coupling->stiffness, least);
    }
    for (size_t i = 0; i < plant->npassive; i++) {
        const size_t j = plant->passive_joint[i];

        moved |= is_sprung(s, j) && lean_on_spring(s, j, robot->joint[j].passive.stiffness, least);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        double *q = &plant->state[plant->at.v - robot->njoint + j];
        double left = robot_joint_is_driven(joint) ? 0.0 : drive_torque(s, j), past;

        if (fabs(left) <= least || joint->stop.stiffness == 0.0 || is_sprung(s, j) ||
            robot_find_coupling(robot, j)) {
            continue;
        }

        /* Move deeper into the pressed stop, or partly out of it */
        past = plant_joint_depth(plant, plant->state, j) - left / joint->stop.stiffness;
        if (past > 0.0 && *q >= joint->upper) {
            *q = joint->upper + past;
            moved = true;
        } else if (past < 0.0 && *q <= joint->lower) {
            *q = joint->lower + past;
            moved = true;
        }
    }
    return moved;
}

/* Checks that a joint without a drive needs no torque, and that a motor needs no more voltage than
 * the supply has. */
static enum error_code check_joint_load(const struct settle *s, size_t j, double tau,
                                        struct error *error)
{
    const struct robot *robot = s->plant->config.robot;
    const struct robot_joint *joint = &robot->joint[j];
    double gravity = sqrt(vec3_dot(robot->gravity, robot->gravity));

    if (!robot_joint_is_driven(joint) && fabs(tau) > ACCEPTED * robot->total_mass * gravity) {
        return error_set(error, ERROR_INPUT, "joint %s has no drive, and %.3g N m would move it",
                         joint->name, tau);
    }
    if (joint->sea.present &&
        fabs(joint->sea.R * effects_current(&joint->sea, tau)) > s->plant->config.supply_v) {
        return error_set(error, ERROR_INPUT,
                         "joint %s needs %.3g V to hold %.3g N m, the supply has %g V", joint->name,
                         joint->sea.R * effects_current(&joint->sea, tau), tau,
                         s->plant->config.supply_v);
    }
    return ERROR_NONE;
}

/* Sets the drives' states for their loads at rest: spring deflections, currents and voltages by eqs
 * (2) to (4), and oil pressures. plant->ext must have the wrenches at the equilibrium. */
static enum error_code load_drives(struct settle *s, struct error *error)
{
    struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;

    settle_weigh_robot(s, NULL);
    for (size_t j = 0; j < robot->njoint; j++) {
        enum error_code code = check_joint_load(s, j, drive_torque(s, j), error);

        if (code != ERROR_NONE) {
            return code;
        }
    }

    /* Electric drives: tau = Ks (qm - q) plus the stop, Kt I = tau, V = R I */
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        const struct robot_sea *sea = &robot->joint[j].sea;
        double tau = drive_torque(s, j), *y = plant->state + plant_drive_offset(plant, d);

        y[DRIVE_MOTOR_POSITION] =
            effects_motor_rest(sea, plant_joint_position(plant, plant->state, j), tau);
        y[DRIVE_MOTOR_SPEED] = 0.0;
        y[DRIVE_CURRENT] = effects_current(sea, tau);
        plant->voltage[d] = plant_holding_voltage(plant, d, y[DRIVE_CURRENT]);
        plant->bridge_on[d] = true;
        plant->command.motor[j].bridge_on = true;
        plant->command.motor[j].voltage_v = plant->voltage[d];
    }

    /* Hydraulic joints: closed valves keep the pressures that carry the loads */
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        size_t j = plant->hydraulic_joint[c];
        double tau = drive_torque(s, j);

        if (!plant_hydraulic_load(plant, c, tau)) {
            return error_set(error, ERROR_INPUT,
                             "joint %s needs %.3g N m, more than its cylinder gives there",
                             robot->joint[j].name, tau);
        }
    }
    return ERROR_NONE;
}

/* ---- the whole search ---- */

/* Returns the radius of gyration of the robot with its joints locked, about its center of mass,
 * m. */
static double gyration_radius(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    double center[3], momentum[3], sum = 0.0;

    plant_center_of_mass(plant, center, momentum);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        double arm[3];

        mat3_apply(plant->whole_motion[b].R, inertia->com, arm);
        for (int i = 0; i < 3; i++) {
            arm[i] += plant->whole_motion[b].p[i] - center[i];
        }
        sum += inertia->mass * vec3_dot(arm, arm) +
               0.5 * (inertia->I[0] + inertia->I[3] + inertia->I[5]);
    }
    return sqrt(sum / robot->total_mass);
}

/* Lists the bodies with an unknown position at rest: a floating robot, and free bodies that start
 * without velocity. */
static void list_resting_bodies(struct settle *s)
{
    struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;
    double gravity = sqrt(vec3_dot(robot->gravity, robot->gravity));

    if (robot->floating) {
        s->rest[s->nrest++] = (struct rest){.name = robot->name,
                                            .robot = true,
                                            .weight = robot->total_mass * gravity,
                                            .radius = gyration_radius(plant)};
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const struct plant_free_body *body = &plant->config.free[b];
        const double *y = plant->state + plant->at.free + PLANT_FREE_STATE * b;
        const double *I = body->inertia.I, *v = y + PLANT_FREE_VELOCITY, *w = y + PLANT_FREE_SPIN;

        if (vec3_dot(v, v) + vec3_dot(w, w) == 0.0) {
            s->rest[s->nrest++] =
                (struct rest){.name = body->name,
                              .free = b,
                              .weight = body->inertia.mass * gravity,
                              .radius = sqrt(0.5 * (I[0] + I[3] + I[5]) / body->inertia.mass)};
        }
    }
}

/* Allocates the scratch of the search. Returns false if the arena is full. */
static bool allocate_settle(struct settle *s, struct arena *arena)
{
    const struct robot *robot = s->plant->config.robot;
    size_t most = UNKNOWNS * (1 + s->plant->config.nfree);
    bool ok = true;

    TAKE(s->rest, 1 + s->plant->config.nfree);
    TAKE(s->zero, robot->nv);
    TAKE(s->f, robot->nv);
    TAKE(s->g, most);
    TAKE(s->ahead, most);
    TAKE(s->step, most);
    TAKE(s->K, most * most);
    TAKE(s->factor, most * most);
    TAKE(s->before, s->plant->at.count);
    return ok;
}

/* Finds the equilibrium with or without sticking friction. */
static enum error_code find_equilibrium(struct settle *s, bool holds, struct settled *settled,
                                        struct error *error)
{
    enum error_code code;

    /* Repeat the search, because joints that lean on stops shift the weight. The shift decreases in
     * each round */
    settle_begin(s, holds);
    for (int k = 0; k == 0 || lean_on_stops(s); k++) {
        if (k == LEANINGS) {
            return error_set(
                error, ERROR_INPUT,
                "the search did not converge: joints at their limits still move after %d rounds",
                LEANINGS);
        }
        if ((code = iterate_to_rest(s, settled, error)) ||
            (code = check_equilibrium(s, settled, error))) {
            return code;
        }
    }
    if ((code = load_drives(s, error))) {
        return code;
    }
    if (s->plant->config.robot->floating) {
        settled->rise_m = s->rest[0].risen;
        settled->tilt_rad = vec3_norm(s->rest[0].tilt);
    }
    return ERROR_NONE;
}

/* Finds the body that would slide, after the search with friction has failed. When a body slides,
 * the forces of the failed search are meaningless. So the search is repeated without friction. If
 * only sideways forces remain, they give the slope under each body. The steepest slope that
 * friction holds is then measured for the body. If no body is on a steeper slope, the old error
 * stays. */
static void find_sliding_body(struct settle *s, const double *start, struct error *error)
{
    struct settled unused = {0};
    struct error silent;
    double most = 0.0;

    memcpy(s->plant->state, start, s->plant->at.count * sizeof *start);
    settle_begin(s, false);
    if (iterate_to_rest(s, &unused, &silent)) {
        return;
    }
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];
        double push, slope, held;

        settle_begin(s, false);
        if (settle_weigh(s, s->g)) {
            return;
        }
        push = find_push(s, rest);
        slope = portable_atan2(push, rest->weight);
        if (push > LEVEL * rest->weight && !settle_friction_angle(s, b, &held) &&
            slope - held > most) {
            most = slope - held;
            error_set(error, ERROR_INPUT,
                      "%s would slide: it stands on a slope of %.3g rad, where %.3g N push it "
                      "sideways, and friction holds it up to %.3g rad",
                      rest->name, slope, push, held);
        }
    }
}

/* Finds the equilibrium without friction, so that legs do not push against each other. If there is
 * none and friction sticks, finds the equilibrium with friction. */
static enum error_code find_rest(struct settle *s, const double *start, struct settled *settled,
                                 struct error *error)
{
    struct plant *plant = s->plant;
    struct error without;
    enum error_code code = find_equilibrium(s, false, settled, &without);

    if (plant->nbristle > 0 && (code == ERROR_INPUT || settled->sideways > LEVEL)) {
        memcpy(plant->state, start, plant->at.count * sizeof *start);
        code = find_equilibrium(s, true, settled, error);
        if (code == ERROR_INPUT) {
            find_sliding_body(s, start, error);
        }
        return code;
    }
    return code ? error_set(error, code, "%s", without.text) : ERROR_NONE;
}

enum error_code plant_settle(struct plant *plant, struct arena *arena, struct settled *settled,
                             struct error *error)
{
    const struct robot *robot = plant->config.robot;
    struct settle s = {.plant = plant};
    double *start = arena_alloc(arena, plant->at.count, sizeof *start);
    bool clamped = plant->clamped;
    enum error_code code;

    *settled = (struct settled){0};
    if (!start || !allocate_settle(&s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory to settle %s", robot->name);
    }
    if (!(vec3_dot(robot->gravity, robot->gravity) > 0.0)) {
        return error_set(error, ERROR_INPUT, "nothing comes to rest without gravity");
    }

    /* Compute the direction up, against gravity, and two directions across it */
    double length = sqrt(vec3_dot(robot->gravity, robot->gravity));
    int least = 0;
    double pick[3] = {0.0, 0.0, 0.0};

    for (int i = 0; i < 3; i++) {
        s.up[i] = -robot->gravity[i] / length;
        least = fabs(s.up[i]) < fabs(s.up[least]) ? i : least;
    }
    pick[least] = 1.0;
    vec3_cross(s.up, pick, s.across[1]);
    length = sqrt(vec3_dot(s.across[1], s.across[1]));
    for (int i = 0; i < 3; i++) {
        s.across[1][i] /= length;
    }
    vec3_cross(s.across[1], s.up, s.across[0]);
    plant_find_bristles(plant);
    memcpy(start, plant->state, plant->at.count * sizeof *start);

    /* Unclamp during the search, because supports do not act on a clamped robot */
    plant->clamped = false;
    list_resting_bodies(&s);
    code = find_rest(&s, start, settled, error);
    plant->clamped = clamped;
    plant->stepped = false;
    if (code != ERROR_NONE) {
        memcpy(plant->state, start, plant->at.count * sizeof *start);
    }
    plant_find_bristles(plant);
    if (code != ERROR_NONE) {
        return code;
    }

    /* Make the equilibrium the start */
    plant_balance(plant, clamped);
    if ((code = plant_restart_energy(plant)) || (code = plant_sample(plant))) {
        return engine_failed(&s, code, error);
    }
    return ERROR_NONE;
}
