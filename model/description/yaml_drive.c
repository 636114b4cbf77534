/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Builds the drives of a robot file. A value comes from the first of these that has it: the joint,
 * the robot's variant, the robot, the catalogue. Effects beyond the paper's equations are off
 * unless the file has their keys.
 */
#include "base/config.h"
#include "base/array.h"
#include "model/description/yaml.h"
#include "model/drives/effects.h"
#include "model/plant_io.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* ---- kinds ---- */

static const char *const kind_word[] = {
    [DRIVE_ELECTRIC] = "an electric drive", [DRIVE_HYDRAULIC] = "a hydraulic drive"};

/* Returns the first key of this kind in a drive; NULL if there is none. */
static const char *drive_find_key(const struct drive_yaml *drive, enum drive_kind kind)
{
    size_t count;
    const struct yaml_field *row = robot_drive_rows(kind, &count);

    for (size_t i = 0; i < count; i++) {
        if (yaml_has(&drive->mark, row[i].key)) {
            return row[i].key;
        }
    }
    return NULL;
}

enum drive_kind robot_drive_kind(const struct drive_yaml *drive)
{
    return drive_find_key(drive, DRIVE_HYDRAULIC)  ? DRIVE_HYDRAULIC
           : drive_find_key(drive, DRIVE_ELECTRIC) ? DRIVE_ELECTRIC
                                                   : DRIVE_UNSAID;
}

/* Refuses a drive whose kind differs from the kind of `from`. */
static enum error_code refuse_other_kind(struct robot_builder *b, const struct drive_yaml *drive,
                                         enum drive_kind kind, const char *from)
{
    const enum drive_kind other = kind == DRIVE_HYDRAULIC ? DRIVE_ELECTRIC : DRIVE_HYDRAULIC;
    const char *key = kind == DRIVE_UNSAID ? NULL : drive_find_key(drive, other);

    return key ? yaml_error(b->error, yaml_place(&drive->mark, key),
                            "found key \"%s\" of %s beside %s, expected keys of %s", key,
                            kind_word[other], from, kind_word[kind])
               : ERROR_NONE;
}

/* Refuses keys of both kinds in one mapping. */
static enum error_code refuse_mixed_keys(struct robot_builder *b, const struct drive_yaml *drive)
{
    const enum drive_kind kind = robot_drive_kind(drive);
    char from[96];

    snprintf(from, sizeof from, "key \"%s\" of %s",
             kind == DRIVE_UNSAID ? "" : drive_find_key(drive, kind),
             kind == DRIVE_UNSAID ? "" : kind_word[kind]);
    return refuse_other_kind(b, drive, kind, from);
}

/* ---- merging ---- */

enum error_code robot_merge_drive(struct robot_builder *b, const struct drive_yaml *change,
                                  struct drive_yaml *drive)
{
    const struct yaml_key *const from[] = {change->mark.keys, drive->mark.keys};
    struct yaml_key *keys, *at;
    size_t count = 1;

    for (size_t i = 0; i < ARRAY_COUNT(from); i++) {
        for (const struct yaml_key *key = from[i]; key && key->key; key++) {
            count++;
        }
    }
    keys = at = arena_alloc(b->arena, count, sizeof *keys);
    if (!keys) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < ARRAY_COUNT(from); i++) {
        for (const struct yaml_key *key = from[i]; key && key->key; key++) {
            *at++ = *key;
        }
    }
    yaml_override(&robot_drive_schema, &change->mark, change, drive);
    drive->mark = change->mark;
    drive->mark.keys = keys;
    return ERROR_NONE;
}

enum error_code robot_change_drive(struct robot_builder *b, struct drive_yaml *change)
{
    const enum drive_kind own = robot_drive_kind(&b->file.drive);
    enum error_code code = robot_take_drive(b, change);

    if (!code) {
        code = refuse_other_kind(b, change, own, "the robot's own drive");
    }
    return code ? code : robot_merge_drive(b, change, &b->file.drive);
}

enum error_code robot_check_own_drives(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;

    return robot_drive_kind(&file->drive) == DRIVE_HYDRAULIC &&
                   robot_drive_kind(&file->hydraulic) == DRIVE_HYDRAULIC
               ? yaml_error(
                     b->error, &file->hydraulic.mark,
                     "found key \"hydraulic\" beside a hydraulic \"drive\", expected one of them")
               : ERROR_NONE;
}

/* ---- the catalogue ---- */

/* Checks that a drive of the catalogue has ratings of its kind, and no triangle keys. */
static enum error_code check_drive_file(struct robot_builder *b, const struct drive_file_yaml *file)
{
    static const char *const rating[] = {"supply_v", "torque_nm", "peak_torque_nm", "speed_rad_s"};
    const bool oil = robot_drive_kind(&file->drive) == DRIVE_HYDRAULIC;
    const char *wrong = oil ? NULL : "pressure_pa";
    enum error_code code = refuse_mixed_keys(b, &file->drive);
    size_t count;
    const struct yaml_field *row = robot_drive_rows(DRIVE_HYDRAULIC, &count);

    for (size_t i = 0; i < count && !code; i++) {
        if (robot_key_is_of_triangle(row[i].key) && yaml_has(&file->drive.mark, row[i].key)) {
            code = yaml_error(b->error, yaml_place(&file->drive.mark, row[i].key),
                              "found key \"%s\" in a drive's file, expected it at the joint that "
                              "takes the drive: the triangle is the joint's",
                              row[i].key);
        }
    }
    for (size_t i = 0; i < ARRAY_COUNT(rating) && oil && !wrong; i++) {
        wrong = yaml_has(&file->mark, rating[i]) ? rating[i] : NULL;
    }
    if (!code && wrong && yaml_has(&file->mark, wrong)) {
        code = yaml_error(b->error, yaml_place(&file->mark, wrong),
                          "found rating \"%s\" in the file of %s, expected none of %s", wrong,
                          kind_word[oil ? DRIVE_HYDRAULIC : DRIVE_ELECTRIC],
                          kind_word[oil ? DRIVE_ELECTRIC : DRIVE_HYDRAULIC]);
    }
    if (!code && oil && !yaml_has(&file->mark, "pressure_pa")) {
        code = yaml_error(b->error, &file->mark,
                          "found the file of a hydraulic drive without key \"pressure_pa\", "
                          "expected the pressure that it is made for");
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

/* Determines whether a file exists (mode F_OK) or is readable (mode R_OK). Returns an error if the
 * system cannot determine it. */
static enum error_code drive_file_exists(struct robot_builder *b, const char *path, int mode,
                                         bool *there)
{
    *there = access(path, mode) == 0;
    return *there || errno == ENOENT || errno == ENOTDIR || errno == EACCES
               ? ERROR_NONE
               : error_set_file(b->error, errno, path, "cannot be looked for");
}

/* Finds the file of a drive. A path is relative to the robot's folder. A name is searched in the
 * folder drives beside the robot's folder, then in the configuration trees. */
static enum error_code find_drive_file(struct robot_builder *b, const struct drive_yaml *drive,
                                       const char **path)
{
    const struct yaml_mark *mark = yaml_place(&drive->mark, "file");
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

    /* The error for an unreadable file points to the line that names it */
    code = drive_file_exists(b, path, R_OK, &there);
    if (code) {
        return code;
    }
    if (!there) {
        return yaml_error(
            b->error, yaml_place(&drive->mark, "file"),
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

    /* Values beside the file's name replace the values in the file */
    taken = file.drive;
    taken.file = drive->file;
    code = robot_merge_drive(b, drive, &taken);
    *drive = taken;
    return code;
}

/* ---- a joint's drive ---- */

/* Default stiffness of a spring's stop as a multiple of the spring's stiffness, if the file has
 * only the largest deflection. */
#define SPRING_STOP_TIMES 20.0

/* Default temperature coefficient of copper, 1/K at 25 degree C (IEC 60034-1: 1/(234.5 + 25)). */
#define COPPER_PER_K 0.00385

/* Default temperature of the air, deg C. */
#define AMBIENT_C 25.0

/* Builds the stop of a drive's spring. given: the joint's own keys. */
static enum error_code build_spring_stop(struct robot_builder *b, const struct joint_yaml *given,
                                         const struct yaml_mark *drive, struct robot_sea *sea)
{
    const struct yaml_mark *own = &given->drive.mark;

    if (!yaml_has(drive, "deflection_rad")) {
        sea->stop = (struct robot_stop){0};
        return yaml_has(own, "stop_Ks_nm_rad") || yaml_has(own, "stop_Ds_nm_s_rad")
                   ? yaml_error(b->error, own,
                                "found a stop of the spring of joint \"%s\" without key "
                                "\"deflection_rad\", expected the deflection at which it begins",
                                given->joint.name)
                   : ERROR_NONE;
    }
    if (!yaml_has(drive, "stop_Ks_nm_rad")) {
        sea->stop.stiffness = SPRING_STOP_TIMES * sea->Ks;
    }
    if (!yaml_has(drive, "stop_Ds_nm_s_rad")) {
        sea->stop.damping = STOP_RETURNS * sea->stop.stiffness;
    }
    return ERROR_NONE;
}

/* Copies a list of sines, at most ROBOT_HARMONICS. */
static enum error_code build_harmonics(struct robot_builder *b, const struct harmonic_yaml *given,
                                       size_t count, struct robot_harmonic *harmonic, size_t *made)
{
    if (count > ROBOT_HARMONICS) {
        return yaml_error(b->error, &given[ROBOT_HARMONICS].mark,
                          "found %zu sines, expected no more than %d", count, ROBOT_HARMONICS);
    }
    for (size_t i = 0; i < count; i++) {
        harmonic[i] = given[i].sine;
    }
    *made = count;
    return ERROR_NONE;
}

/* Refuses keys that have no effect without another key. */
static enum error_code check_effect_keys(struct robot_builder *b, const struct yaml_mark *drive)
{
    static const char *const pair[][2] = {
        {"breakaway_nm", "coulomb_nm"},
        {"breakaway_nm", "stribeck_rad_s"},
        {"stribeck_rad_s", "breakaway_nm"},
        {"stribeck_exponent", "stribeck_rad_s"},
        {"load_motor_stribeck", "stribeck_rad_s"},
        {"load_external_stribeck", "stribeck_rad_s"},
        {"load_motor_per_nm", "stribeck_rad_s"},
        {"load_external_per_nm", "stribeck_rad_s"},
        {"hysteresis_nm", "hysteresis_nm_rad"},
        {"hysteresis_nm_rad", "hysteresis_nm"},
        {"winding_k_w", "housing_k_w"},
        {"housing_k_w", "winding_j_k"},
        {"winding_j_k", "housing_j_k"},
        {"housing_j_k", "winding_k_w"},
        {"ambient_c", "winding_k_w"},
        {"R_per_k", "winding_k_w"},
        {"NKt_per_k", "winding_k_w"},
        {"dead_time_s", "pwm_hz"},
        {"switching_s", "pwm_hz"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(pair); i++) {
        if (yaml_has(drive, pair[i][0]) && !yaml_has(drive, pair[i][1])) {
            return yaml_error(b->error, drive,
                              "found a drive with key \"%s\" and without \"%s\", expected both",
                              pair[i][0], pair[i][1]);
        }
    }
    return ERROR_NONE;
}

/* Returns whether a drive has effects: a number in the schema rows after the spring's stop, a sine,
 * or freewheeling. */
static bool drive_has_effects(const struct drive_yaml *drive)
{
    bool any = drive->effects.freewheel || drive->nerror > 0 || drive->ncogging > 0, effect = false;
    size_t count;
    const struct yaml_field *row = robot_drive_rows(DRIVE_ELECTRIC, &count);

    for (size_t i = 0; i < count && row[i].type == YAML_REAL; i++) {
        effect = effect || strcmp(row[i].key, "coulomb_nm") == 0;
        any = any || (effect && yaml_has(&drive->mark, row[i].key));
    }
    return any;
}

/* Builds the effects of a drive, or sets NULL if it has none. */
static enum error_code build_effects(struct robot_builder *b, const struct drive_yaml *drive,
                                     struct robot_sea *sea)
{
    const struct yaml_mark *mark = &drive->mark;
    struct robot_effects *effects;
    enum error_code code;
    struct error why;

    if (!drive_has_effects(drive)) {
        return ERROR_NONE;
    }
    if ((code = check_effect_keys(b, mark))) {
        return code;
    }

    /* Allocate effects separately, so that a drive without effects needs no memory for them */
    effects = arena_alloc(b->arena, 1, sizeof *effects);
    if (!effects) {
        return robot_no_memory(b);
    }
    *effects = drive->effects;
    if (!yaml_has(mark, "breakaway_nm")) {
        effects->breakaway = effects->coulomb;
    }
    if (!yaml_has(mark, "ambient_c")) {
        effects->thermal.ambient_c = AMBIENT_C;
    }
    if (!yaml_has(mark, "R_per_k")) {
        effects->thermal.R_per_k = COPPER_PER_K;
    }
    if ((code =
             build_harmonics(b, drive->error, drive->nerror, effects->error, &effects->nerror)) ||
        (code = build_harmonics(b, drive->cogging, drive->ncogging, effects->cogging,
                                &effects->ncogging))) {
        return code;
    }
    sea->effects = effects;
    return effects_check(sea, &why) ? yaml_error(b->error, mark, "%s", why.text) : ERROR_NONE;
}

/* Builds an electric drive. Each parameter comes from the joint's drive, else from the robot's
 * drive. */
static enum error_code build_electric(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_sea *sea)
{
    struct drive_yaml drive = b->file.drive;
    enum error_code code = robot_merge_drive(b, &given->drive, &drive);
    size_t count;
    const struct yaml_field *row = robot_drive_rows(DRIVE_ELECTRIC, &count);

    if (code) {
        return code;
    }
    /* Only the parameters before deflection_rad are required */
    for (; strcmp(row->key, "deflection_rad") != 0; row++) {
        if (!yaml_has(&drive.mark, row->key)) {
            return yaml_error(b->error, &given->drive.mark,
                              "found the drive of joint \"%s\" without key \"%s\", expected it "
                              "here%s or in the robot's own drive",
                              given->joint.name, row->key,
                              given->drive.file ? ", in the file of the drive," : "");
        }
    }
    /* Set the paper's constants, then the extensions */
    *sea = drive.sea;
    sea->present = true;
    if (!yaml_has(&drive.mark, "current_loop_hz")) {
        sea->current_loop_hz = CURRENT_LOOP_HZ;
    }
    code = build_spring_stop(b, given, &drive.mark, sea);
    return code ? code : build_effects(b, &drive, sea);
}

enum error_code robot_build_drive(struct robot_builder *b, struct joint_yaml *given,
                                  struct robot_joint *joint)
{
    const bool hydraulic = yaml_has(&given->mark, "hydraulic");
    enum drive_kind kind;
    enum error_code code;

    /* A joint has at most one drive, and only a revolute joint has a drive */
    if (hydraulic && yaml_has(&given->mark, "drive")) {
        return yaml_error(b->error, &given->hydraulic.mark,
                          "found a hydraulic drive on driven joint \"%s\", expected none",
                          given->joint.name);
    }
    if (hydraulic) {
        given->drive = given->hydraulic;
    } else if (!yaml_has(&given->mark, "drive")) {
        return ERROR_NONE;
    }
    if (joint->type != JOINT_REVOLUTE) {
        return yaml_error(b->error, &given->drive.mark,
                          "found a drive on prismatic joint \"%s\", expected none: drives turn",
                          given->joint.name);
    }
    /* Take the kind from the joint's keys, else from the robot's own drive */
    code = robot_take_drive(b, &given->drive);
    if (code) {
        return code;
    }
    kind = robot_drive_kind(&given->drive);
    if (kind == DRIVE_UNSAID) {
        kind = hydraulic ? DRIVE_HYDRAULIC : robot_drive_kind(&b->file.drive);
    }
    return kind == DRIVE_HYDRAULIC ? robot_build_hydraulic(b, given, joint)
                                   : build_electric(b, given, &joint->sea);
}

/* ---- a drive without a robot ---- */

enum error_code robot_load_drive(const char *path, struct arena *arena,
                                 const struct robot_drive **drive, struct error *error)
{
    static const struct joint_yaml nothing = {.joint.name = "of this file"};
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
    *made = file.made;
    joint.drive = file.drive;
    *drive = made;
    return robot_drive_kind(&file.drive) == DRIVE_HYDRAULIC
               ? robot_build_cylinder(&b, &file.drive, NULL, &made->hydraulic)
               : build_electric(&b, &joint, &made->sea);
}

enum error_code robot_describe_drive(const char *path, struct arena *arena,
                                     const char **description, bool *hydraulic, struct error *error)
{
    struct robot_builder b = {.arena = arena, .error = error};
    struct drive_file_yaml file;
    enum error_code code = read_drive_file(&b, path, &file);

    if (!code) {
        *description = file.made.description;
        *hydraulic = robot_drive_kind(&file.drive) == DRIVE_HYDRAULIC;
    }
    return code;
}

enum error_code robot_check_number(const char *key, double value, struct error *error)
{
    size_t count;
    const struct yaml_field *row = robot_drive_rows(DRIVE_ELECTRIC, &count);
    bool required = true;

    for (size_t i = 0; i < count; i++) {
        required = required && strcmp(row[i].key, "deflection_rad") != 0;
        if (!strcmp(row[i].key, key) && (value < row[i].min || value > row[i].max) &&
            (required || value != 0.0)) {
            return error_set(error, ERROR_INPUT, "found %g for \"%.63s\", expected %g to %g", value,
                             key, row[i].min, row[i].max);
        }
    }
    return ERROR_NONE;
}
