/* SPDX-License-Identifier: Apache-2.0 */
/* Draws line plots as SVG. */
#include "app/report/svg.h"

#include "base/markup.h"

#include <errno.h>
#include <math.h>
#include <string.h>

enum {
    WIDTH = 720,
    HEIGHT = 450,
    TOP = 36, /* space above the drawing area without the legend, px */
    BOTTOM = 56,
    LEFT = 92,
    RIGHT = 24,
    TICKS = 6,      /* desired number of ticks on an axis */
    TICKS_MAX = 40, /* largest number of ticks; the steps below give at most 13 */
    LEGEND_LINE = 18,
    LEGEND_KEY = 50, /* width of the line of a legend entry, with the space around it, px */
    CHARACTER = 7,   /* approximate width of a character at font size 12, px */
    DENSE = 8,       /* number of points per pixel at which a line is reduced */
};

/* Okabe-Ito colors, which color-blind readers can distinguish. */
static const char *const colors[SVG_SERIES_MAX] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                   "#e69f00", "#56b4e9", "#000000", "#999999"};

/* The scale of an axis: its range, and the positions of both ends on the page. */
struct scale {
    const struct svg_axis *axis;
    double min, max; /* in values, or in decimal logarithms */
    double from, to; /* px */
};

/* The panel being drawn. */
struct page {
    const struct svg_plot *plot;
    const char *area; /* name of the drawing area, unique in the document */
    struct scale x, y;
    FILE *out;
};

struct svg_series svg_line(const char *name, const double *x, const double *y, size_t count,
                           enum svg_style style)
{
    return (struct svg_series){name, x, y, count, style};
}

struct svg_plot svg_panel(const char *title, const char *x, const char *y,
                          const struct svg_series *series, size_t nseries)
{
    return (struct svg_plot){title, {.label = x}, {.label = y}, series, nseries, 560, 360, NULL};
}

/* Converts a value to a position on the page, px. */
static double on_scale(const struct scale *scale, double value)
{
    double number = scale->axis->logarithmic ? log10(value) : value;

    return scale->from +
           (number - scale->min) / (scale->max - scale->min) * (scale->to - scale->from);
}

/* Checks whether an axis can show a value: it must be finite, and positive on a logarithmic
 * axis. */
static bool value_is_drawable(const struct svg_axis *axis, double value)
{
    return isfinite(value) && (!axis->logarithmic || value > 0.0);
}

/* Checks whether both coordinates of a point can be drawn. */
static bool point_is_drawable(const struct svg_plot *plot, const struct svg_series *series,
                              size_t i)
{
    return value_is_drawable(&plot->x, series->x[i]) && value_is_drawable(&plot->y, series->y[i]);
}

/* Returns the distance of ticks: a round number, or whole decades. */
static double tick_step(const struct scale *scale)
{
    double range = scale->max - scale->min;

    if (scale->axis->logarithmic) {
        return fmax(1.0, ceil(range / (2.0 * TICKS)));
    }

    /* Choose the step for about TICKS ticks: 1, 2 or 5 times a power of ten */
    double raw = range / TICKS, power = pow(10.0, floor(log10(raw))), digit = raw / power;

    return power * (digit < 1.5 ? 1.0 : digit < 3.5 ? 2.0 : digit < 7.5 ? 5.0 : 10.0);
}

/* Finds the range of an axis: the fixed range, else the range of all values that can be drawn, with
 * a margin. Returns false if there are no such values. */
static bool find_range(const struct svg_plot *plot, bool vertical, struct scale *scale)
{
    const struct svg_axis *axis = vertical ? &plot->y : &plot->x;
    double low = (double)INFINITY, high = -(double)INFINITY, margin;

    /* Find the lowest and highest value, or their decimal logarithms */
    for (size_t s = 0; s < plot->nseries; s++) {
        const struct svg_series *series = &plot->series[s];

        for (size_t i = 0; i < series->count; i++) {
            if (point_is_drawable(plot, series, i)) {
                double value = vertical ? series->y[i] : series->x[i];

                value = axis->logarithmic ? log10(value) : value;
                low = fmin(low, value);
                high = fmax(high, value);
            }
        }
    }
    if (!(low <= high)) {
        return false;
    }

    /* Use the fixed range, whole decades, or a margin of 4 %; a single value also gets a range */
    if (axis->fixed) {
        low = axis->logarithmic ? log10(axis->min) : axis->min;
        high = axis->logarithmic ? log10(axis->max) : axis->max;
    } else if (axis->logarithmic) {
        low = floor(low);
        high = fmax(ceil(high), low + 1.0);
    } else {
        margin = high > low ? 0.04 * (high - low) : fmax(0.1 * fabs(high), 1e-300);
        low -= margin;
        high += margin;
    }
    scale->axis = axis;
    scale->min = low;
    scale->max = high;
    return true;
}

/* Draws a tick: a grid line and its label. */
static void put_tick(const struct page *page, const struct scale *scale, bool vertical,
                     double number, double step)
{
    double at =
        scale->from + (number - scale->min) / (scale->max - scale->min) * (scale->to - scale->from);

    if (vertical) {
        fprintf(page->out, "<path class=\"grid\" d=\"M%.2f %.2fH%.2f\"/>", page->x.from, at,
                page->x.to);
        fprintf(page->out, "<text x=\"%.2f\" y=\"%.2f\" text-anchor=\"end\">", page->x.from - 8.0,
                at + 4.0);
    } else {
        fprintf(page->out, "<path class=\"grid\" d=\"M%.2f %.2fV%.2f\"/>", at, page->y.from,
                page->y.to);
        fprintf(page->out, "<text x=\"%.2f\" y=\"%.2f\" text-anchor=\"middle\">", at,
                page->y.from + 18.0);
    }

    /* Write the label of a tick. On a logarithmic axis, number is the exponent of ten. */
    double largest = fmax(fabs(scale->min), fabs(scale->max));

    if (scale->axis->logarithmic) {
        if (number >= -2.0 && number <= 4.0) {
            fprintf(page->out, "%g", pow(10.0, number));
        } else {
            fprintf(page->out, "1e%d", (int)number);
        }
    } else if (largest >= 1e6 || largest < 1e-3) {
        fprintf(page->out, "%.3g", number);
    } else {
        fprintf(page->out, "%.*f", (int)fmax(0.0, fmin(17.0, -floor(log10(step) + 1e-9))), number);
    }
    fputs("</text>\n", page->out);
}

/* Draws the ticks of an axis, at multiples of its step. */
static void put_ticks(const struct page *page, const struct scale *scale, bool vertical)
{
    double step = tick_step(scale), first = ceil(scale->min / step - 1e-9);

    for (int i = 0; i < TICKS_MAX; i++) {
        double number = (first + i) * step;

        if (number > scale->max + 1e-9 * step) {
            break;
        }
        /* Convert -0 to 0 */
        put_tick(page, scale, vertical, number == 0.0 ? 0.0 : number, step);
    }
}

/* Draws the ticks, the axes with their labels, and the title. */
static void put_axes(const struct page *page)
{
    const struct svg_plot *plot = page->plot;
    double middle_x = 0.5 * (page->x.from + page->x.to);
    double middle_y = 0.5 * (page->y.from + page->y.to);

    put_ticks(page, &page->x, false);
    put_ticks(page, &page->y, true);
    fprintf(page->out, "<path class=\"axis\" d=\"M%.2f %.2fV%.2fH%.2f\"/>\n", page->x.from,
            page->y.to, page->y.from, page->x.to);
    fprintf(page->out, "<text class=\"title\" x=\"%.2f\" y=\"26\" text-anchor=\"middle\">",
            middle_x);
    markup_put(page->out, plot->title);
    fprintf(page->out, "</text>\n<text x=\"%.2f\" y=\"%.2f\" text-anchor=\"middle\">", middle_x,
            page->y.from + 42.0);
    markup_put(page->out, plot->x.label);
    fprintf(page->out,
            "</text>\n<text transform=\"translate(20 %.2f) rotate(-90)\" text-anchor=\"middle\">",
            middle_y);
    markup_put(page->out, plot->y.label);
    fputs("</text>\n", page->out);
}

/* Starts the path of series s, before its data. */
static void open_line(const struct page *page, size_t s)
{
    fputs("<path class=\"line", page->out);
    if (page->plot->part) {
        fprintf(page->out, " s%zu", s);
    }
    fprintf(page->out, "\" stroke=\"%s\"%s d=\"", colors[s],
            page->plot->series[s].style == SVG_DASHED ? " stroke-dasharray=\"6 4\"" : "");
}

/* Draws the marker of a point of series s. */
static void put_dot(const struct page *page, size_t s, double x, double y)
{
    fprintf(page->out, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"3\" fill=\"%s\"", x, y, colors[s]);
    if (page->plot->part) {
        fprintf(page->out, " class=\"s%zu\"", s);
    }
    fputs("/>", page->out);
}

/* Adds a point to the path: a line to the point if `drawing`, else a move to it. */
static void put_line_point(const struct page *page, const struct svg_series *series, size_t i,
                           bool drawing)
{
    fprintf(page->out, "%c%.2f %.2f", drawing ? 'L' : 'M', on_scale(&page->x, series->x[i]),
            on_scale(&page->y, series->y[i]));
}

/* Returns the end of the run of points, from i on, in one pixel column. *low and *high receive the
 * lowest and the highest point. */
static size_t find_column_end(const struct page *page, const struct svg_series *series, size_t i,
                              size_t *low, size_t *high)
{
    double column = floor(on_scale(&page->x, series->x[i]));

    *low = *high = i;
    while (i < series->count && point_is_drawable(page->plot, series, i) &&
           floor(on_scale(&page->x, series->x[i])) == column) {
        *low = series->y[i] < series->y[*low] ? i : *low;
        *high = series->y[i] > series->y[*high] ? i : *high;
        i++;
    }
    return i;
}

/* Draws a series that has many points per pixel. It draws only the first, lowest, highest and last
 * point of each pixel column. */
static void put_dense_line(const struct page *page, const struct svg_series *series)
{
    bool drawing = false;

    for (size_t i = 0; i < series->count;) {
        size_t low, high, end, last = i;

        if (!point_is_drawable(page->plot, series, i)) {
            drawing = false;
            i++;
            continue;
        }
        end = find_column_end(page, series, i, &low, &high);
        put_line_point(page, series, i, drawing);
        drawing = true;

        /* The lowest and the highest point in order of time, then the last point, each once */
        const size_t rest[] = {low < high ? low : high, low < high ? high : low, end - 1};

        for (size_t k = 0; k < 3; k++) {
            if (rest[k] > last) {
                put_line_point(page, series, rest[k], true);
                last = rest[k];
            }
        }
        i = end;
    }
}

/* Draws the line of a series. Points that cannot be drawn leave a gap. */
static void put_line(const struct page *page, size_t s)
{
    const struct svg_series *series = &page->plot->series[s];
    bool drawing = false;

    open_line(page, s);
    if ((double)series->count > DENSE * (page->x.to - page->x.from)) {
        put_dense_line(page, series);
    } else {
        for (size_t i = 0; i < series->count; i++) {
            bool drawable = point_is_drawable(page->plot, series, i);

            if (drawable) {
                put_line_point(page, series, i, drawing);
            }
            drawing = drawable;
        }
    }
    fputs("\"/>\n", page->out);
}

/* Draws the markers of a series. */
static void put_markers(const struct page *page, size_t s)
{
    const struct svg_series *series = &page->plot->series[s];

    for (size_t i = 0; i < series->count; i++) {
        if (point_is_drawable(page->plot, series, i)) {
            put_dot(page, s, on_scale(&page->x, series->x[i]), on_scale(&page->y, series->y[i]));
            putc('\n', page->out);
        }
    }
}

/* Finds the position of legend entry s. Entries fill rows above the drawing area. Returns the
 * number of rows so far. */
static int legend_place(const struct svg_plot *plot, size_t s, double from, double to, double *x)
{
    int rows = 1;

    *x = from;
    for (size_t i = 0;; i++) {
        double width = LEGEND_KEY + CHARACTER * (double)strlen(plot->series[i].name);

        if (*x > from && *x + width > to) {
            *x = from;
            rows++;
        }
        if (i == s) {
            return rows;
        }
        *x += width;
    }
}

/* Returns the width of a plot, px. */
static int plot_width(const struct svg_plot *plot)
{
    return plot->width ? plot->width : WIDTH;
}

/* Returns the height of a plot, px. */
static int plot_height(const struct svg_plot *plot)
{
    return plot->height ? plot->height : HEIGHT;
}

/* Draws a plot without its background, within its own width and height. */
static enum error_code put_plot(const struct svg_plot *plot, const char *area, FILE *out,
                                struct error *error)
{
    int width = plot_width(plot), height = plot_height(plot);
    struct page page = {.plot = plot, .area = area, .out = out};
    double unused;

    if (!find_range(plot, false, &page.x) || !find_range(plot, true, &page.y)) {
        return error_set(error, ERROR_INPUT, "found a plot without a point that can be drawn");
    }
    page.x.from = LEFT;
    page.x.to = width - RIGHT;
    page.y.from = height - BOTTOM;
    page.y.to =
        TOP + LEGEND_LINE * legend_place(plot, plot->nseries - 1, LEFT, width - RIGHT, &unused);
    put_axes(&page);

    /* Draw all series, clipped to the drawing area */
    fprintf(page.out,
            "<clipPath id=\"%s\"><rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\"/>"
            "</clipPath>\n<g clip-path=\"url(#%s)\">\n",
            page.area, page.x.from, page.y.to, page.x.to - page.x.from, page.y.from - page.y.to,
            page.area);
    for (size_t s = 0; s < page.plot->nseries; s++) {
        const struct svg_series *series = &page.plot->series[s];

        if (series->style != SVG_MARKERS) {
            put_line(&page, s);
        }
        if (series->style == SVG_MARKERS || series->style == SVG_LINE_MARKERS) {
            put_markers(&page, s);
        }
    }
    fputs("</g>\n", page.out);

    /* Draw the legend: the line or marker and the name of each series */
    for (size_t s = 0; s < page.plot->nseries; s++) {
        const struct svg_series *series = &page.plot->series[s];
        double x, y;

        y = TOP + LEGEND_LINE * legend_place(page.plot, s, page.x.from, page.x.to, &x) - 10.0;
        if (series->style != SVG_MARKERS) {
            open_line(&page, s);
            fprintf(page.out, "M%.2f %.2fh24\"/>", x, y - 4.0);
        }
        if (series->style == SVG_MARKERS || series->style == SVG_LINE_MARKERS) {
            put_dot(&page, s, x + 12.0, y - 4.0);
        }
        fprintf(page.out, "<text x=\"%.2f\" y=\"%.2f\">", x + 30.0, y);
        markup_put(page.out, series->name);
        fputs("</text>\n", page.out);
    }
    return ERROR_NONE;
}

enum error_code svg_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error)
{
    enum error_code code = ERROR_NONE;
    int height = 0, top = 0;

    for (size_t i = 0; i < npanel; i++) {
        height += plot_height(&panel[i]);
        if (panel[i].nseries < 1 || panel[i].nseries > SVG_SERIES_MAX) {
            return error_set(error, ERROR_INPUT, "found a plot of %zu series, expected 1 to %d",
                             panel[i].nseries, SVG_SERIES_MAX);
        }
    }

    /* Draw the panels one below the other, each with its own clip area */
    const int width = plot_width(panel);

    if (panel->part) {
        fputs("<svg class=\"plot\" role=\"img\"", out);
    } else {
        fprintf(out, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\"", width,
                height);
    }
    fprintf(out, " viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"12\">\n", width,
            height);
    if (!panel->part) {
        fputs("<style>.grid{stroke:#ddd;fill:none}.axis{stroke:#000;fill:none}.line{stroke-width:1."
              "5;fill:none;stroke-linejoin:round}.title{font-size:15px}</style>\n",
              out);
    }
    fprintf(out, "<rect%s width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
            panel->part ? " class=\"paper\"" : "", width, height);
    for (size_t i = 0; !code && i < npanel; i++) {
        char area[32];

        snprintf(area, sizeof area, i ? "area%zu" : "area", i);
        if (top) {
            fprintf(out, "<g transform=\"translate(0 %d)\">\n", top);
        }
        code = put_plot(&panel[i], panel[i].part ? panel[i].part : area, out, error);
        fputs(top ? "</g>\n" : "", out);
        top += plot_height(&panel[i]);
    }
    fputs("</svg>\n", out);
    if (!code && (fflush(out) == EOF || ferror(out))) {
        return error_set_errno(error, errno, "cannot write a plot");
    }
    return code;
}

enum error_code svg_write(const struct svg_plot *plot, FILE *out, struct error *error)
{
    return svg_write_panels(plot, 1, out, error);
}
