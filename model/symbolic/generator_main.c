/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The generator as a build tool: [--fix-base POSE] ROBOT.yaml FILE.c NAME writes a module with the
 * function NAME_dynamics that takes masses as inputs. --fix-base fixes the base at its place in the
 * pose. The users' command is coman-hil generate, which contains the code written by this tool.
 */
#include "model/symbolic/symbolic.h"

#include <stdio.h>
#include <string.h>

/* Fixes the base of a robot at its position in one of the poses. */
static enum error_code tool_fix_base(struct robot *robot, const char *name, struct error *error)
{
    for (size_t p = 0; p < robot->npose; p++) {
        const struct robot_pose *pose = &robot->pose[p];

        if (strcmp(pose->name, name) == 0) {
            return robot_fix_base(robot, pose->base_position, pose->base_quaternion, error);
        }
    }
    return error_set(error, ERROR_INPUT, "%s: found no pose %s", robot->file, name);
}

int main(int argc, char **argv)
{
    const struct symbolic_options options = {.lanes = 4, .inertia_inputs = true};
    const char *pose = NULL;
    const struct robot *robot;
    struct robot *named;
    enum error_code code;
    struct error error;
    struct arena arena;
    FILE *file;

    if (argc > 2 && strcmp(argv[1], "--fix-base") == 0) {
        pose = argv[2];
        argv += 2;
        argc -= 2;
    }
    if (argc != 4) {
        fputs("usage: generate_dynamics [--fix-base POSE] ROBOT.yaml FILE.c NAME\n", stderr);
        return 2;
    }
    if (arena_init(&arena, (size_t)64 << 20, &error) ||
        robot_load(argv[1], NULL, &arena, &robot, &error) ||
        robot_copy(robot, &arena, &named, &error) || (pose && tool_fix_base(named, pose, &error))) {
        fprintf(stderr, "%s\n", error.text);
        return 2;
    }

    /* Use the name given by the build, not the robot's name */
    named->name = argv[3];

    /* Write the file; delete it if it is incomplete */
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
