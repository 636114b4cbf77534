/* SPDX-License-Identifier: Apache-2.0 */
/* Reads signals from a recording. */
#include "app/report/signals.h"

#include "base/csv.h"
#include "base/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    /* largest number of values: an hour of five signals at 1 kHz is 18 million */
    POINTS_MAX = 20000000,
};

/* A CSV file and the columns to read; the file's first column is first. */
struct table {
    struct csv *csv;
    size_t chosen[SIGNALS_MAX + 1];
};

/* Opens a CSV file. Refuses a file with fewer than two titles. */
static enum error_code signals_open_table(const char *path, struct csv **csv, struct error *error)
{
    enum error_code code = csv_open(path, csv, error);

    if (code || (*csv)->ncolumn >= 2) {
        return code;
    }
    csv_close(*csv);
    return error_set(error, ERROR_INPUT,
                     "%s:1: found no titles, expected those of signals.csv: time_s,...", path);
}

/* Finds the columns of the signals. Suggests the nearest title for a missing one. */
static enum error_code select_signals(struct table *table, const char *const *name, size_t count,
                                      struct signals *signals, struct error *error)
{
    const struct csv *csv = table->csv;

    for (size_t i = 0; i < count; i++) {
        const int column = TEXT_INDEX(csv->title, csv->ncolumn, name[i]);

        if (column < 0) {
            const char *nearest = text_nearest(name[i], csv->title, csv->ncolumn);

            return error_set(error, ERROR_INPUT,
                             "found no signal \"%.100s\" in %s, expected one of its titles%s%s",
                             name[i], csv->path, nearest ? "; the nearest is " : "",
                             nearest ? nearest : "");
        }
        table->chosen[++signals->nsignal] = (size_t)column;
    }
    return ERROR_NONE;
}

/* Doubles the number of allocated rows. Refuses more than POINTS_MAX values. */
static enum error_code signals_grow(struct signals *signals, struct error *error)
{
    size_t capacity = signals->capacity ? 2 * signals->capacity : 4096;

    if (capacity * (signals->nsignal + 1) > POINTS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found more than %d values, expected fewer: "
                         "choose a shorter time or fewer signals",
                         POINTS_MAX);
    }
    for (size_t i = 0; i <= signals->nsignal; i++) {
        double *value = realloc(signals->value[i], capacity * sizeof *value);

        if (!value) {
            return error_set(error, ERROR_MEMORY, "no memory for %zu values", capacity);
        }
        signals->value[i] = value;
    }
    signals->capacity = capacity;
    return ERROR_NONE;
}

/* Stores the chosen cells of the current row. Skips a row whose first number is outside [from,
 * to]. */
static enum error_code signals_take_row(const struct table *table, struct signals *signals,
                                        double from, double to, struct error *error)
{
    const double *cell = table->csv->cell;

    if (cell[0] < from || cell[0] > to) {
        return ERROR_NONE;
    }
    if (signals->count == signals->capacity) {
        enum error_code code = signals_grow(signals, error);

        if (code) {
            return code;
        }
    }
    for (size_t i = 0; i <= signals->nsignal; i++) {
        signals->value[i][signals->count] = cell[table->chosen[i]];
    }
    signals->count++;
    return ERROR_NONE;
}

/* Reads all rows of a table. */
static enum error_code signals_read_table(struct table *table, const char *const *title,
                                          size_t ntitle, double from, double to,
                                          struct signals *signals, struct error *error)
{
    enum error_code code = select_signals(table, title, ntitle, signals, error);

    snprintf(signals->first_title, sizeof signals->first_title, "%s", table->csv->title[0]);
    while (!code) {
        bool end;

        code = csv_next(table->csv, &end, error);
        if (code || end) {
            return code;
        }
        code = signals_take_row(table, signals, from, to, error);
    }
    return code;
}

/* ---- the file ---- */

enum error_code signals_read(const char *path, const char *const *title, size_t ntitle, double from,
                             double to, struct signals *signals, struct error *error)
{
    struct table table = {.csv = NULL};
    enum error_code code;

    *signals = (struct signals){.nsignal = 0};
    if (ntitle > SIGNALS_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu signals to read, expected at most %d",
                         ntitle, SIGNALS_MAX);
    }
    code = signals_open_table(path, &table.csv, error);
    if (!code) {
        code = signals_read_table(&table, title, ntitle, from, to, signals, error);
        csv_close(table.csv);
    }
    return code;
}

enum error_code signals_titles(const char *path, const char ***title, size_t *count,
                               struct error *error)
{
    struct csv *csv;
    enum error_code code = signals_open_table(path, &csv, error);
    size_t bytes = 0;
    char *text;

    *title = NULL;
    if (code) {
        return code;
    }

    /* One allocation: the pointers, then the texts of the titles */
    for (size_t i = 1; i < csv->ncolumn; i++) {
        bytes += strlen(csv->title[i]) + 1;
    }
    *title = malloc(csv->ncolumn * sizeof **title + bytes);
    if (!*title) {
        code = error_set(error, ERROR_MEMORY, "no memory");
    } else {
        text = (char *)(*title + csv->ncolumn);
        *count = csv->ncolumn - 1;
        for (size_t i = 0; i < *count; i++) {
            (*title)[i] = text;
            text = stpcpy(text, csv->title[i + 1]) + 1;
        }
    }
    csv_close(csv);
    return code;
}

void signals_free(struct signals *signals)
{
    for (size_t i = 0; i <= SIGNALS_MAX; i++) {
        free(signals->value[i]);
        signals->value[i] = NULL;
    }
}
