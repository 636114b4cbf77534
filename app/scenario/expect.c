/* SPDX-License-Identifier: Apache-2.0 */
/* What a scenario expects, judged tick by tick, and plots of what was not met. */
#include "app/scenario/private.h"

#include "app/report/svg.h"

#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum progress { WAITING, OPEN, DECIDED, CLOSED };

struct judged {
    const struct scenario_expectation *what;
    struct scenario_signal signal;
    enum progress progress;
    bool met;
    int64_t decided_ns;
    char text[SCENARIO_TEXT];
    double reference;         /* of a relative signal */
    double lowest, highest;   /* seen in the window */
    uint64_t fresh, count;    /* matches in this tick; in the window */
    int64_t open_ns, last_ns; /* of the window; of the last match */
    double *trace;            /* a sample a tick, for the plot */
};

struct scenario_expectations {
    const struct scenario *scenario;
    size_t count, nsample, max;
    struct judged judged[SCENARIO_EXPECTATIONS_MAX];
    double *time_s;
};

static int64_t ns(double seconds)
{
    return llround(seconds * 1e9);
}

enum error_code scenario_expectations_create(const struct scenario *scenario, const struct rig *rig,
                                             size_t ticks, struct arena *arena,
                                             struct scenario_expectations **out,
                                             struct error *error)
{
    struct scenario_expectations *made = arena_alloc(arena, 1, sizeof *made);
    bool good = made && (made->time_s = arena_alloc(arena, ticks, sizeof *made->time_s));

    for (size_t i = 0; good && i < scenario->nexpectation; i++) {
        struct judged *judged = &made->judged[i];

        judged->what = &scenario->expectation[i];
        judged->lowest = (double)INFINITY;
        judged->highest = -(double)INFINITY;
        judged->decided_ns = -1;
        judged->trace = arena_alloc(arena, ticks, sizeof *judged->trace);
        good = judged->trace != NULL;
        if (good && judged->what->signal_given &&
            scenario_signal_find(judged->what->signal, rig, &judged->what->mark, &judged->signal,
                                 error)) {
            return ERROR_INPUT;
        }
    }
    if (!good) {
        return error_set(error, ERROR_MEMORY,
                         "%s: no memory left for %zu samples of each expectation", scenario->file,
                         ticks);
    }
    made->scenario = scenario;
    made->count = scenario->nexpectation;
    made->max = ticks;
    *out = made;
    return ERROR_NONE;
}

void scenario_expectations_frame(struct scenario_expectations *expectations, size_t bus,
                                 const struct bus_frame *frame)
{
    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];
        const struct scenario_pattern *pattern = &judged->what->frame;

        judged->fresh += judged->what->frame_given && (size_t)pattern->bus_index == bus &&
                         scenario_pattern_matches(pattern, frame);
    }
}

void scenario_expectations_event(struct scenario_expectations *expectations, const char *text)
{
    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];

        judged->fresh += judged->what->event_given && strstr(text, judged->what->event) != NULL;
    }
}

/* ---- judging ---- */

static void decide(struct judged *judged, bool met, int64_t time_ns)
{
    judged->progress = DECIDED;
    judged->met = met;
    judged->decided_ns = time_ns;
}

static const char *subject(const struct judged *judged)
{
    return judged->what->signal_given  ? judged->what->signal
           : judged->what->event_given ? judged->what->event
                                       : "frames";
}

static void fail_band(struct judged *judged, double value, int64_t time_ns)
{
    decide(judged, false, time_ns);
    snprintf(judged->text, sizeof judged->text, "%.96s%s is %.6g at %.4f s, expected %.6g to %.6g",
             subject(judged), judged->what->relative ? " has moved: it" : "", value,
             (double)time_ns * 1e-9, judged->what->band[0], judged->what->band[1]);
}

static void fail_count(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;
    char most[32] = " or more";

    if (band[1] < DBL_MAX) {
        snprintf(most, sizeof most, " to %.0f", band[1]);
    }
    decide(judged, false, time_ns);
    snprintf(judged->text, sizeof judged->text,
             "%.96s seen %" PRIu64 " times until %.4f s, expected %.0f%s", subject(judged),
             judged->count, (double)time_ns * 1e-9, band[0], most);
}

static void fail_period(struct judged *judged, int64_t gap_ns, int64_t time_ns)
{
    decide(judged, false, time_ns);
    snprintf(judged->text, sizeof judged->text,
             "%.6g s without a frame, or between two, at %.4f s, expected %.6g to %.6g s",
             (double)gap_ns * 1e-9, (double)time_ns * 1e-9, judged->what->band[0],
             judged->what->band[1]);
}

static void judge_signal(struct judged *judged, double value, int64_t time_ns)
{
    const double *band = judged->what->band;
    bool inside = value >= band[0] && value <= band[1];

    judged->lowest = fmin(judged->lowest, value);
    judged->highest = fmax(judged->highest, value);
    if (judged->what->look == SCENARIO_BETWEEN && !inside) {
        fail_band(judged, value, time_ns);
    } else if (judged->what->look == SCENARIO_REACHES && inside) {
        decide(judged, true, time_ns);
    }
}

static void judge_period(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;
    int64_t gap_ns = time_ns - judged->last_ns;
    bool first = judged->count == 0; /* since the window opened, not since a frame */
    bool short_gap = judged->fresh > 0 && !first && gap_ns < ns(band[0]);
    bool none = judged->fresh > 1 && band[0] > 0.0; /* several in one tick */

    if (gap_ns > ns(band[1]) || short_gap || none) {
        fail_period(judged, none ? 0 : gap_ns, time_ns);
    }
}

static void judge_count(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;

    if ((double)judged->count > band[1]) {
        fail_count(judged, time_ns);
    } else if (band[1] == DBL_MAX && (double)judged->count >= band[0]) {
        decide(judged, true, time_ns);
    }
}

static void judge_matches(struct judged *judged, int64_t time_ns)
{
    if (judged->what->look == SCENARIO_PERIOD) {
        judge_period(judged, time_ns);
    }
    if (judged->fresh > 0 && judged->progress == OPEN) {
        judged->count += judged->fresh;
        judged->last_ns = time_ns;
    }
    if (judged->what->look == SCENARIO_SEEN) {
        judge_count(judged, time_ns);
    }
}

/* the window is over, or the run */
static void close_window(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;
    enum scenario_look look = judged->what->look;

    if (look == SCENARIO_BETWEEN) {
        decide(judged, true, time_ns);
    } else if (look == SCENARIO_REACHES) {
        decide(judged, false, time_ns);
        snprintf(
            judged->text, sizeof judged->text,
            "%.96s stayed between %.6g and %.6g until %.4f s, expected it to reach %.6g to %.6g",
            subject(judged), judged->lowest, judged->highest, (double)time_ns * 1e-9, band[0],
            band[1]);
    } else if (look == SCENARIO_PERIOD) {
        decide(judged, judged->count > 0, time_ns);
        if (!judged->met) {
            fail_period(judged, time_ns - judged->last_ns, time_ns);
        }
    } else if ((double)judged->count < band[0]) {
        fail_count(judged, time_ns);
    } else {
        decide(judged, true, time_ns);
    }
}

static void step_one(struct judged *judged, double value, const struct scenario_clock *clock,
                     int64_t time_ns)
{
    const struct scenario_expectation *what = judged->what;
    int64_t label = clock->label_ns[what->after_index];

    if (judged->progress == OPEN && what->to_given && time_ns > label + ns(what->to_s)) {
        close_window(judged, label + ns(what->to_s));
    }
    if (judged->progress == OPEN && !what->signal_given) {
        judge_matches(judged, time_ns);
    }
    if (judged->progress == WAITING && label >= 0 && time_ns >= label + ns(what->from_s)) {
        judged->progress = OPEN;
        judged->open_ns = judged->last_ns = time_ns;
        judged->reference = what->relative ? value : 0.0;
    }
    if (judged->progress == OPEN && what->signal_given) {
        judge_signal(judged, value - judged->reference, time_ns);
    }
    judged->fresh = 0;
}

void scenario_expectations_step(struct scenario_expectations *expectations,
                                const struct scenario_view *view,
                                const struct scenario_clock *clock, int64_t time_ns)
{
    bool kept = expectations->nsample < expectations->max;

    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];
        const struct scenario_signal *signal = &judged->signal;
        double value = 0.0;

        if (judged->what->signal_given) {
            value = signal->read(view, signal->a, signal->b);
        }
        step_one(judged, value, clock, time_ns);
        if (kept) {
            judged->trace[expectations->nsample] =
                judged->what->signal_given ? value - judged->reference : (double)judged->count;
        }
    }
    if (kept) {
        expectations->time_s[expectations->nsample++] = (double)time_ns * 1e-9;
    }
}

void scenario_expectations_finish(struct scenario_expectations *expectations,
                                  const struct scenario_clock *clock, int64_t time_ns,
                                  struct scenario_outcome *outcome)
{
    outcome->nverdict = expectations->count;
    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];
        const struct scenario_expectation *what = judged->what;
        int64_t label = clock->label_ns[what->after_index];

        if (judged->progress == OPEN && what->to_given && time_ns < label + ns(what->to_s)) {
            decide(judged, false, time_ns);
            snprintf(judged->text, sizeof judged->text,
                     "the run ended at %.4f s, expected to look until %.4f s",
                     (double)time_ns * 1e-9, (double)label * 1e-9 + what->to_s);
        } else if (judged->progress == OPEN) {
            close_window(judged, time_ns);
        } else if (judged->progress == WAITING) {
            snprintf(judged->text, sizeof judged->text, "never looked: %.64s %s",
                     expectations->scenario->label[what->after_index],
                     label < 0 ? "did not happen" : "was too late in the run");
        }
        outcome->verdict[i].met = judged->met;
        outcome->verdict[i].time_ns = judged->decided_ns;
        memcpy(outcome->verdict[i].text, judged->text, sizeof judged->text);
    }
}

/* ---- plots ---- */

static enum error_code plot_one(const struct scenario_expectations *expectations, size_t index,
                                const char *directory, struct error *error)
{
    const struct judged *judged = &expectations->judged[index];
    const double *band = judged->what->band;
    double span[2] = {(double)judged->open_ns * 1e-9, (double)judged->decided_ns * 1e-9};
    double lower[2] = {band[0], band[0]}, upper[2] = {band[1], band[1]};
    double found[2] = {span[1], 0.0};
    struct svg_series series[4] = {
        {subject(judged), expectations->time_s, judged->trace, expectations->nsample, SVG_LINE}};
    struct svg_plot plot = {.title = judged->what->name,
                            .x = {.label = "time (s)"},
                            .y = {.label = judged->what->signal_given ? subject(judged) : "count"},
                            .series = series,
                            .nseries = 1,
                            .width = 900,
                            .height = 360};
    enum error_code code;
    char path[4352];
    FILE *out;

    if (judged->progress != WAITING && judged->what->look != SCENARIO_PERIOD) {
        series[plot.nseries++] = (struct svg_series){"at least", span, lower, 2, SVG_DASHED};
        if (band[1] < DBL_MAX) {
            series[plot.nseries++] = (struct svg_series){"at most", span, upper, 2, SVG_DASHED};
        }
    }
    for (size_t i = 0; i < expectations->nsample && judged->decided_ns >= 0; i++) {
        if (expectations->time_s[i] <= span[1]) {
            found[1] = judged->trace[i];
        }
    }
    if (judged->decided_ns >= 0) {
        series[plot.nseries++] = (struct svg_series){"decided", found, found + 1, 1, SVG_MARKERS};
    }
    snprintf(path, sizeof path, "%s/expectation-%zu.svg", directory, index + 1);
    out = fopen(path, "w");
    if (!out) {
        return error_set_errno(error, errno, "cannot write %s", path);
    }
    code = svg_write(&plot, out, error);
    if (fclose(out) && !code) {
        code = error_set_errno(error, errno, "cannot write %s", path);
    }
    return code;
}

enum error_code scenario_expectations_plot(const struct scenario_expectations *expectations,
                                           const struct scenario_outcome *outcome,
                                           const char *directory, struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < expectations->count && !code; i++) {
        if (!outcome->verdict[i].met && expectations->nsample > 0) {
            code = plot_one(expectations, i, directory, error);
        }
    }
    return code;
}
