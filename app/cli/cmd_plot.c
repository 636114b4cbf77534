/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil plot: signals of a recording (signals.csv) as an SVG line plot. */
#include "app/cli/commands.h"

#include "app/report/signals.h"
#include "app/report/svg.h"
#include "base/count.h"
#include "base/options.h"
#include "base/whole_file.h"
#include "manual/plot.h"

#include <stdio.h>
#include <string.h>

/* The unit at the end of a signal's title, and the label of its axis. */
static const struct unit {
    const char *ending, *label;
} units[] = {
    {"_rad", "angle, rad"}, {"_nm", "torque, N m"}, {"_n", "force, N"},
    {"_m", "position, m"},  {"_a", "current, A"},   {"_v", "voltage, V"},
};

static const char *plot_axis_of(const char *title)
{
    for (size_t i = 0; i < ARRAY_COUNT(units); i++) {
        size_t length = strlen(title), end = strlen(units[i].ending);

        if (length > end && !strcmp(title + length - end, units[i].ending)) {
            return units[i].label;
        }
    }
    return "";
}

/* The label that all of them share, or none. */
static const char *common_axis(const struct option_list *names)
{
    for (size_t i = 1; i < names->count; i++) {
        if (plot_axis_of(names->item[i]) != plot_axis_of(names->item[0])) {
            return "";
        }
    }
    return plot_axis_of(names->item[0]);
}

static enum error_code plot_draw_signals(const struct option_list *names,
                                         const struct signals *signals, const char *title,
                                         const char *path, struct error *error)
{
    struct svg_series series[SVG_SERIES_MAX];
    bool time = !strcmp(signals->first_title, "time_s");
    struct svg_plot plot = {.title = title,
                            .x = {.label = time ? "time, s" : signals->first_title},
                            .y = {.label = common_axis(names)},
                            .series = series,
                            .nseries = signals->nsignal,
                            .width = 900,
                            .height = 360};
    struct whole_file file;
    enum error_code code = path ? whole_file_open(&file, path, error) : ERROR_NONE;

    if (code) {
        return code;
    }
    for (size_t i = 0; i < signals->nsignal; i++) {
        series[i] = (struct svg_series){.name = names->item[i],
                                        .x = signals->value[0],
                                        .y = signals->value[i + 1],
                                        .count = signals->count,
                                        .style = SVG_LINE};
    }
    code = svg_write(&plot, path ? file.out : stdout, error);
    return path ? whole_file_close(&file, code, error) : code;
}

static enum error_code plot_file(const char *path, const struct option_list *names,
                                 const double span[2], const char *title, const char *output,
                                 struct error *error)
{
    struct signals signals;
    enum error_code code =
        signals_read(path, names->item, names->count, span[0], span[1], &signals, error);

    if (!code) {
        code = plot_draw_signals(names, &signals, title, output, error);
    }
    signals_free(&signals);
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
        {"--from", OPTION_REAL, "S", "first second to plot", .value = &span[0], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
        {"--to", OPTION_REAL, "S", "last second to plot", .value = &span[1], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
    };
    static const struct operand_spec operands[] = {
        {"FILE", "signals.csv of a recording", true, .value = &file}};
    static const struct command_spec spec = {
        .name = "plot",
        .summary = "Plot signals of a recording.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_PLOT,
    };
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    /* A plot has as many colors */
    if (names.count == 0 || names.count > SVG_SERIES_MAX) {
        error_set(&error, ERROR_INPUT, "--signal: found %zu, expected 1 to %d of them", names.count,
                  SVG_SERIES_MAX);
        return options_fail(&spec, &error);
    }
    code = plot_file(file, &names, span, title, output, &error);
    return options_end(&spec, code, &error);
}
