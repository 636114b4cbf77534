/* SPDX-License-Identifier: Apache-2.0 */
/* Selects drives of the catalogue for the joints of an import; app/import/drive.h has the
 * rules. */
#include "app/import/drive.h"

#include "base/config.h"
#include "base/text.h"

#include <fnmatch.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

/* One parsed --drive option. */
struct drive_pick {
    const char *option;  /* the option's text, for messages */
    const char *pattern; /* shell pattern of joint names */
    const char *file;    /* name or path of the drive, as a robot file writes it */
    const char *copy;    /* absolute path of a user's own file, which is copied; or NULL */
    const struct robot_drive *drive;
};

double import_drive_torque(const struct robot_drive *drive)
{
    if (drive->peak_torque > 0.0) {
        return drive->peak_torque;
    }
    return drive->torque > 0.0 ? drive->torque : drive->sea.Kt * drive->supply_v / drive->sea.R;
}

/* Returns the name by which a robot file refers to its own folder drives, "../drives/NAME";
 * NULL when there is no memory. */
static char *drive_name_own(const char *name, struct arena *arena)
{
    static const char before[] = "../drives/";
    char *file = arena_alloc(arena, sizeof before + strlen(name), 1);

    return file ? strcat(strcpy(file, before), name) : NULL;
}

/* Refuses two different drive files with one name, because their copies would be in one folder. */
static enum error_code robot_check_drive_copies(const struct import_robot *to, struct error *error)
{
    for (size_t j = 0; j < to->robot->njoint; j++) {
        for (size_t k = 0; k < j && to->drive_copy[j]; k++) {
            if (to->drive_copy[k] && strcmp(to->drive_file[j], to->drive_file[k]) == 0 &&
                strcmp(to->drive_copy[j], to->drive_copy[k]) != 0) {
                return error_set(error, ERROR_INPUT,
                                 "--drive: found \"%.200s\" and \"%.200s\", expected files with "
                                 "different names",
                                 to->drive_copy[k], to->drive_copy[j]);
            }
        }
    }
    return ERROR_NONE;
}

/* Finds the drive file in the option: a path (with "/" or "."), copied into the folder drives of
 * the import, or a name of the catalogue. */
static enum error_code drive_pick_locate(struct drive_pick *pick, struct arena *arena,
                                         const char **path, struct error *error)
{
    char whole[PATH_MAX];
    enum error_code code;

    /* A path is a user's own file, named ../drives/ and its file name in the robot file */
    if (strpbrk(pick->file, "/.")) {
        const char *slash, *name;

        if (!realpath(pick->file, whole)) {
            return error_set(error, ERROR_INPUT,
                             "--drive: found \"%.200s\", expected a drive of the catalogue or its "
                             "file: no such file",
                             pick->file);
        }
        slash = strrchr(whole, '/');
        name = slash ? slash + 1 : whole;
        if (!text_is_name(name)) {
            return error_set(
                error, ERROR_INPUT,
                "--drive: found \"%.200s\", expected letters, digits and _ - . only in "
                "the name of a drive's file",
                name);
        }
        *path = pick->copy = arena_strdup(arena, whole);
        pick->file = drive_name_own(name, arena);
        return *path && pick->file ? ERROR_NONE
                                   : error_set(error, ERROR_MEMORY, "no memory for the drives");
    }

    /* A plain name is one of the catalogue */
    code = config_locate_from(CONFIG_DRIVE, pick->file, "", arena, path, error);
    return code ? error_prefix(error, "--drive") : ERROR_NONE;
}

/* Parses one --drive, NAME or JOINTS=NAME, and loads the drive that it names. */
static enum error_code drive_pick_read(const char *option, struct arena *arena,
                                       struct drive_pick *pick, struct error *error)
{
    const char *equals = strchr(option, '='), *path;
    enum error_code code;

    *pick = (struct drive_pick){.option = option, .pattern = "*", .file = option};
    if (equals) {
        char *pattern = arena_strdup(arena, option);

        if (!pattern) {
            return error_set(error, ERROR_MEMORY, "no memory for the drives");
        }
        pattern[equals - option] = '\0';
        pick->pattern = pattern;
        pick->file = equals + 1;
    }
    if (!*pick->pattern || !*pick->file) {
        return error_set(error, ERROR_INPUT,
                         "--drive: found \"%.200s\", expected NAME or JOINTS=NAME", option);
    }
    code = drive_pick_locate(pick, arena, &path, error);
    return code ? code : robot_load_drive(path, arena, &pick->drive, error);
}

/* Checks whether a joint needs a drive: it is revolute and does not follow another joint. */
static bool joint_takes_drive(const struct robot *robot, size_t j)
{
    return robot->joint[j].type == JOINT_REVOLUTE && !robot_find_coupling(robot, j);
}

/* Refuses a pattern without a matching driven joint and suggests the nearest name. */
static enum error_code drive_pick_refuse(const struct drive_pick *pick, const struct robot *robot,
                                         struct arena *arena, struct error *error)
{
    const char **name = arena_alloc(arena, robot->njoint + 1, sizeof *name), *near;
    size_t count = 0;

    if (!name) {
        return error_set(error, ERROR_MEMORY, "no memory for the drives");
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        if (joint_takes_drive(robot, j)) {
            name[count++] = robot->joint[j].name;
        }
    }
    near = text_nearest(pick->pattern, name, count);
    return error_set(error, ERROR_INPUT,
                     "--drive: found \"%.200s\", expected a joint that turns before the =%s%.63s%s",
                     pick->option, near ? "; the nearest is \"" : "", near ? near : "",
                     near ? "\"" : "");
}

enum error_code import_pick_drives(const struct import_options *options, struct arena *arena,
                                   struct import_robot *to, struct error *error)
{
    const struct robot *robot = to->robot;

    to->drive = arena_alloc(arena, robot->njoint + 1, sizeof *to->drive);
    to->drive_file = arena_alloc(arena, robot->njoint + 1, sizeof *to->drive_file);
    to->drive_copy = arena_alloc(arena, robot->njoint + 1, sizeof *to->drive_copy);
    if (!to->drive || !to->drive_file || !to->drive_copy) {
        return error_set(error, ERROR_MEMORY, "no memory for the drives");
    }
    /* Options apply in order, so the last match is used */
    for (size_t i = 0; i < options->ndrive; i++) {
        struct drive_pick pick;
        bool matched = false;
        enum error_code code = drive_pick_read(options->drive[i], arena, &pick, error);

        if (code) {
            return code;
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            if (joint_takes_drive(robot, j) &&
                fnmatch(pick.pattern, robot->joint[j].name, 0) == 0) {
                to->drive[j] = pick.drive;
                to->drive_file[j] = pick.file;
                to->drive_copy[j] = pick.copy;
                matched = true;
            }
        }
        if (!matched) {
            return drive_pick_refuse(&pick, robot, arena, error);
        }
    }
    return robot_check_drive_copies(to, error);
}
