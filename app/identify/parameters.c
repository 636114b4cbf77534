/* SPDX-License-Identifier: Apache-2.0 */
/* The table of parameters that an identification may change. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "base/text.h"

#include <math.h>
#include <string.h>

#define AT(member) offsetof(struct trial_robot, member)
const struct parameter parameters[] = {
    {"J_kg_m2", "inertia of the rotor behind the gear", AT(joint.sea.J), SCALE_OTHER},
    {"Dm_nm_s_rad", "viscous friction", AT(joint.sea.Dm), SCALE_DAMPING},
    {"Ks_nm_rad", "stiffness of gear or spring", AT(joint.sea.Ks), SCALE_OTHER},
    {"Ds_nm_s_rad", "damping of gear or spring", AT(joint.sea.Ds), SCALE_DAMPING},
    {"N", "ratio of the gear", AT(joint.sea.N), SCALE_OTHER},
    {"NKt_nm_a", "torque constant behind the gear", AT(joint.sea.Kt), SCALE_OTHER},
    {"NKw_v_s_rad", "back-EMF constant behind the gear", AT(joint.sea.Kw), SCALE_OTHER},
    {"R_ohm", "resistance of the winding", AT(joint.sea.R), SCALE_OTHER},
    {"L_h", "inductance of the winding", AT(joint.sea.L), SCALE_OTHER},
    {"deflection_rad", "room of the spring", AT(joint.sea.deflection), SCALE_ANGLE},
    {"stop_Ks_nm_rad", "stiffness of its stop", AT(joint.sea.stop.stiffness), SCALE_OTHER},
    {"stop_Ds_nm_s_rad", "damping of its stop", AT(joint.sea.stop.damping), SCALE_OTHER},
    {"current_loop_hz", "bandwidth of the current controller", AT(joint.sea.current_loop_hz),
     SCALE_OTHER},
    {"command_filter_s", "filter of commanded currents", AT(joint.sea.command_filter_s),
     SCALE_TIME},
    {"command_delay_s", "delay of the drive's commands", AT(joint.sea.command_delay_s), SCALE_TIME},
    {"coulomb_nm", "Coulomb friction of the gear", AT(effects.coulomb), SCALE_TORQUE},
    {"breakaway_nm", "friction at rest", AT(effects.breakaway), SCALE_TORQUE},
    {"stribeck_rad_s", "Stribeck's speed", AT(effects.stribeck), SCALE_SPEED},
    {"stribeck_exponent", "exponent of Stribeck's dip", AT(effects.stribeck_exponent), SCALE_OTHER},
    {"presliding_nm_rad", "stiffness of the friction at rest", AT(effects.presliding), SCALE_OTHER},
    {"load_motor", "friction by the motor's torque", AT(effects.load.motor), SCALE_SHARE},
    {"load_external", "friction by the load's torque", AT(effects.load.external), SCALE_SHARE},
    {"load_motor_stribeck", "the same, added at rest", AT(effects.load.motor_stribeck),
     SCALE_SHARE},
    {"load_external_stribeck", "the same, added at rest", AT(effects.load.external_stribeck),
     SCALE_SHARE},
    {"load_motor_per_nm", "by the motor's torque squared", AT(effects.load.motor_quadratic),
     SCALE_SHARE},
    {"load_external_per_nm", "by the load's torque squared", AT(effects.load.external_quadratic),
     SCALE_SHARE},
    {"backlash_rad", "whole play of the gear", AT(effects.backlash), SCALE_ANGLE},
    {"hysteresis_nm", "hysteresis, torque", AT(effects.hysteresis), SCALE_TORQUE},
    {"hysteresis_nm_rad", "hysteresis, stiffness", AT(effects.hysteresis_stiffness), SCALE_OTHER},
    {"dead_time_s", "dead time of the bridge", AT(effects.dead_time), SCALE_OTHER},
    {"pwm_hz", "frequency of the bridge", AT(effects.pwm), SCALE_OTHER},
    {"switching_s", "time to switch the bridge", AT(effects.switching), SCALE_OTHER},
    {"bridge_ohm", "resistance of the bridge", AT(effects.bridge_ohm), SCALE_OTHER},
    {"diode_v", "voltage of a diode of the bridge", AT(effects.diode), SCALE_OTHER},
    {"saturation_a", "current that saturates the motor", AT(effects.saturation), SCALE_OTHER},
    {"iron_nm_s_rad_a2", "drag of the iron by the current squared", AT(effects.iron), SCALE_OTHER},
    {"standby_w", "power of the electronics", AT(effects.standby), SCALE_OTHER},
    {"winding_k_w", "heat resistance, winding to housing", AT(effects.thermal.winding_k_w),
     SCALE_OTHER},
    {"housing_k_w", "heat resistance, housing to air", AT(effects.thermal.housing_k_w),
     SCALE_OTHER},
    {"winding_j_k", "heat capacity of the winding", AT(effects.thermal.winding_j_k), SCALE_OTHER},
    {"housing_j_k", "heat capacity of the housing", AT(effects.thermal.housing_j_k), SCALE_OTHER},
    {"ambient_c", "temperature of the air", AT(effects.thermal.ambient_c), SCALE_OTHER},
    {"R_per_k", "how resistance follows temperature", AT(effects.thermal.R_per_k), SCALE_OTHER},
    {"NKt_per_k", "how the torque constant does", AT(effects.thermal.Kt_per_k), SCALE_OTHER},
    {"offset_rad", "the joint's angle where the recording says 0", AT(bench.offset_rad),
     SCALE_ANGLE},
    {"delay_s", "delay of the command", AT(bench.delay_s), SCALE_TIME},
    {"arm_kg", "a rod's mass between axis and load", AT(bench.arm_kg), SCALE_MASS},
    {"command_gain", "true command divided by recorded one", AT(bench.command_gain), SCALE_GAIN},
};

int parameter_find(const char *key)
{
    return TEXT_FIND(parameters, ARRAY_COUNT(parameters), key, key);
}

enum error_code parameter_check(const char *key, int *parameter, struct error *error)
{
    const char *near =
        text_nearest_first(key, parameters, sizeof *parameters, ARRAY_COUNT(parameters));

    *parameter = parameter_find(key);
    if (*parameter != IDENTIFY_NONE) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT, "found \"%.63s\", expected %s", key,
                     near
                         ? near
                         : "a key of a drive's file, or offset_rad, delay_s, arm_kg, command_gain: "
                           "a number that can be identified");
}

const int parameter_count = (int)ARRAY_COUNT(parameters);

double parameter_get(const struct trial_robot *trial, int parameter)
{
    return *(const double *)(const void *)((const char *)trial + parameters[parameter].offset);
}

void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count)
{
    struct robot_load_friction *load = &trial->effects.load;
    const double ratio = trial->joint.sea.Kw / trial->joint.sea.Kt;
    bool free[ARRAY_COUNT(parameters)] = {false};

    for (size_t i = 0; i < count; i++) {
        *(double *)(void *)((char *)trial + parameters[parameter[i]].offset) = value[i];
        free[parameter[i]] = true;
    }

    /* Set the parameters that depend on free ones, unless they are free too */
    if (free[parameter_find("NKt_nm_a")] && !free[parameter_find("NKw_v_s_rad")]) {
        trial->joint.sea.Kw = ratio * trial->joint.sea.Kt;
    }
    if (free[parameter_find("load_motor")] && !free[parameter_find("load_external")]) {
        load->external = load->motor;
    }
    if (free[parameter_find("load_motor_stribeck")] &&
        !free[parameter_find("load_external_stribeck")]) {
        load->external_stribeck = load->motor_stribeck;
    }
    trial->effects.breakaway = trial->effects.stribeck > 0.0
                                   ? fmax(trial->effects.breakaway, trial->effects.coulomb)
                                   : trial->effects.coulomb;
}

void parameter_set_group(struct trial_robot *trial, const struct group_number *number)
{
    size_t i = 0;

    while (i < trial->ngroup && (trial->group[i].parameter != number->parameter ||
                                 strcmp(trial->group[i].group, number->group) != 0)) {
        i++;
    }
    trial->group[i] = *number;
    trial->ngroup += i == trial->ngroup;
}

void parameter_take_group(struct trial_robot *trial, const char *group)
{
    for (size_t i = 0; i < trial->ngroup; i++) {
        const struct group_number *number = &trial->group[i];

        if (!strcmp(number->group, group)) {
            parameter_set(trial, &number->parameter, &number->value, 1);
        }
    }
}

void parameter_bounds(const struct trial_robot *trial, int parameter, double supply_v,
                      double *lower, double *upper)
{
    const struct robot_sea *sea = &trial->joint.sea;
    const double stall = supply_v / sea->R * sea->Kt;
    const double start = parameter_get(trial, parameter);
    const double most[] = {
        [SCALE_SHARE] = 0.9,
        [SCALE_TORQUE] = 0.5 * stall,
        [SCALE_SPEED] = supply_v / sea->Kw,
        [SCALE_DAMPING] = 0.5 * stall * sea->Kw / supply_v,
        [SCALE_ANGLE] = 0.1,
        [SCALE_TIME] = 0.02,
        [SCALE_MASS] = 0.5 * trial->body[1].inertia.mass,
        [SCALE_GAIN] = 3.0,
        [SCALE_OTHER] = 20.0 * start,
    };
    const enum scale scale = parameters[parameter].scale;

    *upper = fmax(most[scale], scale == SCALE_SHARE ? 0.0 : 5.0 * start);
    *lower = scale == SCALE_OTHER ? 0.05 * start : scale == SCALE_SPEED ? 0.002 * *upper : 0.0;
    if (!strcmp(parameters[parameter].key, "offset_rad")) {
        *lower = -*upper;
    }
}

bool parameter_is_written(const struct trial_robot *trial, int parameter)
{
    const struct parameter *of = &parameters[parameter];
    const struct robot_effects *effects = &trial->effects;
    const bool thermal = of->offset >= AT(effects.thermal) && of->offset < AT(effects.dead_time);

    /* The constants of the paper's drive model are required. A parameter that has no effect without
     * another one is omitted */
    if (of->offset < AT(joint.sea.deflection)) {
        return true;
    }
    if ((thermal && effects->thermal.winding_k_w == 0.0) ||
        (!strcmp(of->key, "breakaway_nm") && effects->stribeck == 0.0) ||
        (!strcmp(of->key, "presliding_nm_rad") && effects->coulomb + effects->load.motor == 0.0)) {
        return false;
    }
    return of->offset < AT(bench) && parameter_get(trial, parameter) != 0.0;
}
