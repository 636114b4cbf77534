/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the hydraulic drives and their supply from a robot file. */
#include "model/hydraulics/hydraulic.h"
#include "model/description/yaml.h"

#include <math.h>
#include <string.h>

/* Default speed scale on which friction changes its sign, m/s. */
#define FRICTION_SPEED 0.01

/* Default oil volume in manifold and hoses, relative to the accumulator. */
#define LINE_SHARE 0.1

static const double pi = 3.14159265358979323846;

/* The triangle's keys belong to the joint, not to the drive. */
bool robot_key_is_of_triangle(const char *key)
{
    return strcmp(key, "base_m") == 0 || strcmp(key, "arm_m") == 0 ||
           strcmp(key, "offset_rad") == 0 || strcmp(key, "closed_m") == 0;
}

enum error_code robot_build_cylinder(struct robot_builder *b, const struct drive_yaml *drive,
                                     const char *joint, struct robot_hydraulic *cylinder)
{
    const struct drive_yaml *own =
        robot_drive_kind(&b->file.drive) == DRIVE_HYDRAULIC ? &b->file.drive : &b->file.hydraulic;
    struct drive_yaml merged = *own;
    enum error_code code = robot_merge_drive(b, drive, &merged);
    size_t count;
    const struct yaml_field *row = robot_drive_rows(DRIVE_HYDRAULIC, &count);

    /* Only the keys before valve_lap are required */
    for (; !code && strcmp(row->key, "valve_lap") != 0; row++) {
        if (!yaml_has(&merged.mark, row->key) && (joint || !robot_key_is_of_triangle(row->key))) {
            /* Refuse a hydraulic drive with a missing key. `joint` is NULL for
             * a drive file. */
            return joint ? yaml_error(b->error, &drive->mark,
                                      "found the hydraulic drive of joint \"%s\" without key "
                                      "\"%s\", expected it here%s or in the robot's own drive",
                                      joint, row->key,
                                      robot_key_is_of_triangle(row->key)
                                          ? " (the triangle is the joint's)"
                                      : drive->file ? ", in the file of the drive,"
                                                    : "")
                         : yaml_error(b->error, &drive->mark,
                                      "found a hydraulic drive without key \"%s\", expected it",
                                      row->key);
        }
    }
    if (!code && merged.rod >= merged.bore) {
        return yaml_error(b->error, &drive->mark,
                          "found a rod as thick as its bore, expected a thinner");
    }

    /* Compute areas and constants of a cylinder and its valve from the numbers of the file */
    *cylinder = merged.cylinder;
    cylinder->present = true;
    cylinder->A1 = 0.25 * pi * merged.bore * merged.bore;
    cylinder->A2 = 0.25 * pi * (merged.bore * merged.bore - merged.rod * merged.rod);
    cylinder->valve_w = 2.0 * pi * merged.valve_hz;
    cylinder->K = merged.valve_flow / sqrt(0.5 * merged.valve_drop);
    if (!yaml_has(&merged.mark, "coulomb_m_s")) {
        cylinder->coulomb_speed = FRICTION_SPEED;
    }

    return code;
}

enum error_code robot_build_hydraulic(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_joint *joint)
{
    const struct yaml_mark *mark = &given->drive.mark;
    enum error_code code;
    struct error why;

    if (!yaml_has(&b->file.mark, "hydraulic_supply")) {
        return yaml_error(b->error, mark,
                          "found a hydraulic drive of joint \"%s\" in a robot without key "
                          "\"hydraulic_supply\", expected both",
                          given->joint.name);
    }
    code = robot_build_cylinder(b, &given->drive, given->joint.name, &joint->hydraulic);
    if (code) {
        return code;
    }
    if (hydraulic_check(&joint->hydraulic, joint->lower, joint->upper, &why)) {
        return yaml_error(b->error, mark, "%s: %s", given->joint.name, why.text);
    }
    return ERROR_NONE;
}

enum error_code robot_build_hydraulic_supply(struct robot_builder *b)
{
    const struct yaml_mark *mark = yaml_place(&b->file.mark, "hydraulic_supply");
    struct robot_hydraulic_supply *supply = &b->robot->hydraulic_supply;

    *supply = b->file.hydraulic_supply;
    if (!yaml_has(&b->file.mark, "hydraulic_supply")) {
        return ERROR_NONE;
    }
    if (!(supply->pressure > supply->back)) {
        return yaml_error(b->error, mark,
                          "found a supply of %g Pa above a return of %g Pa, expected more",
                          supply->pressure, supply->back);
    }
    if (supply->accumulator > 0.0 &&
        !(supply->precharge > supply->back && supply->precharge <= supply->pressure &&
          supply->relief > 0.0)) {
        return yaml_error(b->error, mark,
                          "found an accumulator of precharge_pa %g and relief_pa %g, expected a "
                          "precharge between return and pressure, and a relief",
                          supply->precharge, supply->relief);
    }
    if (!yaml_has(&b->file.mark, "hydraulic_supply.line_m3")) {
        supply->line = LINE_SHARE * supply->accumulator;
    }
    return ERROR_NONE;
}
