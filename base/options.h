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
    STATUS_FAILED = 1,      /* the run itself failed: a task failed, stopped on an overrun */
    STATUS_INPUT = 2,       /* wrong command line, file or value */
    STATUS_SYSTEM = 3,      /* the system refused a call, or there is no memory */
    STATUS_UNSUPPORTED = 4, /* this machine or build cannot do it */
};

enum option_type {
    OPTION_FLAG,   /* value: bool, set to true */
    OPTION_STRING, /* value: const char *, an element of argv; never empty */
    OPTION_REAL,   /* value: double, finite, from min to max */
    OPTION_INT,    /* value: int64_t, from min to max (within +-2^53) */
    OPTION_ENUM,   /* value: int, that of one of words */
    OPTION_LIST,   /* value: struct option_list; the option may stand more than once */
};

enum { OPTION_LIST_MAX = 32 };

struct option_list {
    size_t count;
    const char *item[OPTION_LIST_MAX];
};

/* The value starts as the default and is left alone when the option is not given. */
struct option_spec {
    const char *name; /* "--duration" */
    enum option_type type;
    const char *argument; /* what --help calls the argument: "S"; NULL for a flag */
    const char *help;     /* what it does and its default; wrapped when printed */
    void *value;
    double min, max;          /* of OPTION_REAL and OPTION_INT, inclusive; both needed */
    bool above_min;           /* OPTION_REAL: min itself is no value */
    const char *unit;         /* for messages: "seconds"; NULL = none */
    const struct word *words; /* of OPTION_ENUM, ends with word NULL */
    const char *noun;         /* as of an operand */
    const char *letter;       /* a second name, "-o"; NULL = none */
};

/* An argument without dashes. Those that must be given come first. */
struct operand_spec {
    const char *name; /* "RIG" */
    const char *help;
    bool required;
    const char **value;       /* NULL stays when it is optional and not given */
    const char *const **list; /* instead of value, where there may be many: NULL at their end */
    /* What a shell completes it to, beside files: what "coman-hil list NOUN --names" prints, or
     * these words, NULL at the end. Neither: files. */
    const char *noun;
    const char *const *words;
};

struct command_spec {
    const char *name;                 /* "run" */
    const char *summary;              /* one line, the same as in the table of commands */
    const struct option_spec *option; /* at most 64 */
    size_t noption;
    const struct operand_spec *operand;
    size_t noperand;
    bool many;           /* the last operand may stand more than once */
    const char *manual;  /* paragraphs printed at the end of --help, or NULL */
    const char *program; /* whose command it is; NULL = "coman-hil" */
};

/* Parses the arguments after argv[0]. --name VALUE and --name=VALUE are the same; -- ends the
 * options. The list of a last operand is in argv, whose words move for it and which ends with NULL.
 * Sets *help and stops when --help or -h stands before anything wrong. The error names
 * the option, what was found and what was expected. */
enum error_code options_parse(const struct command_spec *spec, int argc, char **argv, bool *help,
                              struct error *error);

/* Prints the command's manual, made from the table. */
void options_help(const struct command_spec *spec, FILE *out);

/* The same as the source of a manual page, for scdoc(1). */
void options_page(const struct command_spec *spec, FILE *out);

/* options_parse for the main of a command. False when the command must return *status at once,
 * because the manual was printed (by --help, or for other programs by --help=scdoc or =table
 * alone) or the error was reported on stderr. */
bool options_read(const struct command_spec *spec, int argc, char **argv, int *status);

/* Returns the exit status of a command that ended with an error. */
enum exit_status exit_status_of(enum error_code code);

/* Prints "coman-hil COMMAND: text" on stderr and returns the exit status of the error. */
int command_fail(const char *command, const struct error *error);

/* The same with the names of program and command from the table. */
int options_fail(const struct command_spec *spec, const struct error *error);

/* Ends a command: returns STATUS_OK, or what options_fail returns. */
int options_end(const struct command_spec *spec, enum error_code code, const struct error *error);

/* Flushes standard output at a program's end and returns its exit status: a full disk or a closed
 * pipe must not look like success. */
int options_flush_output(int status);

/* Prints text wrapped at 80 columns, every line but the first indented, and what goes on a line
 * that begins with spaces by these and two more; used is the column that the first line starts
 * in. */
void options_wrap(const char *text, int used, int indent, FILE *out);

/* Copies a manual with list in the place of the line "  @MARK@" (mark is "@MARK@"), which must be
 * there. list: lines with an end each, or "". Cut off at size. */
void options_insert(char *out, size_t size, const char *text, const char *mark, const char *list);

#endif
