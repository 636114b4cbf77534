/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Capsules and spheres on each other in the native engine: springs between points of either axis
 * and the nearest point of the other one; penetration is the sum of the radii less their distance.
 * Points within reach of an axis are those inside of a
 * capsule about it, so that they are one piece of a straight line, the ends of which have a closed
 * form. The sum over it is Gauss and Legendre's in a variable that takes the roots of the
 * integrand off its ends.
 */
#include "contact/native/pairs.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>

#define PI 3.14159265358979323846
#define PARALLEL 1e-12 /* square of the sine between axes that counts as 0 */

#define PIECES 3         /* of an axis between kinks of the distance */
#define FOOT_STANDS 1e-9 /* cosine between axes at which the nearest point does not move */

/* Points and weights of the quadrature on 0 to 1 */
#define PIECE_POINTS 6
static const double piece_point[PIECE_POINTS] = {0.003343283942477657, 0.07636279114578136,
                                                 0.3244323018146882,   0.6755676981853118,
                                                 0.9236372088542186,   0.9966567160575222};
static const double piece_weight[PIECE_POINTS] = {0.01676846244060247, 0.1522780409672891,
                                                  0.3309534965921085,  0.3309534965921086,
                                                  0.1522780409672891,  0.01676846244060247};

/* An axis, and the other one that it is near to, in the frame of the first capsule. */
struct axis_couple {
    const double *direction, *other; /* of both, unit */
    double half, other_half;
    double between[3]; /* from the other's center to the own */
    double reach;      /* sum of the radii, m; for the backing less the layers */
    double round;      /* relative radius */
    double low, high;  /* where the own line is within reach of the other axis */
    bool is_first;     /* the own is the first capsule's */
    double radius;     /* of the first capsule */
};

/* Widens the range low to high by the places s where |w + s u|^2 is limit2 on the own line, if the
 * nearest point (foot) on the other axis is within bound of its center. */
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

/* Computes low and high: where the own line is within reach of the other axis, inside the capsule
 * of that radius about it. */
static void couple_find_range(struct axis_couple *c)
{
    double limit2 = c->reach * c->reach, w[3], u[3];

    /* Through the spheres at the ends */
    c->low = HUGE_VAL;
    c->high = -HUGE_VAL;
    for (int end = -1; end <= 1; end += 2) {
        vec3_add_scaled(c->between, end * c->other_half, c->other, w);
        couple_add_crossing(c, w, c->direction, limit2, HUGE_VAL);
    }

    /* Through the side: across the other axis */
    vec3_add_scaled(c->between, -vec3_dot(c->between, c->other), c->other, w);
    vec3_add_scaled(c->direction, -vec3_dot(c->direction, c->other), c->other, u);
    if (vec3_dot(u, u) > PARALLEL) {
        couple_add_crossing(c, w, u, limit2, c->other_half);
    }
}

/* Adds the spring of a point of the own axis at s from its center: of a piece of that length, or of
 * so many ends. */
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
        /* Axes that meet have no direction between them; any will do */
        to[k] = apart > DBL_MIN ? to[k] / apart : k == 2;
    }

    /* Force and area, half of the law's for either axis (contact.h) */
    if (ends) {
        width = ends * PI / 2 * c->round * depth;
        force = stiffness * width * depth / 2;
        sum->area += width;
    } else {
        width = sqrt(2 * c->round * depth);
        force = stiffness * (2.0 / 3) * width * depth * length;
        sum->area += width * length;
    }

    /* From the first's surface inward by its share of the depth */
    for (int k = 0; k < 3; k++) {
        double at = c->is_first ? s * c->direction[k] : foot * c->other[k];

        b->d[k][b->n] = sign * to[k];
        b->p[k][b->n] = at - (c->radius - share * depth) * sign * to[k];
    }
    b->force[b->n] = force;
    b->depth[b->n] = depth * (ends ? 2.0 / 3 : 0.8); /* twice the stored energy over the force */
    b->rate[b->n] = force / depth * (ends ? 2 : 1.5);
    b->n++;
    sum->depth = depth > sum->depth ? depth : sum->depth;
}

/* Adds the springs of the own axis from low to high, in pieces: where the nearest point of the
 * other axis comes to an end of it, the distance has a kink in its slope. */
static void couple_add_pieces(const struct axis_couple *c, double low, double high,
                              const struct native_law *law, struct native_batch *b,
                              struct native_sum *sum)
{
    double cosine = vec3_dot(c->direction, c->other), foot = vec3_dot(c->between, c->other);
    double cut[PIECES + 1] = {low, low, high, high};

    /* The kinks, from the lower to the upper */
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
}

/* Adds the springs of one axis and its ends. */
static void couple_add_axis(struct axis_couple *c, const struct native_law *law,
                            struct native_batch *b, struct native_sum *sum)
{
    double low, high;

    couple_find_range(c);
    low = c->low > -c->half ? c->low : -c->half;
    high = c->high < c->half ? c->high : c->half;
    if (low > high) {
        return;
    }
    if (c->half <= 0) {
        couple_add_spring(c, 0, 0, 2, law->stiffness, law->share[0], b, sum);
        return;
    }
    couple_add_pieces(c, low, high, law, b, sum);
    for (int end = -1; end <= 1; end += 2) {
        couple_add_spring(c, end * c->half, 0, 1, law->stiffness, law->share[0], b, sum);
    }
}

/* Adds the springs of both axes; the penetration depth counts from a depth of layers (m) on. */
static void capsules_add_axes(const struct native_capsule *first,
                              const struct native_capsule *second, double layers,
                              const struct native_law *law, const struct native_relative *relative,
                              struct native_batch *b, struct native_sum *sum)
{
    const double axis[2][3] = {{0, 0, 1}, {relative->R[2], relative->R[5], relative->R[8]}};
    const double half[2] = {first->half, second->half};

    /* Each axis in turn is the own one, as the law integrates over both */
    for (int own = 0; own < 2; own++) {
        struct axis_couple c = {
            .direction = axis[own],
            .other = axis[!own],
            .half = half[own],
            .other_half = half[!own],
            .reach = first->radius + second->radius - layers,
            .round = first->radius * second->radius / (first->radius + second->radius),
            .is_first = own == 0,
            .radius = first->radius,
        };

        for (int k = 0; k < 3; k++) {
            c.between[k] = own == 0 ? -relative->p[k] : relative->p[k];
        }
        couple_add_axis(&c, law, b, sum);
    }
}

void native_capsules(const struct native_capsule *first, const struct native_capsule *second,
                     const struct native_law *law, const struct native_relative *relative,
                     struct native_scratch *scratch, struct native_sum *sum)
{
    struct native_batch *b = &scratch->batch;

    native_law_make_room(b, 4 * (PIECES * PIECE_POINTS + 2), law, relative, sum);
    capsules_add_axes(first, second, 0, law, relative, b, sum);
    if (native_law_is_backed(law, sum->depth)) {
        const struct native_law backing = native_law_of_backing(law);
        const double area = sum->area;

        capsules_add_axes(first, second, law->layers, &backing, relative, b, sum);
        sum->area = area;
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}
