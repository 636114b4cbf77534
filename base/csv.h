/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads a table of numbers row by row from a text file. Lines that begin with # may come first. The
 * next line has the titles. Commas separate the columns. An error in the file is ERROR_INPUT with
 * file:line. Not RT-safe.
 */
#ifndef BASE_CSV_H
#define BASE_CSV_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

enum { CSV_COLUMNS_MAX = 1024, CSV_LINE_BYTES = 1 << 16 };

struct csv {
    const char *path;
    size_t ncolumn; /* number of columns, 1 or more */
    const char *title[CSV_COLUMNS_MAX];
    double cell[CSV_COLUMNS_MAX]; /* values of the last row read (ncolumn) */
    long line;                    /* number of the last line read, from 1 */
    struct csv_source *source;
};

/* Open a table and read its titles: from a file, or from `size` bytes of memory. For memory,
 * messages use `path` as the name. The arguments must outlive the table. After an error nothing is
 * open. Errors: ERROR_INPUT, ERROR_SYSTEM, ERROR_MEMORY. */
enum error_code csv_open(const char *path, struct csv **csv, struct error *error);
enum error_code csv_open_memory(const char *path, const void *bytes, size_t size, struct csv **csv,
                                struct error *error);

/* Reads the next row into cell; sets *end at the end of the file. Every cell must be a finite
 * number. */
enum error_code csv_next(struct csv *csv, bool *end, struct error *error);

/* Closes the table; NULL is allowed. */
void csv_close(struct csv *csv);

#endif
