/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Flat convex polygons in the plane of a facet (contact/mesh/solid.h), along its axes from its
 * center, for the native engine. Meters. Nothing fails; all is RT-safe.
 */
#ifndef CONTACT_NATIVE_CLIP2D_H
#define CONTACT_NATIVE_CLIP2D_H

#include "contact/native/narrow_phase.h"

/* Two stacked facets, clipped once by the depth, have at most one corner per edge and one more.
 * Rounding may add corners where edges are in line; corners beyond this limit are dropped. */
#define POLYGON_MAX (2 * FACET_MAX_VERTICES + 8)

/* A polygon. Area and moments require counterclockwise corners, seen against the facet's normal. */
struct polygon2d {
    int n;
    double x[POLYGON_MAX], y[POLYGON_MAX];
};

/* Moments of a polygon's area: twice the area (m2), the centroid (m), and the mean squares and
 * product of coordinates relative to the centroid (m2). */
struct moments {
    double twice, x, y, xx, xy, yy;
};

/* Clips a polygon to the part where a linear function is not negative; side: values of the
 * function at the corners. */
void clip2d_side(const struct polygon2d *in, const double *side, struct polygon2d *out);

/* Clips the polygon g[from] to a facet; returns the result, which is g[0] or g[1]. */
const struct polygon2d *clip2d_to_facet(const struct solid *solid, const struct facet *facet,
                                        struct polygon2d g[2], int from);

/* Writes the outline of a facet as a polygon. */
void clip2d_outline(const struct solid *solid, const struct facet *facet, struct polygon2d *out);

/* Computes the moments of a polygon of at least three corners; second moments only if `second`. If
 * the area is 0, sets only twice. */
void clip2d_moments(const struct polygon2d *g, bool second, struct moments *m);

/* Computes three points with the moments of a polygon up to the second. They integrate force and
 * moment of a linear depth exactly. They are L times the corners of an equilateral triangle about
 * the centroid, where L L' is twice the matrix of mean squares. In a convex polygon they are
 * inside, because the ellipse through them is inside (Kannan, Lovasz, Simonovits 1995). */
void clip2d_three_points(const struct moments *m, double x[3], double y[3]);

#endif
