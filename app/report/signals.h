/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads the signals of a recording from signals.csv: a line of titles, then rows of numbers, time
 * first (rt/recording/recorder.h). Not RT-safe.
 */
#ifndef APP_REPORT_SIGNALS_H
#define APP_REPORT_SIGNALS_H

#include "base/error.h"

#include <stddef.h>

enum { SIGNALS_MAX = 64 };

/* The chosen columns, which have one length. */
struct signals {
    char first_title[64];           /* title of the first column, the time */
    size_t nsignal, count;          /* number of columns beside the first; number of rows */
    double *value[SIGNALS_MAX + 1]; /* the first column, then the chosen ones in the given order */
    size_t capacity;
};

/* Reads the first column and the columns with these titles (at most SIGNALS_MAX). Keeps rows whose
 * first number is in [from, to]. An error in the file is ERROR_INPUT with file:line. Call
 * signals_free afterwards, even after an error. */
enum error_code signals_read(const char *path, const char *const *title, size_t ntitle, double from,
                             double to, struct signals *signals, struct error *error);

/* Lists the titles of a file except the first. *title has count pointers in one allocation, which
 * the caller frees. Returns the same errors as signals_read. */
enum error_code signals_titles(const char *path, const char ***title, size_t *count,
                               struct error *error);

/* Frees the columns. Safe on a zeroed struct. */
void signals_free(struct signals *signals);

#endif
