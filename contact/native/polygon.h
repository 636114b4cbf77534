/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Flat convex polygons under a bed of springs, for the native engine: each corner has a place (m)
 * and how deep the bed is there, which is linear over the polygon. Nothing fails; all is RT-safe.
 */
#ifndef CONTACT_NATIVE_POLYGON_H
#define CONTACT_NATIVE_POLYGON_H

#include "contact/native/pairs.h"

/* Two facets on top of one another, clipped once by the depth, have a corner for each edge and one
 * more. Rounding may add some where corners are in line; beyond this they are dropped. */
#define POLYGON_MAX (2 * FACET_MAX_VERTICES + 8)

enum { DEPTH = 3 }; /* the fourth coordinate of a corner, m */

struct polygon {
    int n;
    double p[POLYGON_MAX][4];
};

/* Clips a polygon to where its depth is not negative. */
void polygon_clip_depth(const struct polygon *in, struct polygon *out);

/* Computes twice the area as seen along a normal (returned, m2), and the centroid with its
 * depth. */
double polygon_center(const struct polygon *g, const double normal[3], double center[4]);

/* Adds the springs on a polygon: three in each part (parts: of struct facet) of each triangle
 * between the center (polygon_center's) and an edge, which integrates force and moment of a linear
 * depth exactly. pressure is the elastic force per depth and area as seen along the normal, share
 * how far along d from the polygon a spring acts. */
void polygon_add_springs(struct native_scratch *s, const struct polygon *g, const double center[4],
                         const double normal[3], const double d[3], int parts, double pressure,
                         double share, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum);

#endif
