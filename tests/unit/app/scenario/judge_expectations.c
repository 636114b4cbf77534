/* SPDX-License-Identifier: Apache-2.0 */
/* Windows, counts and periods of frames and log lines, and bands of a signal, tick by tick with a
 * clock in hand. */
#include "app/scenario/private.h"
#include "tests/test.h"

#include <unistd.h>

enum { TICKS = 100 };

#define MS INT64_C(1000000)

static struct arena arena;
static struct error error;
static struct scenario_expectations *expectations;
static struct scenario_clock clock_of;
static struct scenario_outcome outcome;

/* ---- a signal that the test sets ---- */

static double signal_value;

static double read_signal(const struct scenario_view *view, size_t a, size_t b)
{
    (void)view;
    (void)a;
    (void)b;
    return signal_value;
}

enum error_code __wrap_scenario_signal_find(const char *name, const struct rig *rig,
                                            const struct yaml_mark *mark,
                                            struct scenario_signal *signal, struct error *unused);

enum error_code __wrap_scenario_signal_find(const char *name, const struct rig *rig,
                                            const struct yaml_mark *mark,
                                            struct scenario_signal *signal, struct error *unused)
{
    (void)name;
    (void)rig;
    (void)mark;
    (void)unused;
    signal->read = read_signal;
    return ERROR_NONE;
}

/* ---- a run ---- */

/* One expectation that reads expectation_text, of frames 0x10 on bus 0, of the event "boom" or of
 * the signal above. */
static void expect(const char *expectation_text)
{
    struct scenario *cases;
    char text[1024];
    size_t count;

    arena_fini(&arena);
    assert_ok(arena_init(&arena, (size_t)64 << 20, &error));
    snprintf(text, sizeof text,
             "name: x\ndescription: d\nrig: r.yaml\nduration_s: 1\n"
             "stimuli: [{label: mark}]\nexpectations:\n  - {name: e, %s}\n",
             expectation_text);
    assert_int_equal(
        scenario_read_text("a/x.yaml", text, strlen(text), &arena, &cases, &count, &error), 0);
    assert_int_equal(
        scenario_expectations_create(cases, NULL, TICKS + 1, &arena, &expectations, &error), 0);
    for (size_t i = 0; i < sizeof clock_of.label_ns / sizeof clock_of.label_ns[0]; i++) {
        clock_of.label_ns[i] = -1;
    }
    clock_of.label_ns[SCENARIO_LABEL_START] = 0;
}

static bool missed; /* what the last step has said */

/* Runs to the end of last ms of the TICKS that were planned; a frame and an event come in the ticks
 * of the list, which ends with 0; mark is when the label happens, -1 = never. */
static const struct scenario_verdict *run_until(int last, const int *ticks, int mark)
{
    const struct bus_frame frame = frame_make(0x10, 0, NULL);

    for (int tick = 0; tick <= last; tick++) {
        if (tick == mark) {
            clock_of.label_ns[SCENARIO_LABELS] = tick * MS;
        }
        for (const int *at = ticks; *at; at++) {
            if (*at == tick) {
                scenario_expectations_frame(expectations, 0, &frame);
                scenario_expectations_event(expectations, "1.0 s: boom and bust");
            }
        }
        missed = scenario_expectations_step(expectations, NULL, &clock_of, tick * MS);
    }
    scenario_expectations_finish(expectations, &clock_of, last * MS, TICKS * MS, false, &outcome);
    assert_int_equal(outcome.nverdict, 1);
    return &outcome.verdict[0];
}

static const struct scenario_verdict *run(const int *ticks, int mark)
{
    return run_until(TICKS, ticks, mark);
}

/* The signal has the value usual but for the tick odd, where it has another. */
static const struct scenario_verdict *run_signal(double usual, int odd, double other)
{
    for (int tick = 0; tick <= TICKS; tick++) {
        signal_value = tick == odd ? other : usual;
        scenario_expectations_step(expectations, NULL, &clock_of, tick * MS);
    }
    scenario_expectations_finish(expectations, &clock_of, TICKS * MS, TICKS * MS, false, &outcome);
    return &outcome.verdict[0];
}

TEST(what_an_early_end_left_open_is_not_judged)
{
    expect("event: boom, never: true");
    run_until(5, (const int[]){3, 0}, -1);
    assert_true(missed);
    assert_true(outcome.verdict[0].judged && !outcome.verdict[0].met);
    expect("event: boom, never: true");
    run_until(5, (const int[]){0}, -1);
    assert_false(missed);
    assert_true(outcome.verdict[0].judged && !outcome.verdict[0].met); /* it should have gone on */
    expect("event: boom, never: true");
    scenario_expectations_step(expectations, NULL, &clock_of, 0);
    scenario_expectations_finish(expectations, &clock_of, MS, TICKS * MS, true, &outcome);
    assert_false(outcome.verdict[0].judged || outcome.verdict[0].met);
    assert_non_null(strstr(outcome.verdict[0].text, "not judged"));
}

TEST(judges_frames_and_events)
{
    static const struct {
        const char *expectation;
        int ticks[8], mark;
        bool met;
        int decided_ms; /* -1 = never */
    } table[] = {
        {"event: boom", {30}, -1, true, 30},
        {"event: doom", {30}, -1, false, 100},
        {"event: boom, within_s: 0.03", {30}, -1, true, 30},
        {"event: boom, within_s: 0.03", {31}, -1, false, 30},
        {"event: boom, from_s: 0.03", {30}, -1, false, 100}, /* what came before it opened */
        {"event: boom, from_s: 0.03", {31}, -1, true, 31},
        {"event: boom, never: true", {30}, -1, false, 30},
        {"event: boom, never: true, to_s: 0.029", {30}, -1, true, 29},
        {"event: boom, after: mark, never: true", {30}, 30, true, 100},
        {"event: boom, after: mark, never: true", {30}, -1, false, -1},
        {"event: boom, after: mark, within_s: 0.01", {30, 45}, 35, true, 45},
        {"event: boom, to_s: 0.2", {0}, -1, false, 100}, /* the run ended before the window */
        {"event: boom, count: [2, 3]", {10, 20}, -1, true, 100},
        {"event: boom, count: [2, 3]", {10}, -1, false, 100},
        {"event: boom, count: [2, 3]", {10, 20, 30, 40}, -1, false, 40},
        {"frame: {bus: b, id: 0x10}", {30}, -1, true, 30},
        {"frame: {bus: b, id: 0x11}", {30}, -1, false, 100},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]", {10, 40, 60, 85}, -1, true, 100},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]", {10, 40, 59, 85}, -1, false, 59},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]", {10, 40, 60}, -1, false, 91},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]", {0}, -1, false, 31},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.2]", {0}, -1, false, 100},
        {"frame: {bus: b, id: 0x10}, period_s: [0.001, 0.2]", {10, 10}, -1, false, 10},
        {"frame: {bus: b, id: 0x10}, period_s: [0.0, 0.2]", {10, 10}, -1, true, 100},
    };

    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct scenario_verdict *verdict;

        print_message("# %s\n", table[i].expectation);
        expect(table[i].expectation);
        verdict = run(table[i].ticks, table[i].mark);
        assert_int_equal(verdict->met, table[i].met);
        assert_int_equal(verdict->time_ns, table[i].decided_ms < 0 ? -1 : table[i].decided_ms * MS);
        assert_int_equal(verdict->text[0] == '\0', verdict->met);
    }
    arena_fini(&arena);
}

TEST(judges_values_against_their_band)
{
    const double nan = (double)NAN, inf = (double)INFINITY;
    const struct {
        const char *expectation;
        double usual, other; /* the other at 40 ms */
        bool met;
        int decided_ms;
    } table[] = {
        {"signal: s, between: [-1, 2]", 0.0, 2.0, true, 100},
        {"signal: s, between: [-1, 2]", 0.0, -1.0, true, 100},
        {"signal: s, between: [-1, 2]", 0.0, 2.0001, false, 40},
        {"signal: s, between: [-1, 2]", 0.0, -1.0001, false, 40},
        {"signal: s, between: [-1, 2]", 0.0, nan, false, 40},
        {"signal: s, between: [-1, 2]", 0.0, -nan, false, 40},
        {"signal: s, between: [-1, 2]", 0.0, inf, false, 40},
        {"signal: s, between: [-1, 2], from_s: 0.04", nan, 0.0, false, 41},
        {"signal: s, between: [-1, 2], from_s: 0.041", 0.0, nan, true, 100},
        {"signal: s, between: [-1, 2], to_s: 0.039", 0.0, nan, true, 39},
        {"signal: s, between: [-1, 2], to_s: 0.04", 0.0, nan, false, 40},
        {"signal: s, between: [0, 0], relative: true", 7.0, nan, false, 40},
        {"signal: s, between: [-1, 1], relative: true, from_s: 0.04", 0.0, nan, false, 40},
        {"signal: s, between: [-1, 1], relative: true, from_s: 0.04", 0.0, 1.5, false, 41},
        {"signal: s, between: [-1, 1], relative: true, from_s: 0.041", 5.0, 1.5, true, 100},
        {"signal: s, reaches: [2, 3]", 0.0, 2.0, true, 40},
        {"signal: s, reaches: [2, 3]", 0.0, 3.0, true, 40},
        {"signal: s, reaches: [2, 3]", 0.0, 3.0001, false, 100},
        {"signal: s, reaches: [2, 3]", 0.0, nan, false, 100},
        {"signal: s, reaches: [2, 3]", nan, nan, false, 100},
        {"signal: s, reaches: [2, 3]", nan, 2.5, true, 40},
        {"signal: s, reaches: [2, 3], within_s: 0.039", 0.0, 2.5, false, 39},
        {"signal: s, reaches: [2, 3], within_s: 0.04", 0.0, 2.5, true, 40},
    };

    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct scenario_verdict *verdict;

        print_message("# %s, at 40 ms %g\n", table[i].expectation, table[i].other);
        expect(table[i].expectation);
        verdict = run_signal(table[i].usual, 40, table[i].other);
        assert_int_equal(verdict->met, table[i].met);
        assert_int_equal(verdict->time_ns, table[i].decided_ms * MS);
        assert_int_equal(verdict->text[0] == '\0', verdict->met);
    }
    arena_fini(&arena);
}

/* Nobody knows what would have been seen in the rest. */
TEST(a_run_that_ends_early_meets_only_what_was_decided)
{
    static const struct {
        const char *expectation;
        int ticks[4], last;
        bool met;
    } table[] = {
        {"event: boom, never: true", {0}, 99, false},
        {"event: boom, never: true", {0}, 100, true},
        {"event: boom, never: true, to_s: 0.05", {0}, 51, true},
        {"event: boom, never: true, to_s: 0.05", {0}, 50, true},
        {"event: boom, never: true, to_s: 0.05", {0}, 49, false},
        {"event: boom", {30}, 31, true},
        {"event: boom, count: [1, 3]", {30}, 60, false},
        {"event: boom, count: [1, 3], to_s: 0.05", {30}, 60, true},
        {"event: boom, from_s: 0.07, never: true", {0}, 60, false},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.05]", {10, 40}, 60, false},
        {"signal: s, between: [-1, 1]", {0}, 99, false},
        {"signal: s, between: [-1, 1], to_s: 0.05", {0}, 60, true},
        {"signal: s, reaches: [-1, 1]", {0}, 10, true},
    };

    signal_value = 0.0;
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct scenario_verdict *verdict;

        print_message("# %s, until %d ms\n", table[i].expectation, table[i].last);
        expect(table[i].expectation);
        verdict = run_until(table[i].last, table[i].ticks, -1);
        assert_int_equal(verdict->met, table[i].met);
        assert_int_equal(verdict->text[0] == '\0', verdict->met);
    }
    arena_fini(&arena);
}

/* The least distance from a bound, as a share of the room between both; of a signal in a band
 * alone. */
TEST(measures_the_margin_of_a_band)
{
    const double none = (double)NAN;
    const struct {
        const char *expectation;
        double usual, other, margin;
    } table[] = {
        {"signal: s, between: [0, 10]", 4.0, 3.0, 0.3},
        {"signal: s, between: [0, 10]", 6.0, 9.0, 0.1},
        {"signal: s, between: [0, 10]", 5.0, 5.0, 0.5},
        {"signal: s, between: [2, 6]", 5.0, 3.0, 0.25},
        {"signal: s, between: [-6, -2]", -5.0, -2.5, 0.125},
        {"signal: s, between: [2, 6]", 4.0, 2.0, 0.0},
        {"signal: s, between: [2, 6]", 4.0, 6.0, 0.0},
        {"signal: s, between: [0, 10]", 5.0, 12.0, -0.2},
        {"signal: s, between: [0, 10]", 5.0, -3.0, -0.3},
        {"signal: s, between: [0, 10], from_s: 0.041", 6.0, 9.0, 0.4},
        {"signal: s, between: [0, 10], to_s: 0.039", 6.0, 9.0, 0.4},
        {"signal: s, between: [-1, 1], relative: true", 7.0, 7.5, 0.25},
        {"signal: s, between: [0, 0]", 0.0, 0.0, none},
        {"signal: s, between: [0, 10], after: mark", 5.0, 5.0, none},
        {"signal: s, reaches: [0, 10]", 5.0, 5.0, none},
        {"event: boom, never: true", 5.0, 5.0, none},
    };

    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct scenario_verdict *verdict;

        print_message("# %s, %g and %g\n", table[i].expectation, table[i].usual, table[i].other);
        expect(table[i].expectation);
        verdict = run_signal(table[i].usual, 40, table[i].other);
        assert_int_equal(verdict->has_margin, !isnan(table[i].margin));
        assert_true(!verdict->has_margin || fabs(verdict->margin - table[i].margin) < 1e-12);
    }
    arena_fini(&arena);
}

TEST(a_failure_says_what_was_found_and_what_was_expected)
{
    static const struct {
        const char *expectation;
        int ticks[8];
        double usual, other; /* of the signal, the other at 40 ms */
        const char *text;
    } table[] = {
        {"event: boom, count: [2, 3]",
         {10},
         0,
         0,
         "boom seen 1 times until 0.1000 s, expected 2 to 3"},
        {"event: boom, count: [1, 2]",
         {10, 20, 30},
         0,
         0,
         "boom seen 3 times until 0.0300 s, expected 1 to 2"},
        {"event: boom, never: true",
         {30},
         0,
         0,
         "boom seen 1 times until 0.0300 s, expected 0 to 0"},
        {"event: doom", {30}, 0, 0, "doom seen 0 times until 0.1000 s, expected 1 or more"},
        {"frame: {bus: b, id: 0x11}",
         {30},
         0,
         0,
         "frames seen 0 times until 0.1000 s, expected 1 or more"},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]",
         {10, 40, 59},
         0,
         0,
         "0.019 s without a frame, or between two, at 0.0590 s, expected 0.02 to 0.03 s"},
        {"signal: s, between: [-1, 2]", {0}, 0, 2.5, "s is 2.5 at 0.0400 s, expected -1 to 2"},
        {"signal: s, between: [-1, 2], relative: true",
         {0},
         7,
         5,
         "s has moved: it is -2 at 0.0400 s, expected -1 to 2"},
        {"signal: s, reaches: [2, 3]",
         {0},
         1,
         4,
         "s stayed between 1 and 4 until 0.1000 s, expected it to reach 2 to 3"},
        {"event: boom, after: mark", {30}, 0, 0, "never looked: mark did not happen"},
    };

    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        expect(table[i].expectation);
        if (strstr(table[i].expectation, "signal")) {
            run_signal(table[i].usual, 40, table[i].other);
        } else {
            run(table[i].ticks, -1);
        }
        assert_string_equal(outcome.verdict[0].text, table[i].text);
    }
    arena_fini(&arena);
}

/* The band of a failure as dashed lines while it was looked at, and the sample that decided. */
TEST(a_failure_is_plotted_with_its_band)
{
    static const struct {
        const char *expectation;
        int lines; /* dashed */
        double from, to;
        bool decided;
    } table[] = {
        {"signal: s, between: [2, 6]", 2, 0.0, 0.04, true},
        {"signal: s, between: [2, 6], from_s: 0.02", 2, 0.02, 0.04, true},
        {"signal: s, reaches: [20, 30]", 2, 0.0, 0.1, true},
        {"event: doom", 1, 0.0, 0.1, true},
        {"frame: {bus: b, id: 0x10}, period_s: [0.02, 0.03]", 0, 0, 0, true},
        {"signal: s, between: [2, 6], after: mark", 0, 0, 0, false},
    };
    char folder[] = "/tmp/judge-XXXXXX", path[64], text[65536];

    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/expectation-1.svg", folder);
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        double x0 = 0, x1 = 0, y = 0, end[4] = {0}, last = 0;
        const char *at;
        int lines = 0;
        FILE *file;

        print_message("# %s\n", table[i].expectation);
        expect(table[i].expectation);
        run_signal(4.0, 40, 8.0);
        assert_ok(scenario_expectations_plot(expectations, &outcome, folder, &error));
        file = fopen(path, "r");
        assert_non_null(file);
        text[fread(text, 1, sizeof text - 1, file)] = '\0';
        fclose(file);
        unlink(path);

        /* The first line is the trace, over 0.1 s. Those of the legend do not have two points */
        at = strstr(strstr(text, "class=\"line\""), " d=\"M");
        assert_int_equal(sscanf(at, " d=\"M%lf %lf", &x0, &y), 2);
        for (; *at != '/'; at++) {
            x1 = *at == 'L' && sscanf(at, "L%lf %lf", &last, &y) == 2 ? last : x1;
        }
        for (at = text; (at = strstr(at, "stroke-dasharray")); at++) {
            double p[4];

            if (sscanf(at, "stroke-dasharray=\"6 4\" d=\"M%lf %lfL%lf %lf", &p[0], &p[1], &p[2],
                       &p[3]) == 4) {
                assert_true(p[1] == p[3]);
                assert_true(fabs((p[0] - x0) / (x1 - x0) - table[i].from / 0.1) < 1e-3);
                assert_true(fabs((p[2] - x0) / (x1 - x0) - table[i].to / 0.1) < 1e-3);
                end[lines++] = p[1];
            }
        }
        assert_int_equal(lines, table[i].lines);
        assert_true(lines < 2 || end[0] > end[1]); /* the lower bound is below */
        assert_int_equal(strstr(text, ">decided<") != NULL, table[i].decided);
        assert_int_equal(strstr(text, ">at least<") != NULL, lines > 0);
        assert_int_equal(strstr(text, ">at most<") != NULL, lines > 1);
    }
    assert_int_equal(rmdir(folder), 0);
    arena_fini(&arena);
}
