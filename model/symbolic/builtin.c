/* SPDX-License-Identifier: Apache-2.0 */
/* The modules that were generated when the program was built. */
#include "model/symbolic/builtin.h"

#include <string.h>

/* MODULE(NAME_dynamics) for each of them, written by the build */
#define MODULE(function) const struct dynamics_module *function(void);
#include "dynamics/builtin.inc"
#undef MODULE

/* Returns the first module that fits, among those with mass properties as inputs or those
 * without; NULL when there is none. */
static const struct dynamics_module *find_builtin(const struct robot *robot, bool inputs)
{
    static const struct dynamics_module *(*const entry[])(void) = {
#define MODULE(function) function,
#include "dynamics/builtin.inc"
#undef MODULE
        NULL,
    };

    for (size_t n = 0; entry[n]; n++) {
        const struct dynamics_module *module = dynamics_module_used(entry[n]());

        if ((module->ninertia > 0) == inputs && dynamics_module_fits(module, robot)) {
            return module;
        }
    }
    return NULL;
}

const struct dynamics_module *symbolic_builtin_exact(const struct robot *robot)
{
    return find_builtin(robot, false);
}

const struct dynamics_module *symbolic_builtin(const struct robot *robot)
{
    const struct dynamics_module *exact = symbolic_builtin_exact(robot);

    return exact ? exact : find_builtin(robot, true);
}
