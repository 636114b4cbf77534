/* SPDX-License-Identifier: Apache-2.0 */
/* The modules that were generated when the program was built, and what is taken where none fits. */
#include "model/symbolic/builtin.h"

#include <string.h>

/* MODULE(NAME_dynamics) for each of them, written by the build */
#define MODULE(function) const struct dynamics_module *function(void);
#include "dynamics/builtin.inc"
#undef MODULE

const struct dynamics_module *symbolic_builtin(uint64_t robot_hash)
{
    static const struct dynamics_module *(*const entry[])(void) = {
#define MODULE(function) function,
#include "dynamics/builtin.inc"
#undef MODULE
        NULL,
    };

    for (size_t n = 0; entry[n]; n++) {
        const struct dynamics_module *module = dynamics_module_used(entry[n]());

        if (module->robot_hash == robot_hash) {
            return module;
        }
    }
    return NULL;
}

enum error_code dynamics_fastest(const struct robot *robot, const char *folder,
                                 struct symbolic_progress progress, struct arena *arena,
                                 struct dynamics *out, struct symbolic_library *library,
                                 struct error *notice, struct error *error)
{
    const struct symbolic_options options = {.lanes = 4, .this_cpu = true, .progress = progress};
    const struct dynamics_module *module = symbolic_builtin(robot->hash);
    struct error reason = {.text = "no cache folder"};

    memset(library, 0, sizeof *library);
    if (module) {
        error_set(notice, ERROR_NONE, "built-in generated dynamics (%s)", module->variant);
        return dynamics_generated(robot, module, arena, out, error);
    }
    if (folder && !symbolic_build(robot, &options, folder, library, &reason)) {
        if (!dynamics_generated(robot, library->module, arena, out, &reason)) {
            error_set(notice, ERROR_NONE, "generated dynamics (%s), %s in %s",
                      library->module->variant, library->cached ? "found" : "compiled", folder);
            return ERROR_NONE;
        }
        symbolic_close(library);
    }
    error_set(notice, ERROR_NONE, "numeric dynamics, several times slower than generated ones: %s",
              reason.text);
    return dynamics_generic(robot, arena, out, error);
}
