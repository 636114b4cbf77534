/* SPDX-License-Identifier: Apache-2.0 */
/* Polygons in the plane of a facet: clips them and computes their moments. */
#include "contact/native/clip2d.h"

#include "contact/lanes.h"

#include <float.h>

/* Clips in one walk around the polygon (Sutherland, Hodgman 1974). */
void clip2d_side(const struct polygon2d *in, const double *side, struct polygon2d *out)
{
    int n = 0;

    for (int i = 0; i < in->n && n + 2 <= POLYGON_MAX; i++) {
        int j = i + 1 < in->n ? i + 1 : 0;

        if (side[i] >= 0) {
            out->x[n] = in->x[i];
            out->y[n++] = in->y[i];
        }
        if ((side[i] >= 0) != (side[j] >= 0)) {
            double t = side[i] / (side[i] - side[j]);

            out->x[n] = in->x[i] + t * (in->x[j] - in->x[i]);
            out->y[n++] = in->y[i] + t * (in->y[j] - in->y[i]);
        }
    }
    out->n = n;
}

/* Computes the outline of a triangle (solids store no outlines of triangles), padded to full
 * lanes. */
static void triangle_outline(const struct facet *f, const double (*ring)[3], double *x, double *y)
{
    for (int i = 0; i < 3; i++) {
        double to[3];

        vec3_sub(ring[i], f->center, to);
        x[i] = vec3_dot(f->axis[0], to);
        y[i] = vec3_dot(f->axis[1], to);
    }
    for (int i = 3; i < FACET_OUTLINE(3); i++) {
        x[i] = x[0];
        y[i] = y[0];
    }
}

/* Finds the edges of an outline that have a corner of the polygon outside; bit i is edge i. */
static uint64_t outline_find_cutting_edges(const double *x, const double *y, int n,
                                           const struct polygon2d *g)
{
    uint64_t edges = 0;

    for (int i = 0; i < n; i += LANES) {
        lanes x0 = lanes_load(x + i), dx = lanes_load_any(x + i + 1) - x0;
        lanes y0 = lanes_load(y + i), dy = lanes_load_any(y + i + 1) - y0;
        lanes_mask outside = {0};

        for (int k = 0; k < g->n; k++) {
            outside |= lanes_less(dx * (g->y[k] - y0), dy * (g->x[k] - x0));
        }
        edges |= lanes_bits(outside) << i;
    }
    return edges; /* edges of length 0 cut nothing */
}

/* Checks whether a polygon lies inside a circle about the facet's center. */
static bool flat_is_in_circle(const struct polygon2d *g, double radius)
{
    for (int i = 0; i < g->n; i++) {
        if (g->x[i] * g->x[i] + g->y[i] * g->y[i] > radius * radius) {
            return false;
        }
    }
    return true;
}

/* Finds the outline of a facet with any number of corners. room: memory for a triangle's
 * outline. */
static void facet_find_outline(const struct solid *solid, const struct facet *f,
                               double room[2][FACET_OUTLINE(3)], const double **x, const double **y)
{
    if (f->count == 3) {
        triangle_outline(f, solid->ring + f->first, room[0], room[1]);
        *x = room[0];
        *y = room[1];
    } else {
        *x = solid->outline[0] + f->outline;
        *y = solid->outline[1] + f->outline;
    }
}

const struct polygon2d *clip2d_to_facet(const struct solid *solid, const struct facet *facet,
                                        struct polygon2d g[2], int from)
{
    _Alignas(64) double triangle[2][FACET_OUTLINE(3)];
    struct polygon2d *now = &g[from];
    const double *x, *y;
    double side[POLYGON_MAX];

    if (now->n < 3 || flat_is_in_circle(now, facet->inradius)) {
        return now;
    }

    /* Clips by each edge of the outline that has a corner outside */
    facet_find_outline(solid, facet, triangle, &x, &y);
    for (uint64_t edges = outline_find_cutting_edges(x, y, facet->count, now);
         edges != 0 && now->n >= 3; edges &= edges - 1) {
        struct polygon2d *next = now == &g[0] ? &g[1] : &g[0];
        int e = __builtin_ctzll(edges);
        double dx = x[e + 1] - x[e], dy = y[e + 1] - y[e];

        for (int i = 0; i < now->n; i++) {
            side[i] = dx * (now->y[i] - y[e]) - dy * (now->x[i] - x[e]);
        }
        clip2d_side(now, side, next);
        now = next;
    }
    return now;
}

void clip2d_outline(const struct solid *solid, const struct facet *facet, struct polygon2d *out)
{
    _Alignas(64) double triangle[2][FACET_OUTLINE(3)];
    const double *x, *y;

    facet_find_outline(solid, facet, triangle, &x, &y);
    out->n = facet->count;
    for (int i = 0; i < out->n; i++) {
        out->x[i] = x[i];
        out->y[i] = y[i];
    }
}

/* Sums over the triangles between the first corner and an edge. */
void clip2d_moments(const struct polygon2d *g, bool second, struct moments *m)
{
    double x0 = g->x[0], y0 = g->y[0], ux = g->x[1] - x0, uy = g->y[1] - y0;

    /* Sums about the first corner, without the factors 1/3, 1/6 or 1/12 */
    *m = (struct moments){0};
    for (int i = 2; i < g->n; i++) {
        double vx = g->x[i] - x0, vy = g->y[i] - y0, twice = ux * vy - uy * vx;
        double sx = ux + vx, sy = uy + vy;

        m->twice += twice;
        m->x += twice * sx;
        m->y += twice * sy;
        if (second) {
            m->xx += twice * (sx * sx - ux * vx);
            m->yy += twice * (sy * sy - uy * vy);
            m->xy += twice * (sx * sy + ux * uy + vx * vy);
        }
        ux = vx;
        uy = vy;
    }

    /* Means over the area; the second moments about the centroid */
    if (m->twice > DBL_MIN) {
        double inverse = 1 / m->twice, x = m->x * inverse / 3, y = m->y * inverse / 3;

        m->x = x0 + x;
        m->y = y0 + y;
        m->xx = m->xx * inverse / 6 - x * x;
        m->yy = m->yy * inverse / 6 - y * y;
        m->xy = m->xy * inverse / 12 - x * y;
    }
}

void clip2d_three_points(const struct moments *m, double x[3], double y[3])
{
    const double h = 0.86602540378443865; /* sqrt(3)/2 */

    /* L, the Cholesky factor; rounding may make a mean square negative */
    const double lx = sqrt(m->xx > 0 ? 2 * m->xx : 0), ly = lx > 0 ? 2 * m->xy / lx : 0;
    const double rest = 2 * m->yy - ly * ly, lyy = sqrt(rest > 0 ? rest : 0);

    x[0] = m->x;
    x[1] = m->x - h * lx;
    x[2] = m->x + h * lx;
    y[0] = m->y + lyy;
    y[1] = m->y - h * ly - lyy / 2;
    y[2] = m->y + h * ly - lyy / 2;
}
