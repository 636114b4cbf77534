/* SPDX-License-Identifier: Apache-2.0 */
/* Broad phase, evaluation: tests rows of bounding balls, LANES at a time. */
#include "contact/broad_phase.h"

#include "contact/lanes.h"
#include "contact/segments.h"

/* Distance up to which a pair is kept in the list, m. Each surface may move by half of it before
 * the list is made again. */
#define MARGIN 0.04

/* Distances up to this count as 0, m. It is far above rounding errors, so that the result does not
 * depend on when the list was made. */
#define ROUNDING 1e-9

/* ---- the pairs within the margin ---- */

/* Returns a bit mask of the surfaces whose ball is within the margin of the row's plane (bit l:
 * surface first + l). */
static unsigned row_meets_plane(const struct broad_balls *b, const struct broad_row *row)
{
    const double *x = b->x + row->first, *y = b->y + row->first, *z = b->z + row->first;
    const double *reach = b->reach + row->first;
    const int i = row->surface;
    uint64_t meets = 0;

    for (int l = 0; l < BROAD_LANES; l += LANES) {
        lanes height = b->x[i] * lanes_load(x + l) + b->y[i] * lanes_load(y + l) +
                       b->z[i] * lanes_load(z + l) + b->reach[i];

        meets |= lanes_bits(lanes_less(height, lanes_load(reach + l) + MARGIN)) << l;
    }
    return (unsigned)meets;
}

/* Returns a bit mask of the surfaces whose ball is within the margin of the row's ball (bit l:
 * surface first + l). */
static unsigned row_meets_ball(const struct broad_balls *b, const struct broad_row *row)
{
    const double *x = b->x + row->first, *y = b->y + row->first, *z = b->z + row->first;
    const double *reach = b->reach + row->first;
    const int i = row->surface;
    uint64_t meets = 0;

    for (int l = 0; l < BROAD_LANES; l += LANES) {
        lanes dx = lanes_load(x + l) - b->x[i], dy = lanes_load(y + l) - b->y[i];
        lanes dz = lanes_load(z + l) - b->z[i];
        lanes sum = lanes_load(reach + l) + (b->reach[i] + MARGIN);

        meets |= lanes_bits(lanes_less(dx * dx + dy * dy + dz * dz, sum * sum)) << l;
    }
    return (unsigned)meets;
}

/* Returns a lower bound of the height of a surface over a half-space's plane, m, from its ball and
 * capsule. */
static double surface_height(const struct broad_phase *broad, int plane, int i)
{
    const struct broad_balls *b = &broad->ball;
    const struct broad_capsule *c = &broad->capsule[i];
    double normal[3] = {b->x[plane], b->y[plane], b->z[plane]};
    double height = normal[0] * b->x[i] + normal[1] * b->y[i] + normal[2] * b->z[i];
    double below = fabs(vec3_dot(normal, c->half)) + c->radius;

    return height + b->reach[plane] - (below < b->reach[i] ? below : b->reach[i]);
}

/* Returns a lower bound of the gap between two surfaces, m, after their slack. Uses their balls
 * and, if these are near, the axes of their capsules. */
static double surfaces_distance(const struct broad_phase *broad, int i, int j, double slack)
{
    const struct broad_balls *b = &broad->ball;
    const struct broad_capsule *p = &broad->capsule[i], *q = &broad->capsule[j];
    double to[3] = {b->x[j] - b->x[i], b->y[j] - b->y[i], b->z[j] - b->z[i]};
    double balls = vec3_norm(to) - b->reach[i] - b->reach[j], capsules;
    struct segment first, second;

    /* Positions relative to the first surface's center */
    for (int k = 0; k < 3; k++) {
        first.from[k] = -p->half[k];
        first.by[k] = 2 * p->half[k];
        second.from[k] = to[k] - q->half[k];
        second.by[k] = 2 * q->half[k];
    }
    capsules = sqrt(segments_distance2(&first, &second)) - p->radius - q->radius;
    return (balls > capsules ? balls : capsules) + slack;
}

/* Returns an upper bound of the distance by which any two surfaces have approached since the list
 * was made, m. A point of a capsule moves at most as far as the center plus the relative motion of
 * an end of the axis. */
static double list_moved(const struct broad_phase *broad)
{
    const struct broad_balls *now = &broad->ball, *then = &broad->then;
    double most = 0;

    for (size_t s = 0; s < broad->nsurface; s++) {
        const double *half = broad->capsule[s].half, *half_then = broad->capsule_then[s].half;
        double x = now->x[s] - then->x[s], y = now->y[s] - then->y[s], z = now->z[s] - then->z[s];
        double u = half[0] - half_then[0], v = half[1] - half_then[1], w = half[2] - half_then[2];
        double moved2 = x * x + y * y + z * z + u * u + v * v + w * w;

        most = moved2 > most ? moved2 : most;
    }

    /* Two surfaces move; (x + y)^2 <= 2 (x^2 + y^2) */
    return 2 * sqrt(2 * most);
}

/* ---- pairs that may touch ---- */

void broad_phase_find(struct broad_phase *broad, uint64_t *near)
{
    double moved = broad->found ? list_moved(broad) : MARGIN;

    if (!(moved < MARGIN)) {
        /* Make Verlet's list of candidate pairs, and store the present poses of the surfaces */
        const struct broad_balls *now = &broad->ball, *then = &broad->then;

        broad->ncandidate = 0;
        for (size_t r = 0; r < broad->nrow; r++) {
            const struct broad_row *row = &broad->row[r];
            unsigned meets =
                row->wanted & (row->plane ? row_meets_plane(now, row) : row_meets_ball(now, row));

            for (; meets; meets &= meets - 1) {
                const int lane = __builtin_ctz(meets);
                struct broad_candidate *c = &broad->candidate[broad->ncandidate];

                /* Add a pair to the list if it is within the margin */
                *c = (struct broad_candidate){.surface = row->surface,
                                              .other = row->first + lane,
                                              .pair = row->pair[lane],
                                              .plane = row->plane,
                                              .slack = row->slack[lane]};
                c->gap = c->plane ? surface_height(broad, c->surface, c->other)
                                  : surfaces_distance(broad, c->surface, c->other, c->slack);
                broad->ncandidate += c->gap < MARGIN;
            }
        }

        /* Stores the poses for list_moved */
        for (size_t s = 0; s < broad->nsurface; s++) {
            then->x[s] = now->x[s];
            then->y[s] = now->y[s];
            then->z[s] = now->z[s];
            broad->capsule_then[s] = broad->capsule[s];
        }
        broad->found = broad->keeps;

        moved = 0;
    }

    /* Tests the candidates whose gap may have closed */
    for (size_t w = 0; w < broad->nword; w++) {
        near[w] = 0;
    }
    for (size_t c = 0; c < broad->ncandidate; c++) {
        const struct broad_candidate *of = &broad->candidate[c];

        if (of->gap > moved + ROUNDING) {
            continue;
        }
        if ((of->plane ? surface_height(broad, of->surface, of->other)
                       : surfaces_distance(broad, of->surface, of->other, of->slack)) < ROUNDING) {
            near[of->pair / 64] |= UINT64_C(1) << of->pair % 64;
        }
    }
}
