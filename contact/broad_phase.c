/* SPDX-License-Identifier: Apache-2.0 */
/* Broad phase, evaluation: tests rows of bounding balls, as many at a time as there are lanes. */
#include "contact/broad_phase.h"

#include "contact/lanes.h"

#include <math.h>

/* Distance, m, up to which a pair is kept in the list. Each of its surfaces may move by half of it
 * before the list is made again. */
#define MARGIN 0.04

/* ---- the pairs within the margin ---- */

/* Returns a bit for each surface of a row whose ball is within the margin of the row's plane: bit l
 * for surface first + l. */
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

/* Returns a bit for each surface of a row whose ball is within the margin of the row's ball: bit l
 * for surface first + l. */
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

/* Checks whether the distance of the capsules about two surfaces may be less than a margin, m: it
 * is not when a plane across the line between their centers separates them. */
static bool capsules_may_meet(const struct broad_phase *broad, int i, int j, double margin)
{
    const struct broad_balls *b = &broad->ball;
    const struct broad_capsule *p = &broad->capsule[i], *q = &broad->capsule[j];
    double dx = b->x[j] - b->x[i], dy = b->y[j] - b->y[i], dz = b->z[j] - b->z[i];
    double apart2 = dx * dx + dy * dy + dz * dz, round = p->radius + q->radius + margin;
    /* Gap between the axes along the line between the centers, times the centers' distance */
    double gap = apart2 - fabs(p->half[0] * dx + p->half[1] * dy + p->half[2] * dz) -
                 fabs(q->half[0] * dx + q->half[1] * dy + q->half[2] * dz);

    return gap <= 0 || gap * gap < round * round * apart2;
}

/* Makes the list of candidate pairs (Verlet's) and stores where the surfaces are now. */
static void list_make(struct broad_phase *broad)
{
    const struct broad_balls *now = &broad->ball, *then = &broad->then;

    broad->ncandidate = 0;
    for (size_t r = 0; r < broad->nrow; r++) {
        const struct broad_row *row = &broad->row[r];
        unsigned meets =
            row->wanted & (row->plane ? row_meets_plane(now, row) : row_meets_ball(now, row));

        for (; meets; meets &= meets - 1) {
            int lane = __builtin_ctz(meets), other = row->first + lane;

            if (row->plane ||
                capsules_may_meet(broad, row->surface, other, MARGIN - row->slack[lane])) {
                broad->candidate[broad->ncandidate++] = (struct broad_candidate){
                    row->surface, other, row->pair[lane], row->plane, row->slack[lane]};
            }
        }
    }

    /* The places that list_holds compares with */
    for (size_t s = 0; s < broad->nsurface; s++) {
        then->x[s] = now->x[s];
        then->y[s] = now->y[s];
        then->z[s] = now->z[s];
        broad->capsule_then[s] = broad->capsule[s];
    }
    broad->found = broad->keeps;
}

/* Checks whether no point of a surface's capsule has moved by more than half of the margin since
 * the list was made. A point moves by no more than the center and an end of the axis relative to it
 * do together. */
static bool list_holds(const struct broad_phase *broad)
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

    /* (x + y)^2 <= 2 (x^2 + y^2) */
    return 2 * most < MARGIN * MARGIN / 4;
}

/* ---- those that may touch ---- */

/* Checks whether a surface's ball reaches below a half-space's plane. */
static bool ball_meets_plane(const struct broad_balls *b, int plane, int i)
{
    return b->x[plane] * b->x[i] + b->y[plane] * b->y[i] + b->z[plane] * b->z[i] + b->reach[plane] <
           b->reach[i];
}

/* Checks whether the balls of two surfaces overlap by more than a slack, m. */
static bool balls_meet(const struct broad_balls *b, int i, int j, double slack)
{
    double dx = b->x[j] - b->x[i], dy = b->y[j] - b->y[i], dz = b->z[j] - b->z[i];
    double sum = b->reach[j] + b->reach[i] - slack;

    return dx * dx + dy * dy + dz * dz < sum * sum;
}

void broad_phase_find(struct broad_phase *broad, uint64_t *near)
{
    if (!broad->found || !list_holds(broad)) {
        list_make(broad);
    }

    /* Of the candidates those whose bounding volumes overlap now */
    for (size_t w = 0; w < broad->nword; w++) {
        near[w] = 0;
    }
    for (size_t c = 0; c < broad->ncandidate; c++) {
        const struct broad_candidate *of = &broad->candidate[c];

        if (of->plane ? ball_meets_plane(&broad->ball, of->surface, of->other)
                      : balls_meet(&broad->ball, of->surface, of->other, of->slack) &&
                            capsules_may_meet(broad, of->surface, of->other, -of->slack)) {
            near[of->pair / 64] |= UINT64_C(1) << of->pair % 64;
        }
    }
}
