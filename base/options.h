/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What every command shares: a table of options that parses the command line and prints the
 * command's --help and manual page, and the exit statuses. Not RT-safe.
 *
 *     static bool quiet;
 *     static double duration = 10.0;
 *     static const char *rig;
 *     static const struct option_spec options[] = {
 *         {"--duration", OPTION_REAL, "S", "stop after S seconds", &duration,
 *          .min = 0.0, .max = 1e6, .unit = "seconds"},
 *         {"--quiet", OPTION_FLAG, NULL, "no status line", &quiet},
 *     };
 *     static const struct operand_spec operands[] = {{"RIG", "the rig file", true, &rig}};
 *     static const struct command_spec spec = {"run", "run a rig", ...};
 *     int status;
 *
 *     if (!options_read(&spec, argc, argv, &status)) {
 *         return status;
 *     }
 */
#ifndef BASE_OPTIONS_H
#define BASE_OPTIONS_H

#include "base/error.h"
#include "base/enum_names.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* The exit statuses of the program. */
enum exit_status {
    STATUS_OK = 0,
    STATUS_FAILED = 1,      /* the run failed: a task failed, or an overrun stopped it */
    STATUS_INPUT = 2,       /* error in the command line, a file or a value */
    STATUS_SYSTEM = 3,      /* the system refused a call, or out of memory */
    STATUS_UNSUPPORTED = 4, /* not possible on this machine or with this build */
};

enum option_type {
    OPTION_FLAG,   /* value: bool, set to true by the option */
    OPTION_STRING, /* value: const char *, an element of argv; never empty */
    OPTION_REAL,   /* value: double, finite, from min to max */
    OPTION_INT,    /* value: int64_t, from min to max (within +-2^53) */
    OPTION_ENUM,   /* value: int, the value of one of `words` */
    OPTION_LIST,   /* value: struct option_list; the option may be repeated */
};

enum { OPTION_LIST_MAX = 32 };

struct option_list {
    size_t count;
    const char *item[OPTION_LIST_MAX];
};

/* *value initially holds the default; it stays if the option is not given. */
struct option_spec {
    const char *name; /* "--duration" */
    enum option_type type;
    const char *argument; /* name of the argument in --help: "S"; NULL for a flag */
    const char *help;     /* effect and default; wrapped when printed */
    void *value;
    double min, max;          /* range of OPTION_REAL and OPTION_INT, inclusive; both required */
    bool above_min;           /* OPTION_REAL: min itself is excluded */
    const char *unit;         /* for messages: "seconds"; NULL = none */
    const struct word *words; /* for OPTION_ENUM, ends with word NULL */
    const char *noun;         /* as in struct operand_spec */
    const char *letter;       /* a second name, "-o"; NULL = none */
};

/* An argument without dashes. Required ones come first. */
struct operand_spec {
    const char *name; /* "RIG" */
    const char *help;
    bool required;
    const char **value;       /* stays NULL when an optional operand is not given */
    const char *const **list; /* instead of value, for several operands: NULL at the end */
    /* Completion in a shell, besides files: the output of "coman-hil list NOUN --names", or these
     * words, NULL at the end. Neither: files only. */
    const char *noun;
    const char *const *words;
};

struct command_spec {
    const char *name;                 /* "run" */
    const char *summary;              /* one line, as in the table of commands */
    const struct option_spec *option; /* at most 64 */
    size_t noption;
    const struct operand_spec *operand;
    size_t noperand;
    bool many;           /* the last operand may be repeated */
    const char *manual;  /* paragraphs at the end of --help, or NULL */
    const char *program; /* name of the program; NULL = "coman-hil" */
};

/* The members of a command_spec for an array of options, and for one of operands. */
#define OPTION_TABLE(rows) .option = (rows), .noption = sizeof(rows) / sizeof *(rows)
#define OPERAND_TABLE(rows) .operand = (rows), .noperand = sizeof(rows) / sizeof *(rows)

/* Parses the arguments after argv[0]. --name VALUE and --name=VALUE are equal; -- ends the options.
 * A list of last operands stays in argv, whose words are moved, and ends with NULL. --help or -h
 * before any error sets *help and stops. The error names the option, what was found and what was
 * expected. */
enum error_code options_parse(const struct command_spec *spec, int argc, char **argv, bool *help,
                              struct error *error);

/* Prints the command's manual from the table. */
void options_help(const struct command_spec *spec, FILE *out);

/* Prints the manual page as source for scdoc(1). */
void options_page(const struct command_spec *spec, FILE *out);

/* Runs options_parse for the main of a command. Returns false when the command must return *status
 * at once: the manual was printed (by --help, or for other programs by --help=scdoc or =table
 * alone), or the error was printed on stderr. */
bool options_read(const struct command_spec *spec, int argc, char **argv, int *status);

/* Returns the exit status of a command that ended with an error. */
enum exit_status exit_status_of(enum error_code code);

/* Prints "coman-hil COMMAND: text" on stderr and returns the exit status of the error. */
int command_fail(const char *command, const struct error *error);

/* Does the same with the names of program and command from the table. */
int options_fail(const struct command_spec *spec, const struct error *error);

/* Ends a command. Returns STATUS_OK, or the result of options_fail. */
int options_end(const struct command_spec *spec, enum error_code code, const struct error *error);

/* Flushes standard output at the end of a program and returns its exit status, because a full disk
 * or a closed pipe must not look like success. */
int options_flush_output(int status);

/* Prints text wrapped at 80 columns; all lines but the first are indented. The continuation of a
 * line that begins with spaces is indented by these spaces and two more. used: column where the
 * first line starts. */
void options_wrap(const char *text, int used, int indent, FILE *out);

/* Copies a manual and replaces the line "  @MARK@" (mark is "@MARK@"), which must exist, by list:
 * complete lines, or "". Truncates at size. */
void options_insert(char *out, size_t size, const char *text, const char *mark, const char *list);

#endif
