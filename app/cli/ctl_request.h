/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil ctl: converts the words of a command line to a request for the control
 * socket (control/control.h), and prints its answer. Not RT-safe.
 */
#ifndef APP_CLI_CTL_REQUEST_H
#define APP_CLI_CTL_REQUEST_H

#include "base/error.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* The words of a command line after the program's name. */
struct ctl_options {
    const char *command, *socket, *udp; /* udp: destination of rows; NULL = standard output */
    const char *const *word;            /* the command's arguments; ends with NULL */
    size_t nword;
    double period_ms;
    int64_t rows;
    bool json, csv;
};

/* A command of ctl. */
struct ctl_command {
    const char *name;
    size_t least, most;   /* number of arguments */
    const char *key[2];   /* keys of the first arguments; further ones are KEY=VALUE */
    const char *expected; /* description of the arguments, for messages */
    /* Prints an answer; NULL: prints tick, time and hash */
    void (*print)(const json_t *answer, FILE *out);
};

/* Adds the arguments to a request that has "cmd". Omits a value if there is no memory; the server
 * then refuses the request. */
enum error_code ctl_make_request(const struct ctl_command *command, const struct ctl_options *o,
                                 json_t *request, struct error *error);

/* Returns the names of all commands, NULL at the end. */
const char *const *ctl_command_names(void);

/* Returns the command with a name; otherwise NULL with an error that suggests the nearest one. */
const struct ctl_command *ctl_find_command(const char *name, struct error *error);

#endif
