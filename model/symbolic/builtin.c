/* SPDX-License-Identifier: Apache-2.0 */
/* Finds modules that were generated when the program was built. */
#include "model/symbolic/symbolic.h"

/* The build writes MODULE(NAME_dynamics) for each module */
#define MODULE(function) const struct dynamics_module *function(void);
#include "dynamics/builtin.inc"
#undef MODULE

const struct dynamics_module *symbolic_builtin(const struct robot *robot)
{
    static const struct dynamics_module *(*const entry[])(void) = {
#define MODULE(function) function,
#include "dynamics/builtin.inc"
#undef MODULE
        NULL,
    };

    for (size_t n = 0; entry[n]; n++) {
        const struct dynamics_module *module = dynamics_module_used(entry[n]());

        if (dynamics_module_fits(module, robot)) {
            return module;
        }
    }
    return NULL;
}

enum error_code dynamics_choose(const struct robot *robot, bool numeric, struct arena *arena,
                                struct dynamics *out, struct error *notice, struct error *error)
{
    const struct dynamics_module *module = symbolic_builtin(robot);

    if (numeric) {
        error_set(notice, ERROR_NONE, "numeric dynamics, as the rig says");
    } else if (module) {
        error_set(notice, ERROR_NONE, "built-in generated dynamics (%s)", module->variant);
        return dynamics_generated(robot, module, arena, out, error);
    } else {
        error_set(notice, ERROR_NONE, "numeric dynamics: generated dynamics of %s are not built in",
                  robot->name);
    }
    return dynamics_generic(robot, arena, out, error);
}
