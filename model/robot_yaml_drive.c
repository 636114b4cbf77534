/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives of a robot file: what the catalogue gives, what the robot and its variant give for all
 * joints, what a joint gives itself, and the drive that comes of it.
 */
#include "base/config.h"
#include "model/robot_yaml.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* What a variant's drive gives goes before what the robot's own drive does. */
void robot_merge_drive(const struct drive_yaml *change, struct drive_yaml *drive)
{
    for (enum drive_parameter i = 0; i < PARAMETER_COUNT; i++) {
        if (change->given[i]) {
            drive->value[i] = change->value[i];
            drive->given[i] = true;
        }
    }
    if (change->has_freewheel) {
        drive->freewheel = change->freewheel;
        drive->has_freewheel = true;
    }
    if (change->has_error) {
        drive->error = change->error;
        drive->nerror = change->nerror;
        drive->has_error = true;
    }
    if (change->has_cogging) {
        drive->cogging = change->cogging;
        drive->ncogging = change->ncogging;
        drive->has_cogging = true;
    }
}

/* ---- the catalogue ---- */

/* Whether a file is there (F_OK) or may be read (R_OK); what the system could not find out is an
 * error. */
static enum error_code drive_file_exists(struct robot_builder *b, const char *path, int mode,
                                         bool *there)
{
    *there = access(path, mode) == 0;
    return *there || errno == ENOENT || errno == ENOTDIR || errno == EACCES
               ? ERROR_NONE
               : error_set_file(b->error, errno, path, "cannot be looked for");
}

/* The file that a drive is from: a path from the robot's folder, or a name: of the folder drives
 * beside that, which goes first, or of the configuration trees. */
static enum error_code find_drive_file(struct robot_builder *b, const struct drive_yaml *drive,
                                       const char **path)
{
    const struct yaml_mark *mark = &drive->file_mark;
    enum error_code code;
    char beside[288];
    bool there = false;

    if (strpbrk(drive->file, "/.")) {
        return yaml_resolve_path(mark, drive->file, b->arena, path, b->error);
    }
    snprintf(beside, sizeof beside, "../drives/%s.yaml", drive->file);
    code = yaml_resolve_path(mark, beside, b->arena, path, b->error);
    code = code ? code : drive_file_exists(b, *path, F_OK, &there);
    if (code || there) {
        return code;
    }
    code = config_locate_from(CONFIG_DRIVE, drive->file, mark->file, b->arena, path, b->error);
    if (code) {
        error_prefix(b->error, "%s:%d:%d", mark->file, mark->line, mark->column);
    }
    return code;
}

enum error_code robot_take_drive(struct robot_builder *b, struct drive_yaml *drive)
{
    struct drive_file_yaml file;
    struct drive_yaml taken;
    enum error_code code;
    const char *path;
    bool there;

    if (!drive->file) {
        return ERROR_NONE;
    }
    code = find_drive_file(b, drive, &path);
    if (code) {
        return code;
    }

    /* A file that cannot be opened is the fault of the line that names it */
    code = drive_file_exists(b, path, R_OK, &there);
    if (code) {
        return code;
    }
    if (!there) {
        return yaml_error(
            b->error, &drive->file_mark,
            "found drive \"%.63s\", whose file %.150s cannot be read, expected a file", drive->file,
            path);
    }
    code = yaml_read_file(path, &drive_file_schema, b->arena, &file, b->error);
    if (code) {
        return code;
    }

    /* What stands beside the name goes before what the file gives */
    taken = file.drive;
    taken.mark = drive->mark;
    taken.file = drive->file;
    taken.file_mark = drive->file_mark;
    robot_merge_drive(drive, &taken);
    *drive = taken;
    return ERROR_NONE;
}

/* ---- a joint's drive ---- */

/* Where the file gives a spring's room, but not its stop, that is so many times as stiff. */
#define SPRING_STOP_TIMES 20.0

/* The stop of a drive's spring from the drive's parameters. */
static enum error_code build_spring_stop(struct robot_builder *b, const struct joint_yaml *given,
                                         const double value[PARAMETER_COUNT],
                                         const bool said[PARAMETER_COUNT], struct robot_sea *sea)
{
    const struct drive_yaml *own = &given->drive;

    if (!said[PARAMETER_DEFLECTION]) {
        return own->given[PARAMETER_STOP_KS] || own->given[PARAMETER_STOP_DS]
                   ? yaml_error(b->error, &own->mark,
                                "found a stop of the spring of joint \"%s\" without key \"%s\", "
                                "expected the deflection at which it begins",
                                given->name, robot_drive_key(PARAMETER_DEFLECTION))
                   : ERROR_NONE;
    }
    sea->deflection = value[PARAMETER_DEFLECTION];
    sea->stop.stiffness =
        said[PARAMETER_STOP_KS] ? value[PARAMETER_STOP_KS] : SPRING_STOP_TIMES * sea->Ks;
    sea->stop.damping =
        said[PARAMETER_STOP_DS] ? value[PARAMETER_STOP_DS] : STOP_RETURNS * sea->stop.stiffness;
    return ERROR_NONE;
}

/* A drive: what the joint does not say, the robot's own drive does. */
enum error_code robot_build_drive(struct robot_builder *b, struct joint_yaml *given,
                                  struct robot_sea *sea)
{
    double value[PARAMETER_COUNT];
    bool said[PARAMETER_COUNT];
    enum error_code code;

    if (!given->has_drive) {
        return ERROR_NONE;
    }
    if (given->type != JOINT_REVOLUTE) {
        return yaml_error(b->error, &given->drive.mark,
                          "found a drive on prismatic joint \"%s\", expected none: series elastic "
                          "drives turn",
                          given->name);
    }

    /* Each parameter from the joint's drive, or else from the robot's */
    code = robot_take_drive(b, &given->drive);
    if (code) {
        return code;
    }
    for (enum drive_parameter i = 0; i < PARAMETER_COUNT; i++) {
        const struct drive_yaml *from = given->drive.given[i] ? &given->drive : &b->file.drive;

        said[i] = from->given[i];
        if (!said[i] && i < PARAMETER_DEFLECTION) {
            return yaml_error(
                b->error, &given->drive.mark,
                "found the drive of joint \"%s\" without key \"%s\", expected it here%s "
                "or in the robot's own drive",
                given->name, robot_drive_key(i),
                given->drive.file ? ", in the file of the drive," : "");
        }
        value[i] = from->value[i];
    }
    *sea = (struct robot_sea){.present = true,
                              .J = value[PARAMETER_J],
                              .Dm = value[PARAMETER_DM],
                              .Ks = value[PARAMETER_KS],
                              .Ds = value[PARAMETER_DS],
                              .N = value[PARAMETER_N],
                              .Kt = value[PARAMETER_KT],
                              .Kw = value[PARAMETER_KW],
                              .R = value[PARAMETER_R],
                              .L = value[PARAMETER_L]};
    if ((code = build_spring_stop(b, given, value, said, sea))) {
        return code;
    }
    return robot_build_effects(b, &given->drive, sea);
}

/* ---- a drive alone ---- */

enum error_code robot_load_drive(const char *path, struct arena *arena,
                                 const struct robot_drive **drive, struct error *error)
{
    static const struct joint_yaml nothing = {.name = "of this file", .type = JOINT_REVOLUTE};
    struct robot_builder b = {.arena = arena, .error = error};
    struct joint_yaml joint = nothing;
    struct drive_file_yaml file;
    struct robot_drive *made;
    enum error_code code = yaml_read_file(path, &drive_file_schema, arena, &file, error);

    if (code) {
        return code;
    }
    made = arena_alloc(arena, 1, sizeof *made);
    if (!made) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory left for this drive", path);
    }
    *made = (struct robot_drive){.name = file.name,
                                 .description = file.description,
                                 .source = file.source,
                                 .supply_v = file.supply_v,
                                 .torque = file.torque,
                                 .peak_torque = file.peak_torque,
                                 .speed = file.speed,
                                 .mass = file.mass};
    joint.has_drive = true;
    joint.drive = file.drive;
    *drive = made;
    return robot_build_drive(&b, &joint, &made->sea);
}
