/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil generate: writes the C code of a robot's dynamics, or compiles it for runs of a rig. */
#include "app/cli/commands.h"

#include "app/cli/rig_command.h"
#include "base/arena.h"
#include "base/array.h"
#include "base/options.h"
#include "base/whole_file.h"
#include "manual/generate.h"
#include "model/symbolic/builtin.h"
#include "sim/robot_dynamics.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

enum { PATH_SIZE = 1024 };

/* Prints how many operations each generated function takes. */
static void print_report(const struct robot *robot, const struct symbolic_report *report,
                         const char *path)
{
    printf("robot     %s, %zu degrees of freedom, hash %016" PRIx64 "\n", robot->name, robot->nv,
           robot->hash);
    printf("groups    %zu of %zu bodies (identical limbs side by side)\n", report->groups,
           robot->nbody);
    printf("function            add  multiply  divide   total  angles\n");
    for (int f = 0; f < SYMBOLIC_FUNCTIONS; f++) {
        const struct symbolic_count *count = &report->count[f];

        printf("  %-16s %5zu  %8zu  %6zu  %6zu  %6zu\n", count->function, count->add,
               count->multiply, count->divide, count->operations, count->sincos);
    }
    printf("written   %s\n", path);
}

/* Generates the C source of a robot's dynamics into a file. */
static enum error_code generate_write_module(const struct robot *robot,
                                             const struct symbolic_options *options,
                                             const char *path, struct symbolic_report *report,
                                             struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    code = symbolic_generate(robot, options, file.out, report, error);
    return whole_file_close(&file, code, error);
}

struct generate_options {
    const char *robot, *variant, *folder;
    struct symbolic_options symbolic;
};

/* Generates the source of a robot into the folder that the options name. */
static enum error_code generate_file(const void *context, const struct robot *robot,
                                     struct arena *arena, struct error *error)
{
    const struct generate_options *o = context;
    char path[PATH_SIZE], symbol[SYMBOLIC_SYMBOL];
    struct symbolic_report report;
    enum error_code code;

    (void)arena;
    symbolic_symbol(robot, symbol);
    if ((size_t)snprintf(path, sizeof path, "%s/%s.c", o->folder, symbol) >= sizeof path) {
        return error_set(error, ERROR_INPUT, "the folder's name is too long");
    }
    code = generate_write_module(robot, &o->symbolic, path, &report, error);
    if (code) {
        return code;
    }
    print_report(robot, &report, path);
    return ERROR_NONE;
}

/* ---- modules ---- */

/* Compiles the module of a robot into the folder, unless there is one. */
static enum error_code generate_compile(const struct robot *robot, const char *folder,
                                        struct error *error)
{
    struct symbolic_library library;
    enum error_code code;

    if (!symbolic_find(robot, &robot_dynamics_module, folder, &library, NULL)) {
        printf("the dynamics of %s are in %s already\n", robot->name, folder);
        symbolic_close(&library);
        return ERROR_NONE;
    }
    fprintf(stderr, "compiling the dynamics of %s: some seconds for each ten of its %zu joints\n",
            robot->name, robot->njoint);

    /* Others may read what root makes; nobody else may write there, or the module would not be
     * loaded */
    umask(022);
    code = folder_make_all(folder, error);
    code = code ? code : symbolic_build(robot, &robot_dynamics_module, folder, &library, error);
    if (!code) {
        printf("the dynamics of %s are in %s now\n", robot->name, folder);
        symbolic_close(&library);
    }
    return code;
}

/* Compiles the module of a rig's robot, unless its dynamics are built in. */
static int generate_module(void *options, const struct rig *rig, struct arena *arena)
{
    char folder[PATH_SIZE];
    struct error error;
    enum error_code code;

    (void)options;
    (void)arena;
    if (symbolic_builtin(rig->robot)) {
        printf("the dynamics of %s are built in\n", rig->robot->name);
        return STATUS_OK;
    }

    /* The module goes where runs look for it */
    code = robot_dynamics_folder(folder, sizeof folder)
               ? generate_compile(rig->robot, folder, &error)
               : error_set(&error, ERROR_SYSTEM,
                           "found no folder for the module, expected XDG_CACHE_HOME or HOME to "
                           "name one");
    if (code) {
        return command_fail("generate", &error);
    }
    if (rig->dynamics == RIG_DYNAMICS_GENERIC) {
        printf("%s has dynamics: generic; with dynamics: fastest it takes them\n", rig->file);
    }
    return STATUS_OK;
}

int cmd_generate(int argc, char **argv)
{
    static const struct word lanes[] = {{"1", 1}, {"2", 2}, {"4", 4}, {NULL, 0}};
    struct generate_options o = {.symbolic = {.lanes = 4}};
    bool module = false;
    const struct option_spec options[] = {
        {"--output", OPTION_STRING, "DIR",
         "folder to write into, which must exist; the current one by default", .value = &o.folder,
         .letter = "-o"},
        {"--variant", OPTION_STRING, "NAME", "variant of the robot file", .value = &o.variant},
        {"--lanes", OPTION_ENUM, "N",
         "at most this many identical limbs side by side; 4 by default", .value = &o.symbolic.lanes,
         .words = lanes},
        {"--module", OPTION_FLAG, NULL,
         "compile the robot of a rig, for all runs that compute with its dynamics",
         .value = &module},
    };
    const struct operand_spec operands[] = {{"ROBOT",
                                             "a robot's file or name; with --module a rig's", true,
                                             &o.robot, .noun = "robots"}};
    const struct command_spec spec = {
        .name = "generate",
        .summary = "Write C code for the dynamics of a robot, or compile it for runs of a rig.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_GENERATE,
    };
    struct error error;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* A module is found by its robot, so nothing about it can be chosen */
    if (module && (o.folder || o.variant || o.symbolic.lanes != 4)) {
        error_set(&error, ERROR_INPUT,
                  "found --module with --output, --variant or --lanes: a module is that of the "
                  "rig's robot, in the folder where runs look for it");
        return command_fail("generate", &error);
    }
    o.folder = o.folder ? o.folder : ".";
    return module ? rig_command("generate", o.robot, &o, generate_module)
                  : robot_command("generate", o.robot, o.variant, &o, generate_file);
}
