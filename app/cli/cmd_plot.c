/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil plot: draws signals of a recording (signals.csv) as line plots, SVG or PNG. */
#include "app/cli/cli.h"
#include "app/report/signals.h"
#include "app/report/svg.h"
#include "base/array.h"
#include "base/text.h"
#include "base/whole_file.h"
#include "manual/plot.h"

#include <fnmatch.h>
#include <stdlib.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

/* Size of a panel, px, and maximum number of panels: one per signal. */
enum { PANEL_WIDTH = 900, PANEL_HEIGHT = 360, PANELS_MAX = SIGNALS_MAX };

/* Units at the end of signal titles, and their axis labels; longer endings first. */
static const struct unit {
    const char *ending, *label;
} units[] = {
    {"_rad_s", "angular rate, rad/s"},
    {"_m_s2", "acceleration, m/s\xc2\xb2"},
    {"_rad", "angle, rad"},
    {"_nm", "torque, N m"},
    {"_n", "force, N"},
    {"_m", "position, m"},
    {"_a", "current, A"},
    {"_v", "voltage, V"},
    {"_t", "magnetic flux density, T"},
    {"_pa", "pressure, Pa"},
};

struct plot_options {
    const char *given, *output;
    char file[PATH_MAX]; /* path of signals.csv */
    struct option_list names;
    double span[2];
    bool list;
};

/* Returns the axis label of a title, from its unit; "" if it has none. */
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

/* ---- selection of signals ---- */

/* Selects the titles that match names or patterns, in file order. A name without a match is kept,
 * so that reading the file reports it. */
static enum error_code plot_choose(const struct option_list *names, const char *const *title,
                                   size_t ntitle, const char *chosen[SIGNALS_MAX], size_t *count,
                                   struct error *error)
{
    *count = 0;
    for (size_t i = 0; i < names->count; i++) {
        bool matched = false;

        /* The step after the last title adds the name itself if no title has matched */
        for (size_t k = 0; k <= ntitle; k++) {
            const char *name = k < ntitle ? title[k] : names->item[i];

            if (k < ntitle ? fnmatch(names->item[i], name, FNM_NOESCAPE) != 0 : matched) {
                continue;
            }
            matched = true;
            if (TEXT_INDEX(chosen, *count, name) >= 0) {
                continue;
            }
            if (*count == SIGNALS_MAX) {
                return error_set(error, ERROR_INPUT,
                                 "--signal: found more than %d signals, expected fewer",
                                 SIGNALS_MAX);
            }
            chosen[(*count)++] = name;
        }
    }
    return ERROR_NONE;
}

/* ---- drawing ---- */

/* Arranges the signals in panels: one per unit, in order of appearance, and another if a panel has
 * no color left. Returns the number of panels. */
static size_t plot_arrange(const char *const *name, const struct signals *signals, const char *x,
                           struct svg_series *series, struct svg_plot *panel)
{
    size_t npanel = 0;

    for (size_t i = 0; i < signals->nsignal; i++) {
        const char *label = plot_axis_of(name[i]);
        struct svg_series *own;
        size_t p = 0;

        /* The first panel with that unit and a color left, or a new one */
        while (p < npanel &&
               (strcmp(panel[p].y.label, label) != 0 || panel[p].nseries == SVG_SERIES_MAX)) {
            p++;
        }
        if (p == npanel) {
            panel[npanel] = svg_panel("", x, label, series + p * SVG_SERIES_MAX, 0);
            panel[npanel].width = PANEL_WIDTH;
            panel[npanel++].height = PANEL_HEIGHT;
        }
        own = series + p * SVG_SERIES_MAX + panel[p].nseries++;
        *own =
            svg_line(name[i], signals->value[0], signals->value[i + 1], signals->count, SVG_LINE);
    }
    return npanel;
}

/* Returns whether a file name has this ending, in upper or lower case. */
static bool plot_ends_in(const char *path, const char *end)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');

    return dot && !strcasecmp(dot, end);
}

/* Refuses a file name with another format's ending. A name without an ending is an SVG file or a
 * device. */
static enum error_code plot_check_output(const char *path, struct error *error)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');

    return !dot || plot_ends_in(path, ".svg") || plot_ends_in(path, ".png")
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "--output: found %.200s, expected a name that ends in .svg or .png: "
                           "plot writes no other format",
                           path);
}

/* Writes the panels as SVG, or as PNG if the file name ends with .png; NULL: standard output. */
static enum error_code plot_write(const struct svg_plot *panel, size_t npanel, const char *path,
                                  struct error *error)
{
    struct whole_file file;
    enum error_code code;

    if (!path) {
        return svg_write_panels(panel, npanel, stdout, error);
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    code = plot_ends_in(path, ".png") ? png_write_panels(panel, npanel, file.out, error)
                                      : svg_write_panels(panel, npanel, file.out, error);
    return whole_file_close(&file, code, error);
}

/* Reads the chosen signals and draws them. */
static enum error_code plot_signals(const struct plot_options *o, const char *const *name,
                                    size_t count, struct error *error)
{
    static struct svg_series series[PANELS_MAX * SVG_SERIES_MAX];
    static struct svg_plot panel[PANELS_MAX];
    struct signals signals;
    enum error_code code =
        signals_read(o->file, name, count, o->span[0], o->span[1], &signals, error);

    if (!code && signals.count == 0) {
        struct signals all;

        /* Refuse a time span without rows in the file; the error gives the file's span */
        code = signals_read(o->file, name, 1, -1e9, 1e9, &all, error);
        if (!code) {
            code = all.count == 0 ? error_set(error, ERROR_INPUT,
                                              "%.200s: found no row, expected some", o->file)
                                  : error_set(error, ERROR_INPUT,
                                              "--from, --to: found no row from %g to %g s, "
                                              "expected times within %g to %g s",
                                              o->span[0], o->span[1], all.value[0][0],
                                              all.value[0][all.count - 1]);
        }
        signals_free(&all);
    } else if (!code) {
        const char *x = !strcmp(signals.first_title, "time_s") ? "time, s" : signals.first_title;
        size_t npanel = plot_arrange(name, &signals, x, series, panel);

        code = plot_write(panel, npanel, o->output, error);
    }
    signals_free(&signals);
    return code;
}

/* Lists the titles of the file, or plots the selected ones. */
static enum error_code plot_file(const struct plot_options *o, struct error *error)
{
    const char *chosen[SIGNALS_MAX], **title;
    size_t ntitle, count;
    enum error_code code = signals_titles(o->file, &title, &ntitle, error);

    if (code) {
        return code;
    }
    for (size_t i = 0; i < ntitle && o->list; i++) {
        puts(title[i]);
    }
    if (!o->list) {
        code = plot_choose(&o->names, title, ntitle, chosen, &count, error);
        code = code ? code : plot_signals(o, chosen, count, error);
    }
    free(title);
    return code;
}

/* Finds the file of signals, from its path or from the directory of its recording. */
static enum error_code plot_find_file(struct plot_options *o, struct error *error)
{
    struct stat there;
    bool folder = stat(o->given, &there) == 0 && S_ISDIR(there.st_mode);

    if (snprintf(o->file, sizeof o->file, "%s%s", o->given, folder ? "/signals.csv" : "") >=
        (int)sizeof o->file) {
        return error_set(error, ERROR_INPUT, "the name of the file is too long");
    }
    if (folder && access(o->file, F_OK)) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found no signals.csv in the directory, expected a recording with "
                         "one (run --record %.200s --record-format csv or both)",
                         o->given, o->given);
    }
    return ERROR_NONE;
}

int cmd_plot(int argc, char **argv)
{
    static struct plot_options o = {.span = {-1e9, 1e9}};
    static const struct option_spec options[] = {
        {"--signal", OPTION_LIST, "NAME",
         "a signal by its title in the file, or a pattern such as 'q_*Knee*_rad'; may be given "
         "more than once",
         .value = &o.names},
        {"--list", OPTION_FLAG, NULL, "print the titles of the signals, draw nothing",
         .value = &o.list},
        {"--output", OPTION_STRING, "FILE",
         "file to write: SVG, or PNG when its name ends in .png; by default SVG on standard "
         "output, unless that is a terminal",
         .value = &o.output, .letter = "-o"},
        {"--from", OPTION_REAL, "S", "first second to plot", .value = &o.span[0], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
        {"--to", OPTION_REAL, "S", "last second to plot", .value = &o.span[1], .min = -1e9,
         .max = 1e9, .unit = "seconds"},
    };
    static const struct operand_spec operands[] = {
        {"FILE", "signals.csv of a recording, or the recording's directory", true,
         .value = &o.given}};
    static const struct command_spec spec = {
        .name = "plot",
        .summary = "Plot signals of a recording.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_PLOT,
    };
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* Refuses an empty selection, and an SVG on a terminal */
    if (o.names.count == 0 && !o.list) {
        error_set(&error, ERROR_INPUT,
                  "--signal: found none, expected one or more; --list prints their names");
        return options_fail(&spec, &error);
    }
    if (!o.output && !o.list && isatty(STDOUT_FILENO)) {
        error_set(&error, ERROR_INPUT,
                  "found a terminal to write an SVG to, expected --output FILE.svg or FILE.png");
        return options_fail(&spec, &error);
    }
    if (o.span[0] > o.span[1]) {
        error_set(&error, ERROR_INPUT, "--from: found %g s behind --to %g s, expected it before",
                  o.span[0], o.span[1]);
        return options_fail(&spec, &error);
    }
    if (o.output && plot_check_output(o.output, &error)) {
        return options_fail(&spec, &error);
    }
    code = plot_find_file(&o, &error);
    code = code ? code : plot_file(&o, &error);
    return options_end(&spec, code, &error);
}
