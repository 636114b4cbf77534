/* SPDX-License-Identifier: Apache-2.0 */
/* Prints answers of the control socket (control/control.h) as text for `coman-hil ctl`. Not
 * RT-safe. */
#ifndef CONTROL_CTL_PRINT_H
#define CONTROL_CTL_PRINT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Makes a line printable (text_make_printable) and parses it. The server may be a foreign program;
 * its names and texts cannot control a terminal. The caller owns the answer. Returns NULL if the
 * line is not JSON, or out of memory. */
json_t *ctl_parse_printable(char *line);

void ctl_print_hello(const json_t *answer, FILE *out);
void ctl_print_status(const json_t *answer, FILE *out);
void ctl_print_statistics(const json_t *answer, FILE *out);

/* Prints the answer to list. */
void ctl_print_list(const json_t *answer, FILE *out);

/* Prints the tunable in the answer to get. */
void ctl_print_tunable(const json_t *answer, FILE *out);

/* Prints tick, time and state hash at which a command took effect. what: text before them. */
void ctl_print_moment(const char *what, const json_t *answer, FILE *out);

/* Print the titles and the rows of a subscription, aligned or as CSV like signals.csv. */
void ctl_print_titles(const json_t *answer, bool csv, FILE *out);
void ctl_print_row(const json_t *answer, const json_t *row, bool csv, FILE *out);

#endif
