/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives and parallel springs in a stage of the implicit integrator: what torque they give at the
 * stage as a function of the joint's acceleration, how they get there, and their accounts.
 *
 * In a stage the joint moves at the rate r = u_base + h a that it has at the stage's end (h that of
 * the stage). The drive is solved exactly for that (model/drive_flow.h), and linear in r:
 *     qm+ = qm + f_qm(r), tau+ = Ks (qm+ - q - h r) + Ds (qm'+ - r) = torque - extra a.
 */
#include "model/implicit_private.h"

#include <string.h>

/* Angle that a rotor may swing on its spring within a stage, rad, to be taken exactly. */
#define SWING_RESOLVED 0.5

/* Parts that a span is divided into for the accounts: two applications of Simpson's rule. */
enum { ACCOUNT_PARTS = 4 };

static const struct drive_flow *drive_flow_of(const struct plant *plant, size_t d, int level,
                                              enum implicit_span span)
{
    return &plant->implicit->flows[d].of[plant->bridge_on[d]][level][span];
}

/* The flows of a step of h seconds. Both are exact where the rotor's swing on its spring is
 * resolved; else they are those of the scheme itself, L-stable together with the link: implicit
 * Euler through the stage, and the change up to the base as much again as (1 - gamma)/gamma. */
static void make_step_flows(const struct robot_sea *sea, bool bridge_on, double h,
                            struct drive_flow flow[SPANS])
{
    const double stage = IMPLICIT_GAMMA * h, rest = (1.0 - IMPLICIT_GAMMA) * h;

    if (sea->Ks * stage * stage <= SWING_RESOLVED * SWING_RESOLVED * sea->J) {
        drive_flow_make(sea, bridge_on, rest, &flow[SPAN_TO_BASE]);
        drive_flow_make(sea, bridge_on, stage, &flow[SPAN_STAGE]);
    } else {
        drive_flow_make_implicit(sea, bridge_on, stage, rest / stage, &flow[SPAN_TO_BASE]);
        drive_flow_make_implicit(sea, bridge_on, stage, 1.0, &flow[SPAN_STAGE]);
    }
}

void implicit_refresh_drive(struct plant *plant, size_t d)
{
    double h = 1e-9 * (double)plant->config.substep_ns;

    for (int level = 0; level < FLOW_LEVELS; level++, h *= 0.25) {
        for (int on = 0; on < 2; on++) {
            make_step_flows(&plant->sea[d], on, h, plant->implicit->flows[d].of[on][level]);
        }
    }
}

static void linearize_drive(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    const struct robot_sea *sea = &plant->sea[d];
    const struct drive_flow *flow = drive_flow_of(plant, d, (int)im->level, SPAN_STAGE);
    size_t j = plant->drive_joint[d];
    double q = plant_joint_position(plant, im->base, j);
    double rate = plant_joint_rate(plant, im->base, j), slope;
    struct sea_state begin = plant_drive_state(plant, im->base, d);
    struct sea_state end = drive_flow_advance(flow, &begin, q, rate, plant->voltage[d]);

    slope = sea->Ks * (flow->qm[FLOW_RATE] - im->stage_h) + sea->Ds * (flow->qmd[FLOW_RATE] - 1.0);
    im->torque[j] += sea_torque(sea, &end, q + im->stage_h * rate, rate);
    im->extra[j] -= slope * im->stage_h;
}

void implicit_linearize_actuators(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;

    memset(im->extra, 0, robot->njoint * sizeof *im->extra);
    memset(im->torque, 0, robot->njoint * sizeof *im->torque);
    for (size_t d = 0; d < plant->ndrive; d++) {
        linearize_drive(plant, d);
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        double torque, extra;

        parallel_spring_step(&robot->joint[j].spring, im->base[plant->at.pretension + s],
                             plant->pretension_rate[s], plant_joint_position(plant, im->base, j),
                             plant_joint_rate(plant, im->base, j), im->stage_h, &torque, &extra);
        im->torque[j] += torque;
        im->extra[j] += extra;
    }
}

/* Adds weight times the powers of a drive to the accounts. */
static void account_drive(const struct plant *plant, size_t d, const struct sea_state *drive,
                          double qd, double weight, double *work)
{
    struct sea_power power;

    sea_power(&plant->sea[d], drive, qd, plant->voltage[d], &power);
    work[WORK_ELECTRICAL] += weight * power.electrical;
    work[WORK_JOULE] += weight * power.joule;
    work[WORK_FRICTION] += weight * power.friction;
    work[WORK_SPRING_DAMPING] += weight * power.spring_damping;
}

/* The integrals of its powers over a span, from the exact states at its quarters (Simpson). */
static void account_span(const struct plant *plant, size_t d, enum implicit_span span,
                         struct sea_state drive, double q, double qd, double *work)
{
    static const double simpson[ACCOUNT_PARTS + 1] = {1.0, 4.0, 2.0, 4.0, 1.0};
    const struct drive_flow *part = drive_flow_of(plant, d, (int)plant->implicit->level + 1, span);

    for (int k = 0; k <= ACCOUNT_PARTS; k++) {
        account_drive(plant, d, &drive, qd, simpson[k] * part->t / 3.0, work);
        drive = drive_flow_advance(part, &drive, q, qd, plant->voltage[d]);
        q += part->t * qd;
    }
}

void implicit_advance_actuators(struct plant *plant, enum implicit_span span, const double *u,
                                double *state)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double *rate = u + robot->nv - robot->njoint;
    const double t = span == SPAN_STAGE ? im->stage_h : im->h - im->stage_h;

    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        double *y = state + plant_drive_offset(plant, d), q = plant_joint_position(plant, state, j);
        struct sea_state drive = plant_drive_state(plant, state, d);

        if (plant->config.account_energy) {
            account_span(plant, d, span, drive, q, rate[j], im->work);
        }
        drive = drive_flow_advance(drive_flow_of(plant, d, (int)im->level, span), &drive, q,
                                   rate[j], plant->voltage[d]);
        y[DRIVE_MOTOR_POSITION] = drive.qm;
        y[DRIVE_MOTOR_SPEED] = drive.qmd;
        y[DRIVE_CURRENT] = drive.I;
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        state[plant->at.pretension + s] += t * plant->pretension_rate[s];
    }
}

void implicit_account_springs(struct plant *plant, const double *u, double weight,
                              const double *state, double offset)
{
    const struct robot *robot = plant->config.robot;
    const double *rate = u + robot->nv - robot->njoint;
    double *work = plant->implicit->work;

    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        const struct robot_parallel_spring *spring = &robot->joint[j].spring;
        double q = plant_joint_position(plant, state, j), pd = plant->pretension_rate[s];
        double p = state[plant->at.pretension + s] + offset * pd;

        work[WORK_PRETENSION] += weight * pd * parallel_spring_force(spring, p, pd, q, rate[j]);
        work[WORK_PARALLEL_DAMPING] += weight * parallel_spring_damping(spring, p, pd, q, rate[j]);
    }
}
