/* SPDX-License-Identifier: Apache-2.0 */
/* The table of parameters that an identification may change. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "base/text.h"

#include <math.h>
#include <string.h>

#define AT(member) offsetof(struct trial_robot, member)
#define DRIVE(member) AT(joint[0].sea.member)
#define EFFECT(member) AT(effects[0].member)
const struct parameter parameters[] = {
    {"J_kg_m2", "inertia of the rotor behind the gear", DRIVE(J), BY_OTHER},
    {"Dm_nm_s_rad", "viscous friction", DRIVE(Dm), BY_DAMPING},
    {"Ks_nm_rad", "stiffness of gear or spring", DRIVE(Ks), BY_OTHER},
    {"Ds_nm_s_rad", "damping of gear or spring", DRIVE(Ds), BY_DAMPING},
    {"N", "ratio of the gear", DRIVE(N), BY_OTHER},
    {"NKt_nm_a", "torque constant behind the gear", DRIVE(Kt), BY_OTHER},
    {"NKw_v_s_rad", "back-EMF constant behind the gear", DRIVE(Kw), BY_OTHER},
    {"R_ohm", "resistance of the winding", DRIVE(R), BY_OTHER},
    {"L_h", "inductance of the winding", DRIVE(L), BY_OTHER},
    {"deflection_rad", "room of the spring", DRIVE(deflection), BY_ANGLE},
    {"stop_Ks_nm_rad", "stiffness of its stop", DRIVE(stop.stiffness), BY_OTHER},
    {"stop_Ds_nm_s_rad", "damping of its stop", DRIVE(stop.damping), BY_OTHER},
    {"current_loop_hz", "bandwidth of the current controller", DRIVE(current_loop_hz), BY_OTHER},
    {"command_filter_s", "filter of commanded currents", DRIVE(command_filter_s), BY_TIME},
    {"command_delay_s", "delay of the drive's commands", DRIVE(command_delay_s), BY_TIME},
    {"coulomb_nm", "Coulomb friction of the gear", EFFECT(coulomb), BY_TORQUE},
    {"breakaway_nm", "friction at rest", EFFECT(breakaway), BY_TORQUE},
    {"stribeck_rad_s", "Stribeck's speed", EFFECT(stribeck), BY_SPEED},
    {"stribeck_exponent", "exponent of Stribeck's dip", EFFECT(stribeck_exponent), BY_OTHER},
    {"presliding_nm_rad", "stiffness of the friction at rest", EFFECT(presliding), BY_OTHER},
    {"load_motor", "friction by the motor's torque", EFFECT(load.motor), BY_SHARE},
    {"load_external", "friction by the load's torque", EFFECT(load.external), BY_SHARE},
    {"load_motor_stribeck", "the same, added at rest", EFFECT(load.motor_stribeck), BY_SHARE},
    {"load_external_stribeck", "the same, added at rest", EFFECT(load.external_stribeck), BY_SHARE},
    {"load_motor_per_nm", "by the motor's torque squared", EFFECT(load.motor_quadratic), BY_SHARE},
    {"load_external_per_nm", "by the load's torque squared", EFFECT(load.external_quadratic),
     BY_SHARE},
    {"backlash_rad", "whole play of the gear", EFFECT(backlash), BY_ANGLE},
    {"hysteresis_nm", "hysteresis, torque", EFFECT(hysteresis), BY_TORQUE},
    {"hysteresis_nm_rad", "hysteresis, stiffness", EFFECT(hysteresis_stiffness), BY_OTHER},
    {"dead_time_s", "dead time of the bridge", EFFECT(dead_time), BY_OTHER},
    {"pwm_hz", "frequency of the bridge", EFFECT(pwm), BY_OTHER},
    {"switching_s", "time to switch the bridge", EFFECT(switching), BY_OTHER},
    {"bridge_ohm", "resistance of the bridge", EFFECT(bridge_ohm), BY_OTHER},
    {"diode_v", "voltage of a diode of the bridge", EFFECT(diode), BY_OTHER},
    {"saturation_a", "current that saturates the motor", EFFECT(saturation), BY_OTHER},
    {"iron_nm_s_rad_a2", "drag of the iron by the current squared", EFFECT(iron), BY_OTHER},
    {"R_skin_ohm", "resistance of the skin effect at 1 rad/s", EFFECT(skin), BY_OTHER},
    {"standby_w", "power of the electronics", EFFECT(standby), BY_OTHER},
    {"winding_k_w", "heat resistance, winding to housing", EFFECT(thermal.winding_k_w), BY_OTHER},
    {"housing_k_w", "heat resistance, housing to air", EFFECT(thermal.housing_k_w), BY_OTHER},
    {"winding_j_k", "heat capacity of the winding", EFFECT(thermal.winding_j_k), BY_OTHER},
    {"housing_j_k", "heat capacity of the housing", EFFECT(thermal.housing_j_k), BY_OTHER},
    {"ambient_c", "temperature of the air", EFFECT(thermal.ambient_c), BY_OTHER},
    {"R_per_k", "how resistance follows temperature", EFFECT(thermal.R_per_k), BY_OTHER},
    {"NKt_per_k", "how the torque constant does", EFFECT(thermal.Kt_per_k), BY_OTHER},
    {"offset_rad", "the joint's angle where the recording says 0", AT(bench[0].offset_rad),
     BY_ANGLE},
    {"delay_s", "delay of the command", AT(bench[0].delay_s), BY_TIME},
    {"arm_kg", "a rod's mass between axis and load", AT(bench[0].arm_kg), BY_MASS},
    {"command_gain", "true command divided by recorded one", AT(bench[0].command_gain), BY_GAIN},
};

const int parameter_count = (int)ARRAY_COUNT(parameters);

/* Returns the key in a name "JOINT.KEY" or "KEY". */
static const char *key_of(const char *name)
{
    const char *dot = strrchr(name, '.');

    return dot ? dot + 1 : name;
}

/* Returns whether a parameter belongs to the bench. Then each joint has its own value, even if
 * joints share a drive. */
static bool is_of_bench(int index)
{
    return parameters[index].offset >= AT(bench);
}

int parameter_find(const char *name)
{
    return TEXT_FIND(parameters, ARRAY_COUNT(parameters), key, key_of(name));
}

const struct parameter *parameter_of(int parameter)
{
    return &parameters[parameter % parameter_count];
}

enum error_code parameter_check(const char *name, int *parameter, struct error *error)
{
    const char *near =
        text_nearest_first(key_of(name), parameters, sizeof *parameters, ARRAY_COUNT(parameters));

    *parameter = parameter_find(name);
    if (*parameter != IDENTIFY_NONE) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT, "found \"%.63s\", expected %s", name,
                     near ? near
                          : "a key of a drive's file, or offset_rad, delay_s, arm_kg, "
                            "command_gain: a number that can be identified");
}

enum error_code parameter_resolve(const struct trial_robot *trial, const char *name,
                                  int parameter[TRIAL_JOINTS_MAX], size_t *count,
                                  struct error *error)
{
    const char *dot = strrchr(name, '.');
    const size_t length = dot ? (size_t)(dot - name) : 0;
    enum error_code code;
    int index;

    *count = 0;
    if ((code = parameter_check(name, &index, error))) {
        return code;
    }
    for (size_t k = 0; k < trial->njoint; k++) {
        const int j = trial->at[k];
        const char *joint = trial->joint[j].name;
        const bool named = dot && strlen(joint) == length && !strncmp(name, joint, length);
        const bool leads = is_of_bench(index) || trial->drive[j] == j;

        if (dot ? named : leads) {
            parameter[(*count)++] =
                (is_of_bench(index) ? j : trial->drive[j]) * parameter_count + index;
        }
    }
    if (*count == 0) {
        return error_set(error, ERROR_INPUT,
                         "found \"%.63s\", expected a joint of the bench as "
                         "\"%.63s\" before the point",
                         name, trial->joint[trial->at[0]].name);
    }
    if (!strcmp(parameters[index].key, "arm_kg") && trial->robot.njoint > 1) {
        return error_set(error, ERROR_INPUT,
                         "found arm_kg for a robot of %zu joints, expected it for one joint",
                         trial->robot.njoint);
    }
    return ERROR_NONE;
}

/* Returns the offset of a parameter in a trial. */
static size_t offset_of(int parameter)
{
    const int index = parameter % parameter_count;
    const size_t offset = parameters[index].offset;
    const size_t stride = is_of_bench(index)      ? sizeof(struct bench_numbers)
                          : offset >= AT(effects) ? sizeof(struct robot_effects)
                                                  : sizeof(struct robot_joint);

    return offset + (size_t)(parameter / parameter_count) * stride;
}

double parameter_get(const struct trial_robot *trial, int parameter)
{
    return *(const double *)(const void *)((const char *)trial + offset_of(parameter));
}

/* Sets the parameters of one joint. */
static void set_joint(struct trial_robot *trial, int j, const int *parameter, const double *value,
                      size_t count)
{
    struct robot_sea *sea = &trial->joint[j].sea;
    struct robot_effects *effects = &trial->effects[j];
    struct robot_load_friction *load = &effects->load;
    const double ratio = sea->Kw / sea->Kt;
    bool free[ARRAY_COUNT(parameters)] = {false};

    for (size_t i = 0; i < count; i++) {
        const int index = parameter[i] % parameter_count, of = parameter[i] / parameter_count;

        if (of == (is_of_bench(index) ? j : trial->drive[j])) {
            *(double *)(void *)((char *)trial + offset_of(j * parameter_count + index)) = value[i];
            free[index] = true;
        }
    }

    /* Set the parameters that depend on free ones, unless they are free too */
    if (free[parameter_find("NKt_nm_a")] && !free[parameter_find("NKw_v_s_rad")]) {
        sea->Kw = ratio * sea->Kt;
    }
    if (free[parameter_find("load_motor")] && !free[parameter_find("load_external")]) {
        load->external = load->motor;
    }
    if (free[parameter_find("load_motor_stribeck")] &&
        !free[parameter_find("load_external_stribeck")]) {
        load->external_stribeck = load->motor_stribeck;
    }
    effects->breakaway =
        effects->stribeck > 0.0 ? fmax(effects->breakaway, effects->coulomb) : effects->coulomb;
}

void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count)
{
    for (size_t k = 0; k < trial->njoint; k++) {
        set_joint(trial, trial->at[k], parameter, value, count);
    }
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
    const int j = parameter / parameter_count;
    const struct robot_sea *sea = &trial->joint[j].sea;
    const double stall = supply_v / sea->R * sea->Kt;
    const double start = parameter_get(trial, parameter);
    const double most[] = {
        [BY_SHARE] = 0.9,
        [BY_TORQUE] = 0.5 * stall,
        [BY_SPEED] = supply_v / sea->Kw,
        [BY_DAMPING] = 0.5 * stall * sea->Kw / supply_v,
        [BY_ANGLE] = 0.1,
        [BY_TIME] = 0.02,
        [BY_MASS] = 0.5 * trial->body[j + 1].inertia.mass,
        [BY_GAIN] = 3.0,
        [BY_OTHER] = 20.0 * start,
    };
    const enum scale scale = parameter_of(parameter)->scale;

    *upper = fmax(most[scale], scale == BY_SHARE ? 0.0 : 5.0 * start);
    *lower = scale == BY_OTHER ? 0.05 * start : scale == BY_SPEED ? 0.002 * *upper : 0.0;
    if (!strcmp(parameter_of(parameter)->key, "offset_rad")) {
        *lower = -*upper;
    }
}

bool parameter_is_written(const struct trial_robot *trial, int parameter)
{
    const struct parameter *of = parameter_of(parameter);
    const struct robot_effects *effects = &trial->effects[parameter / parameter_count];
    const bool thermal = of->offset >= EFFECT(thermal) && of->offset < EFFECT(dead_time);

    /* The constants of the paper's drive model are required. A parameter that has no effect without
     * another one is omitted */
    if (of->offset < DRIVE(deflection)) {
        return true;
    }
    if ((thermal && effects->thermal.winding_k_w == 0.0) ||
        (!strcmp(of->key, "breakaway_nm") && effects->stribeck == 0.0) ||
        (!strcmp(of->key, "presliding_nm_rad") && effects->coulomb + effects->load.motor == 0.0)) {
        return false;
    }
    return of->offset < AT(bench) && parameter_get(trial, parameter) != 0.0;
}
