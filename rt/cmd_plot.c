/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil plot: signals of a recording (signals.csv) as an SVG line plot. */
#include "base/text.h"
#include "rt/commands.h"
#include "rt/options.h"
#include "rt/svg.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLUMNS_MAX = 1024,
    LINE_MAX_BYTES = 1 << 16,
    POINTS_MAX = 20000000, /* values kept: an hour of eight signals at 1 kHz is 29 million */
};

/* A CSV file of numbers under one line of titles. */
struct table {
    const char *path;
    FILE *file;
    char *line, *titles; /* LINE_MAX_BYTES each */
    const char *title[COLUMNS_MAX];
    size_t ncolumn;
    long row; /* line of the file */
};

/* What is plotted: x first, then the chosen signals. */
struct selection {
    size_t column[SVG_SERIES_MAX + 1];
    double *value[SVG_SERIES_MAX + 1];
    size_t nsignal, count, capacity;
};

static enum error_code read_line(struct table *table, bool *end, struct error *error)
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

static enum error_code read_titles(struct table *table, struct error *error)
{
    bool end;
    enum error_code code = read_line(table, &end, error);

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

static enum error_code select_signals(const struct table *table, const struct option_list *names,
                                      struct selection *selection, struct error *error)
{
    selection->column[0] = 0;
    for (size_t i = 0; i < names->count; i++) {
        size_t column = 0;

        while (column < table->ncolumn && strcmp(table->title[column], names->item[i]) != 0) {
            column++;
        }
        if (column == table->ncolumn) {
            const char *nearest = text_nearest(names->item[i], table->title, table->ncolumn);

            return error_set(error, ERROR_INPUT,
                             "found no signal \"%.100s\" in %s, expected one of its titles%s%s",
                             names->item[i], table->path, nearest ? "; the nearest is " : "",
                             nearest ? nearest : "");
        }
        selection->column[++selection->nsignal] = column;
    }
    return ERROR_NONE;
}

static enum error_code grow(struct selection *selection, struct error *error)
{
    size_t capacity = selection->capacity ? 2 * selection->capacity : 4096;

    if (capacity * (selection->nsignal + 1) > POINTS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found more than %d values to plot, expected fewer: "
                         "choose a shorter time or fewer signals",
                         POINTS_MAX);
    }
    for (size_t i = 0; i <= selection->nsignal; i++) {
        double *value = realloc(selection->value[i], capacity * sizeof *value);

        if (!value) {
            return error_set(error, ERROR_MEMORY, "no memory for %zu values", capacity);
        }
        selection->value[i] = value;
    }
    selection->capacity = capacity;
    return ERROR_NONE;
}

/* takes the selected cells of the present line over; lines outside [from, to] are passed over */
static enum error_code take_row(const struct table *table, struct selection *selection, double from,
                                double to, struct error *error)
{
    double cell[SVG_SERIES_MAX + 1];
    char *at = table->line;

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
        for (size_t i = 0; i <= selection->nsignal; i++) {
            if (selection->column[i] == column) {
                cell[i] = value;
            }
        }
    }
    if (at) {
        return error_set(error, ERROR_INPUT, "%s:%ld: found more than %zu columns", table->path,
                         table->row, table->ncolumn);
    }
    if (cell[0] < from || cell[0] > to) {
        return ERROR_NONE;
    }
    if (selection->count == selection->capacity) {
        enum error_code code = grow(selection, error);

        if (code) {
            return code;
        }
    }
    for (size_t i = 0; i <= selection->nsignal; i++) {
        selection->value[i][selection->count] = cell[i];
    }
    selection->count++;
    return ERROR_NONE;
}

static enum error_code read_table(struct table *table, const struct option_list *names, double from,
                                  double to, struct selection *selection, struct error *error)
{
    enum error_code code = read_titles(table, error);
    bool end = false;

    if (!code) {
        code = select_signals(table, names, selection, error);
    }
    while (!code && !end) {
        code = read_line(table, &end, error);
        if (!code && !end) {
            code = take_row(table, selection, from, to, error);
        }
    }
    return code;
}

static enum error_code draw(const struct table *table, const struct selection *selection,
                            const char *title, const char *path, struct error *error)
{
    struct svg_series series[SVG_SERIES_MAX];
    struct svg_plot plot = {.title = title,
                            .x = {.label = table->title[0]},
                            .y = {.label = ""},
                            .series = series,
                            .nseries = selection->nsignal,
                            .width = 900,
                            .height = 360};
    FILE *out = path ? fopen(path, "w") : stdout;
    enum error_code code;

    if (!out) {
        return error_set_errno(error, errno, "cannot write %s", path);
    }
    for (size_t i = 0; i < selection->nsignal; i++) {
        series[i] = (struct svg_series){.name = table->title[selection->column[i + 1]],
                                        .x = selection->value[0],
                                        .y = selection->value[i + 1],
                                        .count = selection->count,
                                        .style = SVG_LINE};
    }
    code = svg_write(&plot, out, error);
    if (path && fclose(out) && !code) {
        code = error_set_errno(error, errno, "cannot write %s", path);
    }
    return code;
}

static enum error_code plot_file(const char *path, const struct option_list *names,
                                 const double span[2], const char *title, const char *output,
                                 struct error *error)
{
    static struct table table;
    struct selection selection = {.nsignal = 0};
    enum error_code code;

    table.path = path;
    table.file = fopen(path, "r");
    if (!table.file) {
        return error_set(error, ERROR_INPUT, "cannot read %s: %s", path, strerror(errno));
    }
    table.line = malloc(LINE_MAX_BYTES);
    table.titles = malloc(LINE_MAX_BYTES);
    code = table.line && table.titles ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory");
    if (!code) {
        code = read_table(&table, names, span[0], span[1], &selection, error);
    }
    if (!code) {
        code = draw(&table, &selection, title, output, error);
    }
    for (size_t i = 0; i <= SVG_SERIES_MAX; i++) {
        free(selection.value[i]);
    }
    free(table.line);
    free(table.titles);
    fclose(table.file);
    return code;
}

int cmd_plot(int argc, char **argv)
{
    static const char *file, *output, *title = "";
    static struct option_list names;
    static double span[2] = {-1e9, 1e9};
    static const struct option_spec options[] = {
        {"--signal", OPTION_LIST, "NAME", "a signal by its title in the file; up to 8 of them",
         .value = &names},
        {"--output", OPTION_STRING, "FILE", "SVG file to write; standard output by default",
         .value = &output},
        {"--title", OPTION_STRING, "TEXT", "title of the plot", .value = &title},
        {"--from", OPTION_REAL, "S", "first second that is plotted", .value = &span[0], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
        {"--to", OPTION_REAL, "S", "last second that is plotted", .value = &span[1], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
    };
    static const struct operand_spec operands[] = {
        {"FILE", "signals.csv of a recording", true, &file}};
    static const struct command_spec spec = {
        .name = "plot",
        .summary = "Plot signals of a recording.",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 1,
        .manual = "The recording is what \"run --record DIR\" leaves in DIR/signals.csv: a line of "
                  "titles, then numbers, time first. Titles end in the unit, for example "
                  "q_RKneeSag_rad (link), qm_RKneeSag_rad (motor behind the gear), "
                  "torque_RKneeSag_nm, current_RKneeSag_a, voltage_RKneeSag_v, fz_RFoot_n.",
    };
    struct error error;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (names.count == 0 || names.count > SVG_SERIES_MAX) {
        error_set(&error, ERROR_INPUT, "--signal: found %zu, expected 1 to %d of them", names.count,
                  SVG_SERIES_MAX);
        return command_fail(spec.name, &error);
    }
    if (plot_file(file, &names, span, title, output, &error)) {
        return command_fail(spec.name, &error);
    }
    return STATUS_OK;
}
