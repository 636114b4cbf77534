/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Line plots as SVG: axes with ticks at round numbers, lines and markers, a legend. The same bytes
 * for the same numbers. Not RT-safe.
 */
#ifndef APP_REPORT_SVG_H
#define APP_REPORT_SVG_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { SVG_SERIES_MAX = 8 }; /* as many as there are colors */

enum svg_style {
    SVG_LINE,
    SVG_LINE_MARKERS,
    SVG_MARKERS,
    SVG_DASHED, /* for what the others are compared with */
};

/* A series of count points; one that is not finite (or not positive on a logarithmic axis) breaks
 * the line. */
struct svg_series {
    const char *name; /* in the legend; any text */
    const double *x, *y;
    size_t count;
    enum svg_style style;
};

/* An axis of a plot. */
struct svg_axis {
    const char *label;
    bool logarithmic;
    bool fixed;      /* from min to max; otherwise as wide as the series need */
    double min, max; /* min < max, both positive when logarithmic */
};

/* A plot, or one panel of several. */
struct svg_plot {
    const char *title;
    struct svg_axis x, y;
    const struct svg_series *series; /* the first lies below the others */
    size_t nseries;                  /* 1 to SVG_SERIES_MAX */
    int width, height;               /* px, 0 = 720 and 450 */
    /* NULL: a document of its own. Otherwise a name that no other plot of the same HTML page has:
     * the plot is a part of that page, without a style of its own, as wide as there is room for;
     * the page styles .grid, .axis, .line and .title, and may give .paper, text and the series' .s0
     * to .s7 other colors */
    const char *part;
};

/* Return a series, and a panel of 560 x 360 px with its title, the labels of its axes and its
 * series. */
struct svg_series svg_line(const char *name, const double *x, const double *y, size_t count,
                           enum svg_style style);
struct svg_plot svg_panel(const char *title, const char *x, const char *y,
                          const struct svg_series *series, size_t nseries);

/* Writes plots one below the other, as wide as the first, in one document. Errors as of
 * svg_write. */
enum error_code svg_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error);

/* Writes a whole SVG document. A line of far more points than the plot is wide keeps the first, the
 * least, the greatest and the last of each column of pixels, which looks the same. Fails with
 * ERROR_INPUT on a plot that holds no point or more series than colors, with ERROR_SYSTEM when out
 * cannot be written. */
enum error_code svg_write(const struct svg_plot *plot, FILE *out, struct error *error);

/* Writes panels as svg_write_panels does; ERROR_UNSUPPORTED when there is no rsvg-convert. */
enum error_code png_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error);

#endif
