/* SPDX-License-Identifier: Apache-2.0 */
/* The modules that were generated when the program was built, and what is taken where none fits. */
#include "model/symbolic/builtin.h"

#include <string.h>

/* MODULE(NAME_dynamics) for each of them, written by the build */
#define MODULE(function) const struct dynamics_module *function(void);
#include "dynamics/builtin.inc"
#undef MODULE

/* The first that fits, among those with mass properties as inputs or those without. */
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

static const struct symbolic_options fastest = {.lanes = 4, .this_cpu = true};

enum symbolic_state dynamics_fastest_state(const struct robot *robot, const char *folder,
                                           struct error *reason)
{
    return symbolic_state(robot, &fastest, folder, reason);
}

/* A module that is there, or is waited for; else reason says why not. */
static enum error_code open_library(const struct robot *robot, const char *folder,
                                    const struct dynamics_compiling *compiling,
                                    struct symbolic_library *library, struct error *reason)
{
    struct symbolic_options options = fastest;

    options.progress = compiling->progress;
    if (compiling->when == DYNAMICS_COMPILE_NEVER) {
        return error_set(reason, ERROR_UNSUPPORTED, "not looked for, as asked");
    }
    if (!folder) {
        return error_set(reason, ERROR_UNSUPPORTED, "no cache folder");
    }
    if (compiling->when == DYNAMICS_COMPILE_WAIT) {
        return symbolic_build(robot, &options, folder, library, reason);
    }
    if (!symbolic_find(robot, &options, folder, library, NULL)) {
        return ERROR_NONE;
    }
    switch (symbolic_build_in_background(robot, &options, folder, compiling->loop_cpu, reason)) {
    case SYMBOLIC_COMPILED: /* since */
        return symbolic_find(robot, &options, folder, library, reason);
    case SYMBOLIC_COMPILING:
        if (!reason->text[0]) {
            error_set(reason, ERROR_UNSUPPORTED,
                      "these are compiled in the background, for the next start");
        }
        break;
    case SYMBOLIC_MISSING:
    case SYMBOLIC_FAILED:
        break;
    }
    return ERROR_UNSUPPORTED;
}

/* Dynamics by a built-in module. */
static enum error_code take_builtin(const struct robot *robot, const struct dynamics_module *module,
                                    struct arena *arena, struct dynamics *out, struct error *notice,
                                    struct error *error)
{
    error_set(notice, ERROR_NONE, "built-in generated dynamics%s (%s)",
              module->ninertia ? " with masses as inputs" : "", module->variant);
    return dynamics_generated(robot, module, arena, out, error);
}

enum error_code dynamics_fastest(const struct robot *robot, const char *folder,
                                 const struct dynamics_compiling *compiling, struct arena *arena,
                                 struct dynamics *out, struct symbolic_library *library,
                                 struct error *notice, struct error *error)
{
    const struct dynamics_module *module = symbolic_builtin(robot);
    struct error reason;

    memset(library, 0, sizeof *library);
    if (module) {
        return take_builtin(robot, module, arena, out, notice, error);
    }
    if (!open_library(robot, folder, compiling, library, &reason)) {
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

enum error_code dynamics_built_in(const struct robot *robot, struct arena *arena,
                                  struct dynamics *out, struct error *notice, struct error *error)
{
    const struct dynamics_module *module = symbolic_builtin(robot);

    if (module) {
        return take_builtin(robot, module, arena, out, notice, error);
    }
    error_set(notice, ERROR_NONE,
              "numeric dynamics, several times slower than generated ones: no code is compiled for "
              "added masses");
    return dynamics_generic(robot, arena, out, error);
}
