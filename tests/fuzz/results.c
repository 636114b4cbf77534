/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a run has left and is read again, and may have been edited in between: an input that begins
 * with '<' is a JUnit file to be merged, any other is signals.csv behind a first line of the titles
 * wanted. Refused with its place, or finite numbers of which a plot is made.
 */
#include "app/scenario/jobs.h"
#include "app/report/signals.h"
#include "app/report/svg.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

enum { TITLES = 8 };

static bool has_line(const char *message, const char *path)
{
    const size_t length = strlen(path);
    long line;

    return fuzz_is_sentence(message) && strncmp(message, path, length) == 0 &&
           sscanf(message + length, ":%ld:", &line) == 1 && line >= 1;
}

static void check_plot(const struct signals *signals)
{
    struct svg_series series[TITLES] = {0};
    struct svg_plot plot = {.title = "t", .x.label = "x", .y.label = "y", .series = series};
    struct fuzz_text text;
    struct error error;

    for (size_t i = 0; i < signals->nsignal && i < SVG_SERIES_MAX; i++, plot.nseries++) {
        series[i] = (struct svg_series){"s", signals->value[0], signals->value[i + 1],
                                        signals->count, SVG_LINE};
    }
    fuzz_text_open(&text);
    if (svg_write(&plot, text.file, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_is_sentence(error.text), "%s", error.text);
        fuzz_text_finish(&text);
    } else {
        fuzz_text_finish(&text);
        fuzz_require(!strstr(text.text, "nan") && !strstr(text.text, "inf"), "%s", text.text);
    }
    fuzz_text_free(&text);
}

static void check_signals(const char *path, const char *const *title, size_t ntitle)
{
    struct signals signals;
    struct error error = {0};

    if (signals_read(path, title, ntitle, -1e9, 1e9, &signals, &error)) {
        fuzz_require(error.code == ERROR_INPUT &&
                         (has_line(error.text, path) || strstr(error.text, "found no signal")),
                     "%s", error.text);
        fuzz_tally.refused++;
    } else {
        fuzz_require(signals.nsignal == ntitle, "%zu signals", signals.nsignal);
        for (size_t i = 0; i <= ntitle; i++) {
            for (size_t k = 0; k < signals.count; k++) {
                fuzz_require(isfinite(signals.value[i][k]), "%g", signals.value[i][k]);
            }
        }
        check_plot(&signals);
        fuzz_tally.taken++;
    }
    signals_free(&signals);
}

static void read_signals(const char *text, size_t size, const char *path)
{
    const char *newline = memchr(text, '\n', size), *title[TITLES];
    const size_t length = newline ? (size_t)(newline - text) : size;
    char line[256], *at = line;
    size_t ntitle = 0;

    snprintf(line, sizeof line, "%.*s", (int)(length < sizeof line ? length : sizeof line - 1),
             text);
    while (at && ntitle < TITLES) {
        title[ntitle++] = strsep(&at, ",");
    }
    fuzz_write_file("signals.csv", newline ? newline + 1 : "", newline ? size - length - 1 : 0);
    check_signals(path, title, ntitle);
}

static void merge(const char *text, size_t size)
{
    char from[128], to[128];
    const char *files[1] = {from};
    size_t tests = 0, failed = 0, again = 0;
    struct error error = {0};

    fuzz_write_file("from.xml", text, size);
    snprintf(from, sizeof from, "%s/from.xml", fuzz_folder());
    snprintf(to, sizeof to, "%s/to.xml", fuzz_folder());
    if (scenario_junit_merge(files, 1, to, &tests, &failed, &error)) {
        fuzz_require(error.code == ERROR_INPUT && has_line(error.text, from), "%s", error.text);
        fuzz_tally.refused++;
        return;
    }
    /* what was merged can be merged */
    files[0] = to;
    fuzz_require(scenario_junit_merge(files, 1, from, &again, &failed, &error) == ERROR_NONE, "%s",
                 error.text);
    fuzz_require(again == tests, "%zu tests, then %zu", tests, again);
    fuzz_tally.taken++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char path[128];

    if (size > 0 && data[0] == '<') {
        merge((const char *)data, size);
        return 0;
    }
    snprintf(path, sizeof path, "%s/signals.csv", fuzz_folder());
    read_signals((const char *)data, size, path);
    return 0;
}
