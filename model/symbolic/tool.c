/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The generator as a program of the build: [--inertia-inputs] ROBOT.yaml FILE.c NAME [VARIANT], for
 * a module function NAME_dynamics. The user's command is coman-hil generate, which itself contains
 * what this program writes.
 */
#include "model/symbolic/symbolic.h"

#include <stdio.h>
#include <string.h>

int main(int argc, char **argv)
{
    struct symbolic_options options = {.lanes = 4};
    const struct robot *robot;
    struct robot *named;
    enum error_code code;
    struct error error;
    struct arena arena;
    FILE *file;

    if (argc > 1 && strcmp(argv[1], "--inertia-inputs") == 0) {
        options.inertia_inputs = true;
        argv++;
        argc--;
    }
    if (argc != 4 && argc != 5) {
        fprintf(stderr, "usage: generate_dynamics [--inertia-inputs] ROBOT.yaml FILE.c NAME "
                        "[VARIANT]\n");
        return 2;
    }
    if (arena_init(&arena, (size_t)64 << 20, &error) ||
        robot_load(argv[1], argc == 5 ? argv[4] : NULL, &arena, &robot, &error) ||
        robot_copy(robot, &arena, &named, &error)) {
        fprintf(stderr, "%s\n", error.text);
        return 2;
    }

    /* The module is called as the build says, not as the robot is */
    named->name = argv[3];

    /* A file that is not complete does not stay */
    file = fopen(argv[2], "w");
    if (!file) {
        perror(argv[2]);
        return 3;
    }
    code = symbolic_generate(named, &options, file, NULL, &error);
    if (fclose(file) && !code) {
        code = error_set(&error, ERROR_SYSTEM, "%s cannot be written", argv[2]);
    }
    if (code) {
        fprintf(stderr, "%s\n", error.text);
        remove(argv[2]);
    }
    arena_fini(&arena);
    return code ? 3 : 0;
}
