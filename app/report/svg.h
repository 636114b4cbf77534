/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Draws line plots as SVG: axes with ticks at round numbers, lines, markers, and a legend. The same
 * numbers give the same bytes. Not RT-safe.
 */
#ifndef APP_REPORT_SVG_H
#define APP_REPORT_SVG_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { SVG_SERIES_MAX = 8 }; /* equal to the number of colors */

enum svg_style {
    SVG_LINE,
    SVG_LINE_MARKERS,
    SVG_MARKERS,
    SVG_DASHED, /* for a reference */
};

/* A series of points. A point that is not finite (or not positive on a logarithmic axis) leaves a
 * gap in the line. */
struct svg_series {
    const char *name; /* any text, for the legend */
    const double *x, *y;
    size_t count;
    enum svg_style style;
};

/* An axis of a plot. */
struct svg_axis {
    const char *label;
    bool logarithmic;
    bool fixed;      /* range from min to max; otherwise the range of the data */
    double min, max; /* min < max, both positive if logarithmic */
};

/* A plot, or one panel of several. */
struct svg_plot {
    const char *title;
    struct svg_axis x, y;
    const struct svg_series *series; /* the first one is drawn below the others */
    size_t nseries;                  /* 1 to SVG_SERIES_MAX */
    int width, height;               /* px; 0 = default of 720 and 450 */
    /* NULL = a separate document. Otherwise the plot becomes part of an HTML page, as wide as
     * possible; part is its unique name in that page. Then it has no style sheet: the page must
     * style .grid, .axis, .line and .title, and may change the colors of .paper, text and the
     * series .s0 to .s7 */
    const char *part;
};

/* svg_line returns a series. svg_panel returns a panel of 560 x 360 px with title, axis labels and
 * series. */
struct svg_series svg_line(const char *name, const double *x, const double *y, size_t count,
                           enum svg_style style);
struct svg_plot svg_panel(const char *title, const char *x, const char *y,
                          const struct svg_series *series, size_t nseries);

/* Writes plots one below the other in one document with the width of the first. Returns the same
 * errors as svg_write. */
enum error_code svg_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error);

/* Writes an SVG document. If a line has many more points than the plot has pixels, the function
 * keeps only the first, lowest, highest and last point of each pixel column, which looks the same.
 * Returns ERROR_INPUT for a plot without points or with more series than colors, and ERROR_SYSTEM
 * if out cannot be written. */
enum error_code svg_write(const struct svg_plot *plot, FILE *out, struct error *error);

/* Writes panels like svg_write_panels, as PNG. Returns ERROR_UNSUPPORTED without rsvg-convert. */
enum error_code png_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error);

#endif
