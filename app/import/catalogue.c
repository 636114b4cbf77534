/* SPDX-License-Identifier: Apache-2.0 */
/* Selects catalogue drives for the joints of an import, by the rules in app/import/drive.h. */
#include "app/import/drive.h"
#include "app/import/path.h"

#include "base/config.h"
#include "base/text.h"

#include <fnmatch.h>
#include <string.h>

/* One parsed --drive option. */
struct drive_pick {
    const char *option;  /* text of the option, for messages */
    const char *pattern; /* shell pattern of joint names */
    const char *file;    /* name or path of the drive in the robot file */
    const char *copy;    /* absolute path of a user's own file to copy; NULL = none */
    const struct robot_drive *drive;
};

double import_drive_torque(const struct robot_drive *drive)
{
    if (drive->peak_torque > 0.0) {
        return drive->peak_torque;
    }
    return drive->torque > 0.0 ? drive->torque : drive->sea.Kt * drive->supply_v / drive->sea.R;
}

/* Finds the drive file of an option. A path (with "/" or ".") is a user's own file, which the
 * import copies to its folder drives. Another name is in the catalogue. */
static enum error_code drive_pick_locate(struct drive_pick *pick, struct arena *arena,
                                         const char **path, struct error *error)
{
    enum error_code code;

    /* A path: the robot file names the copy ../drives/NAME */
    if (strpbrk(pick->file, "/.")) {
        code = import_find_own_file("drive", pick->file,
                                    "a drive of the catalogue or its file: no such file", arena,
                                    &pick->copy, &pick->file, error);
        *path = pick->copy;
        return code || (*path && pick->file)
                   ? code
                   : error_set(error, ERROR_MEMORY, "no memory for the drives");
    }

    /* A name in the catalogue */
    code = config_locate_from(CONFIG_DRIVE, pick->file, "", arena, path, error);
    return code ? error_prefix(error, "--drive") : ERROR_NONE;
}

/* Parses a --drive option, NAME or JOINTS=NAME, and loads its drive. */
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

/* Refuses a pattern that matches no driven joint, and suggests the nearest name. */
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
    /* Options apply in order, so the last match counts */
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

    /* Refuse two different drive files with the same name, because their copies would be in the
     * same folder */
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
