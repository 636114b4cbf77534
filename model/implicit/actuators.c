/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives and springs in a stage of the implicit integrator: their torque at the stage as a function
 * of the joint's acceleration, their motion through a span, and their accounts.
 *
 * In a stage of length h, the joint moves at its rate at the stage's end, r = u_base + h a. The
 * drive is solved exactly for this motion (model/drives/drive_flow.h) and is linear in r:
 *     qm+ = qm + f_qm(r), tau+ = Ks (qm+ - q - h r) + Ds (qm'+ - r) = torque - extra a.
 * A spring at its stop has another linear law, tau = Ks d + Ds d' + offset, in which Ks and Ds
 * include the stop. It has its own flow about the deflection d + offset/Ks. One law holds for a
 * whole span; the predicted place of the free spring decides which one.
 */
#include "model/coupling.h"
#include "model/implicit/private.h"
#include "model/stop.h"

#include <math.h>
#include <string.h>

/* Number of parts of a span for the accounts: Simpson's rule is applied twice. */
enum { ACCOUNT_PARTS = 4 };

/* Returns the flow of drive d for a spring law, a step level and a span. */
static const struct drive_flow *drive_flow_of(const struct plant *plant, size_t d,
                                              enum spring_law law, int level,
                                              enum implicit_span span)
{
    return &plant->implicit->flows[d]->of[law][plant->bridge_on[d]][level][span];
}

/* Computes the flows of a step of h seconds. Both are exact if the step resolves the rotor's
 * oscillation on its spring. Otherwise they follow the integrator's scheme, L-stable together with
 * the link: an implicit Euler step through the stage, and its change times (1 - gamma)/gamma for
 * the span to the base. */
static void make_step_flows(const struct robot_sea *sea, bool bridge_on, double h,
                            struct drive_flow flow[SPANS])
{
    const double stage = IMPLICIT_GAMMA * h, rest = (1.0 - IMPLICIT_GAMMA) * h;

    if (!drive_swings_fast(sea->Ks, sea->J, stage)) {
        drive_flow_make(sea, bridge_on, rest, &flow[SPAN_TO_BASE]);
        drive_flow_make(sea, bridge_on, stage, &flow[SPAN_STAGE]);
    } else {
        drive_flow_make_implicit(sea, bridge_on, stage, rest / stage, &flow[SPAN_TO_BASE]);
        drive_flow_make_implicit(sea, bridge_on, stage, 1.0, &flow[SPAN_STAGE]);
    }
}

/* Computes all flows of a drive, for the configuration's step and its parts. */
static void make_drive_flows(const struct robot_sea *sea, double h, struct drive_flows *flows)
{
    struct robot_sea pressed = *sea;

    pressed.Ks += sea->stop.stiffness;
    pressed.Ds += sea->stop.damping;
    for (int level = 0; level < FLOW_LEVELS; level++, h *= 0.25) {
        for (int on = 0; on < 2; on++) {
            make_step_flows(sea, on, h, flows->of[SPRING_FREE][on][level]);
            make_step_flows(&pressed, on, h, flows->of[SPRING_PRESSED][on][level]);
        }
    }
}

/* Returns whether two drives have equal flows. */
static bool drives_flow_alike(const struct robot_sea *a, const struct robot_sea *b)
{
    return a->J == b->J && a->Ks == b->Ks && a->Ds == b->Ds && a->Dm == b->Dm && a->Kt == b->Kt &&
           a->Kw == b->Kw && a->R == b->R && a->L == b->L &&
           a->stop.stiffness == b->stop.stiffness && a->stop.damping == b->stop.damping;
}

/* Computes the flows of drive d from its own parameters. Copies the flows from an earlier drive
 * with equal parameters, because a robot has only a few kinds of drives. */
static void prepare_sound_flows(struct plant *plant, size_t d)
{
    const struct robot_joint *joint = plant->config.robot->joint;
    const struct robot_sea *sea = &joint[plant->drive_joint[d]].sea;
    struct drive_flows *sound = plant->implicit->sound;

    for (size_t e = 0; e < d; e++) {
        if (drives_flow_alike(sea, &joint[plant->drive_joint[e]].sea)) {
            sound[d] = sound[e];
            return;
        }
    }
    make_drive_flows(sea, 1e-9 * (double)plant->config.substep_ns, &sound[d]);
}

void implicit_prepare_drives(struct plant *plant)
{
    for (size_t d = 0; d < plant->ndrive; d++) {
        prepare_sound_flows(plant, d);
        implicit_prepare_effects(plant, d);
        implicit_refresh_drive(plant, d);
    }
}

/* Computes the flows of drive d from its changed parameters. Copies the flows from another drive
 * with equal changed parameters, if there is one. */
static void take_changed_flows(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;

    for (size_t e = 0; e < plant->ndrive; e++) {
        if (im->flows[e] == &im->changed[e] && drives_flow_alike(&plant->sea[d], &plant->sea[e])) {
            im->changed[d] = im->changed[e];
            return;
        }
    }
    make_drive_flows(&plant->sea[d], 1e-9 * (double)plant->config.substep_ns, &im->changed[d]);
}

void implicit_refresh_drive(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    const struct robot_sea *sound = &plant->config.robot->joint[plant->drive_joint[d]].sea;

    implicit_refresh_effects(plant, d);
    implicit_switch_loop(plant, d);
    im->flows[d] = &im->sound[d];
    if (plant->sea[d].J != sound->J || plant->sea[d].Ks != sound->Ks) {
        take_changed_flows(plant, d);
        im->flows[d] = &im->changed[d];
    }
}

/* ---- drives ---- */

double implicit_stop_shift(const struct robot_sea *sea, double deflection)
{
    return copysign(sea->stop.stiffness * sea->deflection / (sea->Ks + sea->stop.stiffness),
                    deflection);
}

/* Returns a span from base in this step. */
static struct implicit_part part_of(const struct plant *plant, enum spring_law law,
                                    enum implicit_span span)
{
    const struct implicit *im = plant->implicit;

    return (struct implicit_part){
        .law = law, .level = (int)im->level, .span = span, .step_s = im->h, .begin_s = im->base_s};
}

/* Returns the state of a drive after a part, whose joint moves from q at `rate`. *slope receives
 * the derivatives with respect to the rate. */
static struct sea_state flow_drive(struct plant *plant, size_t d, const struct implicit_part *part,
                                   const struct sea_state *drive, double q, double rate,
                                   struct sea_state *slope)
{
    const struct drive_flow *flow = drive_flow_of(plant, d, part->law, part->level, part->span);
    double shift = 0.0;

    if (plant->loop[d].on) {
        return implicit_follow_loop(plant, d, part, drive, q, rate, slope);
    }
    if (part->law == SPRING_PRESSED) {
        shift = implicit_stop_shift(&plant->sea[d], drive->qm - q);
    }
    *slope = (struct sea_state){
        .qm = flow->qm[FLOW_RATE], .qmd = flow->qmd[FLOW_RATE], .I = flow->I[FLOW_RATE]};
    return drive_flow_advance(flow, drive, q + shift, rate, plant->voltage[d]);
}

/* Returns the spring law of a span. It is PRESSED if the free spring would reach its stop and the
 * stop would then push, not pull. */
static enum spring_law find_spring_law(struct plant *plant, size_t d, enum implicit_span span,
                                       const struct sea_state *drive, double q, double rate)
{
    const struct robot_sea *sea = &plant->sea[d];
    const double t = drive_flow_of(plant, d, SPRING_FREE, (int)plant->implicit->level, span)->t;

    /* Usual case: the spring stays far from its stop */
    if (fabs(drive->qm - q) + t * fabs(drive->qmd - rate) < STOP_NEAR * sea->deflection) {
        return SPRING_FREE;
    }
    for (int law = SPRING_FREE; sea->stop.stiffness > 0.0 && law < SPRING_LAWS; law++) {
        const struct implicit_part part = part_of(plant, (enum spring_law)law, span);
        struct sea_state slope, end = flow_drive(plant, d, &part, drive, q, rate, &slope);
        double twist = end.qm - q - drive_flow_of(plant, d, part.law, part.level, span)->t * rate;

        if (sea_spring_at(sea, twist, end.qmd - rate).Ks == sea->Ks) {
            return SPRING_FREE;
        }
    }
    return sea->stop.stiffness > 0.0 ? SPRING_PRESSED : SPRING_FREE;
}

void implicit_linearize_drive(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    size_t j = plant->drive_joint[d];
    double q = plant_joint_position(plant, im->base, j);
    double rate = plant_joint_rate(plant, im->base, j), torque, slope;
    struct sea_state begin = plant_drive_state(plant, im->base, d), end, change;
    struct sea_spring spring = {.Ks = plant->sea[d].Ks, .Ds = plant->sea[d].Ds};
    struct implicit_part part;

    if (plant->sea[d].effects) {
        implicit_linearize_effects(plant, d);
        return;
    }

    /* Predict the state of the drive if the joint keeps its rate */
    im->law[d] = find_spring_law(plant, d, SPAN_STAGE, &begin, q, rate);
    part = part_of(plant, im->law[d], SPAN_STAGE);
    end = flow_drive(plant, d, &part, &begin, q, rate, &change);

    /* Compute the spring's torque in this state, and its slope against the rate */
    if (im->law[d] == SPRING_PRESSED) {
        spring.Ks += plant->sea[d].stop.stiffness;
        spring.Ds += plant->sea[d].stop.damping;
        spring.offset =
            -copysign(plant->sea[d].stop.stiffness * plant->sea[d].deflection, begin.qm - q);
    }
    torque = spring.Ks * (end.qm - (q + im->stage_h * rate)) + spring.Ds * (end.qmd - rate) +
             spring.offset;
    slope = spring.Ks * (change.qm - im->stage_h) + spring.Ds * (change.qmd - 1.0);
    im->torque[j] += torque;
    im->extra[j] -= slope * im->stage_h;
}

/* Returns whether all joints end the stage within their ranges. The joints have the accelerations a
 * or, if a is NULL, keep their rates. */
static bool joints_stay_within(const struct plant *plant, const double *a)
{
    const struct implicit *im = plant->implicit;
    const size_t njoint = plant->config.robot->njoint;
    const double *q = im->base + plant->at.v - njoint;
    const double *rate = im->base + plant->at.drive - njoint;
    const double h = im->stage_h, *lower = im->lower, *upper = im->upper;

    for (size_t j = 0; j < njoint; j++) {
        const double end = q[j] + h * (a ? rate[j] + h * a[j] : rate[j]);

        if (!(end >= lower[j] && end <= upper[j])) {
            return false;
        }
    }
    return true;
}

/* Adds the end stops that the joints press at the stage to torque and extra. */
static void linearize_stops(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;

    /* Usual case: no stop is pressed */
    if (!im->stops_acted && joints_stay_within(plant, NULL)) {
        if (!im->stops_rest) {
            memset(im->stop, 0, robot->njoint * sizeof *im->stop);
            im->stops_rest = true;
        }
        return;
    }
    im->stops_rest = false;
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const double q = plant_joint_position(plant, im->base, j);
        const double rate = plant_joint_rate(plant, im->base, j), end = q + im->stage_h * rate;
        const double earlier = im->stops_acted ? im->stop_torque[j] : 0.0;

        if (earlier != 0.0) {
            stop_step_continue(&joint->stop, joint->lower, joint->upper, q, rate, im->stage_h,
                               earlier < 0.0 ? 1 : -1, earlier, &im->stop[j]);
        } else if (end >= joint->lower && end <= joint->upper) {
            im->stop[j] = (struct stop_step){0};
            continue;
        } else {
            stop_step_begin(&joint->stop, joint->lower, joint->upper, q, rate, im->stage_h,
                            &im->stop[j]);
        }
        if (im->stop[j].side != 0) {
            im->torque[j] += im->stop[j].torque;
            im->extra[j] += im->stop[j].extra;
        }
    }
}

bool implicit_revise_stops(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double *a = im->a + robot->nv - robot->njoint;
    bool revised = false;

    if (im->stops_rest && joints_stay_within(plant, a)) {
        return false;
    }
    im->stops_rest = false;
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const double end =
            plant_joint_position(plant, im->base, j) +
            im->stage_h * (plant_joint_rate(plant, im->base, j) + im->stage_h * a[j]);
        struct stop_step before = im->stop[j];

        if (before.side == 0 && end > joint->lower && end < joint->upper) {
            continue;
        }
        if (stop_step_revise(
                &joint->stop, joint->lower, joint->upper, plant_joint_position(plant, im->base, j),
                plant_joint_rate(plant, im->base, j), im->stage_h, a[j], &im->stop[j])) {
            im->torque[j] += im->stop[j].torque - before.torque;
            im->extra[j] += im->stop[j].extra - before.extra;
            revised = true;
        }
    }
    return revised;
}

void implicit_linearize_actuators(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;

    memset(im->extra, 0, robot->njoint * sizeof *im->extra);
    memset(im->torque, 0, robot->njoint * sizeof *im->torque);
    implicit_linearize_drives(plant);
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        double torque, extra;

        parallel_spring_step(&robot->joint[j].spring, im->base[plant->at.pretension + s],
                             plant->pretension_rate[s], plant_joint_position(plant, im->base, j),
                             plant_joint_rate(plant, im->base, j), im->stage_h, &torque, &extra);
        im->torque[j] += torque;
        im->extra[j] += extra;
    }

    /* Add the passive springs to torque and extra. Their torque at the end of the stage is tau(q +
     * h q', q') - h (D + h K) a */
    for (size_t i = 0; i < plant->npassive; i++) {
        const size_t j = plant->passive_joint[i];
        const struct robot_passive *passive = &plant->config.robot->joint[j].passive;
        const double rate = plant_joint_rate(plant, im->base, j);

        im->torque[j] += passive_torque(
            passive, plant_joint_position(plant, im->base, j) + im->stage_h * rate, rate);
        im->extra[j] += im->stage_h * (passive->damping + im->stage_h * passive->stiffness);
    }
    if (plant->nhydraulic > 0) {
        implicit_linearize_hydraulics(plant);
    }
    linearize_stops(plant);

    /* Fill compliance and pull of the stage from base */
    const double *q = im->base + plant->at.v - robot->njoint;
    const double *qd = im->base + plant->at.drive - robot->njoint;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const double rate = coupling_rate(coupling, qd);
        const double ahead = coupling_error(coupling, q) + im->stage_h * rate;

        im->compliance[i] =
            1.0 / (im->stage_h * (coupling->damping + im->stage_h * coupling->stiffness));
        im->pull[i] = im->compliance[i] * coupling_force(coupling, ahead, rate);
    }
}

/* ---- end of a span, and the accounts ---- */

/* Adds the integrals of a drive's powers over a span, from the exact states at its quarters
 * (Simpson's rule). */
static void account_span(struct plant *plant, size_t d, enum spring_law law,
                         enum implicit_span span, struct sea_state drive, double q, double qd)
{
    static const double simpson[ACCOUNT_PARTS + 1] = {1.0, 4.0, 2.0, 4.0, 1.0};
    struct implicit *im = plant->implicit;
    const double t = drive_flow_of(plant, d, law, (int)im->level + 1, span)->t;
    const double stored = plant->loop[d].on ? 0.5 * plant->sea[d].L : 0.0;
    struct implicit_part part = part_of(plant, law, span);
    struct sea_state slope;

    part.level++;
    part.step_s /= ACCOUNT_PARTS;
    im->work[WORK_ELECTRICAL] -= stored * drive.I * drive.I;
    for (int k = 0; k <= ACCOUNT_PARTS; k++) {
        /* Add weight times the powers of a drive to the accounts */
        double weight = simpson[k] * t / 3.0;
        double voltage = plant->voltage[d];
        struct sea_power power;

        /* A current controller's voltage without L I', whose energy account_span adds */
        if (plant->loop[d].on) {
            voltage = plant->sea[d].R * drive.I + plant->sea[d].Kw * drive.qmd;
        }
        sea_power(&plant->sea[d], &drive, q, qd, voltage, &power);
        im->work[WORK_ELECTRICAL] += weight * power.electrical;
        im->work[WORK_JOULE] += weight * power.joule;
        im->work[WORK_FRICTION] += weight * power.friction;
        im->work[WORK_SPRING_DAMPING] += weight * power.spring_damping;

        if (k == ACCOUNT_PARTS) {
            break;
        }
        drive = flow_drive(plant, d, &part, &drive, q, qd, &slope);
        q += t * qd;
        part.begin_s += t;
    }
    im->work[WORK_ELECTRICAL] += stored * drive.I * drive.I;
}

/* Raises jump if a spring that was free at the start of the step presses its stop in a span. The
 * law of the stop holds for the whole span, so it pulls until the spring reaches the stop. */
static void raise_jump_at_spring(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    const size_t j = plant->drive_joint[d];
    const struct sea_state begin = plant_drive_state(plant, im->begin, d);
    const double twist = begin.qm - plant_joint_position(plant, im->begin, j);

    if (fabs(twist) < plant->sea[d].deflection) {
        const double rate = begin.qmd - plant_joint_rate(plant, im->begin, j);

        im->jump = fmax(im->jump, STRIKE_LEVER * fabs(rate));
    }
}

void implicit_advance_drive(struct plant *plant, size_t d, enum implicit_span span, double rate)
{
    struct implicit *im = plant->implicit;
    double *y = im->base + plant_drive_offset(plant, d);
    double q = plant_joint_position(plant, im->base, plant->drive_joint[d]);
    struct sea_state drive = plant_drive_state(plant, im->base, d);
    enum spring_law law = im->law[d];
    struct implicit_part part;
    struct sea_state slope;

    if (plant->sea[d].effects) {
        implicit_advance_effects(plant, d, span, rate, im->base);
        return;
    }
    if (span != SPAN_STAGE) {
        law = find_spring_law(plant, d, span, &drive, q, rate);
    }
    if (law == SPRING_PRESSED) {
        raise_jump_at_spring(plant, d);
    }
    if (plant->accounts) {
        account_span(plant, d, law, span, drive, q, rate);
    }
    part = part_of(plant, law, span);
    drive = flow_drive(plant, d, &part, &drive, q, rate, &slope);
    y[DRIVE_MOTOR_POSITION] = drive.qm;
    y[DRIVE_MOTOR_SPEED] = drive.qmd;
    y[DRIVE_CURRENT] = drive.I;
}

void implicit_advance_actuators(struct plant *plant, enum implicit_span span, const double *u)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double t = span == SPAN_STAGE ? im->stage_h : im->h - im->stage_h;

    implicit_advance_drives(plant, span, u + robot->nv - robot->njoint);
    for (size_t s = 0; s < plant->nspring; s++) {
        im->base[plant->at.pretension + s] += t * plant->pretension_rate[s];
    }
    if (plant->nhydraulic > 0) {
        implicit_advance_hydraulics(plant, t, u + robot->nv - robot->njoint);
    }
}

/* Returns the loss of the end stops at the solved stage, W, from the torques that moved the joints.
 * The stored energy follows from the state at the stage. */
static double stop_power(const struct plant *plant, const double *state)
{
    const struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double *a = im->a + robot->nv - robot->njoint;
    double power = 0.0;

    for (size_t j = 0; j < robot->njoint && !im->stops_rest; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const double torque = im->stop[j].torque - im->stop[j].extra * a[j];
        const double depth =
            stop_depth(joint->lower, joint->upper, plant_joint_position(plant, state, j));

        power -= (torque + joint->stop.stiffness * depth) * plant_joint_rate(plant, state, j);
    }
    return power;
}

void implicit_account_joints(struct plant *plant, double weight, const double *state, double offset)
{
    const struct robot *robot = plant->config.robot;
    double *work = plant->implicit->work;

    if (!plant->config.account_energy) {
        return;
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        const struct robot_parallel_spring *spring = &robot->joint[j].spring;
        double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
        double pd = plant->pretension_rate[s];
        double p = state[plant->at.pretension + s] + offset * pd;

        work[WORK_PRETENSION] += weight * pd * parallel_spring_force(spring, p, pd, q, qd);
        work[WORK_PARALLEL_DAMPING] += weight * parallel_spring_damping(spring, p, pd, q, qd);
    }
    if (!plant->clamped) {
        work[WORK_STOPS] += weight * stop_power(plant, state);
        work[WORK_SPRING_DAMPING] += weight * plant_spring_loss(plant, state);
    }
}
