/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the hydraulic drives and their supply from a robot file. */
#include "model/hydraulics/hydraulic.h"
#include "model/description/yaml.h"

#include <math.h>

/* Speed about which friction changes its sign, m/s, where the file does not say. */
#define FRICTION_SPEED 0.01

/* Volume of oil in manifold and hoses as a part of the accumulator's, where the file does not
 * say. */
#define LINE_SHARE 0.1

static const double pi = 3.14159265358979323846;

/* Computes areas and constants of a cylinder and its valve out of the numbers of the file. */
static void fill_cylinder(const double value[HYDRAULIC_PARAMETERS],
                          const bool said[HYDRAULIC_PARAMETERS], struct robot_hydraulic *cylinder)
{
    const double bore = value[HYDRAULIC_BORE], rod = value[HYDRAULIC_ROD];

    *cylinder = (struct robot_hydraulic){
        .present = true,
        .A1 = 0.25 * pi * bore * bore,
        .A2 = 0.25 * pi * (bore * bore - rod * rod),
        .stroke = value[HYDRAULIC_STROKE],
        .dead = value[HYDRAULIC_DEAD],
        .base = value[HYDRAULIC_BASE],
        .arm = value[HYDRAULIC_ARM],
        .offset = value[HYDRAULIC_OFFSET],
        .closed = value[HYDRAULIC_CLOSED],
        .valve_w = 2.0 * pi * value[HYDRAULIC_VALVE_HZ],
        .valve_damping = value[HYDRAULIC_VALVE_DAMPING],
        .valve_v = value[HYDRAULIC_VALVE_V],
        .K = value[HYDRAULIC_VALVE_FLOW] / sqrt(0.5 * value[HYDRAULIC_VALVE_DROP]),
        .lap = value[HYDRAULIC_LAP],
        .beta = value[HYDRAULIC_BETA],
        .leakage = value[HYDRAULIC_LEAKAGE],
        .viscous = value[HYDRAULIC_VISCOUS],
        .coulomb = value[HYDRAULIC_COULOMB],
        .coulomb_speed =
            said[HYDRAULIC_COULOMB_SPEED] ? value[HYDRAULIC_COULOMB_SPEED] : FRICTION_SPEED,
    };
}

/* Refuses a hydraulic drive whose key is missing: that of a joint by name, or of a file (NULL). */
static enum error_code refuse_missing_key(struct robot_builder *b, const struct drive_yaml *drive,
                                          enum hydraulic_parameter key, const char *joint)
{
    const bool triangle = key >= HYDRAULIC_BASE && key <= HYDRAULIC_CLOSED;

    return joint ? yaml_error(b->error, &drive->mark,
                              "found the hydraulic drive of joint \"%s\" without key \"%s\", "
                              "expected it here%s or in the robot's own drive",
                              joint, robot_hydraulic_key(key),
                              triangle      ? " (the triangle is the joint's)"
                              : drive->file ? ", in the file of the drive,"
                                            : "")
                 : yaml_error(b->error, &drive->mark,
                              "found a hydraulic drive without key \"%s\", expected it",
                              robot_hydraulic_key(key));
}

/* Builds a cylinder: each parameter from the joint, or else from the robot. Without a joint's
 * name it is a drive of the catalogue, which has no triangle. */
static enum error_code build_cylinder(struct robot_builder *b, const struct drive_yaml *drive,
                                      const char *joint, struct robot_hydraulic *cylinder)
{
    const struct drive_yaml *own =
        robot_drive_kind(&b->file.drive) == DRIVE_HYDRAULIC ? &b->file.drive : &b->file.hydraulic;
    double value[HYDRAULIC_PARAMETERS];
    bool said[HYDRAULIC_PARAMETERS];

    for (enum hydraulic_parameter i = 0; i < HYDRAULIC_PARAMETERS; i++) {
        const struct drive_yaml *from = drive->has_cylinder[i] ? drive : own;
        const bool triangle = i >= HYDRAULIC_BASE && i <= HYDRAULIC_CLOSED;

        said[i] = from->has_cylinder[i];
        value[i] = from->cylinder[i];
        if (!said[i] && i < HYDRAULIC_LAP && (joint || !triangle)) {
            return refuse_missing_key(b, drive, i, joint);
        }
    }
    if (value[HYDRAULIC_ROD] >= value[HYDRAULIC_BORE]) {
        return yaml_error(b->error, &drive->mark,
                          "found a rod as thick as its bore, expected a thinner");
    }
    fill_cylinder(value, said, cylinder);
    return ERROR_NONE;
}

enum error_code robot_build_cylinder(struct robot_builder *b, const struct drive_yaml *drive,
                                     struct robot_hydraulic *cylinder)
{
    return build_cylinder(b, drive, NULL, cylinder);
}

enum error_code robot_build_hydraulic(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_joint *joint)
{
    const struct yaml_mark *mark = &given->drive.mark;
    enum error_code code;
    struct error why;

    if (!b->file.has_hydraulic_supply) {
        return yaml_error(b->error, mark,
                          "found a hydraulic drive of joint \"%s\" in a robot without key "
                          "\"hydraulic_supply\", expected both",
                          given->name);
    }
    code = build_cylinder(b, &given->drive, given->name, &joint->hydraulic);
    if (code) {
        return code;
    }
    if (hydraulic_check(&joint->hydraulic, joint->lower, joint->upper, &why)) {
        return yaml_error(b->error, mark, "%s: %s", given->name, why.text);
    }
    return ERROR_NONE;
}

enum error_code robot_build_hydraulic_supply(struct robot_builder *b)
{
    const struct hydraulic_supply_yaml *given = &b->file.hydraulic_supply;
    const double line = given->has_line ? given->line : LINE_SHARE * given->accumulator;

    if (!b->file.has_hydraulic_supply) {
        return ERROR_NONE;
    }
    if (!(given->pressure > given->back)) {
        return yaml_error(b->error, &given->mark,
                          "found a supply of %g Pa above a return of %g Pa, expected more",
                          given->pressure, given->back);
    }
    if (given->accumulator > 0.0 && !(given->precharge > given->back &&
                                      given->precharge <= given->pressure && given->relief > 0.0)) {
        return yaml_error(b->error, &given->mark,
                          "found an accumulator of precharge_pa %g and relief_pa %g, expected a "
                          "precharge between return and pressure, and a relief",
                          given->precharge, given->relief);
    }
    b->robot->hydraulic_supply = (struct robot_hydraulic_supply){.pressure = given->pressure,
                                                                 .back = given->back,
                                                                 .pump = given->pump,
                                                                 .accumulator = given->accumulator,
                                                                 .precharge = given->precharge,
                                                                 .line = line,
                                                                 .relief = given->relief,
                                                                 .relief_flow = given->relief_flow};
    return ERROR_NONE;
}
