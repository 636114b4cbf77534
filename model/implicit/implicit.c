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
 * The second stage is the end of the step. Each stage is an implicit Euler step of gamma h from a
 * base: u0 and q0 for the first stage, the terms before gamma h k2 and gamma h u2 for the second.
 * docs/integrator.md has the derivation, the stability map and the measured errors.
 *
 * Linearization. Each stage evaluates the forces at one point near the stage and linearizes them
 * there. The slope of the last step predicts the rates at the point. The prediction has an error
 * of order h^2. So velocity products and the pose in the mass matrix, which are not stiff, have
 * order 2 without a second evaluation. The predicting slope is the smaller of two slopes, or
 * zero if their signs differ (minmod). So the scheme does not extrapolate an impact.
 *
 *   drives      The scheme solves each drive exactly for a joint that moves at the stage's rate
 *               (model/drives/drive_flow.h). The joint sees a torque and an additional inertia.
 *               Parallel springs give the same two terms by implicit Euler.
 *   couplings   Couplings between joints are solved by implicit Euler, outside the tree
 *               (model/implicit/solve.c).
 *   end stops   Stops that joints press at the stage act by implicit Euler. If a stop turns out to
 *               pull, the stage is solved again without it. If a stop turns out to be missing, the
 *               stage is solved again with it. A stop that pushed in the first stage may take back
 *               as much in the second stage (model/stop.h).
 *   contact     A pair has the tangents K and D, and at its center the wrench
 *               F - H (D + H K) (A - Ap). H is gamma h, A the relative acceleration of the stage,
 *               Ap the relative acceleration that leads to the point. So H (D + H K) is an
 *               additional inertia of the pair's bodies.
 *   friction    The rates at the point bend the bristles of sticking friction from the base. The
 *               stage's rates then correct the bend linearly (model/implicit/bristle.c).
 *               Friction at its limit follows the normal force of the stage, and pairs that pull
 *               are removed: the stage is then solved again (implicit_revise_friction).
 *   gyroscopic  Gyroscopic moments of free bodies are evaluated at the stage, by iteration.
 *
 * Linear system. A stage is the system (Mass + E + sum Jb^T A_b Jb) a = right-hand side, with the
 * additional inertias E of joints and A_b of bodies. dynamics_ops.implicit solves it in one pass
 * over the tree. Each free body is a 6x6 system. A pair between two moving bodies adds blocks
 * outside the tree's structure. C consists of these blocks, P is the system without them. Conjugate
 * gradients with P as preconditioner solve (P + C) a = rhs. P, P + C and P - C are positive
 * definite, so the eigenvalues of P^-1 C are within (-1, 1). At most 12 of them per pair are not
 * zero.
 *
 * Output. The sensors read the wrenches that moved the bodies in the second stage, and the
 * accelerations of that stage. The contact law is not evaluated again at the end of the step: each
 * velocity error e would become a force D e, with D up to 1e5 N s/m, that has moved no body. The
 * energy account uses the wrenches of both stages, with the scheme's weights.
 *
 * Impacts. At an impact, the rates of a pair, or of a joint at its stop, differ much between stage
 * and point. The step is then repeated in 4 or 16 parts. A step in which the robot's base spins
 * fast is repeated in 4 parts. The amount of work is bounded and deterministic.
 *
 * Passive drives. The scheme is dissipative for linear drives, but not at every event of friction
 * and play. A robot of joints with effects and no input repeats a step in which its joints make
 * energy: first with stiff drives, then in 16 implicit Euler steps, which are dissipative for
 * monotone forces of any stiffness.
 */
#include "model/implicit/implicit.h"

#include "model/coupling.h"
#include "model/implicit/private.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Unpredicted changes of a pair's velocity in a stage at which a step is divided into 4 or into 16
 * parts, m/s. */
#define JUMP_QUARTER 0.02
#define JUMP_SIXTEENTH 0.1

/* Rotation of the robot's base in a step at which the step is divided into 4 parts, rad. For steps
 * of 1 ms this is 12 rad/s. */
#define TURN_QUARTER 0.012

/* What springs, drives and stops of several joints must make, as a multiple of the error of the
 * motion, for a step to be repeated. */
#define MOTION_ERROR 100.0

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

/* Adds the torques on the joints of a plant without input over weight seconds. At the end of a
 * step, adds their work: the impulse times the mean rate is what a constant mass matrix gains. */
static void account_impulse(struct plant *plant, double weight, bool ends)
{
    struct implicit *im = plant->implicit;
    const size_t njoint = plant->config.robot->njoint, first = plant->config.robot->nv - njoint;

    for (size_t j = 0; j < njoint && im->passive; j++) {
        const double rate = 0.5 * (im->u_begin[first + j] + im->u[first + j]);

        im->joint_impulse[j] += weight * (im->torque[j] - im->extra[j] * im->a[first + j]);
        if (ends) {
            im->joint_work += im->joint_impulse[j] * rate;
            im->joint_impulse[j] = 0.0;
        }
    }
}

/* Solves the first stage: fills u_1 and slope, and advances base to the base of the second
 * stage. */
static enum error_code take_first_stage(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const size_t bytes = plant->at.bristle * sizeof *im->base;
    const double rest = (1.0 - IMPLICIT_GAMMA) * im->h;
    enum error_code code;

    im->base_s = im->start_s;
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
    for (size_t t = 0; t < im->ntouched; t++) {
        const int c = im->touched[t];

        memcpy(im->origin_1[c], implicit_motion(plant, c)->p, sizeof im->origin_1[c]);
    }
    account_stage(plant, rest);
    account_impulse(plant, rest, false);

    /* Account for the powers of the joints at the solved stage */
    memcpy(im->point, im->base, bytes);
    implicit_move(plant, im->u, im->stage_h, im->point);
    implicit_set_rates(plant, im->u, im->point);
    implicit_account_joints(plant, rest, im->point, im->stage_h);

    /* Store the torques of end stops in the first stage for the second stage. weight: weight of the
     * second stage relative to the first stage */
    const struct robot *robot = plant->config.robot;
    const double *a = im->a + robot->nv - robot->njoint;

    im->stops_acted = !im->stops_rest;
    for (size_t j = 0; j < robot->njoint && im->stops_acted; j++) {
        im->stop_torque[j] = (rest / im->stage_h) * (im->stop[j].torque - im->stop[j].extra * a[j]);
    }

    /* Advance base to the base of the second stage */
    implicit_advance_actuators(plant, SPAN_TO_BASE, im->u);
    im->base_s += rest;
    implicit_move(plant, im->u, rest, im->base);
    implicit_advance_bristles(plant, rest);
    for (size_t i = 0; i < im->na; i++) {
        im->u_base[i] = im->u_begin[i] + rest * im->slope[i];
    }
    implicit_set_rates(plant, im->u_base, im->base);
    return ERROR_NONE;
}

/* Solves the second stage: advances state to the end of the step, and sets trend, the prediction
 * for the next step. */
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
    account_impulse(plant, im->stage_h, true);
    for (size_t i = 0; i < im->na; i++) {
        im->trend[i] = smaller_slope(im->slope[i], (im->u[i] - im->u_begin[i]) / im->h);
    }

    /* Advance drives and positions to the end of the step */
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
    /* Solve both stages, then apply the constraints and the accounts at the end of the step */
    if (im->scheme == EFFECTS_EULER) {
        /* Make the start of the step the base of its only stage, an implicit Euler step */
        im->stage_h = im->h;
        im->base_s = im->start_s;
        im->stops_acted = false;
        memcpy(im->base, im->begin, plant->at.bristle * sizeof *im->base);
        memcpy(im->u_base, im->u_begin, im->na * sizeof *im->u_base);
        memcpy(im->u_1, im->u_begin, im->na * sizeof *im->u_1);
    } else if ((code = take_first_stage(plant))) {
        return code;
    }
    if ((code = take_second_stage(plant))) {
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

/* Returns into how many parts a step of h seconds must be divided, after it was solved in one part.
 * Reasons: impacts, or a base that spins so fast that the velocity products of the limbs vary
 * within the step. */
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

/* Takes the step in equal parts, from the state at its start. */
static enum error_code step_in_parts(struct plant *plant, enum implicit_level level, double h,
                                     int parts)
{
    struct implicit *im = plant->implicit;
    enum error_code code = ERROR_NONE;

    plant_return_state(plant);
    im->joint_work = 0.0;
    memcpy(im->trend, im->trend_begin, im->na * sizeof *im->trend);
    for (int part = 0; part < parts && !code; part++) {
        im->start_s = part * (h / parts);
        code = step_part(plant, level, h / parts);
        if (!code) {
            implicit_gather_wrenches(plant);
        }
    }
    return code;
}

/* Returns whether the plant is a robot of joints with drives without any input, whose energy can
 * only fall. A current controller may hold a position, as a spring. */
static bool lacks_input(const struct plant *plant)
{
    const struct plant_config *config = &plant->config;
    bool lacks = plant->has_effects && plant->nspring == 0 && plant->nhydraulic == 0 &&
                 config->ncontact == 0 && config->nfree == 0 && config->robot->ncoupling == 0 &&
                 !plant->clamped;

    for (size_t d = 0; d < plant->ndrive && lacks; d++) {
        const struct current_loop *loop = &plant->loop[d];
        const struct loop_command *law = &loop->command[1];

        lacks = loop->on ? loop->filtered == 0.0 && law->current == 0.0 && law->speed == 0.0 &&
                               loop->switch_s == 0.0
                         : !plant->bridge_on[d] || plant->voltage[d] == 0.0;
    }
    return lacks;
}

/* Energies of a plant without input, J. */
struct passive_energy {
    double plant, joints; /* of the bodies, springs, drives and stops; without the bodies */
    double rounding;      /* bound on the errors of sums, and of differences of large angles */
};

static struct passive_energy find_passive_energy(struct plant *plant)
{
    const struct dynamics *dynamics = plant->config.dynamics;
    struct passive_energy energy = {.plant = plant_stored_mechanical(plant)};
    double kinetic, potential;

    for (size_t d = 0; d < plant->ndrive; d++) {
        const struct loop_command *law = &plant->loop[d].command[1];
        const double stiffness = plant->loop[d].on ? plant->sea[d].Kt * law->stiffness : 0.0;
        const double qm = plant_drive_state(plant, plant->state, d).qm, off = qm - law->position;
        const double q = plant_joint_position(plant, plant->state, plant->drive_joint[d]);
        const double error = DBL_EPSILON * (fabs(q) + fabs(qm));

        energy.plant += 0.5 * stiffness * off * off;
        energy.rounding += 2.0 * plant->sea[d].Ks * error * (error + fabs(qm - q));
    }
    dynamics->ops->energy(dynamics, plant->q, plant->state + plant->at.v, &kinetic, &potential);
    energy.joints = energy.plant - kinetic - potential;
    energy.rounding += 4.0 * DBL_EPSILON * fabs(energy.plant);
    return energy;
}

/* Returns whether springs, drives and stops have made energy since *before. The energy of a robot
 * of several bodies also rises by errors of its motion: what they make must exceed those errors. */
static bool joints_make_energy(struct plant *plant, const struct passive_energy *before)
{
    const struct passive_energy now = find_passive_energy(plant);
    const double gain = now.plant - before->plant;
    const double made = now.joints - before->joints + plant->implicit->joint_work;

    return plant->config.robot->nv == 1
               ? gain > now.rounding
               : made > now.rounding && made > MOTION_ERROR * (fabs(gain - made) - now.rounding);
}

enum error_code implicit_step(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;
    const bool passive = lacks_input(plant);
    const struct passive_energy energy =
        passive ? find_passive_energy(plant) : (struct passive_energy){0};
    enum implicit_level level;
    enum error_code code;

    /* Try the step in one part. At an impact, repeat the step in parts */
    implicit_hold_lanes(plant);
    im->passive = passive;
    memcpy(im->trend_begin, im->trend, im->na * sizeof *im->trend);
    im->scheme = EFFECTS_USUAL;
    im->start_s = im->joint_work = 0.0;
    code = step_part(plant, LEVEL_WHOLE, h);
    if (code) {
        return code;
    }
    if ((level = needed_level(plant, h)) == LEVEL_WHOLE) {
        implicit_gather_wrenches(plant);
    } else {
        code = step_in_parts(plant, level, h, level == LEVEL_QUARTER ? 4 : 16);
    }

    /* Repeat a step that makes energy by schemes that damp more */
    while (passive && !code && im->load.push == 0.0 && im->scheme < EFFECTS_EULER &&
           joints_make_energy(plant, &energy)) {
        im->scheme++;
        code = step_in_parts(plant, LEVEL_WHOLE, h, im->scheme == EFFECTS_EULER ? 16 : 1);
    }
    return code;
}

void implicit_restart(struct plant *plant)
{
    memset(plant->implicit->trend, 0, plant->implicit->na * sizeof *plant->implicit->trend);
}

/* ---- memory ---- */

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

    /* Count the accelerations and the observed bodies */
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
    TAKE(im->loop_flows, plant->ndrive);
    TAKE(im->law, plant->ndrive);
    im->ngroup = (plant->ndrive + DRIVE_LANES - 1) / DRIVE_LANES;
    TAKE(im->group, im->ngroup);
    TAKE(im->lane_bridge, plant->ndrive);
    TAKE(im->effects_sound, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->effects_changed, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->effects, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->effects_tangent, plant->has_effects ? plant->ndrive : 0);
    TAKE(im->extra, robot->njoint);
    TAKE(im->torque, robot->njoint);
    TAKE(im->stop, robot->njoint);
    TAKE(im->stop_torque, robot->njoint);
    TAKE(im->joint_impulse, robot->njoint);
    TAKE(im->lower, robot->njoint);
    TAKE(im->upper, robot->njoint);
    TAKE(im->unit, robot->ncoupling * robot->njoint);
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
    TAKE(im->origin_1, ncontact);
    TAKE(im->free_inertia, nfree);
    TAKE(im->free_load, nfree);
    TAKE(im->a, im->na);
    TAKE(im->uncoupled, im->na);
    TAKE(im->z, im->na);
    TAKE(im->p, im->na);
    TAKE(im->twist_point, ncontact);
    TAKE(im->twist_p, ncontact);
    TAKE(im->held, ncontact);
    TAKE(im->twist_z, ncontact);
    TAKE(im->r, ncontact);
    TAKE(im->s, ncontact);
    TAKE(im->w, ncontact);
    TAKE(im->ext, robot->nbody);
    TAKE(im->motion, robot->nbody);

    /* Assign drives to groups; copy the ranges of the joints to arrays */
    for (size_t d = 0; ok && d < DRIVE_LANES * im->ngroup; d++) {
        im->group[d / DRIVE_LANES].drive[d % DRIVE_LANES] =
            d < plant->ndrive ? d : plant->ndrive - 1;
    }
    for (size_t j = 0; ok && j < robot->njoint; j++) {
        im->lower[j] = robot->joint[j].lower;
        im->upper[j] = robot->joint[j].upper;
    }

    /* Set the unit loads of the couplings, and choose dynamics that can respond to them */
    for (size_t i = 0; ok && i < robot->ncoupling; i++) {
        coupling_press(&robot->coupling[i], -1.0, im->unit + i * robot->njoint);
    }
    im->tree = plant->config.dynamics;
    if (ok && robot->ncoupling > 0 && !im->tree->ops->respond) {
        struct dynamics *numeric = arena_alloc(arena, 1, sizeof *numeric);
        struct error error;

        ok = numeric && !dynamics_generic(robot, arena, numeric, &error);
        im->tree = numeric;
    }

    /* Find the index of each contact body among the observed bodies */
    for (size_t c = 0; ok && c < ncontact; c++) {
        for (size_t b = 0; b < robot->nbody && (int)b < plant->config.contact_body[c]; b++) {
            im->number[c] += robot->body[b].observed;
        }
    }
    return ok ? im : NULL;
}
