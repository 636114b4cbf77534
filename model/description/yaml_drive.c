/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Builds the drives of a robot file: what the catalogue gives, what the robot and its variant give
 * for all joints, what a joint gives itself, and the drive that comes of it.
 */
#include "base/config.h"
#include "model/description/yaml.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* ---- kinds ---- */

static const char *const kind_word[] = {
    [DRIVE_ELECTRIC] = "an electric drive", [DRIVE_HYDRAULIC] = "a hydraulic drive"};

/* Returns the first key of that kind, and where it stands; NULL when there is none. */
static const char *drive_find_key(const struct drive_yaml *drive, enum drive_kind kind,
                                  const struct yaml_mark **mark)
{
    for (size_t i = 0; kind == DRIVE_HYDRAULIC && i < HYDRAULIC_PARAMETERS; i++) {
        if (drive->has_cylinder[i]) {
            *mark = &drive->cylinder_mark[i];
            return robot_hydraulic_key((enum hydraulic_parameter)i);
        }
    }
    for (size_t i = 0; kind == DRIVE_ELECTRIC && i < PARAMETER_COUNT; i++) {
        if (drive->given[i]) {
            *mark = &drive->value_mark[i];
            return robot_drive_key((enum drive_parameter)i);
        }
    }
    *mark = &drive->mark;
    return kind != DRIVE_ELECTRIC ? NULL
           : drive->has_freewheel ? "freewheel"
           : drive->has_error     ? "gear_error"
           : drive->has_cogging   ? "cogging"
                                  : NULL;
}

enum drive_kind robot_drive_kind(const struct drive_yaml *drive)
{
    const struct yaml_mark *mark;

    return drive_find_key(drive, DRIVE_HYDRAULIC, &mark)  ? DRIVE_HYDRAULIC
           : drive_find_key(drive, DRIVE_ELECTRIC, &mark) ? DRIVE_ELECTRIC
                                                          : DRIVE_UNSAID;
}

/* Refuses a drive that has keys of the other kind than the one that from names. */
static enum error_code refuse_other_kind(struct robot_builder *b, const struct drive_yaml *drive,
                                         enum drive_kind kind, const char *from)
{
    const enum drive_kind other = kind == DRIVE_HYDRAULIC ? DRIVE_ELECTRIC : DRIVE_HYDRAULIC;
    const struct yaml_mark *mark;
    const char *key = kind == DRIVE_UNSAID ? NULL : drive_find_key(drive, other, &mark);

    return key ? yaml_error(b->error, mark, "found key \"%s\" of %s beside %s, expected keys of %s",
                            key, kind_word[other], from, kind_word[kind])
               : ERROR_NONE;
}

/* Refuses keys of both kinds in one mapping. */
static enum error_code refuse_mixed_keys(struct robot_builder *b, const struct drive_yaml *drive)
{
    const enum drive_kind kind = robot_drive_kind(drive);
    const struct yaml_mark *mark;
    char from[96];

    snprintf(from, sizeof from, "key \"%s\" of %s",
             kind == DRIVE_UNSAID ? "" : drive_find_key(drive, kind, &mark),
             kind == DRIVE_UNSAID ? "" : kind_word[kind]);
    return refuse_other_kind(b, drive, kind, from);
}

/* ---- merging ---- */

/* Merges change into drive; the numbers of change go first. */
static void merge_drive(const struct drive_yaml *change, struct drive_yaml *drive)
{
    for (enum drive_parameter i = 0; i < PARAMETER_COUNT; i++) {
        if (change->given[i]) {
            drive->value[i] = change->value[i];
            drive->given[i] = true;
        }
    }
    for (enum hydraulic_parameter i = 0; i < HYDRAULIC_PARAMETERS; i++) {
        if (change->has_cylinder[i]) {
            drive->cylinder[i] = change->cylinder[i];
            drive->has_cylinder[i] = true;
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

enum error_code robot_change_drive(struct robot_builder *b, struct drive_yaml *change)
{
    const enum drive_kind own = robot_drive_kind(&b->file.drive);
    enum error_code code = robot_take_drive(b, change);

    if (!code) {
        code = refuse_other_kind(b, change, own, "the robot's own drive");
    }
    if (!code) {
        merge_drive(change, &b->file.drive);
    }
    return code;
}

enum error_code robot_check_own_drives(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;

    return robot_drive_kind(&file->drive) == DRIVE_HYDRAULIC &&
                   robot_drive_kind(&file->hydraulic) == DRIVE_HYDRAULIC
               ? yaml_error(b->error, &file->hydraulic.mark,
                            "found key \"hydraulic\" beside a hydraulic \"drive\", expected one of "
                            "them")
               : ERROR_NONE;
}

/* ---- the catalogue ---- */

/* Checks that a drive of the catalogue has ratings of its kind, and no triangle. */
static enum error_code check_drive_file(struct robot_builder *b, const struct drive_file_yaml *file)
{
    const struct drive_yaml *drive = &file->drive;
    const bool oil = robot_drive_kind(drive) == DRIVE_HYDRAULIC;
    enum error_code code = refuse_mixed_keys(b, drive);

    for (enum hydraulic_parameter i = HYDRAULIC_BASE; i <= HYDRAULIC_CLOSED && !code; i++) {
        if (drive->has_cylinder[i]) {
            code = yaml_error(b->error, &drive->cylinder_mark[i],
                              "found key \"%s\" in a drive's file, expected it at the joint that "
                              "takes the drive: the triangle is the joint's",
                              robot_hydraulic_key(i));
        }
    }
    for (enum drive_rating i = 0; i < RATING_MASS && !code; i++) {
        if (file->rating[i] > 0.0 && (i == RATING_PRESSURE) != oil) {
            code =
                yaml_error(b->error, &file->rating_mark[i],
                           "found rating \"%s\" in the file of %s, expected none of %s",
                           robot_rating_key(i), kind_word[oil ? DRIVE_HYDRAULIC : DRIVE_ELECTRIC],
                           kind_word[oil ? DRIVE_ELECTRIC : DRIVE_HYDRAULIC]);
        }
    }
    if (!code && oil && !(file->rating[RATING_PRESSURE] > 0.0)) {
        code = yaml_error(b->error, &file->mark,
                          "found the file of a hydraulic drive without key \"%s\", expected the "
                          "pressure that it is made for",
                          robot_rating_key(RATING_PRESSURE));
    }
    return code;
}

/* Reads and checks a file of the catalogue. */
static enum error_code read_drive_file(struct robot_builder *b, const char *path,
                                       struct drive_file_yaml *file)
{
    enum error_code code = yaml_read_file(path, &drive_file_schema, b->arena, file, b->error);

    return code ? code : check_drive_file(b, file);
}

/* Finds out whether a file exists (mode F_OK) or may be read (R_OK); what the system could not
 * find out is an error. */
static enum error_code drive_file_exists(struct robot_builder *b, const char *path, int mode,
                                         bool *there)
{
    *there = access(path, mode) == 0;
    return *there || errno == ENOENT || errno == ENOTDIR || errno == EACCES
               ? ERROR_NONE
               : error_set_file(b->error, errno, path, "cannot be looked for");
}

/* Finds the file of a drive: a path from the robot's folder, or a name, first in the folder
 * drives beside that, then in the configuration trees. */
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
    char from[96];
    bool there;

    code = refuse_mixed_keys(b, drive);
    if (code || !drive->file) {
        return code;
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
    code = read_drive_file(b, path, &file);
    if (code) {
        return code;
    }
    snprintf(from, sizeof from, "drive \"%.63s\"", drive->file);
    code = refuse_other_kind(b, drive, robot_drive_kind(&file.drive), from);
    if (code) {
        return code;
    }

    /* Numbers beside the name go before those of the file */
    taken = file.drive;
    taken.mark = drive->mark;
    taken.file = drive->file;
    taken.file_mark = drive->file_mark;
    merge_drive(drive, &taken);
    *drive = taken;
    return ERROR_NONE;
}

/* ---- a joint's drive ---- */

/* Stiffness of a spring's stop as a multiple of the spring's, where the file gives its room
 * alone. */
#define SPRING_STOP_TIMES 20.0

/* Builds the stop of a drive's spring from the drive's parameters. */
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

/* Builds an electric drive: each parameter from the joint's drive, or else from the robot's. */
static enum error_code build_electric(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_sea *sea)
{
    double value[PARAMETER_COUNT];
    bool said[PARAMETER_COUNT];
    enum error_code code;

    /* Only the parameters before the deflection are required */
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
    /* The paper's constants, then what goes beyond them */
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

enum error_code robot_build_drive(struct robot_builder *b, struct joint_yaml *given,
                                  struct robot_joint *joint)
{
    enum drive_kind kind;
    enum error_code code;

    /* At most one drive, on a joint that turns */
    if (given->has_drive && given->has_hydraulic) {
        return yaml_error(b->error, &given->hydraulic.mark,
                          "found a hydraulic drive on driven joint \"%s\", expected none",
                          given->name);
    }
    if (given->has_hydraulic) {
        given->drive = given->hydraulic;
    } else if (!given->has_drive) {
        return ERROR_NONE;
    }
    if (given->type != JOINT_REVOLUTE) {
        return yaml_error(b->error, &given->drive.mark,
                          "found a drive on prismatic joint \"%s\", expected none: drives turn",
                          given->name);
    }
    /* The kind is that of the joint's keys, else of the robot's own drive */
    code = robot_take_drive(b, &given->drive);
    if (code) {
        return code;
    }
    kind = robot_drive_kind(&given->drive);
    if (kind == DRIVE_UNSAID) {
        kind = given->has_hydraulic ? DRIVE_HYDRAULIC : robot_drive_kind(&b->file.drive);
    }
    return kind == DRIVE_HYDRAULIC ? robot_build_hydraulic(b, given, joint)
                                   : build_electric(b, given, &joint->sea);
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
    enum error_code code = read_drive_file(&b, path, &file);

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
                                 .supply_v = file.rating[RATING_SUPPLY],
                                 .torque = file.rating[RATING_TORQUE],
                                 .peak_torque = file.rating[RATING_PEAK_TORQUE],
                                 .speed = file.rating[RATING_SPEED],
                                 .pressure = file.rating[RATING_PRESSURE],
                                 .mass = file.rating[RATING_MASS]};
    joint.drive = file.drive;
    *drive = made;
    return robot_drive_kind(&file.drive) == DRIVE_HYDRAULIC
               ? robot_build_cylinder(&b, &file.drive, &made->hydraulic)
               : build_electric(&b, &joint, &made->sea);
}

enum error_code robot_describe_drive(const char *path, struct arena *arena,
                                     const char **description, bool *hydraulic, struct error *error)
{
    struct robot_builder b = {.arena = arena, .error = error};
    struct drive_file_yaml file;
    enum error_code code = read_drive_file(&b, path, &file);

    if (!code) {
        *description = file.description;
        *hydraulic = robot_drive_kind(&file.drive) == DRIVE_HYDRAULIC;
    }
    return code;
}
