/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a run has left and is read again, and may have been edited in between: an input that begins
 * with '{' is a plan or a result of one of its cases, with '#' the sweep plans are made of; any
 * other is signals.csv behind a first line of the titles wanted. Refused with its place, or finite
 * numbers of which a plot is made.
 */
#include "app/report/signals.h"
#include "app/report/svg.h"
#include "app/sweep/plan.h"
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

/* Refused in a sentence that names the file. */
static void check_refusal(enum error_code code, const char *path, const struct error *error)
{
    if (!code) {
        fuzz_tally.taken++;
        return;
    }
    fuzz_require(error->code == ERROR_INPUT && fuzz_is_sentence(error->text) &&
                     !strncmp(error->text, path, strlen(path)),
                 "%s", error->text);
    fuzz_tally.refused++;
}

/* A plan of cases and the result of one. */
static void read_plan(const char *text, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    struct plan_result result;
    struct error error = {0};
    struct plan plan;
    char path[128];

    fuzz_write_file("plan.json", text, size);
    snprintf(path, sizeof path, "%s/plan.json", fuzz_folder());
    check_refusal(plan_read(path, 0, 0, arena, &plan, &error), path, &error);
    error = (struct error){0};
    check_refusal(plan_read(path, 1, 1, arena, &plan, &error), path, &error);
    error = (struct error){0};
    check_refusal(plan_read_result(path, arena, &result, &error), path, &error);
}

static void read_sweep(const char *text, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    struct error error = {0};
    struct sweep sweep;
    char path[128];

    fuzz_write_file("sweep.yaml", text, size);
    snprintf(path, sizeof path, "%s/sweep.yaml", fuzz_folder());
    check_refusal(sweep_read(path, arena, &sweep, &error), path, &error);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char path[128];

    if (size > 0 && data[0] == '{') {
        read_plan((const char *)data, size);
        return 0;
    }
    if (size > 0 && data[0] == '#') {
        read_sweep((const char *)data, size);
        return 0;
    }
    snprintf(path, sizeof path, "%s/signals.csv", fuzz_folder());
    read_signals((const char *)data, size, path);
    return 0;
}
