/* SPDX-License-Identifier: Apache-2.0 */
/* Writes plots as PNG: the SVG (app/report/svg.h) at twice its size, drawn by rsvg-convert, which
 * must be installed (Debian: librsvg2-bin). Not RT-safe. */
#ifndef APP_REPORT_PNG_H
#define APP_REPORT_PNG_H

#include "app/report/svg.h"

/* Writes panels as svg_write_panels does; ERROR_UNSUPPORTED when there is no rsvg-convert. */
enum error_code png_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error);

#endif
