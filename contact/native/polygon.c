/* SPDX-License-Identifier: Apache-2.0 */
/* Clips polygons under a bed of springs by depth, and puts springs on them. */
#include "contact/native/polygon.h"

#include "base/vec3.h"

#include <float.h>
#include <string.h>

void polygon_clip_depth(const struct polygon *in, struct polygon *out)
{
    out->n = 0;
    for (int i = 0; i < in->n && out->n + 2 <= POLYGON_MAX; i++) {
        const double *a = in->p[i], *b = in->p[i + 1 < in->n ? i + 1 : 0];

        if (a[DEPTH] >= 0) {
            memcpy(out->p[out->n++], a, sizeof in->p[i]);
        }
        if ((a[DEPTH] >= 0) != (b[DEPTH] >= 0)) {
            double t = a[DEPTH] / (a[DEPTH] - b[DEPTH]);

            for (int k = 0; k < 3; k++) {
                out->p[out->n][k] = a[k] + t * (b[k] - a[k]);
            }
            out->p[out->n++][DEPTH] = 0;
        }
    }
}

/* Returns twice the area of a triangle as seen along a normal, m2. */
static double triangle_twice_area(const double a[3], const double b[3], const double c[3],
                                  const double normal[3])
{
    double ab[3], ac[3], x[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_cross(ab, ac, x);
    return vec3_dot(x, normal);
}

double polygon_center(const struct polygon *g, const double normal[3], double center[4])
{
    double twice = 0, sum[4] = {0, 0, 0, 0};

    for (int i = 1; i + 1 < g->n; i++) {
        double part = triangle_twice_area(g->p[0], g->p[i], g->p[i + 1], normal);

        twice += part;
        for (int k = 0; k < 4; k++) {
            sum[k] += part * ((g->p[i][k] - g->p[0][k]) + (g->p[i + 1][k] - g->p[0][k]));
        }
    }
    for (int k = 0; k < 4 && twice > DBL_MIN; k++) {
        center[k] = g->p[0][k] + sum[k] / (3 * twice);
    }
    return twice;
}

void polygon_add_springs(struct native_scratch *s, const struct polygon *g, const double center[4],
                         const double normal[3], const double d[3], int parts, double pressure,
                         double share, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum)
{
    /* In each triangle between the center and an edge, and each of its parts */
    for (int i = 0; i < g->n; i++) {
        const double *v[3] = {center, g->p[i], g->p[i + 1 < g->n ? i + 1 : 0]};
        double twice = triangle_twice_area(v[0], v[1], v[2], normal);
        double rate = pressure * twice / (2 * FACET_POINTS * parts * parts);

        native_law_make_room(&s->batch, (size_t)(FACET_POINTS * parts * parts), law, relative, sum);
        for (int row = 0; row < parts; row++) {
            for (int at = 0; at < FACET_POINTS * (2 * (parts - row) - 1); at++) {
                double p[4], a, b;

                triangle_find_point(1.0 / parts, row, at / FACET_POINTS, at % FACET_POINTS, &a, &b);
                for (int k = 0; k < 4; k++) {
                    p[k] = v[0][k] + a * (v[1][k] - v[0][k]) + b * (v[2][k] - v[0][k]);
                }
                for (int k = 0; k < 3; k++) {
                    p[k] += share * p[DEPTH] * d[k];
                }
                batch_add_spring(&s->batch, p, d, rate, p[DEPTH]);
            }
        }
        sum->depth = v[1][DEPTH] > sum->depth ? v[1][DEPTH] : sum->depth;
    }
}
