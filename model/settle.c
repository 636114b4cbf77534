/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Newton's method on the forces left over on the base and on the free bodies, three unknowns each:
 * the way up and two tilts. The tangent is by differences, which is right for any contact engine;
 * its symmetric part is damped until it is positive definite, so that a step always goes downhill in
 * potential energy and an unstable equilibrium is left, not found. The damping (pseudo-transient
 * continuation) is one weight per DAMPING_LENGTH far from the equilibrium, where a body without
 * contact simply sinks by that, and vanishes with the residual, so that the end is Newton's.
 */
#include "model/settle.h"

#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

enum { UP, FIRST_TILT, SECOND_TILT, UNKNOWNS };
enum { ITERATIONS = 400, HALVINGS = 40, BASE_QUATERNION = 3 };

#define DAMPING_LENGTH 2e-3
#define LONGEST_STEP 5e-3 /* m, tilts times the radius of gyration */
#define DIFFERENCE 1e-7   /* m, for the tangent */
#define LEAST_DAMPING 1e-6

/* Parts of the weight: where the iteration stops, what counts as equilibrium, what friction is
 * trusted with. */
#define TARGET 1e-11
#define ACCEPTED 1e-7
#define SIDEWAYS 0.02

#define DEEPEST 0.2  /* m below the start */
#define STEEPEST 0.2 /* rad from the start */

/* A body that has to find its rest: the robot as one, or a free body. */
struct rest {
    const char *name;
    bool robot;
    size_t free;                /* which free body */
    double weight, radius;      /* N; m, of gyration */
    double force[3], moment[3]; /* left over, world frame; about the base's origin or the center of
                                 * mass */
    double risen, tilt[3];      /* so far: m along up, rad */
};

struct settle {
    struct plant *plant;
    double up[3], across[2][3];
    size_t nrest, n; /* n = UNKNOWNS * nrest */
    struct rest *rest;
    double *zero, *f;   /* nv */
    double *g, *ahead;  /* n: forces left over; tilts' moments over the radius */
    double *K, *factor; /* n x n: symmetric part of -dg/dx; Cholesky factor */
    double *step;       /* n: m; tilts times the radius */
    size_t weak;        /* body that factorize stopped at */
    double *before;     /* copy of the state */
};

/* ---- geometry ---- */

static void choose_axes(const double gravity[3], struct settle *s)
{
    double length = sqrt(vec3_dot(gravity, gravity));
    int least = 0;
    double pick[3] = {0.0, 0.0, 0.0};

    for (int i = 0; i < 3; i++) {
        s->up[i] = -gravity[i] / length;
        least = fabs(s->up[i]) < fabs(s->up[least]) ? i : least;
    }
    pick[least] = 1.0;
    vec3_cross(s->up, pick, s->across[1]);
    length = sqrt(vec3_dot(s->across[1], s->across[1]));
    for (int i = 0; i < 3; i++) {
        s->across[1][i] /= length;
    }
    vec3_cross(s->across[1], s->up, s->across[0]);
}

/* quaternion <- rotation by the vector angle (world frame) after quaternion */
static void turn(const double angle[3], double quaternion[4])
{
    double size = sqrt(vec3_dot(angle, angle));
    double half = size > 0.0 ? sin(0.5 * size) / size : 0.5, w = cos(0.5 * size);
    double x[3] = {half * angle[0], half * angle[1], half * angle[2]};
    double scalar = quaternion[0], vector[3] = {quaternion[1], quaternion[2], quaternion[3]};

    quaternion[0] = w * scalar - vec3_dot(x, vector);
    vec3_cross(x, vector, quaternion + 1);
    for (int i = 0; i < 3; i++) {
        quaternion[1 + i] += w * vector[i] + scalar * x[i];
    }
    plant_normalize_quaternion(quaternion);
}

/* moves every body by scale times x */
static void move(struct settle *s, double scale, const double *x)
{
    for (size_t b = 0; b < s->nrest; b++, x += UNKNOWNS) {
        struct rest *rest = &s->rest[b];
        double *y = s->plant->state;
        double angle[3];

        y += rest->robot ? 0 : s->plant->at.free + PLANT_FREE_STATE * rest->free;
        rest->risen += scale * x[UP];
        for (int i = 0; i < 3; i++) {
            y[i] += scale * x[UP] * s->up[i];
            angle[i] = scale / rest->radius *
                       (x[FIRST_TILT] * s->across[0][i] + x[SECOND_TILT] * s->across[1][i]);
            rest->tilt[i] += angle[i];
        }
        turn(angle, y + (rest->robot ? (int)BASE_QUATERNION : (int)PLANT_FREE_QUATERNION));
    }
}

/* ---- forces ---- */

static void weigh_robot(struct settle *s, struct rest *rest)
{
    struct plant *plant = s->plant;
    double R[9];

    plant->whole.ops->inverse(&plant->whole, plant->q, s->zero, s->zero, plant->ext, s->f);
    if (rest) {
        mat3_from_quaternion(plant->q + BASE_QUATERNION, R);
        mat3_apply(R, s->f, rest->force);
        mat3_apply(R, s->f + 3, rest->moment);
        for (int i = 0; i < 3; i++) {
            rest->force[i] = -rest->force[i];
            rest->moment[i] = -rest->moment[i];
        }
    }
}

static void weigh_free(const struct settle *s, struct rest *rest)
{
    const struct plant *plant = s->plant;
    const struct robot_inertia *inertia = &plant->config.free[rest->free].inertia;
    size_t body = plant->config.robot->nbody + rest->free;
    const struct wrench *ext = &plant->ext[body];
    double moment[3];

    memcpy(moment, ext->moment, sizeof moment);
    vec3_add_cross(ext->force, inertia->com, moment);
    mat3_apply(plant->motion[body].R, ext->force, rest->force);
    mat3_apply(plant->motion[body].R, moment, rest->moment);
    for (int i = 0; i < 3; i++) {
        rest->force[i] += inertia->mass * plant->config.robot->gravity[i];
    }
}

/* g and the forces left over of the present state */
static enum error_code weigh(struct settle *s, double *g)
{
    struct plant_load load;
    enum error_code code = plant_load_bodies(s->plant, s->plant->state, &load);

    if (code != ERROR_NONE) {
        return code;
    }
    for (size_t b = 0; b < s->nrest; b++, g += UNKNOWNS) {
        struct rest *rest = &s->rest[b];

        if (rest->robot) {
            weigh_robot(s, rest);
        } else {
            weigh_free(s, rest);
        }
        g[UP] = vec3_dot(rest->force, s->up);
        g[FIRST_TILT] = vec3_dot(rest->moment, s->across[0]) / rest->radius;
        g[SECOND_TILT] = vec3_dot(rest->moment, s->across[1]) / rest->radius;
    }
    return ERROR_NONE;
}

/* largest part of its weight that is left over on a body; *worst says on which */
static double residual(const struct settle *s, const double *g, size_t *worst)
{
    double most = 0.0;

    for (size_t i = 0; i < s->n; i++) {
        double part = fabs(g[i]) / s->rest[i / UNKNOWNS].weight;

        if (!(part <= most)) {
            most = part;
            *worst = i / UNKNOWNS;
        }
    }
    return most;
}

/* K by central differences */
static enum error_code differentiate(struct settle *s)
{
    size_t n = s->n, bytes = s->plant->at.count * sizeof *s->before;
    enum error_code code = ERROR_NONE;

    memcpy(s->before, s->plant->state, bytes);
    memset(s->K, 0, n * n * sizeof *s->K);
    for (size_t column = 0; column < n && code == ERROR_NONE; column++) {
        memset(s->step, 0, n * sizeof *s->step);
        s->step[column] = DIFFERENCE;
        for (int side = -1; side <= 1 && code == ERROR_NONE; side += 2) {
            move(s, side, s->step);
            code = weigh(s, s->ahead);
            move(s, -side, s->step);
            memcpy(s->plant->state, s->before, bytes);
            for (size_t row = 0; row < n; row++) {
                double half = -0.25 * side * s->ahead[row] / DIFFERENCE;

                s->K[row * n + column] += half;
                s->K[column * n + row] += half;
            }
        }
    }
    return code;
}

/* Cholesky factor of K + damping; false when that is not positive definite, for a body that s->weak
 * then names */
static bool factorize(struct settle *s, double damping)
{
    size_t n = s->n;
    double *L = s->factor;

    memcpy(L, s->K, n * n * sizeof *L);
    for (size_t i = 0; i < n; i++) {
        L[i * n + i] += damping * s->rest[i / UNKNOWNS].weight / DAMPING_LENGTH;
    }
    for (size_t column = 0; column < n; column++) {
        for (size_t row = column; row < n; row++) {
            double sum = L[row * n + column];

            for (size_t k = 0; k < column; k++) {
                sum -= L[row * n + k] * L[column * n + k];
            }
            if (row == column && !(sum > 0.0)) {
                s->weak = column / UNKNOWNS;
                return false;
            }
            L[row * n + column] = row == column ? sqrt(sum) : sum / L[column * n + column];
        }
    }
    return true;
}

/* step = (K + damping)^-1 g, no longer than LONGEST_STEP */
static void solve(struct settle *s)
{
    size_t n = s->n;
    const double *L = s->factor;
    double *x = s->step, longest = 0.0;

    memcpy(x, s->g, n * sizeof *x);
    for (size_t row = 0; row < n; row++) {
        for (size_t k = 0; k < row; k++) {
            x[row] -= L[row * n + k] * x[k];
        }
        x[row] /= L[row * n + row];
    }
    for (size_t row = n; row-- > 0;) {
        for (size_t k = row + 1; k < n; k++) {
            x[row] -= L[k * n + row] * x[k];
        }
        x[row] /= L[row * n + row];
        longest = fmax(longest, fabs(x[row]));
    }
    for (size_t i = 0; longest > LONGEST_STEP && i < n; i++) {
        x[i] *= LONGEST_STEP / longest;
    }
}

/* ---- the iteration ---- */

static enum error_code potential(struct settle *s, double *stored)
{
    struct plant_energy energy;
    enum error_code code = plant_energy(s->plant, &energy);

    *stored = energy.stored;
    return code;
}

/* Takes the step, or the half of it and so on, until it lowers the potential or the residual;
 * *moved is false when no part does. */
static enum error_code advance(struct settle *s, bool *moved)
{
    size_t worst = 0, bytes = s->plant->at.count * sizeof *s->before;
    double norm = residual(s, s->g, &worst), start, stored;
    double scale = 1.0;
    enum error_code code = potential(s, &start);

    *moved = false;
    for (int k = 0; k < HALVINGS && code == ERROR_NONE; k++, scale *= 0.5) {
        move(s, scale, s->step);
        code = weigh(s, s->ahead);
        if (code == ERROR_NONE) {
            code = potential(s, &stored);
        }
        if (code == ERROR_NONE && (residual(s, s->ahead, &worst) < norm || stored < start)) {
            memcpy(s->g, s->ahead, s->n * sizeof *s->g);
            *moved = true;
            return ERROR_NONE;
        }
        move(s, -scale, s->step);
        memcpy(s->plant->state, s->before, bytes);
    }
    return code;
}

/* whether a body has left the bounds within which its rest is looked for */
static enum error_code check_bounds(const struct settle *s, struct error *error)
{
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];
        double tilt = sqrt(vec3_dot(rest->tilt, rest->tilt));
        double lever = sqrt(vec3_dot(rest->moment, rest->moment)) / rest->weight;
        double carried = 1.0 + vec3_dot(rest->force, s->up) / rest->weight;

        if (tilt > STEEPEST) {
            return error_set(error, ERROR_INPUT,
                             "%s tips over: what carries it is %.3f m off its center of mass",
                             rest->name, lever);
        }
        if (rest->risen < -DEEPEST) {
            return error_set(error, ERROR_INPUT,
                             "%s is not supported: %.1f m below its start %.1f %% of its weight of "
                             "%.4g N are carried",
                             rest->name, DEEPEST, 100.0 * fmax(0.0, carried), rest->weight);
        }
    }
    return ERROR_NONE;
}

/* the contact engine failed */
static enum error_code broken(const struct settle *s, enum error_code code, struct error *error)
{
    return error_set(error, code, "%s", s->plant->failure);
}

static enum error_code topples(const struct settle *s, struct error *error)
{
    return error_set(error, ERROR_INPUT,
                     "%s would topple: what carries it resists a tilt by less than its weight adds "
                     "to it, so its rest is not stable",
                     s->rest[s->weak].name);
}

static enum error_code iterate(struct settle *s, struct settled *settled, struct error *error)
{
    enum error_code code = weigh(s, s->g);
    size_t worst = 0;
    bool moved = true;

    for (settled->iterations = 0; code == ERROR_NONE; settled->iterations++) {
        double damping = fmin(1.0, fmax(LEAST_DAMPING, residual(s, s->g, &worst)));

        settled->residual = residual(s, s->g, &worst);
        if (settled->residual <= TARGET || !moved || settled->iterations == ITERATIONS) {
            break;
        }
        code = check_bounds(s, error);
        if (code != ERROR_NONE) {
            return code;
        }
        code = differentiate(s);
        while (code == ERROR_NONE && !factorize(s, damping)) {
            damping *= 4.0;
        }
        if (code == ERROR_NONE) {
            solve(s);
            code = advance(s, &moved);
        }
    }
    if (code != ERROR_NONE) {
        return broken(s, code, error);
    }
    if (settled->residual > ACCEPTED && !factorize(s, LEAST_DAMPING)) {
        return topples(s, error);
    }
    if (settled->residual > ACCEPTED) {
        return error_set(error, ERROR_INPUT,
                         "%s finds no rest: %.2g of its weight of %.4g N are left over after %zu "
                         "iterations",
                         s->rest[worst].name, settled->residual, s->rest[worst].weight,
                         settled->iterations);
    }
    return ERROR_NONE;
}

/* what the three unknowns do not see: stability, and forces across gravity */
static enum error_code check_rest(struct settle *s, struct settled *settled, struct error *error)
{
    enum error_code code = differentiate(s);

    if (code == ERROR_NONE) {
        code = weigh(s, s->g);
    }
    if (code != ERROR_NONE) {
        return broken(s, code, error);
    }
    if (!factorize(s, LEAST_DAMPING)) {
        return topples(s, error);
    }
    settled->sideways = 0.0;
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];
        double a = vec3_dot(rest->force, s->across[0]), c = vec3_dot(rest->force, s->across[1]);
        double push = hypot(a, c), twist = fabs(vec3_dot(rest->moment, s->up)) / rest->radius;

        settled->sideways = fmax(settled->sideways, fmax(push, twist) / rest->weight);
        if (push > SIDEWAYS * rest->weight || twist > SIDEWAYS * rest->weight) {
            return error_set(error, ERROR_INPUT,
                             "%s would slide: %.3g N push it sideways and %.3g N m turn it, and "
                             "friction carries nothing at rest",
                             rest->name, push, twist * rest->radius);
        }
    }
    return ERROR_NONE;
}

/* ---- the robot's drives ---- */

/* what the drive of joint j has to give, N m */
static double drive_torque(const struct settle *s, size_t j)
{
    const struct plant *plant = s->plant;
    double tau = s->f[plant->config.robot->nv - plant->config.robot->njoint + j];

    for (size_t k = 0; k < plant->nspring; k++) {
        if (plant->spring_joint[k] == j) {
            tau -= parallel_spring_torque(&plant->config.robot->joint[j].spring,
                                          plant->state[plant->at.pretension + k], 0.0,
                                          plant_joint_position(plant, plant->state, j), 0.0);
        }
    }
    return tau;
}

static enum error_code check_joint(const struct settle *s, size_t j, double tau,
                                   struct error *error)
{
    const struct robot *robot = s->plant->config.robot;
    const struct robot_joint *joint = &robot->joint[j];
    double gravity = sqrt(vec3_dot(robot->gravity, robot->gravity));

    if (!joint->sea.present && fabs(tau) > ACCEPTED * robot->total_mass * gravity) {
        return error_set(error, ERROR_INPUT, "joint %s has no drive, and %.3g N m would move it",
                         joint->name, tau);
    }
    if (joint->sea.present &&
        fabs(joint->sea.R * tau / joint->sea.Kt) > s->plant->config.supply_v) {
        return error_set(error, ERROR_INPUT,
                         "joint %s needs %.3g V to hold %.3g N m, the supply has %g V", joint->name,
                         joint->sea.R * tau / joint->sea.Kt, tau, s->plant->config.supply_v);
    }
    return ERROR_NONE;
}

/* springs deflected, motors carrying; expects plant->ext to be that of the equilibrium */
static enum error_code load_drives(struct settle *s, struct error *error)
{
    struct plant *plant = s->plant;
    const struct robot *robot = plant->config.robot;

    weigh_robot(s, NULL);
    for (size_t j = 0; j < robot->njoint; j++) {
        enum error_code code = check_joint(s, j, drive_torque(s, j), error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        const struct robot_sea *sea = &robot->joint[j].sea;
        double tau = drive_torque(s, j), *y = plant->state + plant->at.drive + 3 * d;

        y[0] = plant_joint_position(plant, plant->state, j) + tau / sea->Ks;
        y[1] = 0.0;
        y[2] = tau / sea->Kt;
        plant->voltage[d] = sea->R * y[2];
        plant->bridge_on[d] = true;
        plant->command.motor[j].bridge_on = true;
        plant->command.motor[j].voltage_v = plant->voltage[d];
    }
    return ERROR_NONE;
}

/* ---- all of it ---- */

/* of the robot with its joints locked, about its center of mass */
static double gyration_radius(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    double centre[3], momentum[3], sum = 0.0;

    plant_centre_of_mass(plant, centre, momentum);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        double arm[3];

        mat3_apply(plant->whole_motion[b].R, inertia->com, arm);
        for (int i = 0; i < 3; i++) {
            arm[i] += plant->whole_motion[b].p[i] - centre[i];
        }
        sum += inertia->mass * vec3_dot(arm, arm) +
               0.5 * (inertia->I[0] + inertia->I[3] + inertia->I[5]);
    }
    return sqrt(sum / robot->total_mass);
}

/* the bodies that have to find their rest */
static void list_bodies(struct settle *s)
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
    s->n = UNKNOWNS * s->nrest;
}

#define TAKE(pointer, count)                                                                       \
    do {                                                                                           \
        (pointer) = arena_alloc(arena, (count), sizeof *(pointer));                                \
        ok = ok && (pointer);                                                                      \
    } while (0)

static bool allocate(struct settle *s, struct arena *arena)
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

static enum error_code find(struct settle *s, struct settled *settled, struct error *error)
{
    enum error_code code = iterate(s, settled, error);

    if (code == ERROR_NONE) {
        code = check_rest(s, settled, error);
    }
    if (code == ERROR_NONE) {
        code = load_drives(s, error);
    }
    if (code == ERROR_NONE && s->plant->config.robot->floating) {
        settled->rise_m = s->rest[0].risen;
        settled->tilt_rad = sqrt(vec3_dot(s->rest[0].tilt, s->rest[0].tilt));
    }
    return code;
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
    if (!start || !allocate(&s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory to settle %s", robot->name);
    }
    if (!(vec3_dot(robot->gravity, robot->gravity) > 0.0)) {
        return error_set(error, ERROR_INPUT, "nothing comes to rest without gravity");
    }
    choose_axes(robot->gravity, &s);
    memcpy(start, plant->state, plant->at.count * sizeof *start);
    plant->clamped = false; /* in a jig it would not feel what is to carry it */
    list_bodies(&s);
    code = find(&s, settled, error);
    plant->clamped = clamped;
    if (code != ERROR_NONE) {
        memcpy(plant->state, start, plant->at.count * sizeof *start);
        return code;
    }
    plant_balance(plant, clamped);
    code = plant_restart_energy(plant);
    if (code == ERROR_NONE) {
        code = plant_sample(plant);
    }
    return code == ERROR_NONE ? code : broken(&s, code, error);
}
