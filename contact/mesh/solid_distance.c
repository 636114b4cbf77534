/* SPDX-License-Identifier: Apache-2.0 */
/* Distance queries: the nearest point of a solid's surface, and the penetration depth of a point
 * (signed distance, positive inside). */
#include "contact/lanes.h"
#include "contact/mesh/solid.h"
#include "base/vec3.h"

#define TIE 2.2e-14 /* relative difference up to which squared distances are equal */

/* Finds the point of a triangle nearest to p, by the region of p's projection (Ericson 2005,
 * 5.1.5). Returns whether it is on the face, an edge or a corner. */
static enum triangle_feature triangle_find_nearest(const double a[3], const double b[3],
                                                   const double c[3], const double p[3],
                                                   double out[3])
{
    double ab[3], ac[3], ap[3], bp[3], cp[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_sub(p, a, ap);
    double d1 = vec3_dot(ab, ap), d2 = vec3_dot(ac, ap);

    /* Beyond corner a, then beyond b */
    if (d1 <= 0 && d2 <= 0) {
        memcpy(out, a, sizeof ab);
        return FEATURE_CORNER_0;
    }
    vec3_sub(p, b, bp);
    double d3 = vec3_dot(ab, bp), d4 = vec3_dot(ac, bp);

    if (d3 >= 0 && d4 <= d3) {
        memcpy(out, b, sizeof ab);
        return FEATURE_CORNER_1;
    }
    double vc = d1 * d4 - d3 * d2;

    /* Beside edge ab */
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        vec3_add_scaled(a, d1 / (d1 - d3), ab, out);
        return FEATURE_EDGE_0;
    }
    vec3_sub(p, c, cp);
    double d5 = vec3_dot(ab, cp), d6 = vec3_dot(ac, cp);

    /* Beyond corner c */
    if (d6 >= 0 && d5 <= d6) {
        memcpy(out, c, sizeof ab);
        return FEATURE_CORNER_2;
    }
    double vb = d5 * d2 - d1 * d6;

    /* Beside edge ac, then beside bc */
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        vec3_add_scaled(a, d2 / (d2 - d6), ac, out);
        return FEATURE_EDGE_2;
    }
    double va = d3 * d6 - d5 * d4;

    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        double bc[3];

        vec3_sub(c, b, bc);
        vec3_add_scaled(b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), bc, out);
        return FEATURE_EDGE_1;
    }

    /* Above the face: barycentric coordinates */
    double whole = 1 / (va + vb + vc);

    for (int k = 0; k < 3; k++) {
        out[k] = a[k] + ab[k] * (vb * whole) + ac[k] * (vc * whole);
    }
    return FEATURE_FACE;
}

/* Finds the point of a face nearest to p. */
static enum triangle_feature face_find_nearest(const struct solid *s, int face, const double p[3],
                                               double out[3])
{
    const int *v = s->face[face];

    return triangle_find_nearest(s->vertex[v[0]], s->vertex[v[1]], s->vertex[v[2]], p, out);
}

void solid_nearest_of_face(const struct solid *solid, int face, const double p[3], double out[3])
{
    face_find_nearest(solid, face, p, out);
}

/* Searches by branch and bound. Unlike the walks of contact/mesh/tree.h, it visits the nearer child
 * first and keeps the distance of each box. So a near point found early excludes most of the
 * tree. */
bool solid_find_nearest(const struct solid *solid, const double p[3], double limit2,
                        struct solid_nearest *nearest)
{
    struct {
        const struct tree_node *node;
        double distance2;
    } stack[TREE_DEPTH_MAX];
    int top = 0;
    double height = 0;

    nearest->face = -1;
    nearest->distance2 = limit2;
    stack[top].node = solid->faces.node;
    stack[top++].distance2 = box_distance2(&solid->faces.node->box, p);
    while (top > 0) {
        const struct tree_node *node = stack[--top].node;

        /* A nearer point may have been found since this box was pushed */
        if (stack[top].distance2 > nearest->distance2 * (1 + TIE)) {
            continue;
        }
        if (node->count > 0) {
            /* Update the nearest point with the faces of a leaf. Of equal distances, it takes the
             * face over which p is higher. height: height of p over the nearest face so far, m. */
            for (int i = 0; i < node->count; i++) {
                int face = solid->faces.item[node->first + i];
                double point[3], to[3], d2, h;
                enum triangle_feature feature = face_find_nearest(solid, face, p, point);

                vec3_sub(p, point, to);
                d2 = vec3_dot(to, to);
                h = vec3_dot(to, solid->normal[face]);
                if (d2 < nearest->distance2 * (1 - TIE) ||
                    (nearest->face >= 0 && d2 <= nearest->distance2 * (1 + TIE) &&
                     fabs(h) > height)) {
                    nearest->face = face;
                    nearest->feature = feature;
                    nearest->distance2 = d2;
                    nearest->inside = h < 0;
                    memcpy(nearest->point, point, sizeof point);
                    height = fabs(h);
                }
            }

            continue;
        }

        /* Pushes the farther child first, so that the nearer one is visited first */
        const struct tree_node *left = node + 1, *child[2] = {left, left + left->size};
        double d[2] = {box_distance2(&child[0]->box, p), box_distance2(&child[1]->box, p)};
        int far = d[0] <= d[1];

        for (int i = 0; i < 2; ++i, far = !far) {
            stack[top].node = child[far];
            stack[top++].distance2 = d[far];
        }
    }
    return nearest->face >= 0;
}

/* Returns the depth of p behind LANES planes from the i-th on, m. */
LANES_INLINE lanes planes_depth(const struct solid *s, size_t i, const double p[3])
{
    return lanes_load(s->plane[PLANE_OFFSET] + i) - p[0] * lanes_load(s->plane[PLANE_X] + i) -
           p[1] * lanes_load(s->plane[PLANE_Y] + i) - p[2] * lanes_load(s->plane[PLANE_Z] + i);
}

/* Returns the depth of p in a convex solid, m: the smallest depth behind a plane. */
static double solid_convex_depth(const struct solid *s, const double p[3])
{
    lanes depth = planes_depth(s, 0, p);

    for (size_t i = LANES; i < s->nplane; i += LANES) {
        lanes d = planes_depth(s, i, p);

        depth = lanes_pick(lanes_less(d, depth), d, depth);
    }
    return lanes_least(depth);
}

double solid_depth(const struct solid *solid, const double p[3], double limit)
{
    struct solid_nearest nearest;
    double n[3], to[3];

    /* Outside, the planes give only a lower bound of the distance; the callers then need only the
     * sign */
    if (solid->convex) {
        double depth = solid_convex_depth(solid, p);

        return depth < limit ? depth : limit;
    }

    /* Distance to the nearest point, with the sign of its pseudonormal */
    if (!solid_find_nearest(solid, p, limit * limit, &nearest)) {
        return limit;
    }

    /* Compute the pseudonormal at the nearest point, which gives the sign of the distance */
    const struct solid *s = solid;

    if (nearest.feature >= FEATURE_CORNER_0) {
        int vertex = s->face[nearest.face][nearest.feature - FEATURE_CORNER_0];

        memcpy(n, s->vertex_normal[vertex], sizeof s->vertex_normal[vertex]);
    } else if (nearest.feature >= FEATURE_EDGE_0) {
        vec3_add_scaled(s->normal[nearest.face], 1,
                        s->normal[s->neighbor[nearest.face][nearest.feature]], n);
    } else {
        memcpy(n, s->normal[nearest.face], sizeof s->normal[nearest.face]);
    }
    vec3_sub(nearest.point, p, to);
    return vec3_dot(to, n) >= 0 ? sqrt(nearest.distance2) : -sqrt(nearest.distance2);
}
