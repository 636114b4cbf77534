/* SPDX-License-Identifier: Apache-2.0 */
/* Runs a program that has several commands. */
#include "base/program.h"

#include "base/completion.h"
#include "base/options.h"
#include "base/text.h"

#include <string.h>
#include <sys/resource.h>

enum { NAMES_MAX = 64, SUMMARY_COLUMN = 14 };

/* Minimum stack of every command and its threads, bytes. The loop touches 256 KiB of it in
 * advance. */
enum { STACK_LEAST = 512 * 1024 };

const struct program_command *program_find(const struct program *program, const char *name)
{
    const int at = TEXT_FIND(program->command, program->ncommand, name, name);

    return at < 0 ? NULL : &program->command[at];
}

void program_print_usage(const struct program *program, FILE *out)
{
    fprintf(out, "usage: %s COMMAND [OPTIONS] [ARGUMENTS]\n\n%s\n\n", program->name,
            program->about);
    for (size_t i = 0; i < program->ncommand; i++) {
        fprintf(out, "  %-12s", program->command[i].name);
        options_wrap(program->command[i].summary, SUMMARY_COLUMN, SUMMARY_COLUMN, out);
    }
    fprintf(out, "\n%s COMMAND --help prints the manual of a %s.\n", program->name, program->noun);
    fprintf(out, "%s --completion=bash (or zsh, fish) prints that shell's completion.\n",
            program->name);
    if (program->print_more) {
        program->print_more(out);
    }
}

void program_print_version(const struct program *program)
{
    printf("%s %s\n", program->name, HIL_VERSION);
}

int program_refuse(const struct program *program, const char *name, const char *const *more,
                   size_t nmore)
{
    const char *names[NAMES_MAX], *nearest;
    size_t count = 0;

    for (size_t i = 0; i < program->ncommand && count < NAMES_MAX; i++) {
        names[count++] = program->command[i].name;
    }
    for (size_t i = 0; i < nmore && count < NAMES_MAX; i++) {
        names[count++] = more[i];
    }
    nearest = text_nearest(name, names, count);
    fprintf(stderr, "%s: found unknown %s%s \"%.100s\", expected %s%s%s", program->name,
            program->noun, nmore ? " or topic" : "", name,
            nearest ? "\"" : "one that is listed by --help", nearest ? nearest : "",
            nearest ? "\"" : "");
    for (size_t i = 0; i < nmore && !nearest; i++) {
        fprintf(stderr, "%s%s", i ? ", " : "; the topics are ", more[i]);
    }
    fputc('\n', stderr);
    return STATUS_INPUT;
}

int program_main(const struct program *program, int argc, char **argv)
{
    const struct program_command *command;
    struct rlimit stack;
    bool help;

    if (argc < 2) {
        program_print_usage(program, stderr);
        return STATUS_INPUT;
    }
    if (!strcmp(argv[1], "--version")) {
        program_print_version(program);
        return options_flush_output(STATUS_OK);
    }
    if (!strncmp(argv[1], "--completion=", 13) && completion_print(program, argv[1] + 13)) {
        return options_flush_output(STATUS_OK);
    }
    help = !strcmp(argv[1], "--help") || !strcmp(argv[1], "-h");
    command = program_find(program, help ? "help" : argv[1]);
    if (command && !getrlimit(RLIMIT_STACK, &stack) && stack.rlim_cur < STACK_LEAST) {
        fprintf(stderr,
                "%s: found a stack limit of %llu KiB (RLIMIT_STACK), expected at least %d KiB: "
                "raise it with \"ulimit -s 8192\"\n",
                program->name, (unsigned long long)stack.rlim_cur / 1024, STACK_LEAST / 1024);
        return STATUS_SYSTEM;
    }
    if (command) {
        return options_flush_output(command->run(argc - 1, argv + 1));
    }
    if (!help) {
        return program_refuse(program, argv[1], NULL, 0);
    }
    program_print_usage(program, stdout);
    return options_flush_output(STATUS_OK);
}
