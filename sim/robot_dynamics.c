/* SPDX-License-Identifier: Apache-2.0 */
/* Chooses what computes a robot's dynamics, and finds modules that were made beforehand. */
#include "sim/robot_dynamics.h"

#include "model/symbolic/builtin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MACHINE_FOLDER "/var/cache/coman-hil"

enum { FOLDER_SIZE = 4096 };

const struct symbolic_options robot_dynamics_module = {.lanes = 4, .inertia_inputs = true};

bool robot_dynamics_folder(char *path, size_t size)
{
    const char *cache = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    int length;

    if (cache && *cache == '/') {
        length = snprintf(path, size, "%s/coman-hil", cache);
    } else if (geteuid() == 0) {
        length = snprintf(path, size, MACHINE_FOLDER);
    } else if (home && *home == '/') {
        length = snprintf(path, size, "%s/.cache/coman-hil", home);
    } else {
        return false;
    }
    return length > 0 && (size_t)length < size;
}

/* Loads the robot's module from the user's folder, else from that of the machine; reason says why
 * there is none. */
static enum error_code find_module(const struct robot *robot, struct symbolic_library *library,
                                   struct error *reason)
{
    char folder[FOLDER_SIZE];

    if (robot_dynamics_folder(folder, sizeof folder)) {
        enum error_code code =
            symbolic_find(robot, &robot_dynamics_module, folder, library, reason);

        if (!code || strcmp(folder, MACHINE_FOLDER) == 0) {
            return code;
        }
        reason = NULL;
    }
    return symbolic_find(robot, &robot_dynamics_module, MACHINE_FOLDER, library, reason);
}

enum error_code robot_dynamics_fastest(const struct robot *robot, struct arena *arena,
                                       struct dynamics *out, struct symbolic_library *library,
                                       struct error *notice, struct error *error)
{
    const struct dynamics_module *module = symbolic_builtin(robot);
    struct error reason;

    memset(library, 0, sizeof *library);
    /* A built-in module, else one made beforehand, else the numeric algorithms */
    if (module) {
        error_set(notice, ERROR_NONE, "built-in generated dynamics%s (%s)",
                  module->ninertia ? " with masses as inputs" : "", module->variant);
        return dynamics_generated(robot, module, arena, out, error);
    }
    if (!find_module(robot, library, &reason)) {
        if (!dynamics_generated(robot, library->module, arena, out, &reason)) {
            error_set(notice, ERROR_NONE, "generated dynamics (%s), made beforehand",
                      library->module->variant);
            return ERROR_NONE;
        }
        symbolic_close(library);
    }
    error_set(notice, ERROR_NONE, "numeric dynamics, several times slower than generated ones: %s",
              reason.text);
    return dynamics_generic(robot, arena, out, error);
}

enum error_code robot_dynamics_create(const struct rig *rig, struct arena *arena,
                                      struct dynamics *out, struct symbolic_library *library,
                                      struct error *notice, struct error *error)
{
    struct error found;
    enum error_code code;

    memset(library, 0, sizeof *library);
    if (rig->dynamics == RIG_DYNAMICS_GENERIC) {
        error_set(notice, ERROR_NONE, "numeric dynamics, as the rig says");
        return dynamics_generic(rig->robot, arena, out, error);
    }
    code = robot_dynamics_fastest(rig->robot, arena, out, library, &found, error);
    error_set(notice, ERROR_NONE, "%.400s", found.text);
    if (!code && strcmp(out->ops->name, "generated")) {
        error_set(notice, ERROR_NONE, "%.400s; coman-hil generate --module %s makes one",
                  found.text, rig->file);
    }
    return code;
}
