/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A program of several commands: the table of them, its usage, and how argv[1] chooses one.
 * Not RT-safe.
 */
#ifndef BASE_PROGRAM_H
#define BASE_PROGRAM_H

#include <stddef.h>
#include <stdio.h>

/* argv[0] of run is the command's name; it returns an enum exit_status (base/options.h). */
struct program_command {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
};

struct program {
    const char *name;  /* "coman-hil" */
    const char *noun;  /* what its messages call a command: "command", "benchmark" */
    const char *about; /* a sentence on top of the usage */
    const struct program_command *command;
    size_t ncommand;
    void (*print_more)(FILE *out); /* the end of the usage; NULL = nothing */
};

/* Runs a whole main: the command that argv[1] names, and flushes what it printed. --help is the
 * command help where there is one, else the usage; --version prints the version,
 * --completion=bash or =zsh the script by which that shell completes command lines. Returns the
 * exit status. */
int program_main(const struct program *program, int argc, char **argv);

void program_print_usage(const struct program *program, FILE *out);
void program_print_version(const struct program *program);

/* Finds a command by its name; NULL = there is none. */
const struct program_command *program_find(const struct program *program, const char *name);

/* Says on stderr that name is no command, with the nearest of the commands and of more (nmore
 * further words); returns the exit status for it. */
int program_refuse(const struct program *program, const char *name, const char *const *more,
                   size_t nmore);

#endif
