/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A capsule on a half-space in the native engine. The penetration volume, which is below the plane,
 * is cut into slices
 * across the axis: each is a segment of a disc, also in the half-spheres at the ends. The sum over
 * the slices is Gauss and Legendre's in a variable that takes the roots of the integrand, where it
 * comes out of the plane, off the ends of the interval.
 */
#include "base/portable_math.h"
#include "contact/native/pairs.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>

#define PI 3.14159265358979323846
#define MEAN_LEVER (8.0 / 15) /* mean lever of a paraboloid of pressure, over its radius */
#define UPRIGHT 1e-6          /* cosine of an axis against a plane that counts as 0 */

/* Points and weights of the quadrature on 0 to 1, of the side and of either end */
#define SLICES 6
static const double slice_point[SLICES] = {0.003343283942477657, 0.07636279114578136,
                                           0.3244323018146882,   0.6755676981853118,
                                           0.9236372088542186,   0.9966567160575222};
static const double slice_weight[SLICES] = {0.01676846244060247, 0.1522780409672891,
                                            0.3309534965921085,  0.3309534965921086,
                                            0.1522780409672891,  0.01676846244060247};

/* A capsule over a plane, in the capsule's frame. */
struct capsule_over_plane {
    double radius, half;
    double stiffness, share; /* of the law; of the depth that the capsule gives */
    double normal[3];        /* the plane's */
    double axis[3];          /* downward */
    double across[3];        /* downward in the slices, unit; zero when the axis stands upright */
    double sine, cosine;
    double low; /* height of the lower end of the axis */
};

/* Computes some unit vector perpendicular to a unit vector. */
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

/* Adds the spring of a slice at a distance `along` (m) from the middle of the axis downward. */
static void capsule_add_slice(const struct capsule_over_plane *c, double along, double radius,
                              double thickness, struct native_batch *b, struct native_sum *sum)
{
    const double height = c->low + (c->half - along) * c->sine; /* of its center */
    const bool upright = c->cosine <= UPRIGHT;
    double down = !upright ? height / c->cosine : height > 0 ? radius : -radius;
    double chord = 0, area = PI * radius * radius, middle = 0, deep;

    /* A segment of the disc, or all of it; middle: of the segment, from the disc's */
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

    /* From the capsule's side upward by its share, below the plane by the rest */
    for (int k = 0; k < 3; k++) {
        b->p[k][b->n] =
            along * c->axis[k] + middle * c->across[k] + (c->share - 0.5) * deep * c->normal[k];
        b->d[k][b->n] = c->normal[k];
    }
    b->force[b->n] = c->stiffness * area * thickness;
    b->depth[b->n] = deep;
    b->rate[b->n] = upright ? 0 : c->stiffness * 2 * chord * thickness / c->cosine;
    b->n++;
    sum->area += 2 * chord * thickness;
}

/* Adds the slices of a half-sphere, by their angle from its equator to where it leaves the plane.
 * side: 1 for the lower one, -1 for the upper. */
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
    for (int i = 0; i < SLICES; i++) {
        double sine, cosine, radius;

        portable_sincos(slice_point[i] * last, &sine, &cosine);
        radius = c->radius * cosine;
        capsule_add_slice(c, side * (c->half + c->radius * sine), radius,
                          slice_weight[i] * last * radius, b, sum);
    }
}

/* Adds four springs for a part below the plane that is of one sphere alone, about its middle, so
 * that friction brakes a capsule that spins. */
static void capsule_add_cap(const struct capsule_over_plane *c, struct native_batch *b,
                            struct native_sum *sum)
{
    const double k = c->stiffness * PI, R = c->radius;
    const double x = R - c->low < 2 * R ? R - c->low : 2 * R; /* penetration depth of the sphere */
    const double force = k * x * x * (R - x / 3), area = x * (2 * R - x);
    const double deep = 2 * (x * x * x * (R / 3 - x / 12) / (x * x * (R - x / 3)) + R - c->low - x);
    const double lever = MEAN_LEVER * sqrt(area);
    double to[2][3], at;

    /* Four places on the circle of the mean lever */
    find_direction_across(c->normal, to[0]);
    vec3_cross(c->normal, to[0], to[1]);
    at = -c->low - (1 - c->share) * deep;
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 3; j++) {
            b->p[j][b->n] =
                c->half * c->axis[j] + at * c->normal[j] + (i < 2 ? lever : -lever) * to[i % 2][j];
            b->d[j][b->n] = c->normal[j];
        }
        b->force[b->n] = force / 4;
        b->depth[b->n] = deep;
        b->rate[b->n] = k * area / 4;
        b->n++;
    }
    sum->area += PI * area;
}

/* Adds the springs of a capsule that reaches below the plane. */
static void capsule_add_springs(struct capsule_over_plane *c, struct native_batch *b,
                                struct native_sum *sum)
{
    double from, rim = c->radius * c->cosine;

    /* Only the lower end is below the plane */
    if (c->low >= rim || c->half <= 0) {
        capsule_add_cap(c, b, sum);
        return;
    }

    /* The part of the side below the plane, with the ends that it reaches */
    for (int k = 0; k < 2 && c->cosine > UPRIGHT; k++) {
        c->across[k] = -c->normal[k] / c->cosine;
    }
    from = c->half - (rim - c->low) / (c->sine + DBL_MIN);
    from = from > -c->half ? from : -c->half;
    for (int i = 0; i < SLICES; i++) {
        capsule_add_slice(c, from + slice_point[i] * (c->half - from), c->radius,
                          slice_weight[i] * (c->half - from), b, sum);
    }
    capsule_add_end(c, 1, b, sum);
    if (from <= -c->half) {
        capsule_add_end(c, -1, b, sum);
    }
}

void native_capsule_half_space(const struct native_capsule *capsule, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum)
{
    const double *R = relative->R;
    struct native_batch *b = &scratch->batch;
    struct capsule_over_plane c = {
        .radius = capsule->radius,
        .half = capsule->half,
        .stiffness = law->stiffness,
        .share = law->share[0],
        .normal = {R[2], R[5], R[8]},
        .axis = {0, 0, R[8] > 0 ? -1 : 1},
        .sine = fabs(R[8]),
        .cosine = sqrt(R[2] * R[2] + R[5] * R[5]),
    };

    /* Height of the lower end of the axis; nothing touches from a radius on */
    c.low = -vec3_dot(c.normal, relative->p) - c.half * c.sine;
    if (c.low >= c.radius) {
        return;
    }
    native_law_make_room(b, 6 * SLICES, law, relative, sum);
    sum->depth = c.radius - c.low;
    capsule_add_springs(&c, b, sum);

    /* What backs the layers is a lower plane */
    if (native_law_is_backed(law, sum->depth)) {
        const double area = sum->area;

        c.low += law->layers;
        c.stiffness = law->backing;
        capsule_add_springs(&c, b, sum);
        sum->area = area;
    }
    native_law_sum(b, law, relative, sum);
}
