/* SPDX-License-Identifier: Apache-2.0 */
/* Judges the expectations of a scenario tick by tick, and plots failed expectations. */
#include "app/scenario/private.h"

#include "app/report/report.h"
#include "app/report/svg.h"

#include <float.h>
#include <inttypes.h>

/* State of an expectation: before its window, in its window, or decided. */
enum progress { WAITING /* before the window */, OPEN, DECIDED };

/* An expectation being judged. */
struct judged {
    const struct scenario_expectation *what;
    struct scenario_signal signal;
    enum progress progress;
    bool met;
    int64_t decided_ns; /* virtual time, -1 = not yet */
    char text[SCENARIO_TEXT];
    double reference;         /* value of a relative signal at the opening of the window */
    double lowest, highest;   /* range of the signal in the window */
    uint64_t fresh, count;    /* matches in this tick, and in the window */
    int64_t open_ns, last_ns; /* time at which the window opened; time of the last match */
    double *trace;            /* one sample per tick, for the plot */
};

/* All expectations of a run. Traces and time_s have room for `max` samples. */
struct scenario_expectations {
    const struct scenario *scenario;
    size_t count, nsample, max;
    struct judged judged[SCENARIO_EXPECTATIONS_MAX];
    double *time_s;
};

enum error_code scenario_expectations_create(const struct scenario *scenario, const struct rig *rig,
                                             size_t ticks, struct arena *arena,
                                             struct scenario_expectations **out,
                                             struct error *error)
{
    struct scenario_expectations *made = arena_alloc(arena, 1, sizeof *made);
    bool good = made && (made->time_s = arena_alloc(arena, ticks, sizeof *made->time_s));

    /* Initialize each expectation with an empty range and space for a trace of the whole run */
    for (size_t i = 0; good && i < scenario->nexpectation; i++) {
        struct judged *judged = &made->judged[i];

        judged->what = &scenario->expectation[i];
        judged->lowest = (double)INFINITY;
        judged->highest = -(double)INFINITY;
        judged->decided_ns = -1;
        judged->trace = arena_alloc(arena, ticks, sizeof *judged->trace);
        good = judged->trace != NULL;
        if (good && judged->what->signal &&
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

        judged->fresh += judged->what->frame.bus && (size_t)pattern->bus_index == bus &&
                         scenario_pattern_matches(pattern, frame);
    }
}

void scenario_expectations_event(struct scenario_expectations *expectations, const char *text)
{
    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];

        judged->fresh += judged->what->event && strstr(text, judged->what->event) != NULL;
    }
}

/* ---- judging ---- */

/* Records the decision on an expectation, and its time. */
static void expectation_decide(struct judged *judged, bool met, int64_t time_ns)
{
    judged->progress = DECIDED;
    judged->met = met;
    judged->decided_ns = time_ns;
}

/* Returns the subject of an expectation, for messages. */
static const char *expectation_subject(const struct judged *judged)
{
    return judged->what->signal  ? judged->what->signal
           : judged->what->event ? judged->what->event
                                 : "frames";
}

/* Fails an expectation with too many or too few matches. */
static void expectation_fail_count(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;
    char most[32] = " or more";

    if (band[1] < DBL_MAX) {
        snprintf(most, sizeof most, " to %.0f", band[1]);
    }
    expectation_decide(judged, false, time_ns);
    snprintf(judged->text, sizeof judged->text,
             "%.96s seen %" PRIu64 " times until %.4f s, expected %.0f%s",
             expectation_subject(judged), judged->count, (double)time_ns * 1e-9, band[0], most);
}

/* Fails an expectation whose frames are too late or too early. */
static void expectation_fail_period(struct judged *judged, int64_t gap_ns, int64_t time_ns)
{
    expectation_decide(judged, false, time_ns);
    snprintf(judged->text, sizeof judged->text,
             "%.6g s without a frame, or between two, at %.4f s, expected %.6g to %.6g s",
             (double)gap_ns * 1e-9, (double)time_ns * 1e-9, judged->what->band[0],
             judged->what->band[1]);
}

/* Judges a sample of a signal. BETWEEN fails outside the band; REACHES is met inside the band. */
static void expectation_judge_signal(struct judged *judged, double value, int64_t time_ns)
{
    const double *band = judged->what->band;
    bool inside = value >= band[0] && value <= band[1];

    judged->lowest = fmin(judged->lowest, value);
    judged->highest = fmax(judged->highest, value);
    if (judged->what->look == SCENARIO_BETWEEN && !inside) {
        expectation_decide(judged, false, time_ns);
        snprintf(judged->text, sizeof judged->text,
                 "%.96s%s is %.6g at %.4f s, expected %.6g to %.6g", expectation_subject(judged),
                 judged->what->relative ? " has moved: it" : "", value, (double)time_ns * 1e-9,
                 band[0], band[1]);
    } else if (judged->what->look == SCENARIO_REACHES && inside) {
        expectation_decide(judged, true, time_ns);
    }
}

/* Decides an undecided expectation at the end of its window or of the run. */
static void expectation_close_window(struct judged *judged, int64_t time_ns)
{
    const double *band = judged->what->band;
    enum scenario_look look = judged->what->look;

    /* BETWEEN is met, because the signal stayed in its band; REACHES fails, because it never did */
    if (look == SCENARIO_BETWEEN) {
        expectation_decide(judged, true, time_ns);
    } else if (look == SCENARIO_REACHES) {
        expectation_decide(judged, false, time_ns);
        snprintf(
            judged->text, sizeof judged->text,
            "%.96s stayed between %.6g and %.6g until %.4f s, expected it to reach %.6g to %.6g",
            expectation_subject(judged), judged->lowest, judged->highest, (double)time_ns * 1e-9,
            band[0], band[1]);
    } else if (look == SCENARIO_PERIOD) {
        expectation_decide(judged, judged->count > 0, time_ns);
        if (!judged->met) {
            expectation_fail_period(judged, time_ns - judged->last_ns, time_ns);
        }
    } else if ((double)judged->count < band[0]) {
        expectation_fail_count(judged, time_ns);
    } else {
        expectation_decide(judged, true, time_ns);
    }
}

/* Judges one expectation in a tick. value: the present value of its signal. */
static void expectation_step(struct judged *judged, double value,
                             const struct scenario_clock *clock, int64_t time_ns)
{
    const struct scenario_expectation *what = judged->what;
    int64_t label = clock->label_ns[what->after_index];

    /* Close the window first, because later matches do not count */
    if (judged->progress == OPEN && what->ends && time_ns > label + scenario_ns(what->to_s)) {
        expectation_close_window(judged, label + scenario_ns(what->to_s));
    }
    if (judged->progress == OPEN && !what->signal) {
        const double *band = judged->what->band;

        /* Judge the frames or events of this tick */
        if (judged->what->look == SCENARIO_PERIOD) {
            int64_t gap_ns = time_ns - judged->last_ns;
            /* measured from the opening of the window, not from a frame */
            bool first = judged->count == 0;
            bool short_gap = judged->fresh > 0 && !first && gap_ns < scenario_ns(band[0]);
            bool none = judged->fresh > 1 && band[0] > 0.0; /* several in one tick */

            /* Judge the time since the last frame. It must not be too long or too short;
             * several frames in one tick are too short. */
            if (gap_ns > scenario_ns(band[1]) || short_gap || none) {
                expectation_fail_period(judged, none ? 0 : gap_ns, time_ns);
            }
        }
        if (judged->fresh > 0 && judged->progress == OPEN) {
            judged->count += judged->fresh;
            judged->last_ns = time_ns;
        }

        /* Decide early: too many, or enough without an upper bound */
        if (judged->what->look == SCENARIO_SEEN && (double)judged->count > band[1]) {
            expectation_fail_count(judged, time_ns);
        } else if (judged->what->look == SCENARIO_SEEN && band[1] == DBL_MAX &&
                   (double)judged->count >= band[0]) {
            expectation_decide(judged, true, time_ns);
        }
    }

    /* Open the window after the tick's frames, so that these frames do not count */
    if (judged->progress == WAITING && label >= 0 && time_ns >= label + scenario_ns(what->from_s)) {
        judged->progress = OPEN;
        judged->open_ns = judged->last_ns = time_ns;
        judged->reference = what->relative ? value : 0.0;
    }
    if (judged->progress == OPEN && what->signal) {
        expectation_judge_signal(judged, value - judged->reference, time_ns);
    }
    judged->fresh = 0;
}

bool scenario_expectations_step(struct scenario_expectations *expectations,
                                const struct scenario_view *view,
                                const struct scenario_clock *clock, int64_t time_ns)
{
    bool kept = expectations->nsample < expectations->max, missed = false;

    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];
        const struct scenario_signal *signal = &judged->signal;
        double value = 0.0;

        if (judged->what->signal) {
            value = signal->read(view, signal->a, signal->b);
        }
        expectation_step(judged, value, clock, time_ns);
        missed = missed || (judged->progress == DECIDED && !judged->met);
        if (kept) {
            judged->trace[expectations->nsample] =
                judged->what->signal ? value - judged->reference : (double)judged->count;
        }
    }
    if (kept) {
        expectations->time_s[expectations->nsample++] = (double)time_ns * 1e-9;
    }
    return missed;
}

void scenario_expectations_finish(struct scenario_expectations *expectations,
                                  const struct scenario_clock *clock, int64_t time_ns,
                                  int64_t planned_ns, bool early, struct scenario_outcome *outcome)
{
    outcome->nverdict = expectations->count;
    for (size_t i = 0; i < expectations->count; i++) {
        struct judged *judged = &expectations->judged[i];
        const struct scenario_expectation *what = judged->what;
        int64_t label = clock->label_ns[what->after_index];
        const double *band = what->band, width = band[1] - band[0];
        struct scenario_verdict *verdict = &outcome->verdict[i];
        int64_t until_ns = what->ends ? label + scenario_ns(what->to_s) : planned_ns;

        /* If the run ended early, undecided expectations get no verdict. Otherwise they are
         * decided, or fail because their window was cut short */
        verdict->judged = !early || judged->progress == DECIDED;
        if (!verdict->judged) {
            snprintf(judged->text, sizeof judged->text,
                     "not judged: the run ended at %.4f s, at a failure", (double)time_ns * 1e-9);
        } else if (judged->progress == OPEN && time_ns < until_ns) {
            expectation_decide(judged, false, time_ns);
            snprintf(judged->text, sizeof judged->text,
                     "the run ended at %.4f s, expected to look until %.4f s",
                     (double)time_ns * 1e-9, (double)until_ns * 1e-9);
        } else if (judged->progress == OPEN) {
            expectation_close_window(judged, time_ns);
        } else if (judged->progress == WAITING) {
            snprintf(judged->text, sizeof judged->text, "never looked: %.64s %s",
                     expectations->scenario->label[what->after_index],
                     label < 0 ? "did not happen" : "was too late in the run");
        }
        verdict->met = judged->met;
        verdict->time_ns = judged->decided_ns;
        memcpy(verdict->text, judged->text, sizeof judged->text);

        /* Compute the margin: the smallest distance from a bound, divided by the width of the
         * band */
        verdict->has_margin = what->look == SCENARIO_BETWEEN && width > 0.0 &&
                              judged->lowest <= judged->highest && isfinite(width);
        if (verdict->has_margin) {
            verdict->margin = fmin(judged->lowest - band[0], band[1] - judged->highest) / width;
        }
    }
}

/* ---- plots ---- */

/* Plots the trace of an expectation with its band, and marks the sample of the decision. */
static enum error_code expectation_plot(const struct scenario_expectations *expectations,
                                        size_t index, const char *directory, struct error *error)
{
    const struct judged *judged = &expectations->judged[index];
    const double *band = judged->what->band;
    double span[2] = {(double)judged->open_ns * 1e-9, (double)judged->decided_ns * 1e-9};
    double lower[2] = {band[0], band[0]}, upper[2] = {band[1], band[1]};
    double found[2] = {span[1], 0.0};
    struct svg_series series[4] = {svg_line(expectation_subject(judged), expectations->time_s,
                                            judged->trace, expectations->nsample, SVG_LINE)};
    struct svg_plot plot =
        svg_panel(judged->what->name, "time (s)",
                  judged->what->signal ? expectation_subject(judged) : "count", series, 1);
    char name[64];
    struct report_file file;
    enum error_code code;

    plot.width = 900;

    /* Draw the band, if it is a band of values */
    if (judged->progress != WAITING && judged->what->look != SCENARIO_PERIOD) {
        series[plot.nseries++] = svg_line("at least", span, lower, 2, SVG_DASHED);
        if (band[1] < DBL_MAX) {
            series[plot.nseries++] = svg_line("at most", span, upper, 2, SVG_DASHED);
        }
    }

    /* Mark the sample of the decision */
    for (size_t i = 0; i < expectations->nsample && judged->decided_ns >= 0; i++) {
        if (expectations->time_s[i] <= span[1]) {
            found[1] = judged->trace[i];
        }
    }
    if (judged->decided_ns >= 0) {
        series[plot.nseries++] = svg_line("decided", found, found + 1, 1, SVG_MARKERS);
    }

    snprintf(name, sizeof name, "expectation-%zu.svg", index + 1);
    code = report_file_open(&file, directory, name, error);
    if (code) {
        return code;
    }
    return whole_file_close(&file.whole, svg_write(&plot, file.whole.out, error), error);
}

enum error_code scenario_expectations_plot(const struct scenario_expectations *expectations,
                                           const struct scenario_outcome *outcome,
                                           const char *directory, struct error *error)
{
    for (size_t i = 0; i < expectations->count; i++) {
        if (!outcome->verdict[i].met && expectations->nsample > 0) {
            enum error_code code = expectation_plot(expectations, i, directory, error);

            if (code) {
                return code;
            }
        }
    }
    return ERROR_NONE;
}
