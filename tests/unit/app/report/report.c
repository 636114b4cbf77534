/* SPDX-License-Identifier: Apache-2.0 */
/* Reports: escaping, CSV quoting, findings, errors; signals read back from a recording's CSV. */
#include "app/report/report.h"
#include "app/report/signals.h"
#include "tests/unit/app/put_file.h"

#include <unistd.h>

static struct error error;

static char folder[] = "/tmp/hil-report-XXXXXX";

static const char *path_of(const char *name)
{
    static char path[256];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

/* Whole file; valid until the next call. */
static const char *read_file(const char *name)
{
    static char text[65536];
    FILE *in = fopen(path_of(name), "r");

    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    return text;
}

FIXTURE(make_folder)
{
    return mkdtemp(folder) ? 0 : -1;
}

FIXTURE(remove_folder)
{
    static const char *const names[] = {"index.html", "compared.csv", "t.csv",
                                        "f.csv",      "f-1.svg",      "signals.csv"};

    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        unlink(path_of(names[i]));
    }
    return rmdir(folder);
}

TEST(a_report_escapes_text_and_quotes_cells)
{
    const double x[] = {0.0, 1.0}, y[] = {2.0, 3.0};
    const struct svg_series series = {.name = "a, b", .x = x, .y = y, .count = 2};
    const struct svg_plot plot = {.title = "plot", .series = &series, .nseries = 1};
    static struct report report;

    assert_ok(report_open(&report, folder, "a <title>", &error));
    report_section(&report, "one", "First: & more");
    report_table(&report, "t", "", "a|b");
    report_row(&report, "1, 2|x<y");
    report_figure(&report, "f", "caption", &plot, 1);
    report_finding(&report, true, "speed|%d|%d|why", 3, 4);
    report_compared(&report);
    assert_ok(report_close(&report, &error));
    assert_string_equal(read_file("t.csv"), "a,b\n\"1, 2\",x<y\n");
    assert_string_equal(read_file("f.csv"), "panel,series,x,y\n1,\"a, b\",0,2\n1,\"a, b\",1,3\n");
    assert_string_equal(read_file("compared.csv"),
                        "section,quantity,paper,here,remark\none,speed,3,4,why\n");
    assert_non_null(strstr(read_file("index.html"), "<h1>a &lt;title&gt;</h1>"));
    assert_non_null(strstr(read_file("index.html"), "<h2>First: &amp; more</h2>"));
    assert_non_null(strstr(read_file("index.html"), "<a href=\"#one\">First</a>"));
    assert_non_null(strstr(read_file("index.html"), "<td>x&lt;y</td>"));
    assert_non_null(strstr(read_file("index.html"), "<clipPath id=\"f-1\">"));
    assert_non_null(strstr(read_file("f-1.svg"), "</svg>"));
}

TEST(the_first_error_comes_back_when_it_closes)
{
    static struct report report;
    struct svg_plot empty = {.title = "no series"};

    assert_ok(report_open(&report, folder, "title", &error));
    report_section(&report, "one", "One");
    report_figure(&report, "f", "", &empty, 1);
    assert_int_equal(report_close(&report, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "0 series"));
    assert_int_equal(report_open(&report, "/dev/null/x", "title", &error), ERROR_SYSTEM);
}

TEST(signals_are_read_by_title_within_a_time)
{
    static const char *const titles[] = {"b", "a"};
    struct signals signals CLOSED_BY(signals_free);

    put_file(path_of("signals.csv"), "time_s,a,b\n0,1,2\n1,3,4\n2,5,6\n");
    assert_ok(signals_read(path_of("signals.csv"), titles, 2, 0.5, INFINITY, &signals, &error));
    assert_string_equal(signals.first_title, "time_s");
    assert_int_equal(signals.count, 2);
    assert_true(signals.value[0][0] == 1.0 && signals.value[1][0] == 4.0 &&
                signals.value[2][1] == 5.0);
}

TEST(wrong_signals_are_refused_with_their_place)
{
    static const struct {
        const char *text, *expected;
    } wrong[] = {
        {"", ":1:"},
        {"time_s,a\n0,1\n1\n", ":3: column 2 (a)"},
        {"time_s,a\n0,1,2\n", ":2: found more than 2 columns"},
        {"time_s,a\n0,x\n", ":2: column 2 (a): found \"x\""},
        {"time_s,c\n0,1\n", "found no signal \"a\""},
    };
    static const char *const titles[] = {"a"};
    struct signals signals;

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        put_file(path_of("signals.csv"), wrong[i].text);
        assert_int_equal(
            signals_read(path_of("signals.csv"), titles, 1, 0.0, 9.0, &signals, &error),
            ERROR_INPUT);
        assert_non_null(strstr(error.text, wrong[i].expected));
        signals_free(&signals);
    }
    assert_int_equal(signals_read(path_of("none"), titles, 1, 0.0, 9.0, &signals, &error),
                     ERROR_INPUT);
    signals_free(&signals);
}

TEST_GROUP(make_folder, remove_folder)
