/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil generate: writes the C code of a robot's dynamics. */
#include "app/cli/cli.h"

#include "base/whole_file.h"
#include "manual/generate.h"
#include "model/symbolic/symbolic.h"

#include <inttypes.h>

enum { PATH_SIZE = 1024 };

struct generate_options {
    const char *robot, *variant, *folder;
    struct symbolic_options symbolic;
};

/* Writes the source for a robot to the folder in the options. */
static enum error_code generate_file(const void *context, const struct robot *robot,
                                     struct arena *arena, struct error *error)
{
    const struct generate_options *o = context;
    char path[PATH_SIZE], symbol[SYMBOLIC_SYMBOL];
    struct symbolic_report report;
    struct whole_file file;
    enum error_code code;

    (void)arena;
    symbolic_symbol(robot, symbol);
    if ((size_t)snprintf(path, sizeof path, "%s/%s.c", o->folder, symbol) >= sizeof path) {
        return error_set(error, ERROR_INPUT, "the folder's name is too long");
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    code = symbolic_generate(robot, &o->symbolic, file.out, &report, error);
    code = whole_file_close(&file, code, error);
    if (!code) {
        /* Prints the number of operations of each generated function */
        printf("robot     %s, %zu degrees of freedom, hash %016" PRIx64 "\n", robot->name,
               robot->nv, robot->hash);
        printf("groups    %zu of %zu bodies (identical limbs side by side)\n", report.groups,
               robot->nbody);
        printf("function            add  multiply  divide   total  angles\n");
        for (int f = 0; f < SYMBOLIC_FUNCTIONS; f++) {
            const struct symbolic_count *count = &report.count[f];

            printf("  %-16s %5zu  %8zu  %6zu  %6zu  %6zu\n", count->function, count->add,
                   count->multiply, count->divide, count->operations, count->sincos);
        }
        printf("written   %s\n", path);
    }
    return code;
}

int cmd_generate(int argc, char **argv)
{
    static const struct word lanes[] = {{"1", 1}, {"2", 2}, {"4", 4}, {NULL, 0}};
    struct generate_options o = {.symbolic = {.lanes = 4}};
    const struct option_spec options[] = {
        {"--output", OPTION_STRING, "DIR",
         "folder to write into, which must exist; the current one by default", .value = &o.folder,
         .letter = "-o"},
        {"--variant", OPTION_STRING, "NAME", "variant of the robot file", .value = &o.variant},
        {"--lanes", OPTION_ENUM, "N",
         "at most this many identical limbs side by side; 4 by default", .value = &o.symbolic.lanes,
         .words = lanes},
    };
    const struct operand_spec operands[] = {
        {"ROBOT", "a robot's file or name", true, &o.robot, .noun = "robots"}};
    const struct command_spec spec = {
        .name = "generate",
        .summary = "Write C code for the dynamics of a robot.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_GENERATE,
    };
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    o.folder = o.folder ? o.folder : ".";
    return robot_command("generate", o.robot, o.variant, &o, generate_file);
}
