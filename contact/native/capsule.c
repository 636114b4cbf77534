/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact in the native engine: capsules and spheres with each other; capsules, spheres and
 * cylinders with half-spaces. Integrals along an axis use Gauss-Legendre quadrature in a variable
 * that removes the roots of the integrand at the ends of its range.
 *
 * Between two capsules, springs stand between points of either axis and the nearest point of the
 * other axis. The penetration is the sum of the radii minus their distance. The points of an axis
 * within reach of the other one lie inside a capsule about it: one segment, with a closed form for
 * its ends. On a half-space, the volume below the plane is cut into slices across the axis. Each
 * slice is a segment of a disc, also in the half-spheres at the ends.
 */
#include "base/portable_math.h"
#include "contact/native/narrow_phase.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define MEAN_LEVER (8.0 / 15) /* mean lever of a paraboloid of pressure, over its radius */
#define UPRIGHT 1e-6          /* a smaller cosine between axis and plane counts as 0 */
#define PARALLEL 1e-12        /* a smaller squared sine between axes counts as 0 */

#define PIECES 3         /* pieces of an axis between kinks of the distance */
#define FOOT_STANDS 1e-9 /* cosine between axes below which the nearest point does not move */

/* Points and weights of the quadrature on 0 to 1 */
#define PIECE_POINTS 6
static const double piece_point[PIECE_POINTS] = {0.003343283942477657, 0.07636279114578136,
                                                 0.3244323018146882,   0.6755676981853118,
                                                 0.9236372088542186,   0.9966567160575222};
static const double piece_weight[PIECE_POINTS] = {0.01676846244060247, 0.1522780409672891,
                                                  0.3309534965921085,  0.3309534965921086,
                                                  0.1522780409672891,  0.01676846244060247};

/* An axis (own) and the axis of the other capsule (other), in the frame of the first capsule. */
struct axis_couple {
    const double *direction, *other; /* unit directions of the own and the other axis */
    double half, other_half;
    double between[3]; /* from the other axis's center to the own center */
    double reach;      /* sum of the radii, m; for the backing, minus the layers */
    double round;      /* relative radius */
    double low, high;  /* part of the own line within reach of the other axis */
    bool is_first;     /* the own axis belongs to the first capsule */
    double radius;     /* radius of the first capsule */
};

/* Widens the range [low, high] by the parameters s of the own line with |w + s u|^2 = limit2. Each
 * counts only if the nearest point (foot) on the other axis is within bound of its center. */
static void couple_add_crossing(struct axis_couple *c, const double w[3], const double u[3],
                                double limit2, double bound)
{
    double uu = vec3_dot(u, u), uw = vec3_dot(u, w);
    double root = uw * uw - uu * (vec3_dot(w, w) - limit2);

    if (root < 0) {
        return;
    }
    root = sqrt(root);
    for (int i = 0; i < 2; i++) {
        double s = (i ? root - uw : -root - uw) / uu;
        double foot = vec3_dot(c->between, c->other) + s * vec3_dot(c->direction, c->other);

        if (fabs(foot) <= bound) {
            c->low = s < c->low ? s : c->low;
            c->high = s > c->high ? s : c->high;
        }
    }
}

/* Adds the spring of a point of the own axis at s from its center: for a piece of the axis with
 * this length, or for `ends` ends. */
static void couple_add_spring(const struct axis_couple *c, double s, double length, int ends,
                              double stiffness, double share, struct native_batch *b,
                              struct native_sum *sum)
{
    const double sign = c->is_first ? 1 : -1;
    double own[3], to[3], foot, apart, depth, width, force;

    /* Distance and direction from the nearest point of the other axis, and penetration depth */
    vec3_add_scaled(c->between, s, c->direction, own);
    foot = vec3_dot(own, c->other);
    foot = foot > c->other_half ? c->other_half : foot < -c->other_half ? -c->other_half : foot;
    vec3_add_scaled(own, -foot, c->other, to);
    apart = vec3_norm(to);
    depth = c->reach - apart;
    if (depth <= 0) {
        return;
    }
    for (int k = 0; k < 3; k++) {
        /* Axes that intersect have no direction between them; any direction is valid */
        to[k] = apart > DBL_MIN ? to[k] / apart : k == 2;
    }

    /* Each axis gets half of the force and area of the law (contact.h) */
    if (ends) {
        width = ends * PI / 2 * c->round * depth;
        force = stiffness * width * depth / 2;
        sum->area += width;
    } else {
        width = sqrt(2 * c->round * depth);
        force = stiffness * (2.0 / 3) * width * depth * length;
        sum->area += width * length;
    }

    /* Point of action: from the first surface inward by its share of the depth */
    for (int k = 0; k < 3; k++) {
        double at = c->is_first ? s * c->direction[k] : foot * c->other[k];

        b->d[k][b->n] = sign * to[k];
        b->p[k][b->n] = at - (c->radius - share * depth) * sign * to[k];
    }
    b->force[b->n] = force;
    b->depth[b->n] = depth * (ends ? 2.0 / 3 : 0.8); /* twice the stored energy, over the force */
    b->rate[b->n] = force / depth * (ends ? 2 : 1.5);
    b->n++;
    sum->depth = depth > sum->depth ? depth : sum->depth;
}

/* Adds the springs of one axis and its ends. */
static void couple_add_axis(struct axis_couple *c, const struct native_law *law,
                            struct native_batch *b, struct native_sum *sum)
{
    double low, high;

    /* Compute low and high: the range of the own line inside the capsule of radius reach about the
     * other axis */
    double limit2 = c->reach * c->reach, w[3], u[3];

    /* Crossings with the spheres at the ends */
    c->low = HUGE_VAL;
    c->high = -HUGE_VAL;
    for (int end = -1; end <= 1; end += 2) {
        vec3_add_scaled(c->between, end * c->other_half, c->other, w);
        couple_add_crossing(c, w, c->direction, limit2, HUGE_VAL);
    }

    /* Crossings with the side, measured perpendicular to the other axis */
    vec3_add_scaled(c->between, -vec3_dot(c->between, c->other), c->other, w);
    vec3_add_scaled(c->direction, -vec3_dot(c->direction, c->other), c->other, u);
    if (vec3_dot(u, u) > PARALLEL) {
        couple_add_crossing(c, w, u, limit2, c->other_half);
    }
    low = c->low > -c->half ? c->low : -c->half;
    high = c->high < c->half ? c->high : c->half;
    if (low > high) {
        return;
    }
    if (c->half <= 0) {
        couple_add_spring(c, 0, 0, 2, law->stiffness, law->share[0], b, sum);
        return;
    }

    /* Add the springs of the own axis from low to high in pieces: the slope of the distance has a
     * kink where the nearest point reaches an end of the other axis */
    double cosine = vec3_dot(c->direction, c->other), foot = vec3_dot(c->between, c->other);
    double cut[PIECES + 1] = {low, low, high, high};

    /* Kinks in ascending order */
    for (int side = 0; side < 2 && fabs(cosine) > FOOT_STANDS; side++) {
        double end = (side == 0) == (cosine > 0) ? -c->other_half : c->other_half;
        double kink = (end - foot) / cosine;

        cut[1 + side] = kink < low ? low : kink > high ? high : kink;
    }
    for (int piece = 0; piece < PIECES; piece++) {
        double from = cut[piece], length = cut[piece + 1] - from;

        for (int i = 0; i < PIECE_POINTS && length > 0; i++) {
            couple_add_spring(c, from + piece_point[i] * length, piece_weight[i] * length, 0,
                              law->stiffness, law->share[0], b, sum);
        }
    }

    for (int end = -1; end <= 1; end += 2) {
        couple_add_spring(c, end * c->half, 0, 1, law->stiffness, law->share[0], b, sum);
    }
}

void native_overlap_capsules(const struct native_overlap *o)
{
    const struct native_relative *relative = o->relative;
    const struct native_capsule *first = &o->capsule[0], *second = &o->capsule[1];
    const double axis[2][3] = {{0, 0, 1}, {relative->R[2], relative->R[5], relative->R[8]}};
    const double half[2] = {first->half, second->half};

    /* The law integrates over both axes, so each one is the own axis once */
    native_make_room(o, 2 * (PIECES * PIECE_POINTS + 2));
    for (int own = 0; own < 2; own++) {
        struct axis_couple c = {
            .direction = axis[own],
            .other = axis[!own],
            .half = half[own],
            .other_half = half[!own],
            .reach = first->radius + second->radius - o->from,
            .round = first->radius * second->radius / (first->radius + second->radius),
            .is_first = own == 0,
            .radius = first->radius,
        };

        for (int k = 0; k < 3; k++) {
            c.between[k] = own == 0 ? -relative->p[k] : relative->p[k];
        }
        couple_add_axis(&c, o->law, &o->scratch->batch, o->sum);
    }
}

/* ---- a capsule on a half-space ---- */

/* A capsule over a plane, in the capsule's frame. */
struct capsule_over_plane {
    double radius, half;
    /* stiffness of the law; share of the depth by which the capsule is compressed */
    double stiffness, share;
    double normal[3]; /* the plane's normal */
    double axis[3];   /* direction of the axis, downward */
    /* unit direction in the slices that points downward; zero if the axis is vertical */
    double across[3];
    double sine, cosine;
    double low;      /* height of the lower end of the axis */
    bool flat;       /* a cylinder */
    double aside[3]; /* horizontal unit vector in the slices; only for cylinders */
};

/* Computes a unit vector perpendicular to a unit vector. */
static void find_direction_across(const double n[3], double across[3])
{
    const int least = fabs(n[0]) < fabs(n[1]) ? (fabs(n[0]) < fabs(n[2]) ? 0 : 2)
                                              : (fabs(n[1]) < fabs(n[2]) ? 1 : 2);
    const double axis[3] = {least == 0, least == 1, least == 2};
    double length;

    vec3_cross(n, axis, across);
    length = vec3_norm(across);
    for (int k = 0; k < 3; k++) {
        across[k] /= length;
    }
}

/* Adds the spring of a slice at a distance `along` (m) downward from the middle of the axis. A
 * slice of a cylinder has two springs, each at the mean distance of the slice's area from its
 * middle line. So friction resists the cylinder's spin. turned: rotates the springs of a whole disc
 * by 90 degrees. */
static void capsule_add_slice(const struct capsule_over_plane *c, double along, double radius,
                              double thickness, bool turned, struct native_batch *b,
                              struct native_sum *sum)
{
    const double height = c->low + (c->half - along) * c->sine; /* height of the slice's center */
    const bool upright = c->cosine <= UPRIGHT;
    double down = !upright ? height / c->cosine : height > 0 ? radius : -radius;
    double chord = 0, area = PI * radius * radius, middle = 0, deep, aside = 0, to[3];

    /* Area of the slice below the plane: a segment of the disc, or the whole disc. middle: distance
     * of the segment's center from the disc's center */
    if (down >= radius) {
        return;
    }
    if (down > -radius) {
        chord = sqrt(radius * radius - down * down);
        area = radius * radius * portable_acos(down / radius) - down * chord;
        middle = area > DBL_MIN ? chord * chord * chord / (1.5 * area) : down;
    }
    deep = 2 * (middle * c->cosine - height); /* mean length of its springs */
    if (area * thickness <= 0 || deep <= 0) {
        return;
    }
    memcpy(to, c->aside, sizeof to);
    if (c->flat && chord > 0) {
        aside =
            (2.0 / 3 * radius * radius * radius - radius * radius * down + down * down * down / 3) /
            area;
    } else if (c->flat) {
        aside = 2.0 / 3 * radius;
        if (turned) {
            vec3_cross(c->normal, c->aside, to);
        }
    }

    /* The point of action is above the capsule's side by the capsule's share of the depth, so it is
     * below the plane by the rest */
    const int count = c->flat ? 2 : 1;
    const double end = upright && c->flat ? -area * thickness / c->low : 0;
    const double rate =
        upright ? c->stiffness * end : c->stiffness * 2 * chord * thickness / c->cosine;

    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            b->p[k][b->n] = along * c->axis[k] + middle * c->across[k] +
                            (c->share - 0.5) * deep * c->normal[k] + (i ? -aside : aside) * to[k];
            b->d[k][b->n] = c->normal[k];
        }
        b->force[b->n] = c->stiffness * area * thickness / count;
        b->depth[b->n] = deep;
        b->rate[b->n] = rate / count;
        b->n++;
    }
    sum->area += 2 * chord * thickness + end;
}

/* Adds the slices of a half-sphere, by their angle from its equator to where it leaves the plane.
 * side: 1 for the lower end, -1 for the upper end. */
static void capsule_add_end(const struct capsule_over_plane *c, double side, struct native_batch *b,
                            struct native_sum *sum)
{
    double height = c->low + (side > 0 ? 0 : 2 * c->half * c->sine);
    double ratio = height / c->radius;
    double wet = ratio >= 1 ? 0 : ratio <= -1 ? PI : portable_acos(ratio);
    double last = side * portable_atan2(c->sine, c->cosine) + wet;

    last = last < PI / 2 ? last : PI / 2;
    if (last <= 0) {
        return;
    }
    for (int i = 0; i < PIECE_POINTS; i++) {
        double sine, cosine, radius;

        portable_sincos(piece_point[i] * last, &sine, &cosine);
        radius = c->radius * cosine;
        capsule_add_slice(c, side * (c->half + c->radius * sine), radius,
                          piece_weight[i] * last * radius, false, b, sum);
    }
}

/* Adds the springs of a cylinder: first of slices that the plane cuts, then of slices below the
 * plane. rim: height of the end of the axis at which its disc touches the plane. */
static void cylinder_add_springs(const struct capsule_over_plane *c, double rim,
                                 struct native_batch *b, struct native_sum *sum)
{
    double cut[3] = {c->half - (rim - c->low) / (c->sine + DBL_MIN),
                     c->half + (rim + c->low) / (c->sine + DBL_MIN), c->half};

    for (int i = 0; i < 2; i++) {
        cut[i] = fmin(fmax(cut[i], -c->half), c->half);
    }
    for (int i = 0; i < 2 * PIECE_POINTS; i++) {
        const double from = cut[i / PIECE_POINTS], length = cut[i / PIECE_POINTS + 1] - from;

        capsule_add_slice(c, from + piece_point[i % PIECE_POINTS] * length, c->radius,
                          piece_weight[i % PIECE_POINTS] * length, i % 2, b, sum);
    }
}

/* Adds the springs of a capsule that reaches below the plane. */
static void capsule_add_springs(struct capsule_over_plane *c, struct native_batch *b,
                                struct native_sum *sum)
{
    double from, rim = c->radius * c->cosine;

    /* Only the lower end is below the plane */
    if (c->low >= rim || c->half <= 0) {
        /* Add four springs around the middle of the part below the plane, if this part belongs to
         * one sphere only. So friction brakes a spinning capsule. */
        const double k = c->stiffness * PI, R = c->radius;
        const double x =
            R - c->low < 2 * R ? R - c->low : 2 * R; /* penetration depth of the sphere */
        const double force = k * x * x * (R - x / 3), area = x * (2 * R - x);
        const double deep =
            2 * (x * x * x * (R / 3 - x / 12) / (x * x * (R - x / 3)) + R - c->low - x);
        const double lever = MEAN_LEVER * sqrt(area);
        double to[2][3], at;

        /* Four points on the circle of the mean lever */
        find_direction_across(c->normal, to[0]);
        vec3_cross(c->normal, to[0], to[1]);
        at = -c->low - (1 - c->share) * deep;
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < 3; j++) {
                b->p[j][b->n] = c->half * c->axis[j] + at * c->normal[j] +
                                (i < 2 ? lever : -lever) * to[i % 2][j];
                b->d[j][b->n] = c->normal[j];
            }
            b->force[b->n] = force / 4;
            b->depth[b->n] = deep;
            b->rate[b->n] = k * area / 4;
            b->n++;
        }
        sum->area += PI * area;

        return;
    }

    /* The part of the side below the plane, and the ends that it reaches */
    from = c->half - (rim - c->low) / (c->sine + DBL_MIN);
    from = from > -c->half ? from : -c->half;
    for (int i = 0; i < PIECE_POINTS; i++) {
        capsule_add_slice(c, from + piece_point[i] * (c->half - from), c->radius,
                          piece_weight[i] * (c->half - from), false, b, sum);
    }
    capsule_add_end(c, 1, b, sum);
    if (from <= -c->half) {
        capsule_add_end(c, -1, b, sum);
    }
}

void native_overlap_capsule_half_space(const struct native_overlap *o)
{
    const double *R = o->relative->R;
    struct capsule_over_plane c = {
        .radius = o->capsule[0].radius,
        .half = o->capsule[0].half,
        .stiffness = o->law->stiffness,
        .share = o->law->share[0],
        .normal = {R[2], R[5], R[8]},
        .axis = {0, 0, R[8] > 0 ? -1 : 1},
        .sine = fabs(R[8]),
        .cosine = sqrt(R[2] * R[2] + R[5] * R[5]),
        .flat = o->capsule[0].flat,
    };

    /* Height of the lower end of the axis; a height of `reach` or more has no contact */
    const double reach = o->capsule[0].flat ? c.radius * c.cosine : c.radius;

    c.low = -vec3_dot(c.normal, o->relative->p) - c.half * c.sine + o->from;
    if (c.low >= reach) {
        return;
    }
    for (int k = 0; k < 2 && c.cosine > UPRIGHT; k++) {
        c.across[k] = -c.normal[k] / c.cosine;
    }
    native_make_room(o, 4 * PIECE_POINTS);
    o->sum->depth = fmax(o->sum->depth, reach - c.low);
    if (c.flat) {
        if (c.cosine > UPRIGHT) {
            vec3_cross(c.axis, c.across, c.aside);
        } else {
            find_direction_across(c.axis, c.aside);
        }
        cylinder_add_springs(&c, reach, &o->scratch->batch, o->sum);
    } else {
        capsule_add_springs(&c, &o->scratch->batch, o->sum);
    }
}

/* ---- spheres by Hertz's law (contact.h) ---- */

void native_overlap_hertz(const struct native_overlap *o)
{
    const double radius[2] = {o->capsule[0].radius, o->capsule[1].radius};
    const struct native_relative *relative = o->relative;
    const struct native_law *law = o->law;
    struct native_batch *b = &o->scratch->batch;
    double d[3], depth, apart, relative_radius, force;

    /* Normal, penetration depth and relative radius, for a half-space and for a sphere */
    if (isinf(radius[1])) {
        for (int k = 0; k < 3; k++) {
            d[k] = relative->R[3 * k + 2];
        }
        depth = radius[0] + vec3_dot(d, relative->p);
        relative_radius = radius[0];
    } else {
        apart = vec3_norm(relative->p);
        depth = radius[0] + radius[1] - apart;
        relative_radius = radius[0] * radius[1] / (radius[0] + radius[1]);
        for (int k = 0; k < 3; k++) {
            /* Equal centers have no direction between them; any direction is valid */
            d[k] = apart > DBL_MIN ? -relative->p[k] / apart : k == 2;
        }
    }
    if (depth <= 0) {
        return;
    }

    /* One spring, from the first surface inward by its share of the depth */
    native_make_room(o, 1);
    force = 4.0 / 3 * law->hertz * sqrt(relative_radius * depth) * depth;
    for (int k = 0; k < 3; k++) {
        b->p[k][b->n] = (law->hertz_share * depth - radius[0]) * d[k];
        b->d[k][b->n] = d[k];
    }
    b->force[b->n] = force;
    b->rate[b->n] = 1.5 * force / depth;
    b->depth[b->n] = 0.8 * depth; /* two fifths of force times depth are stored */
    b->n++;
    o->sum->area += PI * relative_radius * depth;
    o->sum->depth = depth;
}
