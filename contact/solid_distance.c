/* SPDX-License-Identifier: Apache-2.0 */
/* Distances to a solid. */
#include "base/vec3.h"
#include "contact/lanes.h"
#include "contact/solid.h"

#include <string.h>

#define TIE 2.2e-14 /* squares of distances this much apart are the same */

/* What of a triangle is nearest. */
enum feature { FACE = -1, EDGE_0, EDGE_1, EDGE_2, CORNER_0, CORNER_1, CORNER_2 };

/* The point of a triangle nearest to p, by the region that p projects to (Ericson 2005, 5.1.5). */
static enum feature nearest_of_triangle(const double a[3], const double b[3], const double c[3],
                                        const double p[3], double out[3])
{
    double ab[3], ac[3], ap[3], bp[3], cp[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_sub(p, a, ap);
    double d1 = vec3_dot(ab, ap), d2 = vec3_dot(ac, ap);

    if (d1 <= 0 && d2 <= 0) {
        memcpy(out, a, sizeof ab);
        return CORNER_0;
    }
    vec3_sub(p, b, bp);
    double d3 = vec3_dot(ab, bp), d4 = vec3_dot(ac, bp);

    if (d3 >= 0 && d4 <= d3) {
        memcpy(out, b, sizeof ab);
        return CORNER_1;
    }
    double vc = d1 * d4 - d3 * d2;

    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        vec3_add_scaled(a, d1 / (d1 - d3), ab, out);
        return EDGE_0;
    }
    vec3_sub(p, c, cp);
    double d5 = vec3_dot(ab, cp), d6 = vec3_dot(ac, cp);

    if (d6 >= 0 && d5 <= d6) {
        memcpy(out, c, sizeof ab);
        return CORNER_2;
    }
    double vb = d5 * d2 - d1 * d6;

    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        vec3_add_scaled(a, d2 / (d2 - d6), ac, out);
        return EDGE_2;
    }
    double va = d3 * d6 - d5 * d4;

    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        double bc[3];

        vec3_sub(c, b, bc);
        vec3_add_scaled(b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), bc, out);
        return EDGE_1;
    }
    double whole = 1 / (va + vb + vc);

    for (int k = 0; k < 3; ++k) {
        out[k] = a[k] + ab[k] * (vb * whole) + ac[k] * (vc * whole);
    }
    return FACE;
}

static enum feature nearest_of_face(const struct solid *s, int face, const double p[3],
                                    double out[3])
{
    const int *v = s->face[face];

    return nearest_of_triangle(s->vertex[v[0]], s->vertex[v[1]], s->vertex[v[2]], p, out);
}

/* Walks the tree, nearer child first, keeping the best. */
static bool search(const struct solid *s, const double p[3], double limit2,
                   struct solid_nearest *best, enum feature *feature)
{
    struct {
        int node;
        double distance2;
    } stack[TREE_DEPTH_MAX];
    int top = 0;
    double best_height = 0;

    best->face = -1;
    best->distance2 = limit2;
    stack[top].node = 0;
    stack[top++].distance2 = box_distance2(&s->faces.node[0].box, p);
    while (top > 0) {
        int index = stack[--top].node;
        const struct tree_node *node = &s->faces.node[index];

        if (stack[top].distance2 > best->distance2 * (1 + TIE)) {
            continue;
        }
        if (node->count == 0) {
            int child[2] = {index + 1, node->right};
            double d[2] = {box_distance2(&s->faces.node[child[0]].box, p),
                           box_distance2(&s->faces.node[child[1]].box, p)};
            int far = d[0] <= d[1];

            for (int i = 0; i < 2; ++i, far = !far) {
                stack[top].node = child[far];
                stack[top++].distance2 = d[far];
            }
            continue;
        }
        for (int i = 0; i < node->count; ++i) {
            int face = s->faces.item[node->first + i];
            double point[3], to[3], d2, height;
            enum feature f = nearest_of_face(s, face, p, point);

            vec3_sub(p, point, to);
            d2 = vec3_dot(to, to);
            height = vec3_dot(to, s->normal[face]);
            if (d2 < best->distance2 * (1 - TIE) ||
                (best->face >= 0 && d2 <= best->distance2 * (1 + TIE) &&
                 fabs(height) > best_height)) {
                best->face = face;
                best->distance2 = d2;
                best->inside = height < 0;
                best_height = fabs(height);
                *feature = f;
                memcpy(best->point, point, sizeof point);
            }
        }
    }
    return best->face >= 0;
}

void solid_nearest_of_face(const struct solid *solid, int face, const double p[3], double out[3])
{
    nearest_of_face(solid, face, p, out);
}

bool solid_find_nearest(const struct solid *solid, const double p[3], double limit2,
                        struct solid_nearest *nearest)
{
    enum feature feature = FACE;

    return search(solid, p, limit2, nearest, &feature);
}

/* The direction that tells inside from outside at the nearest point. */
static void pseudonormal(const struct solid *s, int face, enum feature feature, double out[3])
{
    if (feature >= CORNER_0) {
        memcpy(out, s->vertex_normal[s->face[face][feature - CORNER_0]], sizeof s->normal[0]);
    } else if (feature >= EDGE_0) {
        vec3_add_scaled(s->normal[face], 1, s->normal[s->neighbor[face][feature]], out);
    } else {
        memcpy(out, s->normal[face], sizeof s->normal[0]);
    }
}

/* Behind every facet. */
static double convex_depth(const struct solid *s, const double p[3])
{
    lanes depth = lanes_load(s->plane[3]) - p[0] * lanes_load(s->plane[0]) -
                  p[1] * lanes_load(s->plane[1]) - p[2] * lanes_load(s->plane[2]);

    for (size_t i = LANES; i < s->nplane; i += LANES) {
        lanes d = lanes_load(s->plane[3] + i) - p[0] * lanes_load(s->plane[0] + i) -
                  p[1] * lanes_load(s->plane[1] + i) - p[2] * lanes_load(s->plane[2] + i);

        depth = lanes_pick(lanes_less(d, depth), d, depth);
    }
    return lanes_least(depth);
}

double solid_depth(const struct solid *solid, const double p[3], double limit)
{
    struct solid_nearest nearest;
    enum feature feature = FACE;
    double n[3], to[3];

    if (solid->convex) {
        double depth = convex_depth(solid, p);

        /* outside, the planes say less than the distance; only that it is outside matters then */
        return depth < limit ? depth : limit;
    }
    if (!search(solid, p, limit * limit, &nearest, &feature)) {
        return limit;
    }
    pseudonormal(solid, nearest.face, feature, n);
    vec3_sub(nearest.point, p, to);
    return vec3_dot(to, n) >= 0 ? sqrt(nearest.distance2) : -sqrt(nearest.distance2);
}
