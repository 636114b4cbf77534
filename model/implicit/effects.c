/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives with effects in a stage of the implicit integrator. model/drives/effects_flow.h advances
 * them through the spans. The torque on the joint at the stage is linearized at the joint's
 * predicted rate. The predicted rate has an error of order h^2, so the result has order 2 for any
 * slope. The slope used is the slope of spring, hysteresis and stop with a fixed rotor. It gives an
 * inertia that is never negative and keeps stiff springs stable.
 */
#include "model/implicit/private.h"

#include <math.h>

/* Computes the flows of a drive with effects, for the configuration's step and its parts. */
static void make_effect_flows(const struct robot_sea *sea, double h, struct implicit_effects *made)
{
    effects_linear_make(sea, &made->linear);
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
        make_effect_flows(sound, 1e-9 * (double)plant->config.substep_ns,
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
        make_effect_flows(&plant->sea[d], 1e-9 * (double)plant->config.substep_ns,
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

void implicit_advance_effects(struct plant *plant, size_t d, enum implicit_span span, double rate,
                              double *state)
{
    double *work = plant->implicit->work;
    struct effects_span through = effect_span_of(plant, d, span, rate);
    struct effects_state effects = plant_effects_state(plant, state, d);
    struct effects_power done = {0};

    effects_advance(&through, plant_joint_position(plant, state, plant->drive_joint[d]), &effects,
                    &done);
    plant_effects_store(plant, d, &effects, state);
    work[WORK_ELECTRICAL] += done.electrical;
    work[WORK_JOULE] += done.joule;
    work[WORK_FRICTION] += done.motor;
    work[WORK_SPRING_DAMPING] += done.spring_damping;
    work[WORK_GEAR] += done.gear;
    work[WORK_HYSTERESIS] += done.hysteresis;
    work[WORK_BRIDGE] += done.bridge;
}
