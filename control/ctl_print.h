/* SPDX-License-Identifier: Apache-2.0 */
/* Prints answers of the control socket (control/control.h) for a person, for `coman-hil ctl`.
 * Not RT-safe. */
#ifndef CONTROL_CTL_PRINT_H
#define CONTROL_CTL_PRINT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Makes a line of the server printable (text_make_printable) and parses it into an answer, the
 * caller's, whose names and texts hold nothing that a terminal may obey: the server need not be
 * ours. NULL = it is no JSON, or memory is used up. */
json_t *ctl_parse_printable(char *line);

void ctl_print_hello(const json_t *answer, FILE *out);
void ctl_print_status(const json_t *answer, FILE *out);
void ctl_print_statistics(const json_t *answer, FILE *out);

/* Prints any of the lists. */
void ctl_print_list(const json_t *answer, FILE *out);

/* Prints the tunable that get answers. */
void ctl_print_tunable(const json_t *answer, FILE *out);

/* Prints the moment at which the loop has carried a command out: tick, time, hash. */
void ctl_print_moment(const char *what, const json_t *answer, FILE *out);

/* Print the titles of the answer to a subscribe, and its rows, aligned or as CSV like
 * signals.csv. */
void ctl_print_titles(const json_t *answer, bool csv, FILE *out);
void ctl_print_row(const json_t *answer, const json_t *row, bool csv, FILE *out);

#endif
