/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Flat convex polygons in the plane of a facet (contact/mesh/solid.h), along its axes from its
 * center, for the native engine. Meters. Nothing fails; all is RT-safe.
 */
#ifndef CONTACT_NATIVE_CLIP2D_H
#define CONTACT_NATIVE_CLIP2D_H

#include "contact/native/narrow_phase.h"

#include <stdbool.h>

/* Two facets on top of one another, clipped once by the depth, have a corner for each edge and one
 * more. Rounding may add some where corners are in line; beyond this they are dropped. */
#define POLYGON_MAX (2 * FACET_MAX_VERTICES + 8)

/* A polygon; counterclockwise seen against the facet's normal where its area or moments are
 * wanted. */
struct polygon2d {
    int n;
    double x[POLYGON_MAX], y[POLYGON_MAX];
};

/* Moments of a polygon's area: twice the area (m2), the centroid (m), and the mean squares and
 * product of the distances off it (m2). */
struct moments {
    double twice, x, y, xx, xy, yy;
};

/* Clips a polygon to where a linear function of the place is not negative; side: its values at the
 * corners. */
void clip2d_side(const struct polygon2d *in, const double *side, struct polygon2d *out);

/* Clips the polygon g[from] to a facet; returns the clipped one, which is one of the two. */
const struct polygon2d *clip2d_to_facet(const struct solid *solid, const struct facet *facet,
                                        struct polygon2d g[2], int from);

/* Writes the outline of a facet as a polygon. */
void clip2d_outline(const struct solid *solid, const struct facet *facet, struct polygon2d *out);

/* Computes the moments of a polygon of at least three corners; the second ones only when they are
 * wanted. Only twice is set where there is no area. */
void clip2d_moments(const struct polygon2d *g, bool second, struct moments *m);

#endif
