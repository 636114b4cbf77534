/* SPDX-License-Identifier: Apache-2.0 */
/* A program with several commands: the table of commands, and the usage. argv[1] selects the
 * command. Not RT-safe. */
#ifndef BASE_PROGRAM_H
#define BASE_PROGRAM_H

#include <stddef.h>
#include <stdio.h>

/* A command. argv[0] of `run` is the command's name. `run` returns an enum exit_status
 * (base/options.h). */
struct program_command {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
};

struct program {
    const char *name;  /* for example "coman-hil" */
    const char *noun;  /* word for a command in messages: "command" or "benchmark" */
    const char *about; /* one sentence above the usage */
    const struct program_command *command;
    size_t ncommand;
    void (*print_more)(FILE *out); /* prints the end of the usage; NULL = nothing */
};

/* Runs the command that argv[1] names, then flushes its output. Call it as the whole main. --help
 * runs the command `help` if it exists, else prints the usage. --version prints the version.
 * --completion=bash, =zsh or =fish prints the completion script of the shell. Returns the exit
 * status. */
int program_main(const struct program *program, int argc, char **argv);

void program_print_usage(const struct program *program, FILE *out);
void program_print_version(const struct program *program);

/* Finds a command by its name. Returns NULL if there is none. */
const struct program_command *program_find(const struct program *program, const char *name);

/* Prints on stderr that `name` is not a command. Suggests the nearest word among the commands and
 * the words `more` (nmore). Returns the exit status. */
int program_refuse(const struct program *program, const char *name, const char *const *more,
                   size_t nmore);

#endif
