/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Options of a command. One table parses the command line, and prints the command's --help and its
 * manual page. The exit statuses of all commands are also here. Not RT-safe.
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

/* One option. *value has the default before the parsing. It keeps the default if the option is
 * absent. */
struct option_spec {
    const char *name; /* for example "--duration" */
    enum option_type type;
    const char *argument; /* name of the value in --help: "S"; NULL for a flag */
    const char *help;     /* effect and default; wrapped at print */
    void *value;
    double min, max;          /* range of OPTION_REAL and OPTION_INT, inclusive; both required */
    bool above_min;           /* OPTION_REAL: min itself is not allowed */
    const char *unit;         /* unit in messages: "seconds"; NULL = none */
    const struct word *words; /* for OPTION_ENUM, ends with word NULL */
    const char *noun;         /* noun for completion, as in operand_spec */
    const char *letter;       /* a second name, "-o"; NULL = none */
};

/* An argument without dashes. Required operands come before optional ones. */
struct operand_spec {
    const char *name; /* for example "RIG" */
    const char *help;
    bool required;
    const char **value;       /* stays NULL if an optional operand is absent */
    const char *const **list; /* for several operands, in place of value; ends with NULL */
    /* What a shell completes, besides files: the names that "coman-hil list NOUN --names" prints,
     * or these words (NULL at the end). If both are NULL, only files. */
    const char *noun;
    const char *const *words;
};

struct command_spec {
    const char *name;                 /* for example "run" */
    const char *summary;              /* one line for the list of commands */
    const struct option_spec *option; /* at most 64 */
    size_t noption;
    const struct operand_spec *operand;
    size_t noperand;
    bool many;           /* the last operand may be repeated */
    const char *manual;  /* paragraphs at the end of --help, or NULL */
    const char *program; /* name of the program; NULL = "coman-hil" */
};

/* Set the members of a command_spec for an array of options or of operands. */
#define OPTION_TABLE(rows) .option = (rows), .noption = sizeof(rows) / sizeof *(rows)
#define OPERAND_TABLE(rows) .operand = (rows), .noperand = sizeof(rows) / sizeof *(rows)

/* Parses the arguments after argv[0]. "--name VALUE" and "--name=VALUE" mean the same. "--" ends
 * the options. If the last operand may be repeated, its words stay in argv, moved to the front, and
 * end with NULL. --help or -h sets *help and stops, unless an error comes first. An error names the
 * option, what was found and what was expected. */
enum error_code options_parse(const struct command_spec *spec, int argc, char **argv, bool *help,
                              struct error *error);

/* Prints the manual of a command from its table. */
void options_help(const struct command_spec *spec, FILE *out);

/* Prints the manual page as source for scdoc(1). */
void options_page(const struct command_spec *spec, FILE *out);

/* Parses the arguments of a command's main with options_parse. Returns false if the command must
 * return *status immediately. Then it has printed the manual, or the error on stderr. Alone on the
 * command line, --help=scdoc prints the manual page's source, and --help=table the rows for
 * completion. */
bool options_read(const struct command_spec *spec, int argc, char **argv, int *status);

/* Returns the exit status that belongs to an error code. */
enum exit_status exit_status_of(enum error_code code);

/* Prints "coman-hil COMMAND: text" on stderr and returns the exit status of the error. */
int command_fail(const char *command, const struct error *error);

/* Does the same as command_fail, with the names of program and command from the table. */
int options_fail(const struct command_spec *spec, const struct error *error);

/* Ends a command. Returns STATUS_OK, or the result of options_fail for an error. */
int options_end(const struct command_spec *spec, enum error_code code, const struct error *error);

/* Flushes standard output at the end of a program and returns the exit status. A full disk or a
 * closed pipe thus does not look like success. */
int options_flush_output(int status);

/* Prints text wrapped at 80 columns. `used` is the column where the first line starts. All other
 * lines are indented by `indent`. If a line begins with spaces, its continuation is indented by
 * these spaces plus two. */
void options_wrap(const char *text, int used, int indent, FILE *out);

/* Copies a manual into `out`, at most `size` bytes. Replaces the line " @MARK@" by `list`. `mark`
 * is "@MARK@"; the manual must contain it. `list` consists of complete lines, or is "". */
void options_insert(char *out, size_t size, const char *text, const char *mark, const char *list);

#endif
