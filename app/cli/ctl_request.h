/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil ctl: how the words of a command line become a request of the control
 * socket (control/control.h), and how its answer is printed. Not RT-safe.
 */
#ifndef APP_CLI_CTL_REQUEST_H
#define APP_CLI_CTL_REQUEST_H

#include "base/error.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* The words of a command line, apart from the program's name. */
struct ctl_options {
    const char *command, *socket, *udp; /* udp: where rows are sent; NULL = standard output */
    const char *const *word;            /* the command's arguments; ends with NULL */
    size_t nword;
    double period_ms;
    int64_t rows;
    bool json, csv;
};

/* A command of ctl. */
struct ctl_command {
    const char *name;
    /* Adds the arguments to a request of the caller's, which has "cmd" already. */
    enum error_code (*make)(json_t *request, const struct ctl_options *o, struct error *error);
    void (*print)(const json_t *answer, FILE *out); /* NULL: tick, time and hash are printed */
};

/* Returns the names of all commands, NULL at the end. */
const char *const *ctl_command_names(void);

/* Returns the command of a name, or NULL with an error that names the nearest one. */
const struct ctl_command *ctl_find_command(const char *name, struct error *error);

#endif
