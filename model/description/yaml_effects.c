/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the effects of drives beside the paper's equations from a robot file: all of them are
 * off unless given. */
#include "model/drives/effects.h"
#include "model/description/yaml.h"

#include <math.h>

/* Temperature coefficient of copper, 1/K at 25 degree C (IEC 60034-1: 1/(234.5 + 25)); where a
 * file gives no number. */
#define COPPER_PER_K 0.00385

/* Temperature of the air, where a file does not say. */
#define AMBIENT_C 25.0

/* Copies the sines of a list, ROBOT_HARMONICS at most. */
static enum error_code build_harmonics(struct robot_builder *b, const struct harmonic_yaml *given,
                                       size_t count, struct robot_harmonic *harmonic, size_t *made)
{
    if (count > ROBOT_HARMONICS) {
        return yaml_error(b->error, &given[ROBOT_HARMONICS].mark,
                          "found %zu sines, expected no more than %d", count, ROBOT_HARMONICS);
    }
    for (size_t i = 0; i < count; i++) {
        harmonic[i] = (struct robot_harmonic){.per_turn = given[i].per_turn,
                                              .amplitude = given[i].amplitude,
                                              .phase = given[i].phase};
    }
    *made = count;
    return ERROR_NONE;
}

/* Fills the numbers of the effects, with defaults where none is given. */
static void fill_drive_effects(const double value[PARAMETER_COUNT],
                               const bool said[PARAMETER_COUNT], struct robot_effects *effects)
{
    effects->coulomb = value[PARAMETER_COULOMB];
    effects->breakaway = said[PARAMETER_BREAKAWAY] ? value[PARAMETER_BREAKAWAY] : effects->coulomb;
    effects->stribeck = value[PARAMETER_STRIBECK];
    effects->stribeck_exponent = value[PARAMETER_STRIBECK_EXPONENT];
    effects->load = (struct robot_load_friction){
        .motor = value[PARAMETER_LOAD_MOTOR],
        .external = value[PARAMETER_LOAD_EXTERNAL],
        .motor_stribeck = value[PARAMETER_LOAD_MOTOR_STRIBECK],
        .external_stribeck = value[PARAMETER_LOAD_EXTERNAL_STRIBECK],
        .motor_quadratic = value[PARAMETER_LOAD_MOTOR_QUADRATIC],
        .external_quadratic = value[PARAMETER_LOAD_EXTERNAL_QUADRATIC],
    };
    effects->backlash = value[PARAMETER_BACKLASH];
    effects->hysteresis = value[PARAMETER_HYSTERESIS];
    effects->hysteresis_stiffness = value[PARAMETER_HYSTERESIS_KS];
    effects->thermal = (struct robot_thermal){
        .winding_k_w = value[PARAMETER_WINDING_K_W],
        .housing_k_w = value[PARAMETER_HOUSING_K_W],
        .winding_j_k = value[PARAMETER_WINDING_J_K],
        .housing_j_k = value[PARAMETER_HOUSING_J_K],
        .ambient_c = said[PARAMETER_AMBIENT] ? value[PARAMETER_AMBIENT] : AMBIENT_C,
        .R_per_k = said[PARAMETER_R_PER_K] ? value[PARAMETER_R_PER_K] : COPPER_PER_K,
        .Kt_per_k = value[PARAMETER_KT_PER_K],
    };
    effects->dead_time = value[PARAMETER_DEAD_TIME];
    effects->pwm = value[PARAMETER_PWM];
    effects->diode = value[PARAMETER_DIODE];
    effects->switching = value[PARAMETER_SWITCHING];
    effects->bridge_ohm = value[PARAMETER_BRIDGE_OHM];
}

/* Refuses keys that mean nothing without another. */
static enum error_code check_effect_keys(struct robot_builder *b, const struct yaml_mark *mark,
                                         const bool said[PARAMETER_COUNT])
{
    static const struct {
        enum drive_parameter key, needs;
    } pair[] = {
        {PARAMETER_BREAKAWAY, PARAMETER_COULOMB},
        {PARAMETER_BREAKAWAY, PARAMETER_STRIBECK},
        {PARAMETER_STRIBECK, PARAMETER_BREAKAWAY},
        {PARAMETER_STRIBECK_EXPONENT, PARAMETER_STRIBECK},
        {PARAMETER_LOAD_MOTOR_STRIBECK, PARAMETER_STRIBECK},
        {PARAMETER_LOAD_EXTERNAL_STRIBECK, PARAMETER_STRIBECK},
        {PARAMETER_LOAD_MOTOR_QUADRATIC, PARAMETER_STRIBECK},
        {PARAMETER_LOAD_EXTERNAL_QUADRATIC, PARAMETER_STRIBECK},
        {PARAMETER_HYSTERESIS, PARAMETER_HYSTERESIS_KS},
        {PARAMETER_HYSTERESIS_KS, PARAMETER_HYSTERESIS},
        {PARAMETER_WINDING_K_W, PARAMETER_HOUSING_K_W},
        {PARAMETER_HOUSING_K_W, PARAMETER_WINDING_J_K},
        {PARAMETER_WINDING_J_K, PARAMETER_HOUSING_J_K},
        {PARAMETER_HOUSING_J_K, PARAMETER_WINDING_K_W},
        {PARAMETER_AMBIENT, PARAMETER_WINDING_K_W},
        {PARAMETER_R_PER_K, PARAMETER_WINDING_K_W},
        {PARAMETER_KT_PER_K, PARAMETER_WINDING_K_W},
        {PARAMETER_DEAD_TIME, PARAMETER_PWM},
        {PARAMETER_SWITCHING, PARAMETER_PWM},
    };

    for (size_t i = 0; i < sizeof pair / sizeof pair[0]; i++) {
        if (said[pair[i].key] && !said[pair[i].needs]) {
            return yaml_error(b->error, mark,
                              "found a drive with key \"%s\" and without \"%s\", expected both",
                              robot_drive_key(pair[i].key), robot_drive_key(pair[i].needs));
        }
    }
    return ERROR_NONE;
}

enum error_code robot_build_effects(struct robot_builder *b, const struct drive_yaml *given,
                                    struct robot_sea *sea)
{
    const struct drive_yaml *own = &b->file.drive;
    const struct drive_yaml *error = given->has_error ? given : own;
    const struct drive_yaml *cogging = given->has_cogging ? given : own;
    double value[PARAMETER_COUNT];
    bool said[PARAMETER_COUNT], any = false;
    struct robot_effects *effects;
    enum error_code code;
    struct error why;

    /* Each number from the joint's drive, or else from the robot's; no effects when there is
     * none at all */
    for (enum drive_parameter i = PARAMETER_COULOMB; i < PARAMETER_COUNT; i++) {
        const struct drive_yaml *from = given->given[i] ? given : own;

        said[i] = from->given[i];
        value[i] = from->value[i];
        any |= said[i];
    }
    any |= error->nerror > 0 || cogging->ncogging > 0;
    any |= given->has_freewheel ? given->freewheel : own->freewheel;
    if (!any) {
        return ERROR_NONE;
    }
    if ((code = check_effect_keys(b, &given->mark, said))) {
        return code;
    }

    /* The effects have memory of their own: without them a drive carries nothing of them */
    effects = arena_alloc(b->arena, 1, sizeof *effects);
    if (!effects) {
        return robot_no_memory(b);
    }
    fill_drive_effects(value, said, effects);
    effects->freewheel = given->has_freewheel ? given->freewheel : own->freewheel;
    if ((code =
             build_harmonics(b, error->error, error->nerror, effects->error, &effects->nerror)) ||
        (code = build_harmonics(b, cogging->cogging, cogging->ncogging, effects->cogging,
                                &effects->ncogging))) {
        return code;
    }
    sea->effects = effects;
    if (effects_check(sea, &why)) {
        return yaml_error(b->error, &given->mark, "%s", why.text);
    }
    return ERROR_NONE;
}
