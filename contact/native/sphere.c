/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A sphere on a mesh in the native engine: parallel springs stand over each facet, on the part
 * inside the circle in which the sphere cuts the facet's plane. The origin is the circle's center;
 * h is the height of the sphere's center over the plane. A spring at radius r has the length q - h
 * with q = sqrt(R^2 - r^2). The integrals over the part are integrals along its rim:
 *
 *     integral of f(r) dA = rim integral of G(r) dtheta, G(r) the integral of f(s) s ds from 0 to r
 *
 * So a whole circle has a closed form, and force and moment do not depend on the triangulation of
 * the plane.
 */
#include "base/portable_math.h"
#include "contact/native/narrow_phase.h"

#include <string.h>

#define PI 3.14159265358979323846
#define NEGLIGIBLE 1e-12      /* smaller parts of a circle count as rounding errors */
#define MEAN_LEVER (8.0 / 15) /* mean lever of a paraboloid of pressure, over its radius */

/* Integrals over the part of a facet that is in the circle. */
struct cap {
    double length; /* integral of the springs' lengths: the volume of the overlap */
    double square; /* integral of the squared lengths */
    double area;
    double moment[2]; /* integral of length times place */
};

struct circle {
    double R, h, r; /* radius of the sphere, height of its center, radius of the circle */
};

/* Computes the integrals of length times s ds and of its square from 0 to s. Both are divided by
 * s^2, so that they are defined at 0. */
static void circle_radial(const struct circle *c, double s, double *length, double *square)
{
    double R = c->R, h = c->h, s2 = s * s, q = sqrt(R * R - s2 > 0 ? R * R - s2 : 0);
    /* (R^3 - q^3)/(3 s^2), rewritten without cancellation */
    double cube = (R * R + R * q + q * q) / (3 * (R + q));

    *length = cube - h / 2;
    *square = (R * R + h * h) / 2 - s2 / 4 - 2 * h * cube;
}

/* Returns the integral of the length times s^2 ds from 0 to s, over s^3. */
static double circle_radial_moment(const struct circle *c, double s)
{
    double R2 = c->R * c->R, s2 = s * s, q = sqrt(R2 - s2 > 0 ? R2 - s2 : 0);

    if (s < 1e-3 * c->R) {
        return (c->R - c->h) / 3;
    }
    return (2 * s2 - R2) * q / (8 * s2) +
           R2 * R2 * portable_asin(s < c->R ? s / c->R : 1) / (8 * s2 * s) - c->h / 3;
}

/* Computes the integrals over the whole circle. */
static void circle_whole(const struct circle *c, struct cap *cap)
{
    double r2 = c->r * c->r, length, square;

    if (c->h > 0) {
        /* The springs' lengths t = q - h run from 0 to d, and s ds is (t + h) dt */
        double d = c->R - c->h, d2 = d * d;

        *cap = (struct cap){.length = PI * d2 * (d * (2.0 / 3) + c->h),
                            .square = PI * d2 * d * (d / 2 + c->h * (2.0 / 3)),
                            .area = PI * r2};
        return;
    }
    circle_radial(c, c->r, &length, &square);
    *cap = (struct cap){
        .length = 2 * PI * length * r2, .square = 2 * PI * square * r2, .area = PI * r2};
}

/* Adds the integrals along a straight piece of the rim inside the circle. */
static void cap_add_chord(const struct circle *c, const double a[2], const double b[2],
                          struct cap *cap)
{
    /* Five Gauss-Legendre points on 0 to 1 */
    static const double node[5] = {0.046910077030668, 0.2307653449471585, 0.5, 0.7692346550528415,
                                   0.953089922969332};
    static const double weight[5] = {0.1184634425280945, 0.2393143352496833, 0.2844444444444445,
                                     0.2393143352496833, 0.1184634425280945};
    double cross = a[0] * b[1] - a[1] * b[0];

    for (int i = 0; i < 5; i++) {
        double p[2] = {a[0] + node[i] * (b[0] - a[0]), a[1] + node[i] * (b[1] - a[1])};
        double s = sqrt(p[0] * p[0] + p[1] * p[1]), w = weight[i] * cross;
        double length, square, moment = circle_radial_moment(c, s);

        circle_radial(c, s, &length, &square);
        cap->length += w * length;
        cap->square += w * square;
        cap->moment[0] += w * moment * p[0];
        cap->moment[1] += w * moment * p[1];
    }
    cap->area += cross / 2;
}

/* Adds the integrals along the arc of the circle that replaces a piece of the facet's rim outside
 * the circle. */
static void cap_add_arc(const struct circle *c, const double a[2], const double b[2],
                        struct cap *cap)
{
    double la = sqrt(a[0] * a[0] + a[1] * a[1]), lb = sqrt(b[0] * b[0] + b[1] * b[1]);
    double angle = portable_atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
    double r2 = c->r * c->r, length, square, moment = circle_radial_moment(c, c->r);

    circle_radial(c, c->r, &length, &square);
    cap->length += length * r2 * angle;
    cap->square += square * r2 * angle;
    cap->area += r2 * angle / 2;
    cap->moment[0] += moment * r2 * c->r * (b[1] / lb - a[1] / la);
    cap->moment[1] += moment * r2 * c->r * (a[0] / la - b[0] / lb);
}

/* Adds the integrals along one edge of the facet, from a to b relative to the circle's center: the
 * pieces outside, inside and outside again. */
static void cap_add_edge(const struct circle *c, const double a[2], const double b[2],
                         struct cap *cap)
{
    double e[2] = {b[0] - a[0], b[1] - a[1]};
    double ee = e[0] * e[0] + e[1] * e[1], ae = a[0] * e[0] + a[1] * e[1];
    double aa = a[0] * a[0] + a[1] * a[1] - c->r * c->r;
    double root = ae * ae - ee * aa, t[2], p[2], q[2];

    /* Completely outside: the edge or its line misses the circle */
    if (root <= 0) {
        cap_add_arc(c, a, b, cap);
        return;
    }
    root = sqrt(root);
    t[0] = (-ae - root) / ee;
    t[1] = (-ae + root) / ee;
    if (t[0] >= 1 || t[1] <= 0) {
        cap_add_arc(c, a, b, cap);
        return;
    }

    /* The piece from p to q is inside; the pieces before and after it are outside */
    t[0] = t[0] > 0 ? t[0] : 0;
    t[1] = t[1] < 1 ? t[1] : 1;
    for (int k = 0; k < 2; k++) {
        p[k] = a[k] + t[0] * e[k];
        q[k] = a[k] + t[1] * e[k];
    }
    if (t[0] > 0) {
        cap_add_arc(c, a, p, cap);
    }
    cap_add_chord(c, p, q, cap);
    if (t[1] < 1) {
        cap_add_arc(c, q, b, cap);
    }
}

/* Computes the integrals over the part of the facet in the circle; returns false if there is none.
 * origin: the circle's center; E: the axes of the plane. */
static bool facet_find_cap(const struct solid *solid, const struct facet *f, const struct circle *c,
                           const double origin[3], const double (*E)[3], struct cap *cap)
{
    double corner[FACET_MAX_VERTICES][2], to[3], room = f->inradius - c->r;
    struct cap circle;
    bool whole = true;

    /* The circle is inside the facet's inscribed circle */
    circle_whole(c, &circle);
    vec3_sub(f->center, origin, to);
    if (room > 0 && vec3_dot(to, to) <= room * room) {
        *cap = circle;
        return true;
    }

    /* The whole circle is outside an edge, or inside all edges */
    for (int i = 0; i < f->count; i++) {
        vec3_sub(solid->ring[f->first + i], origin, to);
        corner[i][0] = vec3_dot(E[0], to);
        corner[i][1] = vec3_dot(E[1], to);
    }
    for (int i = 0; i < f->count; i++) {
        const double *a = corner[i], *b = corner[i + 1 < f->count ? i + 1 : 0];
        double ex = b[0] - a[0], ey = b[1] - a[1];
        double side = a[0] * ey - a[1] * ex, reach = c->r * sqrt(ex * ex + ey * ey);

        if (side <= -reach) {
            return false;
        }
        whole = whole && side >= reach;
    }
    if (whole) {
        *cap = circle;
        return true;
    }

    /* Otherwise a part of the circle: integrals along the rim */
    *cap = (struct cap){0};
    for (int i = 0; i < f->count; i++) {
        cap_add_edge(c, corner[i], corner[i + 1 < f->count ? i + 1 : 0], cap);
    }
    /* A facet that the circle just misses leaves only rounding errors */
    return cap->length > NEGLIGIBLE * circle.length && cap->area > NEGLIGIBLE * circle.area &&
           cap->square > 0;
}

/* Adds four springs around the center of pressure in the facet's plane, so that friction brakes a
 * spinning sphere. depth: length of each spring, m; weight: 0 to 1. */
static void sphere_add_springs(const struct facet *f, const struct cap *cap, const double center[3],
                               double depth, double weight, const struct native_law *law,
                               struct native_batch *batch)
{
    const double(*E)[3] = f->axis;
    const double lever = MEAN_LEVER * sqrt(cap->area / PI);
    const size_t n = batch->n;

    /* Stored side by side, because they are read again soon */
    for (int k = 0; k < 3; k++) {
        double at_center = center[k] - law->share[0] * depth * f->normal[k];
        double first = lever * E[0][k], second = lever * E[1][k], down = -f->normal[k];
        double p[4] = {at_center + first, at_center + second, at_center - first,
                       at_center - second};
        double d[4] = {down, down, down, down};

        memcpy(batch->p[k] + n, p, sizeof p);
        memcpy(batch->d[k] + n, d, sizeof d);
    }

    /* Stiffness is k times the area, because each spring grows with the depth of the sphere */
    for (size_t i = 0; i < 4; i++) {
        batch->force[n + i] = weight * law->stiffness * cap->length / 4;
        batch->depth[n + i] = depth;
        batch->rate[n + i] = weight * law->stiffness * cap->area / 4;
    }
    batch->n += 4;
}

/* Adds the springs between a sphere with its center at `at` and a facet. */
static void sphere_add_facet(const struct native_overlap *o, const struct facet *f,
                             const double at[3], double radius)
{
    const struct solid *solid = o->solid[0];
    struct native_sum *sum = o->sum;
    struct circle c = {radius, vec3_dot(f->normal, at) - f->offset, radius};
    const double(*E)[3] = f->axis;
    double origin[3], to[3], middle[3], depth, inverse, weight, reach;
    struct cap cap;

    /* The circle in which the sphere cuts the plane. Its radius decreases again when the center is
     * below the plane; a facet no longer holds a sphere that has sunk by a diameter */
    if (fabs(c.h) >= radius) {
        return;
    }
    c.r = sqrt((radius - c.h) * (radius + c.h));
    vec3_add_scaled(at, -c.h, f->normal, origin);
    vec3_sub(f->center, origin, to);
    reach = f->radius + c.r;
    if (vec3_dot(to, to) >= reach * reach) {
        return;
    }
    if (!facet_find_cap(solid, f, &c, origin, E, &cap)) {
        return;
    }

    /* The mean spring: its length, its place, and its weight from the depth of its middle */
    inverse = 1 / cap.length;
    depth = cap.square * inverse;
    for (int k = 0; k < 3; k++) {
        origin[k] += (cap.moment[0] * E[0][k] + cap.moment[1] * E[1][k]) * inverse;
    }
    vec3_add_scaled(origin, -depth / 2, f->normal, middle);
    weight = native_ramp(solid_depth(solid, middle, 1.01 * depth / 2) / (depth / 2), DEPTH_NONE,
                         DEPTH_FULL);
    if (weight <= 0) {
        return;
    }

    native_make_room(o, 4);
    sphere_add_springs(f, &cap, origin, depth, weight, o->law, &o->scratch->batch);
    sum->area += weight * cap.area;
    depth = c.R - c.h;
    sum->depth = weight >= 0.5 && depth > sum->depth ? depth : sum->depth;
}

void native_overlap_sphere(const struct native_overlap *o)
{
    const double *at = o->relative->p, radius = o->capsule[1].radius - o->from;
    const struct tree *tree = &o->solid[0]->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);

    while (node != end && radius > 0) {
        if (box_distance2(&node->box, at) >= radius * radius) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            sphere_add_facet(o, &o->solid[0]->facet[tree->item[node->first + i]], at, radius);
        }
        ++node;
    }
}
