/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The implicit integrator: a singly diagonally implicit Runge-Kutta scheme of two stages (Alexander
 * 1977; Hairer, Wanner, Solving ODEs II, IV.6), stiffly accurate, L-stable and of order 2, with one
 * linear system a stage. With gamma = 1 - 1/sqrt(2), rates u (velocities of robot and free bodies)
 * and their slopes k = u':
 *
 *     u1 = u0 + gamma h k1                        q1 = q0 + gamma h u1
 *     u2 = u0 + (1 - gamma) h k1 + gamma h k2     q2 = q0 + (1 - gamma) h u1 + gamma h u2
 *
 * and the step's end is the second stage. Each is an implicit Euler step of gamma h from a base
 * (u0, q0, or the terms before gamma h k2, gamma h u2). docs/integrator.md has the derivation, the
 * stability map and the errors measured.
 *
 * Forces at a stage are those at a point near it, linearized there: the slope of the last step
 * predicts the point's rates. Their error is of order h^2. So the parts that are not stiff,
 * velocity products and the pose of the mass matrix, have order 2 without another pass. The
 * predicting slope is the smaller of two, or zero if their signs differ (minmod), so that an impact
 * is not extrapolated.
 *
 *   drives      solved exactly for joints that move at a stage's rates (drives/drive_flow.h): on
 *               its joint remain a torque and an inertia; parallel springs likewise by implicit
 *               Euler;
 *   couplings   of joints by implicit Euler too, beside the tree (model/implicit/solve.c);
 *   end stops   likewise, those that the joints press at the stage; where one turns out to pull, or
 *               to be missing, the stage is solved again without it or with it; one that has
 *               pushed in the first stage may take that much back in the second (model/stop.h);
 *   contact     a pair with the tangents K and D has, at its center, the wrench
 *               F - H (D + H K) (A - Ap), H = gamma h, A the relative acceleration of the stage and
 *               Ap that which leads to the point: H (D + H K) adds to its bodies' inertias;
 *   friction    that sticks: its bristles are bent from the base as the point's rates would, and
 *               follow the stage's linearly (model/implicit/bristle.c);
 *   gyroscopic  moments of free bodies are those at the stage, by iteration.
 *
 * So a stage is the system (Mass + E + sum Jb^T A_b Jb) a = right-hand side, which
 * dynamics_ops.implicit solves in one pass over the tree. Free bodies are 6x6 systems of their own.
 * A pair between two moving bodies couples them beyond the tree's structure: C holds those blocks,
 * and conjugate gradients with the uncoupled system P as preconditioner solve (P + C) a = rhs. Both
 * are positive definite, and so is P - C, hence P^-1 C has its eigenvalues within (-1, 1), no more
 * than 12 of them other than zero for each such pair.
 *
 * The wrench at the step's end is the one that moved the bodies in the second stage. It is kept for
 * the sensors, with the accelerations: the law of contact itself, evaluated at the state that the
 * step led to, would turn each error e of a velocity into a force D e, with D up to 1e5 N s/m, that
 * has moved nothing. The energy account takes the wrenches of both stages, with the scheme's
 * weights.
 *
 * Where something strikes, the rates of a pair, or of a joint at its stop, at a stage are far from
 * those at the point: the step is then taken again in 4 or 16 parts, a bounded and deterministic
 * amount of work; in 4 too where the robot's base spins.
 */
#include "model/implicit/implicit.h"

#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Unpredicted changes of a pair's velocity in a stage from which the step is divided, m/s. */
#define JUMP_QUARTER 0.02
#define JUMP_SIXTEENTH 0.1

/* Rotation of the robot's base in a step from which the step is divided, rad: 12 rad/s at 1 ms. */
#define TURN_QUARTER 0.012

/* Returns the number nearer to zero, or zero if the signs differ (minmod). */
static double smaller_slope(double x, double y)
{
    return x * y <= 0.0 ? 0.0 : fabs(x) < fabs(y) ? x : y;
}

/* Adds the power of contact and pushes at the solved stage, over weight seconds. */
static void account_stage(struct plant *plant, double weight)
{
    struct implicit *im = plant->implicit;

    im->work[WORK_CONTACT] += weight * im->contact_power;
    im->work[WORK_PUSH] += weight * im->load.push;
}

/* Solves the first stage: fills u_1 and slope from the start; base becomes the second stage's. */
static enum error_code take_first_stage(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const size_t bytes = plant->at.bristle * sizeof *im->base;
    const double rest = (1.0 - IMPLICIT_GAMMA) * im->h;
    enum error_code code;

    memcpy(im->base, im->begin, bytes);
    memcpy(im->u_base, im->u_begin, im->na * sizeof *im->u_base);
    im->stops_acted = false;
    for (size_t i = 0; i < im->na; i++) {
        im->u_point[i] = im->u_begin[i] + im->stage_h * im->trend[i];
    }
    if ((code = implicit_solve_stage(plant))) {
        return code;
    }
    memcpy(im->u_1, im->u, im->na * sizeof *im->u_1);
    memcpy(im->wrench_1, im->wrench, plant->config.ncontact * sizeof *im->wrench_1);
    account_stage(plant, rest);

    /* Powers of the joints at the stage itself */
    memcpy(im->point, im->base, bytes);
    implicit_move(plant, im->u, im->stage_h, im->point);
    implicit_set_rates(plant, im->u, im->point);
    implicit_account_joints(plant, rest, im->point, im->stage_h);

    /* Keeps the action of end stops in the solved first stage for the second stage. weight: weight
     * of the second stage relative to the first one. */
    const struct robot *robot = plant->config.robot;
    const double *a = im->a + robot->nv - robot->njoint;

    im->stops_acted = !im->stops_rest;
    for (size_t j = 0; j < robot->njoint && im->stops_acted; j++) {
        im->stop_torque[j] = (rest / im->stage_h) * (im->stop[j].torque - im->stop[j].extra * a[j]);
    }

    /* Base of the second stage */
    implicit_advance_actuators(plant, SPAN_TO_BASE, im->u);
    implicit_move(plant, im->u, rest, im->base);
    implicit_advance_bristles(plant, rest);
    for (size_t i = 0; i < im->na; i++) {
        im->u_base[i] = im->u_begin[i] + rest * im->slope[i];
    }
    implicit_set_rates(plant, im->u_base, im->base);
    return ERROR_NONE;
}

/* Solves the second stage: state becomes the step's end, trend the prediction for the next
 * step. */
static enum error_code take_second_stage(struct plant *plant)
{
    const double further = (1.0 - IMPLICIT_GAMMA) / IMPLICIT_GAMMA;
    struct implicit *im = plant->implicit;
    enum error_code code;

    for (size_t i = 0; i < im->na; i++) {
        double moved = im->u_1[i] - im->u_begin[i];

        im->u_point[i] = im->u_1[i] + further * smaller_slope(moved, im->stage_h * im->trend[i]);
    }
    if ((code = implicit_solve_stage(plant))) {
        return code;
    }
    account_stage(plant, im->stage_h);
    for (size_t i = 0; i < im->na; i++) {
        im->trend[i] = smaller_slope(im->slope[i], (im->u[i] - im->u_begin[i]) / im->h);
    }

    /* The end of the step */
    implicit_advance_actuators(plant, SPAN_STAGE, im->u);
    implicit_move(plant, im->u, im->stage_h, im->base);
    implicit_advance_bristles(plant, im->stage_h);
    implicit_set_rates(plant, im->u, im->base);
    implicit_account_joints(plant, im->stage_h, im->base, 0.0);
    memcpy(plant->state, im->base, plant->at.bristle * sizeof *im->base);
    return ERROR_NONE;
}

/* Advances by one part of a step, of h seconds. */
static enum error_code step_part(struct plant *plant, enum implicit_level level, double h)
{
    struct implicit *im = plant->implicit;
    enum error_code code;

    im->level = level;
    im->h = h;
    im->stage_h = IMPLICIT_GAMMA * h;
    im->jump = 0.0;
    memset(im->work, 0, sizeof im->work);
    memcpy(im->begin, plant->state, plant->at.bristle * sizeof *im->begin);
    implicit_get_rates(plant, im->begin, im->u_begin);
    /* Both stages, then the constraints and the accounts at the end */
    if ((code = take_first_stage(plant)) || (code = take_second_stage(plant))) {
        return code;
    }
    if (plant->config.robot->floating) {
        plant_normalize_quaternion(plant->state + BASE_Q_QUATERNION);
    }
    plant_free_normalize(plant);
    if (plant->config.account_energy) {
        add_scaled(1.0, im->work, plant->state + plant->at.work, plant->nwork);
    }
    if (plant->config.bus.capacitance_f > 0.0) {
        plant_supply_advance(plant, im->work[WORK_ELECTRICAL], h);
    }
    return ERROR_NONE;
}

/* Returns how finely a step of h seconds, taken in one piece, must be divided: because of impacts
 * in it, or because the base spins and the velocity products of the limbs vary within it. */
static enum implicit_level needed_level(const struct plant *plant, double h)
{
    const struct implicit *im = plant->implicit;
    const double *w = im->u_begin + BASE_V_ANGULAR;

    if (im->jump > JUMP_SIXTEENTH) {
        return LEVEL_SIXTEENTH;
    }
    if (im->jump > JUMP_QUARTER) {
        return LEVEL_QUARTER;
    }
    return plant->config.robot->floating && !plant->clamped &&
                   vec3_dot(w, w) * h * h > TURN_QUARTER * TURN_QUARTER
               ? LEVEL_QUARTER
               : LEVEL_WHOLE;
}

enum error_code implicit_step(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    size_t bytes = im->na * sizeof *im->trend;
    enum implicit_level level;
    enum error_code code;
    int parts;

    /* One piece, if there are no impacts and no spin */
    implicit_hold_lanes(plant);
    memcpy(im->trend_begin, im->trend, bytes);
    code = step_part(plant, LEVEL_WHOLE, h);
    if (code) {
        return code;
    }
    if ((level = needed_level(plant, h)) == LEVEL_WHOLE) {
        implicit_gather_wrenches(plant);
        implicit_clamp_friction(plant);
        return ERROR_NONE;
    }

    /* Otherwise again in parts, from the state at the start */
    parts = level == LEVEL_QUARTER ? 4 : 16;
    plant_return_state(plant);
    memcpy(im->trend, im->trend_begin, bytes);
    for (int part = 0; part < parts && !code; part++) {
        code = step_part(plant, level, h / parts);
        if (!code) {
            implicit_gather_wrenches(plant);
        }
    }
    if (!code) {
        implicit_clamp_friction(plant);
    }
    return code;
}

void implicit_restart(struct plant *plant)
{
    memset(plant->implicit->trend, 0, plant->implicit->na * sizeof *plant->implicit->trend);
}

/* ---- memory ---- */

#define TAKE(pointer, count)                                                                       \
    do {                                                                                           \
        (pointer) = arena_alloc(arena, (count), sizeof *(pointer));                                \
        ok = ok && (pointer);                                                                      \
    } while (0)

struct implicit *implicit_create(const struct plant *plant, struct arena *arena)
{
    const struct robot *robot = plant->config.robot;
    size_t ncontact = plant->config.ncontact, nfree = plant->config.nfree;
    size_t pairs = ncontact > 0 ? IMPLICIT_TANGENTS : 0;
    struct implicit *im;
    bool ok = true;

    TAKE(im, 1);
    if (!im) {
        return NULL;
    }

    /* Numbers of accelerations and observed bodies */
    im->na = robot->nv + FREE_ACCELERATIONS * nfree;
    for (size_t b = 0; b < robot->nbody; b++) {
        im->nobserved += robot->body[b].observed;
    }

    TAKE(im->begin, plant->at.bristle);
    TAKE(im->base, plant->at.bristle);
    TAKE(im->point, plant->at.bristle);
    TAKE(im->u_begin, im->na);
    TAKE(im->u_1, im->na);
    TAKE(im->trend, im->na);
    TAKE(im->trend_begin, im->na);
    TAKE(im->u_base, im->na);
    TAKE(im->u_point, im->na);
    TAKE(im->u, im->na);
    TAKE(im->slope, im->na);
    TAKE(im->a_point, im->na);
    TAKE(im->sound, plant->ndrive);
    TAKE(im->changed, plant->ndrive);
    TAKE(im->flows, plant->ndrive);
    TAKE(im->law, plant->ndrive);
    im->ngroup = (plant->ndrive + DRIVE_LANES - 1) / DRIVE_LANES;
    TAKE(im->group, im->ngroup);
    TAKE(im->lane_bridge, plant->ndrive);
    TAKE(im->effects_sound, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->effects_changed, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->effects, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->extra, robot->njoint);
    TAKE(im->torque, robot->njoint);
    TAKE(im->stop, robot->njoint);
    TAKE(im->stop_torque, robot->njoint);
    TAKE(im->lower, robot->njoint);
    TAKE(im->upper, robot->njoint);
    TAKE(im->compliance, robot->ncoupling);
    TAKE(im->pull, robot->ncoupling);
    TAKE(im->column, robot->ncoupling * robot->nv);
    TAKE(im->factor, robot->ncoupling * robot->ncoupling);
    TAKE(im->force, robot->ncoupling);
    TAKE(im->added, im->nobserved);
    TAKE(im->number, ncontact);
    TAKE(im->contact_inertia, ncontact);
    TAKE(im->tangent, pairs);
    TAKE(im->active, pairs);
    TAKE(im->is_touched, ncontact);
    TAKE(im->touched, ncontact);
    TAKE(im->wrench, ncontact);
    TAKE(im->wrench_1, ncontact);
    TAKE(im->free_inertia, nfree);
    TAKE(im->free_load, nfree);
    TAKE(im->a, im->na);
    TAKE(im->uncoupled, im->na);
    TAKE(im->z, im->na);
    TAKE(im->p, im->na);
    TAKE(im->twist_point, ncontact);
    TAKE(im->twist_p, ncontact);
    TAKE(im->twist_z, ncontact);
    TAKE(im->r, ncontact);
    TAKE(im->s, ncontact);
    TAKE(im->w, ncontact);
    TAKE(im->ext, robot->nbody);
    TAKE(im->motion, robot->nbody);

    /* Drives of the groups; ranges of the joints, as arrays */
    for (size_t d = 0; ok && d < DRIVE_LANES * im->ngroup; d++) {
        im->group[d / DRIVE_LANES].drive[d % DRIVE_LANES] =
            d < plant->ndrive ? d : plant->ndrive - 1;
    }
    for (size_t j = 0; ok && j < robot->njoint; j++) {
        im->lower[j] = robot->joint[j].lower;
        im->upper[j] = robot->joint[j].upper;
    }

    /* Index of each contact body among the observed bodies */
    for (size_t c = 0; ok && c < ncontact; c++) {
        for (size_t b = 0; b < robot->nbody && (int)b < plant->config.contact_body[c]; b++) {
            im->number[c] += robot->body[b].observed;
        }
    }
    return ok ? im : NULL;
}
