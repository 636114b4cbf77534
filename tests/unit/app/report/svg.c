/* SPDX-License-Identifier: Apache-2.0 */
/* Plots: well-formed, escaped, the same bytes each time, points where they belong. */
#include "app/report/svg.h"
#include "tests/test.h"

#include <ctype.h>

static struct error error;

/* From the heap. */
static char *draw(const struct svg_plot *plot)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);

    assert_non_null(out);
    assert_no_error(svg_write(plot, out, &error), error.text);
    fclose(out);
    return text;
}

/* Every element is closed, in order, attributes are quoted, & begins an entity. */
static void assert_well_formed(const char *text)
{
    char open[32][16];
    size_t depth = 0;

    for (; *text; text++) {
        if (*text == '&') {
            assert_non_null(strchr(text, ';'));
            assert_true(strchr(text, ';') - text <= 5);
        }
        assert_true((unsigned char)*text >= 0x20 || *text == '\n');
        if (*text == '<') {
            const char *name = text + 1 + (text[1] == '/'), *end = strchr(text, '>');
            size_t length = 0, quotes = 0;

            assert_non_null(end);
            while (isalpha((unsigned char)name[length])) {
                length++;
            }
            assert_in_range(length, 1, 15);
            for (const char *c = text; c < end; c++) {
                quotes += *c == '"';
                assert_true(c == text || *c != '<');
            }
            assert_true(quotes % 2 == 0);
            if (text[1] == '/') {
                assert_true(depth > 0 && strlen(open[depth - 1]) == length);
                depth--;
                assert_memory_equal(open[depth], name, length);
            } else if (end[-1] != '/') {
                assert_true(depth < 32);
                memcpy(open[depth], name, length);
                open[depth++][length] = '\0';
            }
            text = end;
        }
    }
    assert_int_equal(depth, 0);
}

static const double x4[] = {1.0, 2.0, 3.0, 4.0}, y4[] = {10.0, 20.0, 15.0, 30.0};

static struct svg_plot plot_of(const struct svg_series *series, size_t count)
{
    return (struct svg_plot){.title = "a title",
                             .x = {.label = "time, s"},
                             .y = {.label = "torque, N m"},
                             .series = series,
                             .nseries = count};
}

TEST(a_plot_is_well_formed_and_the_same_each_time)
{
    const struct svg_series series[] = {
        {.name = "line", .x = x4, .y = y4, .count = 4},
        {.name = "markers", .x = x4, .y = y4, .count = 4, .style = SVG_MARKERS},
        {.name = "both", .x = x4, .y = y4, .count = 4, .style = SVG_LINE_MARKERS},
        {.name = "dashed", .x = x4, .y = y4, .count = 4, .style = SVG_DASHED},
    };
    const struct svg_plot plot = plot_of(series, 4);
    char *first = draw(&plot), *second = draw(&plot);

    assert_well_formed(first);
    assert_string_equal(first, second);
    for (size_t i = 0; i < 4; i++) {
        assert_non_null(strstr(first, series[i].name));
    }
    assert_non_null(strstr(first, "a title"));
    assert_non_null(strstr(first, "torque, N m"));
    free(first);
    free(second);
}

TEST(text_that_xml_keeps_to_itself_is_escaped)
{
    const struct svg_series series[] = {{.name = "a<b & \"c\">\001", .x = x4, .y = y4, .count = 4}};
    struct svg_plot plot = plot_of(series, 1);
    char *text;

    plot.title = "</svg>";
    text = draw(&plot);
    assert_well_formed(text);
    assert_non_null(strstr(text, "a&lt;b &amp; &quot;c&quot;&gt;?</text>"));
    assert_non_null(strstr(text, "&lt;/svg&gt;"));
    free(text);
}

/* With fixed axes the corners of the range are the corners of the drawing area: 92 px from the left
 * and 24 from the right, 54 from the top (one row of legend) and 56 from the bottom. */
TEST(points_lie_where_the_axes_say)
{
    static const double x[] = {0.0, 10.0, 5.0}, y[] = {-1.0, 1.0, 0.0};
    const struct svg_series series[] = {{.name = "s", .x = x, .y = y, .count = 3}};
    struct svg_plot plot = plot_of(series, 1);
    char *text;

    plot.x = (struct svg_axis){.label = "x", .fixed = true, .min = 0.0, .max = 10.0};
    plot.y = (struct svg_axis){.label = "y", .fixed = true, .min = -1.0, .max = 1.0};
    text = draw(&plot);
    assert_non_null(strstr(text, "M92.00 394.00L696.00 54.00L394.00 224.00\""));
    free(text);
}

TEST(ticks_stand_at_round_numbers)
{
    const struct svg_series series[] = {{.name = "s", .x = x4, .y = y4, .count = 4}};
    struct svg_plot plot = plot_of(series, 1);
    char *text;

    plot.x = (struct svg_axis){.fixed = true, .min = 0.0, .max = 0.3};
    plot.y = (struct svg_axis){.fixed = true, .min = -30.0, .max = 30.0};
    text = draw(&plot);
    assert_non_null(strstr(text, ">0.00<"));
    assert_non_null(strstr(text, ">0.05<"));
    assert_non_null(strstr(text, ">0.30<"));
    assert_null(strstr(text, ">0.35<"));
    assert_non_null(strstr(text, ">-30<"));
    assert_non_null(strstr(text, ">0<"));
    assert_null(strstr(text, ">-0<"));
    assert_non_null(strstr(text, ">30<"));
    free(text);
}

TEST(logarithmic_axes_count_decades)
{
    static const double x[] = {1e-6, 1e-4, 1e-2}, y[] = {3e-14, 2e-5, 4.0};
    const struct svg_series series[] = {{.name = "s", .x = x, .y = y, .count = 3}};
    struct svg_plot plot = plot_of(series, 1);
    char *text;

    plot.x.logarithmic = plot.y.logarithmic = true;
    text = draw(&plot);
    assert_well_formed(text);
    assert_non_null(strstr(text, ">1e-6<"));
    assert_non_null(strstr(text, ">0.01<"));
    assert_non_null(strstr(text, ">1e-14<"));
    /* 1e-4 is in the middle of 1e-6 to 1e-2 */
    assert_non_null(strstr(text, "L394.00 "));
    free(text);
}

TEST(what_cannot_be_drawn_breaks_the_line)
{
    static const double x[] = {0.0, 1.0, 2.0, 3.0, 4.0};
    static const double y[] = {0.0, 1.0, NAN, INFINITY, 2.0};
    const struct svg_series series[] = {{.name = "s", .x = x, .y = y, .count = 5}};
    const struct svg_plot plot = plot_of(series, 1);
    char *text = draw(&plot), *line = strstr(text, "class=\"line\"");
    size_t moves = 0, lines = 0;

    assert_well_formed(text);
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "inf"));
    line = strstr(line, " d=\"") + 4;
    for (; *line != '"'; line++) {
        moves += *line == 'M';
        lines += *line == 'L';
    }
    assert_int_equal(moves, 2);
    assert_int_equal(lines, 1);
    free(text);
}

TEST(one_point_and_one_value_can_be_drawn)
{
    static const double x[] = {5.0}, y[] = {0.0};
    const struct svg_series series[] = {
        {.name = "s", .x = x, .y = y, .count = 1, .style = SVG_MARKERS}};
    const struct svg_plot plot = plot_of(series, 1);
    char *text = draw(&plot);

    assert_well_formed(text);
    assert_non_null(strstr(text, "<circle cx=\"394.00\" cy=\"224.00\""));
    assert_null(strstr(text, "nan"));
    free(text);
}

TEST(a_long_legend_takes_more_rows)
{
    struct svg_series series[SVG_SERIES_MAX];
    const struct svg_plot plot = plot_of(series, SVG_SERIES_MAX);
    char *text;

    for (size_t i = 0; i < SVG_SERIES_MAX; i++) {
        series[i] = (struct svg_series){
            .name = "a name of thirty-one characters", .x = x4, .y = y4, .count = 4};
    }
    text = draw(&plot);
    assert_well_formed(text);
    /* two entries of 267 px in each row of 604 px, rows 18 px apart, the first of them at 44 */
    assert_non_null(strstr(text, "<text x=\"122.00\" y=\"44.00\">a name"));
    assert_non_null(strstr(text, "<text x=\"389.00\" y=\"98.00\">a name"));
    free(text);
}

TEST(a_plot_without_points_is_refused)
{
    static const double x[] = {1.0, -1.0}, y[] = {NAN, 1.0};
    const struct svg_series series[] = {{.name = "s", .x = x, .y = y, .count = 2}};
    struct svg_plot plot = plot_of(series, 1);

    plot.x.logarithmic = true;
    assert_int_equal(svg_write(&plot, stdout, &error), ERROR_INPUT);
    plot.nseries = 0;
    assert_int_equal(svg_write(&plot, stdout, &error), ERROR_INPUT);
    plot.nseries = SVG_SERIES_MAX + 1;
    assert_int_equal(svg_write(&plot, stdout, &error), ERROR_INPUT);
}

TEST(a_full_disk_is_reported)
{
    const struct svg_series series[] = {{.name = "s", .x = x4, .y = y4, .count = 4}};
    const struct svg_plot plot = plot_of(series, 1);
    FILE *out = fopen("/dev/full", "w");

    assert_non_null(out);
    assert_int_equal(svg_write(&plot, out, &error), ERROR_SYSTEM);
    fclose(out);
}
