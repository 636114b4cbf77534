/* SPDX-License-Identifier: Apache-2.0 */
/* A program of several commands: their table, the usage, and the choice by argv[1]. Not RT-safe. */
#ifndef BASE_PROGRAM_H
#define BASE_PROGRAM_H

#include <stddef.h>
#include <stdio.h>

/* argv[0] of run is the command's name; run returns an enum exit_status (base/options.h). */
struct program_command {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
};

struct program {
    const char *name;  /* "coman-hil" */
    const char *noun;  /* word for a command in messages: "command", "benchmark" */
    const char *about; /* one sentence above the usage */
    const struct program_command *command;
    size_t ncommand;
    void (*print_more)(FILE *out); /* the end of the usage; NULL = nothing */
};

/* Runs a whole main: the command that argv[1] names, then flushes its output. --help runs the
 * command `help` if it exists, else prints the usage. --version prints the version.
 * --completion=bash or =zsh prints the shell's completion script. Returns the exit status. */
int program_main(const struct program *program, int argc, char **argv);

void program_print_usage(const struct program *program, FILE *out);
void program_print_version(const struct program *program);

/* Finds a command by its name; NULL = none. */
const struct program_command *program_find(const struct program *program, const char *name);

/* Prints on stderr that name is not a command, with the nearest command or further word (more,
 * nmore). Returns the exit status. */
int program_refuse(const struct program *program, const char *name, const char *const *more,
                   size_t nmore);

#endif
