/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil generate: writes the C code of a robot's dynamics. */
#include "app/cli/commands.h"

#include "base/arena.h"
#include "model/symbolic/symbolic.h"
#include "base/options.h"
#include "base/whole_file.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define ARENA_BYTES ((size_t)64 << 20)

enum { PATH_SIZE = 1024 };

static const char manual[] =
    "Writes NAME_dynamics.c into the folder, NAME being the robot's name: forward dynamics with "
    "and "
    "without external wrenches and with the added inertias of the implicit integrator, inverse "
    "dynamics, kinematics and accelerations of the bodies that carry frames, energy. The file "
    "needs "
    "nothing but a C compiler and libm; compile it with -O2. It holds a plain C, an AVX2 and an "
    "AVX-512 variant and chooses by the CPU that it runs on. Its interface is "
    "struct dynamics_module, declared in the file itself; its only external function is "
    "NAME_dynamics. The same robot gives the same bytes.\n"
    "\n"
    "The operation counts that are printed are floating-point additions, multiplications and "
    "divisions of one call, a SIMD lane counting as one; sines and cosines are counted apart.";

static void print_report(const struct robot *robot, const struct symbolic_report *report,
                         const char *path)
{
    printf("robot     %s, %zu degrees of freedom, hash %016" PRIx64 "\n", robot->name, robot->nv,
           robot->hash);
    printf("groups    %zu of %zu bodies (like limbs side by side)\n", report->groups, robot->nbody);
    printf("function            add  multiply  divide   total  angles\n");
    for (int f = 0; f < SYMBOLIC_FUNCTIONS; f++) {
        const struct symbolic_count *count = &report->count[f];

        printf("  %-16s %5zu  %8zu  %6zu  %6zu  %6zu\n", count->function, count->add,
               count->multiply, count->divide, count->operations, count->sincos);
    }
    printf("written   %s\n", path);
}

static enum error_code write_module(const struct robot *robot,
                                    const struct symbolic_options *options, const char *path,
                                    struct symbolic_report *report, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    code = symbolic_generate(robot, options, file.out, report, error);
    return whole_file_close(&file, code, error);
}

static enum error_code generate(const char *file, const char *variant, const char *folder,
                                const struct symbolic_options *options, struct arena *arena,
                                struct error *error)
{
    char path[PATH_SIZE], symbol[SYMBOLIC_SYMBOL];
    struct symbolic_report report;
    const struct robot *robot;
    enum error_code code;

    code = robot_load(file, variant, arena, &robot, error);
    if (code) {
        return code;
    }
    symbolic_symbol(robot, symbol);
    if ((size_t)snprintf(path, sizeof path, "%s/%s.c", folder, symbol) >= sizeof path) {
        return error_set(error, ERROR_INPUT, "the folder's name is too long");
    }
    code = write_module(robot, options, path, &report, error);
    if (!code) {
        print_report(robot, &report, path);
    }
    return code;
}

int cmd_generate(int argc, char **argv)
{
    static const struct option_word lanes[] = {{"1", 1}, {"2", 2}, {"4", 4}, {NULL, 0}};
    struct symbolic_options symbolic = {.lanes = 4};
    const char *file = NULL, *variant = NULL, *folder = ".";
    const struct option_spec options[] = {
        {.name = "-o",
         .type = OPTION_STRING,
         .argument = "DIR",
         .help = "folder to write into, which must exist; the present one by default",
         .value = &folder},
        {.name = "--variant",
         .type = OPTION_STRING,
         .argument = "NAME",
         .help = "variant of the robot file",
         .value = &variant},
        {.name = "--lanes",
         .type = OPTION_ENUM,
         .argument = "N",
         .help = "at most so many like limbs side by side; 4 by default",
         .value = &symbolic.lanes,
         .words = lanes},
    };
    const struct operand_spec operands[] = {{"ROBOT", "the robot file", true, &file}};
    const struct command_spec spec = {.name = "generate",
                                      .summary = "write C code for the dynamics of a robot",
                                      .option = options,
                                      .noption = sizeof options / sizeof options[0],
                                      .operand = operands,
                                      .noperand = 1,
                                      .manual = manual};
    struct arena arena;
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (arena_init(&arena, ARENA_BYTES, &error)) {
        return command_fail(argv[0], &error);
    }
    code = generate(file, variant, folder, &symbolic, &arena, &error);
    arena_fini(&arena);
    return code ? command_fail(argv[0], &error) : STATUS_OK;
}
