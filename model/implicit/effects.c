/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives with effects in a stage of the implicit integrator. model/drives/effects_flow.h advances
 * them through the spans. The torque on the joint at the stage is linearized at the joint's
 * predicted rate. The predicted rate has an error of order h^2, so the result has order 2 for any
 * slope. The slope used is the slope of spring, hysteresis and stop with a fixed rotor. It gives an
 * inertia that is never negative and keeps stiff springs stable.
 *
 * This is stable only if a stage resolves the oscillations of rotor, link and winding. All other
 * drives, and those with a presliding stiffness, are stiff. They take implicit Euler steps of a
 * stage, as the link does (effects_step_implicit). The stage is solved again until the torque on
 * the link is the torque of the drive at the solved rate.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* A drive is stiff if one of its oscillations is too fast for a stage. These are the weights of the
 * link on the spring and of the rotor with the winding, relative to the rotor on the spring. An
 * undamped link that turns by 0.88 rad in a stage diverges with the scheme of drives that are not
 * stiff. */
#define LINK_SWING (1.0 / 1.5)
#define WINDING_SWING 0.5

/* A drive is stiff if the length of a stage times one of two rates exceeds this: the rate at which
 * iron drag slows the rotor, or the rate at which the skin effect lowers the current. */
#define DECAY 0.5

/* Largest number of solutions of a stage, and the part of the torque by which the tangent of a
 * stiff drive may miss the torque at the solution. */
enum { REVISIONS = 60 };
#define TANGENT_ERROR 1e-12

/* Returns the inertia against a motion of joint j alone with all joints at zero, kg m2 or kg. */
static double find_link_inertia(struct plant *plant, size_t j)
{
    const struct robot *robot = plant->config.robot;
    const struct dynamics *dynamics = plant->config.dynamics;
    double *v = plant->implicit->u, kinetic, potential;

    memset(plant->q, 0, robot->nq * sizeof *plant->q);
    memset(v, 0, robot->nv * sizeof *v);
    if (robot->floating) {
        plant->q[BASE_Q_QUATERNION] = 1.0;
    }
    v[robot->nv - robot->njoint + j] = 1.0;
    dynamics->ops->energy(dynamics, plant->q, v, &kinetic, &potential);
    return 2.0 * kinetic;
}

/* Computes the flows of a drive with effects, for the configuration's step and its parts. */
static void make_effect_flows(const struct plant *plant, const struct robot_sea *sea,
                              double inertia, struct implicit_effects *made)
{
    double h = 1e-9 * (double)plant->config.substep_ns;
    const double stage = IMPLICIT_GAMMA * h, winding = sea->Kt * sea->Kw / sea->L;
    const double I = plant->config.supply_v / sea->R, v = plant->config.supply_v / sea->Kw;
    double stiffness;

    made->inertia = inertia;
    effects_linear_make(sea, &made->linear);
    stiffness = made->linear.of[EFFECTS_BENT].Ks;
    made->is_stiff = sea->effects->presliding > 0.0 ||
                     drive_swings_fast(stiffness, sea->J, stage) ||
                     drive_swings_fast(stiffness, inertia, LINK_SWING * stage) ||
                     drive_swings_fast(winding, sea->J, WINDING_SWING * stage) ||
                     sea->effects->iron * I * I / sea->J * stage > DECAY ||
                     effects_skin(sea, v) / sea->L * stage > DECAY;
    for (int level = 0; level < STEP_LEVELS; level++, h *= 0.25) {
        effects_flow_make(&made->linear, (1.0 - IMPLICIT_GAMMA) * h,
                          &made->flow[level][SPAN_TO_BASE]);
        effects_flow_make(&made->linear, IMPLICIT_GAMMA * h, &made->flow[level][SPAN_STAGE]);
    }
}

void implicit_prepare_effects(struct plant *plant, size_t d)
{
    const struct robot_sea *sound = &plant->config.robot->joint[plant->drive_joint[d]].sea;

    if (sound->effects) {
        make_effect_flows(plant, sound, find_link_inertia(plant, plant->drive_joint[d]),
                          &plant->implicit->effects_sound[d]);
    }
}

void implicit_refresh_effects(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    const struct robot_sea *sound = &plant->config.robot->joint[plant->drive_joint[d]].sea;

    if (!sound->effects) {
        return;
    }
    im->effects[d] = &im->effects_sound[d];
    if (plant->sea[d].J != sound->J || plant->sea[d].Ks != sound->Ks) {
        make_effect_flows(plant, &plant->sea[d], im->effects_sound[d].inertia,
                          &im->effects_changed[d]);
        im->effects[d] = &im->effects_changed[d];
    }
}

/* Returns the constants of a span of drive d whose joint moves at `rate`. */
static struct effects_span effect_span_of(const struct plant *plant, size_t d,
                                          enum implicit_span span, double rate)
{
    const struct implicit_effects *effects = plant->implicit->effects[d];

    return (struct effects_span){.sea = &plant->sea[d],
                                 .linear = &effects->linear,
                                 .flow = &effects->flow[plant->implicit->level][span],
                                 .bridge = plant->bridge[d],
                                 .qd = rate,
                                 .all_powers = plant->config.account_energy};
}

/* A drive under its own current controller counts as stiff at any gain. */
static bool is_stiff(const struct plant *plant, size_t d)
{
    return plant->implicit->effects[d]->is_stiff || plant->implicit->scheme != EFFECTS_USUAL ||
           plant->loop[d].on;
}

/* Returns the bridge of drive d in an implicit step from base. */
static struct effects_bridge step_bridge(const struct plant *plant, size_t d)
{
    struct effects_bridge bridge = plant->bridge[d];

    if (plant->loop[d].on) {
        bridge.loop = &plant->loop[d];
        bridge.begin_s = plant->implicit->base_s;
    }
    return bridge;
}

/* Linearizes a stiff drive at a rate of its joint at the end of the stage. */
static void find_tangent(const struct plant *plant, size_t d, double rate,
                         struct effects_tangent *tangent)
{
    const struct implicit *im = plant->implicit;
    const struct effects_state begin = plant_effects_state(plant, im->base, d);
    const struct effects_bridge bridge = step_bridge(plant, d);
    struct effects_end end;

    effects_step_implicit(&plant->sea[d], &bridge, im->stage_h,
                          plant_joint_position(plant, im->base, plant->drive_joint[d]), rate,
                          im->scheme == EFFECTS_EULER, &begin, &end);
    tangent->rate = rate;
    tangent->torque = end.torque;
    tangent->slope = end.slope;
}

/* Adds sign times a tangent to torque and extra of its joint. */
static void add_tangent(struct plant *plant, size_t d, double sign)
{
    struct implicit *im = plant->implicit;
    const struct effects_tangent *tangent = &im->effects_tangent[d];
    const size_t j = plant->drive_joint[d];

    im->torque[j] +=
        sign *
        (tangent->torque + tangent->slope * (plant_joint_rate(plant, im->base, j) - tangent->rate));
    im->extra[j] -= sign * tangent->slope * im->stage_h;
}

bool implicit_revise_effects(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const double *a = im->a + plant->config.robot->nv - plant->config.robot->njoint;
    bool revised = false;

    if (!plant->has_effects || im->revisions > REVISIONS) {
        return false;
    }
    for (size_t d = 0; d < plant->ndrive; d++) {
        struct effects_tangent *tangent = &im->effects_tangent[d], there = *tangent;
        const size_t j = plant->drive_joint[d];
        const double rate = plant_joint_rate(plant, im->base, j) + im->stage_h * a[j];
        const double step = tangent->slope * (rate - tangent->rate);

        if (!plant->sea[d].effects || !is_stiff(plant, d)) {
            continue;
        }
        find_tangent(plant, d, rate, &there);
        if (fabs(there.torque - tangent->torque - step) <=
            TANGENT_ERROR * (fabs(there.torque) + fabs(step))) {
            continue;
        }
        *(rate > tangent->rate ? &there.low : &there.high) = tangent->rate;
        if (!(rate > there.low && rate < there.high)) {
            find_tangent(plant, d, 0.5 * (there.low + there.high), &there);
        }
        add_tangent(plant, d, -1.0);
        *tangent = there;
        add_tangent(plant, d, 1.0);
        revised = true;
    }
    im->revisions += revised;
    return revised;
}

void implicit_linearize_effects(struct plant *plant, size_t d)
{
    struct implicit *im = plant->implicit;
    const struct robot_sea *sea = &plant->sea[d];
    const size_t j = plant->drive_joint[d];
    const double rate = plant_joint_rate(plant, im->point, j), h = im->stage_h;
    const double q = plant_joint_position(plant, im->base, j), end = q + h * rate;
    struct effects_span span = effect_span_of(plant, d, SPAN_STAGE, rate);
    struct effects_state state = plant_effects_state(plant, im->base, d);
    double slope, bend;

    if (is_stiff(plant, d)) {
        im->effects_tangent[d] = (struct effects_tangent){.low = -INFINITY, .high = INFINITY};
        find_tangent(plant, d, rate, &im->effects_tangent[d]);
        add_tangent(plant, d, 1.0);
        im->revisions = 0;
        return;
    }
    effects_advance(&span, q, &state, NULL);
    slope = -(im->effects[d]->linear.of[EFFECTS_BENT].Ks * h + sea->Ds);
    bend = fabs(effects_deflection(sea, state.sea.qm, end)) - 0.5 * sea->effects->backlash;
    if (sea->stop.stiffness > 0.0 && bend > sea->deflection) {
        slope -= sea->stop.stiffness * h + sea->stop.damping;
    }
    im->torque[j] += effects_torque(sea, &state, end, rate) +
                     slope * (plant_joint_rate(plant, im->base, j) - rate);
    im->extra[j] -= slope * h;
}

/* Advances a stiff drive through a span. The step of the stage, scaled, leads to the base of the
 * second stage. Writes the powers at the end. Returns the span's length, s. */
static double advance_stiff(const struct plant *plant, size_t d, enum implicit_span span,
                            double rate, struct effects_state *state, struct effects_power *power)
{
    const struct implicit *im = plant->implicit;
    const struct robot_sea *sea = &plant->sea[d];
    const double h = im->stage_h, scale = span == SPAN_STAGE ? 1.0 : (im->h - h) / h;
    const double q = plant_joint_position(plant, im->base, plant->drive_joint[d]);
    const double t = h * scale, limit = sea->effects->hysteresis;
    struct effects_bridge bridge = step_bridge(plant, d);
    const double before = state->sea.I;
    double current = before;
    struct effects_end end;
    struct effects_mode mode;

    effects_step_implicit(sea, &bridge, h, q, rate, im->scheme == EFFECTS_EULER, state, &end);
    if (bridge.loop) {
        /* The voltage without L I', whose energy is added below */
        current = effects_loop_current(sea, &bridge, h, t, state, &end);
        bridge.voltage = effects_steady_voltage(sea, &end.state, &bridge);
    }
    mode = effects_find_mode(sea, &end.state, q + h * rate, rate, &bridge);
    effects_power(sea, &end.state, q + h * rate, rate, &bridge, &mode, power);
    state->sea.qm += scale * (end.state.sea.qm - state->sea.qm);
    state->sea.qmd += scale * (end.state.sea.qmd - state->sea.qmd);
    state->sea.I += scale * (end.state.sea.I - state->sea.I);
    state->hysteresis += scale * (end.state.hysteresis - state->hysteresis);
    state->hysteresis = fmin(fmax(state->hysteresis, -limit), limit);
    if (sea->effects->presliding > 0.0) {
        const struct effects_carried carried = effects_carried(sea, &end.state, q + h * rate, rate);
        const double grip = state->grip;

        /* Friction takes its work, less the energy of the grip */
        state->grip = effects_limit_grip(grip + scale * (end.state.grip - grip),
                                         effects_friction(sea, state->sea.qmd, &carried));
        power->gear = end.state.grip * end.state.sea.qmd -
                      (effects_grip_energy(sea, state->grip) - effects_grip_energy(sea, grip)) / t;
    }
    if (bridge.loop) {
        state->sea.I = current;
        power->electrical += 0.5 * sea->L * (current * current - before * before) / t;
    }
    effects_warm(sea, power->joule * t, t, state);
    return t;
}

void implicit_advance_effects(struct plant *plant, size_t d, enum implicit_span span, double rate,
                              double *state)
{
    double *work = plant->implicit->work;
    struct effects_span through = effect_span_of(plant, d, span, rate);
    struct effects_state effects = plant_effects_state(plant, state, d);
    struct effects_power done = {0};
    double weight = 1.0;

    if (is_stiff(plant, d)) {
        weight = advance_stiff(plant, d, span, rate, &effects, &done);
    } else {
        effects_advance(&through, plant_joint_position(plant, state, plant->drive_joint[d]),
                        &effects, &done);
    }
    plant_effects_store(plant, d, &effects, state);
    work[WORK_ELECTRICAL] += weight * done.electrical;
    work[WORK_JOULE] += weight * done.joule;
    work[WORK_FRICTION] += weight * done.motor;
    work[WORK_SPRING_DAMPING] += weight * done.spring_damping;
    work[WORK_GEAR] += weight * done.gear;
    work[WORK_HYSTERESIS] += weight * done.hysteresis;
    work[WORK_BRIDGE] += weight * done.bridge;
}
