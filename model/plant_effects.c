/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives with effects in the plant's state, and the supply of the bridges. rk4 and dopri5 have no
 * events. In a substep they integrate the smooth equations of the mode at the start of the substep.
 * Values that crossed zero are set to zero at the end of the substep.
 */
#include "model/plant_private.h"

#include <math.h>

struct effects_state plant_effects_state(const struct plant *plant, const double *state, size_t d)
{
    const double *y = state + plant->at.effect + plant->neffect * d;

    return (struct effects_state){.sea = plant_drive_state(plant, state, d),
                                  .hysteresis = y[EFFECT_HYSTERESIS],
                                  .winding_c = y[EFFECT_WINDING],
                                  .housing_c = y[EFFECT_HOUSING],
                                  .grip = plant->neffect > EFFECT_GRIP ? y[EFFECT_GRIP] : 0.0};
}

void plant_effects_store(const struct plant *plant, size_t d, const struct effects_state *effects,
                         double *state)
{
    double *drive = state + plant_drive_offset(plant, d);
    double *y = state + plant->at.effect + plant->neffect * d;

    drive[DRIVE_MOTOR_POSITION] = effects->sea.qm;
    drive[DRIVE_MOTOR_SPEED] = effects->sea.qmd;
    drive[DRIVE_CURRENT] = effects->sea.I;
    y[EFFECT_HYSTERESIS] = effects->hysteresis;
    y[EFFECT_WINDING] = effects->winding_c;
    y[EFFECT_HOUSING] = effects->housing_c;
    if (plant->neffect > EFFECT_GRIP) {
        y[EFFECT_GRIP] = effects->grip;
    }
}

double plant_effects_torque(const struct plant *plant, const double *state, size_t d)
{
    const size_t j = plant->drive_joint[d];
    const struct effects_state effects = plant_effects_state(plant, state, d);

    return effects_torque(&plant->sea[d], &effects, plant_joint_position(plant, state, j),
                          plant_joint_rate(plant, state, j));
}

double plant_drive_energy(const struct plant *plant, const double *state, size_t d)
{
    const struct robot_sea *sea = &plant->sea[d];
    const double q = plant_joint_position(plant, state, plant->drive_joint[d]);
    struct sea_state drive;

    if (sea->effects) {
        struct effects_state effects = plant_effects_state(plant, state, d);

        return effects_energy(sea, &effects, q);
    }
    drive = plant_drive_state(plant, state, d);
    return sea_energy(sea, &drive, q);
}

/* ---- start and constants of a step ---- */

/* Returns the voltage of the source without load, V: nominal minus sag. */
static double supply_source(const struct plant *plant)
{
    return fmax(0.0, plant->config.supply_v - plant->command.supply_sag_v);
}

void plant_effects_reset(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;

    for (size_t d = 0; d < plant->ndrive && plant->has_effects; d++) {
        const size_t j = plant->drive_joint[d];
        const struct robot_effects *effects = robot->joint[j].sea.effects;
        struct effects_state start = {.sea = plant_drive_state(plant, plant->state, d)};

        /* A drive with effects starts with a relaxed spring, at ambient temperature */
        if (effects) {
            start.sea.qm = effects_motor_rest(&robot->joint[j].sea,
                                              plant_joint_position(plant, plant->state, j), 0.0);
            start.winding_c = start.housing_c =
                effects->thermal.winding_k_w > 0.0 ? effects->thermal.ambient_c : 0.0;
        }
        plant_effects_store(plant, d, &start, plant->state);
        plant->bridge[d] = (struct effects_bridge){.conducts = false};
    }
    /* The bus starts charged */
    if (plant->config.bus.capacitance_f > 0.0) {
        plant->state[plant->at.supply + SUPPLY_VOLTAGE] =
            fmax(SUPPLY_LEAST_V, supply_source(plant));
        plant->state[plant->at.supply + SUPPLY_CHOPPING] = 0.0;
    }
}

/* Number of dead times per period. Both half bridges switch, and each loses one dead time of
 * voltage against the current. */
#define DEAD_TIMES 2.0

/* Returns the mean voltage lost to dead time at a supply voltage, V. */
static double dead_voltage(const struct robot_effects *effects, double supply)
{
    return fmin(1.0, DEAD_TIMES * effects->dead_time * effects->pwm) * supply;
}

double plant_holding_voltage(const struct plant *plant, size_t d, double I)
{
    const struct robot_sea *sea = &plant->sea[d];
    struct effects_state state;

    if (!sea->effects || I == 0.0) {
        return sea->R * I;
    }
    state = plant_effects_state(plant, plant->state, d);
    return effects_resistance(sea, &state) * I +
           copysign(dead_voltage(sea->effects, plant_supply(plant)), I);
}

/* Returns the mean square of the current ripple of two half bridges that switch alternately, A^2.
 * With V = d U, the voltage across the winding is U - V for the part d of a period, and -V for the
 * remaining part. */
static double ripple_square(const struct robot_sea *sea, double voltage, double supply)
{
    const double d = supply > 0.0 ? fmin(1.0, fabs(voltage) / supply) : 1.0;
    const double peak_to_peak = sea->effects->pwm > 0.0 && sea->L > 0.0
                                    ? supply * d * (1.0 - d) / (sea->L * sea->effects->pwm)
                                    : 0.0;

    return peak_to_peak * peak_to_peak / 12.0;
}

void plant_effects_hold(struct plant *plant, size_t d, double supply)
{
    const struct robot_effects *effects = plant->sea[d].effects;
    struct effects_bridge *bridge = &plant->bridge[d];
    const bool sound = !(plant->condition[d] & (DRIVE_OPEN_PHASE | DRIVE_SHORT));

    *bridge =
        (struct effects_bridge){.conducts = plant->bridge_on[d], .voltage = plant->voltage[d]};
    if (!effects || !sound) {
        return;
    }
    if (plant->bridge_on[d]) {
        bridge->hold = dead_voltage(effects, supply);
        bridge->switching = effects->switching * effects->pwm * supply;
        bridge->ripple = ripple_square(&plant->sea[d], bridge->voltage, supply);
    } else if (effects->freewheel) {
        bridge->conducts = true;
        bridge->diodes = 2.0 * effects->diode;
        bridge->hold = supply + bridge->diodes;
    }
}

/* ---- integrators without events ---- */

void plant_effects_derive(const struct plant *plant, const double *state, size_t d,
                          double *derivative, double *work)
{
    const size_t j = plant->drive_joint[d];
    const double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
    const struct effects_state effects = plant_effects_state(plant, state, d);
    struct effects_bridge bridge = plant->bridge[d];
    struct effects_mode mode = plant->mode[d];
    struct effects_state rate;
    struct effects_power power;

    /* A current controller compensates the lost voltage of the bridge: its current passes zero */
    bridge.voltage = plant_drive_voltage(plant, state, d);
    if (plant->loop[d].on) {
        mode.flow = effects.sea.I < 0.0 ? -1 : 1;
    }
    effects_derivative(&plant->sea[d], &effects, q, qd, &bridge, &mode, &rate);
    plant_effects_store(plant, d, &rate, derivative);
    if (work) {
        effects_power(&plant->sea[d], &effects, q, qd, &bridge, &mode, &power);
        work[WORK_ELECTRICAL] += power.electrical;
        work[WORK_JOULE] += power.joule;
        work[WORK_FRICTION] += power.motor;
        work[WORK_SPRING_DAMPING] += power.spring_damping;
        work[WORK_GEAR] += power.gear;
        work[WORK_HYSTERESIS] += power.hysteresis;
        work[WORK_BRIDGE] += power.bridge;
    }
}

void plant_effects_begin(struct plant *plant)
{
    for (size_t d = 0; d < plant->ndrive && plant->has_effects; d++) {
        const size_t j = plant->drive_joint[d];
        const struct effects_state effects = plant_effects_state(plant, plant->state, d);

        if (plant->sea[d].effects) {
            plant->mode[d] = effects_find_mode(
                &plant->sea[d], &effects, plant_joint_position(plant, plant->state, j),
                plant_joint_rate(plant, plant->state, j), &plant->bridge[d]);
        }
    }
    if (plant->config.bus.capacitance_f > 0.0) {
        supply_switch_chopper(&plant->config.bus, plant->state + plant->at.supply);
    }
}

/* Sets a number of the state to zero. The energy lost counts as a loss. */
static void stop_at_zero(struct plant *plant, size_t at, double inertia, enum plant_work loss)
{
    double *x = &plant->state[at];

    if (plant->config.account_energy) {
        plant->state[plant->at.work + loss] += 0.5 * inertia * *x * *x;
    }
    *x = 0.0;
    plant->lost[at] = 0.0;
}

/* Limits the grip of a drive to what friction allows. The energy lost counts as a loss. */
static void limit_grip(struct plant *plant, size_t d)
{
    const struct robot_sea *sea = &plant->sea[d];
    const size_t j = plant->drive_joint[d];
    struct effects_state state = plant_effects_state(plant, plant->state, d);
    const struct effects_carried carried =
        effects_carried(sea, &state, plant_joint_position(plant, plant->state, j),
                        plant_joint_rate(plant, plant->state, j));
    const double F = effects_friction(sea, state.sea.qmd, &carried), before = state.grip;
    const int slide = plant->mode[d].slide;

    state.grip = slide != 0 ? slide * F : effects_limit_grip(before, F);
    plant_effects_store(plant, d, &state, plant->state);
    if (plant->config.account_energy) {
        plant->state[plant->at.work + WORK_GEAR] +=
            effects_grip_energy(sea, before) - effects_grip_energy(sea, state.grip);
    }
}

void plant_effects_end(struct plant *plant)
{
    for (size_t d = 0; d < plant->ndrive && plant->has_effects; d++) {
        const struct robot_sea *sea = &plant->sea[d];
        const size_t speed = plant_drive_offset(plant, d) + DRIVE_MOTOR_SPEED;
        const size_t current = plant_drive_offset(plant, d) + DRIVE_CURRENT;

        if (!sea->effects) {
            continue;
        }
        if (sea->effects->presliding > 0.0) {
            limit_grip(plant, d);
        }
        if (effects_sticks(sea) && plant->state[speed] * plant->mode[d].slide < 0.0) {
            stop_at_zero(plant, speed, sea->J, WORK_GEAR);
        }
        if (!plant->loop[d].on && plant->bridge[d].hold > 0.0 &&
            plant->state[current] * plant->mode[d].flow < 0.0) {
            stop_at_zero(plant, current, sea->L, WORK_JOULE);
        }
    }
}

/* ---- the supply ---- */

/* Returns the power that the bridges take from the supply, W. */
static double plant_bridge_power(const struct plant *plant, const double *state)
{
    double power = 0.0;

    for (size_t d = 0; d < plant->ndrive; d++) {
        const double I = state[plant_drive_offset(plant, d) + DRIVE_CURRENT];

        if (plant->sea[d].effects) {
            const struct effects_state effects = plant_effects_state(plant, state, d);
            const struct effects_mode mode = {.flow = (I > 0.0) - (I < 0.0)};
            struct effects_bridge bridge = plant->bridge[d];
            struct effects_power taken;

            if (plant->loop[d].on) {
                bridge.voltage = plant_drive_voltage(plant, state, d);
            }
            effects_power_current(&plant->sea[d], &effects, &bridge, &mode, &taken);
            power += taken.electrical;
        } else {
            power +=
                I * (plant->loop[d].on ? plant_drive_voltage(plant, state, d) : plant->voltage[d]);
        }
    }
    return power;
}

/* Returns the voltage of the supply under load, V. Without a bus, solves V = source - R P / V for
 * V; P is the power that the bridges take. Returns half of the source voltage if P exceeds the
 * maximum power. */
double plant_supply(const struct plant *plant)
{
    double source = supply_source(plant), rest;

    if (plant->config.bus.capacitance_f > 0.0) {
        return fmax(SUPPLY_LEAST_V, plant->state[plant->at.supply + SUPPLY_VOLTAGE]);
    }
    if (plant->config.supply_ohm == 0.0) {
        return source;
    }
    rest =
        0.25 * source * source - plant->config.supply_ohm * plant_bridge_power(plant, plant->state);
    return 0.5 * source + sqrt(fmax(0.0, rest));
}

void plant_supply_derive(const struct plant *plant, const double *state, double *derivative,
                         double *work)
{
    struct supply_rates rates;

    supply_rates(&plant->config.bus, supply_source(plant), plant->config.supply_ohm,
                 plant_bridge_power(plant, state), state + plant->at.supply, &rates);
    derivative[plant->at.supply + SUPPLY_VOLTAGE] = rates.voltage;
    if (work) {
        work[WORK_SOURCE] += rates.source;
        work[WORK_SOURCE_LOSS] += rates.source_loss;
        work[WORK_CHOPPER] += rates.chopper;
    }
}

void plant_supply_advance(struct plant *plant, double energy, double h)
{
    double work[3] = {0.0};

    supply_advance(&plant->config.bus, supply_source(plant), plant->config.supply_ohm, energy, h,
                   plant->state + plant->at.supply, work);
    if (plant->config.account_energy) {
        double *account = plant->state + plant->at.work;

        account[WORK_SOURCE] += work[0];
        account[WORK_SOURCE_LOSS] += work[1];
        account[WORK_CHOPPER] += work[2];
    }
}
