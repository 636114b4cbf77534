/* SPDX-License-Identifier: Apache-2.0 */
/* Signals of a recording. */
#include "app/report/signals.h"

#include "base/text.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLUMNS_MAX = 1024,
    LINE_MAX_BYTES = 1 << 16,
    POINTS_MAX = 20000000, /* values kept: an hour of five signals at 1 kHz is 18 million */
};

/* A CSV file of numbers under one line of titles. */
struct table {
    const char *path;
    FILE *file;
    char *line, *titles; /* LINE_MAX_BYTES each */
    const char *title[COLUMNS_MAX];
    size_t ncolumn;
    size_t chosen[SIGNALS_MAX + 1]; /* columns that are read, the first of the file first */
    long row;                       /* line of the file */
};

static enum error_code signals_read_line(struct table *table, bool *end, struct error *error)
{
    size_t length;

    *end = !fgets(table->line, LINE_MAX_BYTES, table->file);
    table->row++;
    if (*end) {
        return ferror(table->file) ? error_set_errno(error, errno, "%s", table->path) : ERROR_NONE;
    }
    length = strlen(table->line);
    if (length == LINE_MAX_BYTES - 1) {
        return error_set(error, ERROR_INPUT, "%s:%ld: found a line of more than %d bytes",
                         table->path, table->row, LINE_MAX_BYTES - 2);
    }
    table->line[strcspn(table->line, "\r\n")] = '\0';
    return ERROR_NONE;
}

static enum error_code signals_read_titles(struct table *table, struct error *error)
{
    bool end;
    enum error_code code = signals_read_line(table, &end, error);

    if (code) {
        return code;
    }
    memcpy(table->titles, table->line, LINE_MAX_BYTES);
    for (char *at = end ? NULL : table->titles; at;) {
        char *title = strsep(&at, ",");

        if (table->ncolumn == COLUMNS_MAX) {
            return error_set(error, ERROR_INPUT, "%s:1: found more than %d columns", table->path,
                             COLUMNS_MAX);
        }
        table->title[table->ncolumn++] = title;
    }
    if (table->ncolumn < 2) {
        return error_set(error, ERROR_INPUT,
                         "%s:1: found no titles, expected those of signals.csv: time_s,...",
                         table->path);
    }
    return ERROR_NONE;
}

static enum error_code select_signals(struct table *table, const char *const *name, size_t count,
                                      struct signals *signals, struct error *error)
{
    for (size_t i = 0; i < count; i++) {
        size_t column = 0;

        while (column < table->ncolumn && strcmp(table->title[column], name[i]) != 0) {
            column++;
        }
        if (column == table->ncolumn) {
            const char *nearest = text_nearest(name[i], table->title, table->ncolumn);

            return error_set(error, ERROR_INPUT,
                             "found no signal \"%.100s\" in %s, expected one of its titles%s%s",
                             name[i], table->path, nearest ? "; the nearest is " : "",
                             nearest ? nearest : "");
        }
        table->chosen[++signals->nsignal] = column;
    }
    return ERROR_NONE;
}

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

/* Adds the selected cells of the current line; lines outside [from, to] are skipped. */
static enum error_code signals_take_row(const struct table *table, struct signals *signals,
                                        double from, double to, struct error *error)
{
    double cell[SIGNALS_MAX + 1];
    char *at = table->line;

    /* Every cell must be a number, chosen or not */
    for (size_t column = 0; column < table->ncolumn; column++) {
        const char *text = strsep(&at, ",");
        double value;

        if (!text || !text_to_double(text, &value)) {
            return error_set(error, ERROR_INPUT,
                             "%s:%ld: column %zu (%s): found \"%.40s\", expected "
                             "a number",
                             table->path, table->row, column + 1, table->title[column],
                             text ? text : "");
        }
        for (size_t i = 0; i <= signals->nsignal; i++) {
            if (table->chosen[i] == column) {
                cell[i] = value;
            }
        }
    }
    if (at) {
        return error_set(error, ERROR_INPUT, "%s:%ld: found more than %zu columns", table->path,
                         table->row, table->ncolumn);
    }

    /* A row of the span joins the others */
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
        signals->value[i][signals->count] = cell[i];
    }
    signals->count++;
    return ERROR_NONE;
}

static enum error_code signals_read_table(struct table *table, const char *const *title,
                                          size_t ntitle, double from, double to,
                                          struct signals *signals, struct error *error)
{
    enum error_code code = signals_read_titles(table, error);

    if (code) {
        return code;
    }
    snprintf(signals->first_title, sizeof signals->first_title, "%s", table->title[0]);
    code = select_signals(table, title, ntitle, signals, error);
    while (!code) {
        bool end;

        code = signals_read_line(table, &end, error);
        if (code || end) {
            return code;
        }
        code = signals_take_row(table, signals, from, to, error);
    }
    return code;
}

/* ---- the file ---- */

static void signals_close_table(struct table *table)
{
    if (table && table->file) {
        fclose(table->file);
    }
    if (table) {
        free(table->line);
        free(table->titles);
    }
    free(table);
}

/* Lines are too long for the stack. */
static enum error_code signals_open_table(const char *path, struct table **out, struct error *error)
{
    struct table *table = calloc(1, sizeof *table);
    enum error_code code;

    if (table) {
        table->path = path;
        table->line = malloc(LINE_MAX_BYTES);
        table->titles = malloc(LINE_MAX_BYTES);
    }
    if (!table || !table->line || !table->titles) {
        signals_close_table(table);
        return error_set(error, ERROR_MEMORY, "no memory");
    }
    table->file = fopen(path, "r");
    if (!table->file) {
        code = error_set_file(error, errno, path, "cannot be read");
        signals_close_table(table);
        return code;
    }
    *out = table;
    return ERROR_NONE;
}

enum error_code signals_read(const char *path, const char *const *title, size_t ntitle, double from,
                             double to, struct signals *signals, struct error *error)
{
    struct table *table;
    enum error_code code;

    *signals = (struct signals){.nsignal = 0};
    if (ntitle > SIGNALS_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu signals to read, expected at most %d",
                         ntitle, SIGNALS_MAX);
    }
    code = signals_open_table(path, &table, error);
    if (!code) {
        code = signals_read_table(table, title, ntitle, from, to, signals, error);
        signals_close_table(table);
    }
    return code;
}

enum error_code signals_titles(const char *path, const char ***title, size_t *count,
                               struct error *error)
{
    struct table *table;
    enum error_code code = signals_open_table(path, &table, error);
    char *text;

    *title = NULL;
    if (code) {
        return code;
    }
    code = signals_read_titles(table, error);
    if (!code) {
        *title = malloc(table->ncolumn * sizeof **title + LINE_MAX_BYTES);
        code = *title ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory");
    }
    if (!code) {
        text = (char *)(*title + table->ncolumn);
        memcpy(text, table->titles, LINE_MAX_BYTES);
        *count = table->ncolumn - 1;
        for (size_t i = 0; i < *count; i++) {
            (*title)[i] = text + (table->title[i + 1] - table->titles);
        }
    }
    signals_close_table(table);
    return code;
}

void signals_free(struct signals *signals)
{
    for (size_t i = 0; i <= SIGNALS_MAX; i++) {
        free(signals->value[i]);
        signals->value[i] = NULL;
    }
}
