/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A mesh on a half-space: parallel springs stand on the plane, along its normal, each as long as
 * the penetration there. The undamped force is the stiffness times the penetration volume for any
 * triangulation of the mesh.
 */
#include "contact/native/clip2d.h"
#include "contact/native/facet_below_plane.h"

#include <float.h>
#include <string.h>

#define FACING 0.5 /* cosine between normals; below it, a facet needs few springs */

enum { DEPTH = 3 }; /* index of the fourth coordinate of a corner: its depth, m */

struct polygon {
    int n;
    double p[POLYGON_MAX][4];
};

/* Returns twice the area of a triangle projected along a normal, m2. */
static double triangle_twice_area(const double a[3], const double b[3], const double c[3],
                                  const double normal[3])
{
    double ab[3], ac[3], x[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_cross(ab, ac, x);
    return vec3_dot(x, normal);
}

/* Computes twice the projected area (returned, m2), and the centroid with its depth. */
static double polygon_center(const struct polygon *g, const double normal[3], double center[4])
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

/* Adds the springs of a polygon: three in each part (facet.parts) of each triangle between the
 * center (from polygon_center) and an edge. They integrate force and moment of a linear depth
 * exactly. pressure: elastic force per depth and projected area. share: distance from the polygon
 * to the point of action along d, relative to the depth. */
static void polygon_add_springs(const struct native_overlap *o, const struct polygon *g,
                                const double center[4], const double normal[3], const double d[3],
                                int parts, double pressure, double share)
{
    /* For each triangle between the center and an edge, and each of its parts */
    for (int i = 0; i < g->n; i++) {
        const double *v[3] = {center, g->p[i], g->p[i + 1 < g->n ? i + 1 : 0]};
        double twice = triangle_twice_area(v[0], v[1], v[2], normal);
        double rate = pressure * twice / (2 * FACET_POINTS * parts * parts);

        native_make_room(o, (size_t)(FACET_POINTS * parts * parts));
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
                batch_add_spring(&o->scratch->batch, p, d, rate, p[DEPTH]);
            }
        }
        o->sum->depth = v[1][DEPTH] > o->sum->depth ? v[1][DEPTH] : o->sum->depth;
    }
}

/* ---- facets below the plane ---- */

/* Adds a facet that is completely below the plane: in closed form if that is enough, else one
 * spring per stored quadrature point. */
static void half_space_add_facet_below(const struct native_overlap *o, const struct facet *f,
                                       const struct facet_linear *bed, const double n[3],
                                       double height, double pressure)
{
    const struct solid *solid = o->solid[0];
    const double share = o->law->share[0];

    if (f->moments >= 0 && o->sum->gather && o->sum->one_way &&
        facet_below_plane_gather(solid, f, bed, n, pressure, o->law, o->relative, o->sum)) {
        o->sum->closed = true;
        return;
    }
    for (int done = 0; done < f->npoint;) {
        int room, take = f->npoint - done;
        struct native_batch *b = &o->scratch->batch;

        /* Adds as many points at a time as the batch has room for */
        native_make_room(o, 8);
        room = (int)(BATCH_MAX - b->n);
        take = take < room ? take : room;
        for (int i = 0; i < take; i++) {
            size_t from = (size_t)(f->point + done + i), to = b->n + (size_t)i;
            double x = solid->point[0][from], y = solid->point[1][from], z = solid->point[2][from];
            double depth = height - (n[0] * x + n[1] * y + n[2] * z);

            /* The point of action is off the facet, toward the plane by the facet's share of the
             * depth */
            b->p[0][to] = x + share * depth * n[0];
            b->p[1][to] = y + share * depth * n[1];
            b->p[2][to] = z + share * depth * n[2];
            b->d[0][to] = n[0];
            b->d[1][to] = n[1];
            b->d[2][to] = n[2];
            b->rate[to] = pressure * solid->weight[from];
            b->force[to] = b->rate[to] * depth;
            b->depth[to] = depth;
        }
        b->n += (size_t)take;
        done += take;
    }
}

/* Adds a facet's springs. n: the plane's normal; height: n . any point of the plane, m. */
static void half_space_add_facet(const struct native_overlap *o, const struct facet *f,
                                 const double n[3], double height)
{
    const struct solid *solid = o->solid[0];
    struct native_sum *sum = o->sum;
    double facing = -vec3_dot(f->normal, n);
    double deepest = 0, shallowest = DBL_MAX;
    struct polygon whole, cut, *sunk = &whole;
    double center[4], twice;

    if (facing <= 0 || height - vec3_dot(n, f->center) + f->radius <= 0) {
        return;
    }

    /* A facet with more than three corners may be completely below, as usual for a standing
     * foot */
    if (f->npoint > 0) {
        const struct facet_linear depth =
            facet_below_plane_depth(solid, f, n, height, &deepest, &shallowest);

        if (deepest > 0 && shallowest >= 0) {
            half_space_add_facet_below(o, f, &depth, n, height, o->law->stiffness * facing);
            sum->area += f->area * facing;
            sum->depth = deepest > sum->depth ? deepest : sum->depth;
        }
        if (deepest <= 0 || shallowest >= 0) {
            return;
        }
    }

    /* Penetration depth at the corners */
    whole.n = f->count;
    for (int i = 0; i < f->count; i++) {
        const double *v = solid->ring[f->first + i];
        double depth = height - vec3_dot(n, v);

        memcpy(whole.p[i], v, sizeof *solid->ring);
        whole.p[i][DEPTH] = depth;
        deepest = depth > deepest ? depth : deepest;
        shallowest = depth < shallowest ? depth : shallowest;
    }
    if (deepest <= 0) {
        return;
    }

    /* If a part is below, adds springs on the clipped part */
    if (shallowest < 0) {
        /* Clip the polygon to the part with a depth of at least 0 */
        cut.n = 0;
        for (int i = 0; i < whole.n && cut.n + 2 <= POLYGON_MAX; i++) {
            const double *a = whole.p[i], *b = whole.p[i + 1 < whole.n ? i + 1 : 0];

            if (a[DEPTH] >= 0) {
                memcpy(cut.p[cut.n++], a, sizeof whole.p[i]);
            }
            if ((a[DEPTH] >= 0) != (b[DEPTH] >= 0)) {
                double t = a[DEPTH] / (a[DEPTH] - b[DEPTH]);

                for (int k = 0; k < 3; k++) {
                    cut.p[cut.n][k] = a[k] + t * (b[k] - a[k]);
                }
                cut.p[cut.n++][DEPTH] = 0;
            }
        }

        sunk = &cut;
    }
    twice = polygon_center(sunk, f->normal, center);
    if (twice > DBL_MIN) {
        polygon_add_springs(o, sunk, center, f->normal, n, facing > FACING ? f->parts : 1,
                            o->law->stiffness * facing, o->law->share[0]);
        sum->area += facing * twice / 2;
    }
}

void native_overlap_half_space(const struct native_overlap *o)
{
    const struct solid *solid = o->solid[0];
    const double n[3] = {o->relative->R[2], o->relative->R[5], o->relative->R[8]};
    const double height = vec3_dot(n, o->relative->p) - o->from;
    const struct tree *tree = &solid->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);

    while (node != end) {
        /* Skips subtrees whose facets are all above the plane or all face away from it */
        if (box_least(&node->box, n) >= height ||
            box_least(&solid->normal_bounds[node - tree->node], n) >= 0) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            half_space_add_facet(o, &solid->facet[tree->item[node->first + i]], n, height);
        }
        ++node;
    }
}
