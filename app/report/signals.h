/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Signals of a recording, read back from its signals.csv: a line of titles, then numbers, time
 * first (rt/recording/recorder.h). Not RT-safe.
 */
#ifndef APP_REPORT_SIGNALS_H
#define APP_REPORT_SIGNALS_H

#include "base/error.h"

#include <stddef.h>

enum { SIGNALS_MAX = 64 };

/* The chosen columns, all of one length. */
struct signals {
    char first_title[64];           /* title of the first column, the time */
    size_t nsignal, count;          /* columns beside the first, and rows */
    double *value[SIGNALS_MAX + 1]; /* the first column, then the chosen ones in their order */
    size_t capacity;
};

/* Reads the first column and those with these titles (at most SIGNALS_MAX), of the rows whose first
 * number is within [from, to]. Any fault of the file is ERROR_INPUT with file:line. Memory is the
 * caller's until signals_free, also after an error. */
enum error_code signals_read(const char *path, const char *const *title, size_t ntitle, double from,
                             double to, struct signals *signals, struct error *error);

/* Lists the titles of a file without the first: count pointers in one allocation, which the caller
 * frees. Errors as of signals_read. */
enum error_code signals_titles(const char *path, const char ***title, size_t *count,
                               struct error *error);

/* Frees the columns; safe on a zeroed struct. */
void signals_free(struct signals *signals);

#endif
