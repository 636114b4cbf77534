/* SPDX-License-Identifier: Apache-2.0 */
/* The table of parameters that an identification may change. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "base/text.h"

#include <math.h>
#include <string.h>

/* The structure that contains a parameter. */
enum owner { OWNER_DRIVE, OWNER_EFFECTS, OWNER_BENCH };

/* The quantity that gives the upper bound of a parameter. */
enum scale {
    SCALE_SHARE,  /* 0.9 */
    SCALE_TORQUE, /* half of the stall torque */
    SCALE_SPEED,  /* no-load speed */
    SCALE_DAMPING,
    SCALE_ANGLE, /* 0.1 rad; for the offset also -0.1 rad */
    SCALE_TIME,  /* 20 ms */
    SCALE_MASS,  /* half of the mass of the link */
    SCALE_GAIN,  /* 3 */
    SCALE_OTHER
};

static const struct parameter {
    const char *key, *meaning;
    enum owner owner;
    size_t offset;
    enum scale scale;
} parameters[] = {
#define DRIVE(word, member, scale, meaning)                                                        \
    {                                                                                              \
        word, meaning, OWNER_DRIVE, offsetof(struct robot_sea, member), scale                      \
    }
#define EFFECT(word, member, scale, meaning)                                                       \
    {                                                                                              \
        word, meaning, OWNER_EFFECTS, offsetof(struct robot_effects, member), scale                \
    }
#define BENCH(word, scale, meaning)                                                                \
    {                                                                                              \
#word, meaning, OWNER_BENCH, offsetof(struct bench_numbers, word), scale                   \
    }
    DRIVE("J_kg_m2", J, SCALE_OTHER, "inertia of the rotor behind the gear"),
    DRIVE("Dm_nm_s_rad", Dm, SCALE_DAMPING, "viscous friction"),
    DRIVE("Ks_nm_rad", Ks, SCALE_OTHER, "stiffness of gear or spring"),
    DRIVE("Ds_nm_s_rad", Ds, SCALE_DAMPING, "damping of gear or spring"),
    DRIVE("N", N, SCALE_OTHER, "ratio of the gear"),
    DRIVE("NKt_nm_a", Kt, SCALE_OTHER, "torque constant behind the gear"),
    DRIVE("NKw_v_s_rad", Kw, SCALE_OTHER, "back-EMF constant behind the gear"),
    DRIVE("R_ohm", R, SCALE_OTHER, "resistance of the winding"),
    DRIVE("L_h", L, SCALE_OTHER, "inductance of the winding"),
    DRIVE("deflection_rad", deflection, SCALE_ANGLE, "room of the spring"),
    DRIVE("stop_Ks_nm_rad", stop.stiffness, SCALE_OTHER, "stiffness of its stop"),
    DRIVE("stop_Ds_nm_s_rad", stop.damping, SCALE_OTHER, "damping of its stop"),
    DRIVE("current_loop_hz", current_loop_hz, SCALE_OTHER, "bandwidth of the current controller"),
    DRIVE("command_filter_s", command_filter_s, SCALE_TIME, "filter of commanded currents"),
    DRIVE("command_delay_s", command_delay_s, SCALE_TIME, "delay of the drive's commands"),
    EFFECT("coulomb_nm", coulomb, SCALE_TORQUE, "Coulomb friction of the gear"),
    EFFECT("breakaway_nm", breakaway, SCALE_TORQUE, "friction at rest"),
    EFFECT("stribeck_rad_s", stribeck, SCALE_SPEED, "Stribeck's speed"),
    EFFECT("stribeck_exponent", stribeck_exponent, SCALE_OTHER, "exponent of Stribeck's dip"),
    EFFECT("presliding_nm_rad", presliding, SCALE_OTHER, "stiffness of the friction at rest"),
    EFFECT("load_motor", load.motor, SCALE_SHARE, "friction by the motor's torque"),
    EFFECT("load_external", load.external, SCALE_SHARE, "friction by the load's torque"),
    EFFECT("load_motor_stribeck", load.motor_stribeck, SCALE_SHARE, "the same, added at rest"),
    EFFECT("load_external_stribeck", load.external_stribeck, SCALE_SHARE,
           "the same, added at rest"),
    EFFECT("load_motor_per_nm", load.motor_quadratic, SCALE_SHARE, "by the motor's torque squared"),
    EFFECT("load_external_per_nm", load.external_quadratic, SCALE_SHARE,
           "by the load's torque squared"),
    EFFECT("backlash_rad", backlash, SCALE_ANGLE, "whole play of the gear"),
    EFFECT("hysteresis_nm", hysteresis, SCALE_TORQUE, "hysteresis, torque"),
    EFFECT("hysteresis_nm_rad", hysteresis_stiffness, SCALE_OTHER, "hysteresis, stiffness"),
    EFFECT("dead_time_s", dead_time, SCALE_OTHER, "dead time of the bridge"),
    EFFECT("pwm_hz", pwm, SCALE_OTHER, "frequency of the bridge"),
    EFFECT("switching_s", switching, SCALE_OTHER, "time to switch the bridge"),
    EFFECT("bridge_ohm", bridge_ohm, SCALE_OTHER, "resistance of the bridge"),
    EFFECT("diode_v", diode, SCALE_OTHER, "voltage of a diode of the bridge"),
    EFFECT("saturation_a", saturation, SCALE_OTHER, "current that saturates the motor"),
    EFFECT("iron_nm_s_rad_a2", iron, SCALE_OTHER, "eddy-current damping per squared current"),
    EFFECT("standby_w", standby, SCALE_OTHER, "power of the electronics"),
    EFFECT("winding_k_w", thermal.winding_k_w, SCALE_OTHER, "heat resistance, winding to housing"),
    EFFECT("housing_k_w", thermal.housing_k_w, SCALE_OTHER, "heat resistance, housing to air"),
    EFFECT("winding_j_k", thermal.winding_j_k, SCALE_OTHER, "heat capacity of the winding"),
    EFFECT("housing_j_k", thermal.housing_j_k, SCALE_OTHER, "heat capacity of the housing"),
    EFFECT("ambient_c", thermal.ambient_c, SCALE_OTHER, "temperature of the air"),
    EFFECT("R_per_k", thermal.R_per_k, SCALE_OTHER, "how resistance follows temperature"),
    EFFECT("NKt_per_k", thermal.Kt_per_k, SCALE_OTHER, "how the torque constant does"),
    BENCH(offset_rad, SCALE_ANGLE, "the joint's angle where the recording says 0"),
    BENCH(delay_s, SCALE_TIME, "delay of the command"),
    BENCH(arm_kg, SCALE_MASS, "a rod's mass between axis and load"),
    BENCH(command_gain, SCALE_GAIN, "true command divided by recorded one"),
};

int parameter_find(const char *key)
{
    for (size_t i = 0; i < ARRAY_COUNT(parameters); i++) {
        if (!strcmp(parameters[i].key, key)) {
            return (int)i;
        }
    }
    return IDENTIFY_NONE;
}

enum error_code parameter_check(const char *key, int *parameter, struct error *error)
{
    const char *known[ARRAY_COUNT(parameters)], *near;

    *parameter = parameter_find(key);
    if (*parameter != IDENTIFY_NONE) {
        return ERROR_NONE;
    }
    for (size_t i = 0; i < ARRAY_COUNT(parameters); i++) {
        known[i] = parameters[i].key;
    }
    near = text_nearest(key, known, ARRAY_COUNT(parameters));
    return error_set(error, ERROR_INPUT, "found \"%.63s\", expected %s", key,
                     near
                         ? near
                         : "a key of a drive's file, or offset_rad, delay_s, arm_kg, command_gain: "
                           "a number that can be identified");
}

size_t parameter_count(void)
{
    return ARRAY_COUNT(parameters);
}

const char *parameter_key(int parameter)
{
    return parameters[parameter].key;
}

const char *parameter_meaning(int parameter)
{
    return parameters[parameter].meaning;
}

enum error_code trial_robot_copy(const struct robot *robot, struct trial_robot *trial,
                                 struct error *error)
{
    if (robot->njoint != 1 || robot->nbody != 2 || robot->floating ||
        !robot->joint[0].sea.present) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a robot of %zu joints%s, expected one joint with an electric "
                         "drive on a fixed base",
                         robot->file, robot->njoint, robot->floating ? " on a floating base" : "");
    }
    *trial = (struct trial_robot){
        .robot = *robot, .joint = robot->joint[0], .bench = {.command_gain = 1.0}};
    memcpy(trial->body, robot->body, sizeof trial->body);
    if (trial->joint.sea.effects) {
        trial->effects = *trial->joint.sea.effects;
    }
    return ERROR_NONE;
}

/* Returns the address of a parameter in a trial. */
static double *parameter_at(struct trial_robot *trial, int parameter)
{
    const struct parameter *of = &parameters[parameter];
    char *owner = of->owner == OWNER_DRIVE     ? (char *)&trial->joint.sea
                  : of->owner == OWNER_EFFECTS ? (char *)&trial->effects
                                               : (char *)&trial->bench;

    return (double *)(void *)(owner + of->offset);
}

double parameter_get(const struct trial_robot *trial, int parameter)
{
    struct trial_robot copy = *trial;

    return *parameter_at(&copy, parameter);
}

/* Returns whether a key is in the list of free parameters. */
static bool is_free(const int *parameter, size_t count, const char *key)
{
    const int sought = parameter_find(key);

    for (size_t i = 0; i < count; i++) {
        if (parameter[i] == sought) {
            return true;
        }
    }
    return false;
}

void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count)
{
    struct robot_load_friction *load = &trial->effects.load;
    const double ratio = trial->joint.sea.Kw / trial->joint.sea.Kt;

    for (size_t i = 0; i < count; i++) {
        *parameter_at(trial, parameter[i]) = value[i];
    }

    /* Set the parameters that depend on free ones, unless they are free too */
    if (is_free(parameter, count, "NKt_nm_a") && !is_free(parameter, count, "NKw_v_s_rad")) {
        trial->joint.sea.Kw = ratio * trial->joint.sea.Kt;
    }
    if (is_free(parameter, count, "load_motor") && !is_free(parameter, count, "load_external")) {
        load->external = load->motor;
    }
    if (is_free(parameter, count, "load_motor_stribeck") &&
        !is_free(parameter, count, "load_external_stribeck")) {
        load->external_stribeck = load->motor_stribeck;
    }
    trial->effects.breakaway = trial->effects.stribeck > 0.0
                                   ? fmax(trial->effects.breakaway, trial->effects.coulomb)
                                   : trial->effects.coulomb;
}

bool parameter_set_group(struct trial_robot *trial, const struct group_number *number)
{
    size_t i = 0;

    while (i < trial->ngroup && (trial->group[i].parameter != number->parameter ||
                                 strcmp(trial->group[i].group, number->group) != 0)) {
        i++;
    }
    if (i == GROUP_NUMBERS_MAX) {
        return false;
    }
    trial->group[i] = *number;
    trial->ngroup += i == trial->ngroup;
    return true;
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
    if (!strcmp(parameter_key(parameter), "offset_rad")) {
        *lower = -*upper;
    }
}

bool parameter_is_written(const struct trial_robot *trial, int parameter)
{
    const struct parameter *of = &parameters[parameter];
    const struct robot_effects *effects = &trial->effects;
    const bool thermal = of->owner == OWNER_EFFECTS &&
                         of->offset >= offsetof(struct robot_effects, thermal) &&
                         of->offset < offsetof(struct robot_effects, dead_time);

    /* The constants of the paper's drive model are required. A parameter that has no effect without
     * another one is omitted */
    if (of->owner == OWNER_DRIVE && of->offset < offsetof(struct robot_sea, deflection)) {
        return true;
    }
    if ((thermal && effects->thermal.winding_k_w == 0.0) ||
        (!strcmp(of->key, "breakaway_nm") && effects->stribeck == 0.0) ||
        (!strcmp(of->key, "presliding_nm_rad") && effects->coulomb + effects->load.motor == 0.0)) {
        return false;
    }
    return of->owner != OWNER_BENCH && parameter_get(trial, parameter) != 0.0;
}
