/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Spheres in the native engine: on each other and on a half-space by Hertz's law, on a mesh by a
 * bed of springs over each facet. Such a bed stands on the part of the facet that lies in the
 * circle where the sphere cuts its plane. With the circle's center as origin and q = sqrt(R^2 -
 * r^2), h the height of the sphere's center over the plane, a spring at radius r is q - h long, and
 * the integrals over the part are those around its rim:
 *
 *     integral of f(r) dA = rim integral of G(r) dtheta, G(r) the integral of f(s) s ds from 0 to r
 *
 * So a whole circle has a closed form and force and moment do not depend on how the plane is cut.
 */
#include "base/vec3.h"
#include "contact/native_pairs.h"

#include <float.h>
#include <stdbool.h>
#include <string.h>

#define NOTHING 1e-12         /* of a circle */
#define MEAN_LEVER (8.0 / 15) /* of a paraboloid of pressure, over its radius */

/* Integrals over the part of a facet that is in the circle. */
struct cap {
    double length; /* of the springs: the volume of the overlap */
    double square; /* of the square of their length */
    double area;
    double moment[2]; /* of their length times the place */
};

struct circle {
    double R, h, r; /* radius of the sphere, height of its center, radius of the circle */
};

/* The integrals from 0 to s of the length and its square, over s^2 so that they have a value at 0.
 * */
static void radial(const struct circle *c, double s, double *length, double *square)
{
    double R = c->R, h = c->h, s2 = s * s, q = sqrt(R * R - s2 > 0 ? R * R - s2 : 0);
    /* (R^3 - q^3)/(3 s^2) without the cancellation */
    double cube = (R * R + R * q + q * q) / (3 * (R + q));

    *length = cube - h / 2;
    *square = (R * R + h * h) / 2 - s2 / 4 - 2 * h * cube;
}

/* That of the length times s, over s^3. */
static double radial_moment(const struct circle *c, double s)
{
    double R2 = c->R * c->R, s2 = s * s, q = sqrt(R2 - s2 > 0 ? R2 - s2 : 0);

    if (s < 1e-3 * c->R) {
        return (c->R - c->h) / 3;
    }
    return (2 * s2 - R2) * q / (8 * s2) + R2 * R2 * asin(s < c->R ? s / c->R : 1) / (8 * s2 * s) -
           c->h / 3;
}

/* The whole circle. */
static void whole_circle(const struct circle *c, struct cap *cap)
{
    const double pi = 3.14159265358979323846;
    double r2 = c->r * c->r, length, square;

    if (c->h > 0) {
        /* the springs' lengths t = q - h run from 0 to d, and s ds is (t + h) dt */
        double d = c->R - c->h, d2 = d * d;

        *cap = (struct cap){.length = pi * d2 * (d * (2.0 / 3) + c->h),
                            .square = pi * d2 * d * (d / 2 + c->h * (2.0 / 3)),
                            .area = pi * r2};
        return;
    }
    radial(c, c->r, &length, &square);
    *cap = (struct cap){
        .length = 2 * pi * length * r2, .square = 2 * pi * square * r2, .area = pi * r2};
}

/* A piece of the rim that is straight and inside the circle. */
static void rim_inside(const struct circle *c, const double a[2], const double b[2],
                       struct cap *cap)
{
    /* Gauss and Legendre's five points on 0 to 1 */
    static const double node[5] = {0.046910077030668, 0.2307653449471585, 0.5, 0.7692346550528415,
                                   0.953089922969332};
    static const double weight[5] = {0.1184634425280945, 0.2393143352496833, 0.2844444444444445,
                                     0.2393143352496833, 0.1184634425280945};
    double cross = a[0] * b[1] - a[1] * b[0];

    for (int i = 0; i < 5; ++i) {
        double p[2] = {a[0] + node[i] * (b[0] - a[0]), a[1] + node[i] * (b[1] - a[1])};
        double s = sqrt(p[0] * p[0] + p[1] * p[1]), w = weight[i] * cross;
        double length, square, moment = radial_moment(c, s);

        radial(c, s, &length, &square);
        cap->length += w * length;
        cap->square += w * square;
        cap->moment[0] += w * moment * p[0];
        cap->moment[1] += w * moment * p[1];
    }
    cap->area += cross / 2;
}

/* A piece of the rim that is outside: the circle goes along between the two directions. */
static void rim_outside(const struct circle *c, const double a[2], const double b[2],
                        struct cap *cap)
{
    double la = sqrt(a[0] * a[0] + a[1] * a[1]), lb = sqrt(b[0] * b[0] + b[1] * b[1]);
    double angle = atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
    double r2 = c->r * c->r, length, square, moment = radial_moment(c, c->r);

    radial(c, c->r, &length, &square);
    cap->length += length * r2 * angle;
    cap->square += square * r2 * angle;
    cap->area += r2 * angle / 2;
    cap->moment[0] += moment * r2 * c->r * (b[1] / lb - a[1] / la);
    cap->moment[1] += moment * r2 * c->r * (a[0] / la - b[0] / lb);
}

/* One edge of the facet, about the circle's center: outside, inside and outside again. */
static void rim_edge(const struct circle *c, const double a[2], const double b[2], struct cap *cap)
{
    double e[2] = {b[0] - a[0], b[1] - a[1]};
    double ee = e[0] * e[0] + e[1] * e[1], ae = a[0] * e[0] + a[1] * e[1];
    double aa = a[0] * a[0] + a[1] * a[1] - c->r * c->r;
    double root = ae * ae - ee * aa, t[2], p[2], q[2];

    if (root <= 0) {
        rim_outside(c, a, b, cap);
        return;
    }
    root = sqrt(root);
    t[0] = (-ae - root) / ee;
    t[1] = (-ae + root) / ee;
    if (t[0] >= 1 || t[1] <= 0) {
        rim_outside(c, a, b, cap);
        return;
    }
    t[0] = t[0] > 0 ? t[0] : 0;
    t[1] = t[1] < 1 ? t[1] : 1;
    for (int k = 0; k < 2; ++k) {
        p[k] = a[k] + t[0] * e[k];
        q[k] = a[k] + t[1] * e[k];
    }
    if (t[0] > 0) {
        rim_outside(c, a, p, cap);
    }
    rim_inside(c, p, q, cap);
    if (t[1] < 1) {
        rim_outside(c, q, b, cap);
    }
}

/* The part of the facet in the circle; false when there is none. E: two directions in the plane. */
static bool cap_of_facet(const struct solid *solid, const struct facet *f, const struct circle *c,
                         const double origin[3], const double (*E)[3], struct cap *cap)
{
    double corner[FACET_MAX_VERTICES][2], to[3], room = f->within - c->r;
    struct cap circle;
    bool whole = true;

    whole_circle(c, &circle);
    vec3_sub(f->center, origin, to);
    if (room > 0 && vec3_dot(to, to) <= room * room) {
        *cap = circle;
        return true;
    }
    for (int i = 0; i < f->count; ++i) {
        vec3_sub(solid->ring[f->first + i], origin, to);
        corner[i][0] = vec3_dot(E[0], to);
        corner[i][1] = vec3_dot(E[1], to);
    }
    for (int i = 0; i < f->count; ++i) {
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
    *cap = (struct cap){0};
    for (int i = 0; i < f->count; ++i) {
        rim_edge(c, corner[i], corner[i + 1 < f->count ? i + 1 : 0], cap);
    }
    /* what is left of a facet that the circle just misses is rounding */
    return cap->length > NOTHING * circle.length && cap->area > NOTHING * circle.area &&
           cap->square > 0;
}

static void sphere_on_facet(const struct solid *solid, const struct facet *f, const double at[3],
                            double radius, const struct native_law *law,
                            const struct native_relative *relative, struct native_batch *batch,
                            struct native_sum *sum)
{
    struct circle c = {radius, vec3_dot(f->normal, at) - f->offset, radius};
    const double(*E)[3] = f->across;
    double origin[3], to[3], middle[3], depth, inverse, weight, lever, reach;
    struct cap cap;
    size_t n;

    /* from a center below the plane on the circle grows smaller again: a sphere that has sunk as
     * deep as it is wide is no longer held by this facet */
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
    if (!cap_of_facet(solid, f, &c, origin, E, &cap)) {
        return;
    }
    inverse = 1 / cap.length;
    depth = cap.square * inverse;
    for (int k = 0; k < 3; ++k) {
        origin[k] += (cap.moment[0] * E[0][k] + cap.moment[1] * E[1][k]) * inverse;
    }
    vec3_add_scaled(origin, -depth / 2, f->normal, middle);
    weight = native_ramp(solid_depth(solid, middle, 1.01 * depth / 2) / (depth / 2), DEPTH_NONE,
                         DEPTH_FULL);
    if (weight <= 0) {
        return;
    }

    /* four springs about the center of pressure, so that a turning sphere is braked */
    lever = MEAN_LEVER * sqrt(cap.area / 3.14159265358979323846);
    native_law_make_room(batch, 4, law, relative, sum);
    n = batch->n;
    for (int k = 0; k < 3; ++k) {
        /* side by side, as they are read again at once */
        double at_center = origin[k] - law->share[0] * depth * f->normal[k];
        double first = lever * E[0][k], second = lever * E[1][k], down = -f->normal[k];
        double p[4] = {at_center + first, at_center + second, at_center - first,
                       at_center - second};
        double d[4] = {down, down, down, down};

        memcpy(batch->p[k] + n, p, sizeof p);
        memcpy(batch->d[k] + n, d, sizeof d);
    }
    for (size_t i = 0; i < 4; ++i) {
        batch->force[n + i] = weight * law->stiffness * cap.length / 4;
        batch->depth[n + i] = depth;
        /* a deeper sphere makes each spring of the bed longer */
        batch->rate[n + i] = weight * law->stiffness * cap.area / 4;
    }
    batch->n += 4;
    sum->area += weight * cap.area;
    depth = c.R - c.h;
    sum->depth = weight >= 0.5 && depth > sum->depth ? depth : sum->depth;
}

void native_overlap_sphere(const struct solid *solid, double radius, const struct native_law *law,
                           const struct native_relative *relative, struct native_scratch *scratch,
                           struct native_sum *sum)
{
    const double *at = relative->p;
    int stack[TREE_DEPTH_MAX], top = 0;

    stack[top++] = 0;
    while (top > 0) {
        int index = stack[--top];
        const struct tree_node *node = &solid->facets.node[index];

        if (box_distance2(&node->box, at) >= radius * radius) {
            continue;
        }
        if (node->count == 0) {
            stack[top++] = node->right;
            stack[top++] = index + 1;
            continue;
        }
        for (int i = 0; i < node->count; ++i) {
            sphere_on_facet(solid, &solid->facet[solid->facets.item[node->first + i]], at, radius,
                            law, relative, &scratch->batch, sum);
        }
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}

/* ---- Hertz ---- */

void native_hertz(const double radius[2], const struct native_law *law,
                  const struct native_relative *relative, struct native_scratch *scratch,
                  struct native_sum *sum)
{
    struct native_batch *b = &scratch->batch;
    double d[3], depth, apart, relative_radius, force;

    if (isinf(radius[1])) {
        /* the first's center over the plane */
        for (int k = 0; k < 3; ++k) {
            d[k] = relative->R[3 * k + 2];
        }
        depth = radius[0] + vec3_dot(d, relative->p);
        relative_radius = radius[0];
    } else {
        apart = vec3_norm(relative->p);
        depth = radius[0] + radius[1] - apart;
        relative_radius = radius[0] * radius[1] / (radius[0] + radius[1]);
        for (int k = 0; k < 3; ++k) {
            /* one in the middle of the other has no direction; any will do */
            d[k] = apart > DBL_MIN ? -relative->p[k] / apart : k == 2;
        }
    }
    if (depth <= 0) {
        return;
    }
    native_law_make_room(b, 1, law, relative, sum);
    force = 4.0 / 3 * law->hertz * sqrt(relative_radius * depth) * depth;
    for (int k = 0; k < 3; ++k) {
        /* from the first's surface inward by its share */
        b->p[k][b->n] = (law->hertz_share * depth - radius[0]) * d[k];
        b->d[k][b->n] = d[k];
    }
    b->force[b->n] = force;
    b->rate[b->n] = 1.5 * force / depth;
    b->depth[b->n] = 0.8 * depth; /* two fifths of force times depth are stored */
    b->n++;
    native_law_sum(b, law, relative, sum);
    sum->area += 3.14159265358979323846 * relative_radius * depth;
    sum->depth = depth;
}
