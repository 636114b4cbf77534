/* SPDX-License-Identifier: Apache-2.0 */
/* The broad phase at work: rows of balls, as many at a time as there are lanes. */
#include "contact/broad_phase.h"

#include "contact/lanes.h"

#include <math.h>

/* Bit l: the ball of surface first + l meets the row's plane. */
static unsigned row_meets_plane(const struct broad_balls *b, const struct broad_row *row)
{
    const double *x = b->x + row->first, *y = b->y + row->first, *z = b->z + row->first;
    const double *reach = b->reach + row->first;
    const int i = row->surface;
    uint64_t meets = 0;

    for (int l = 0; l < BROAD_LANES; l += LANES) {
        lanes height = b->x[i] * lanes_load(x + l) + b->y[i] * lanes_load(y + l) +
                       b->z[i] * lanes_load(z + l) + b->reach[i];

        meets |= lanes_bits(lanes_less(height, lanes_load(reach + l))) << l;
    }
    return (unsigned)meets;
}

/* Bit l: the ball of surface first + l meets the row's ball. */
static unsigned row_meets_ball(const struct broad_balls *b, const struct broad_row *row)
{
    const double *x = b->x + row->first, *y = b->y + row->first, *z = b->z + row->first;
    const double *reach = b->reach + row->first;
    const int i = row->surface;
    uint64_t meets = 0;

    for (int l = 0; l < BROAD_LANES; l += LANES) {
        lanes dx = lanes_load(x + l) - b->x[i], dy = lanes_load(y + l) - b->y[i];
        lanes dz = lanes_load(z + l) - b->z[i], sum = lanes_load(reach + l) + b->reach[i];

        meets |= lanes_bits(lanes_less(dx * dx + dy * dy + dz * dz, sum * sum)) << l;
    }
    return (unsigned)meets;
}

/* Whether the capsules about two surfaces may meet: they do not when a plane across the line
 * between their centers parts them. */
static bool capsules_may_meet(const struct broad_phase *broad, int i, int j)
{
    const struct broad_balls *b = &broad->ball;
    const struct broad_capsule *p = &broad->capsule[i], *q = &broad->capsule[j];
    double dx = b->x[j] - b->x[i], dy = b->y[j] - b->y[i], dz = b->z[j] - b->z[i];
    double apart2 = dx * dx + dy * dy + dz * dz, round = p->radius + q->radius;
    double gap = apart2 - fabs(p->half[0] * dx + p->half[1] * dy + p->half[2] * dz) -
                 fabs(q->half[0] * dx + q->half[1] * dy + q->half[2] * dz);

    return gap <= 0 || gap * gap < round * round * apart2;
}

void broad_phase_find(const struct broad_phase *broad, uint64_t *near)
{
    for (size_t w = 0; w < broad->nword; w++) {
        near[w] = 0;
    }
    for (size_t r = 0; r < broad->nrow; r++) {
        const struct broad_row *row = &broad->row[r];
        unsigned meets = row->wanted & (row->plane ? row_meets_plane(&broad->ball, row)
                                                   : row_meets_ball(&broad->ball, row));

        for (; meets; meets &= meets - 1) {
            int lane = __builtin_ctz(meets), pair = row->pair[lane];

            if (row->plane || capsules_may_meet(broad, row->surface, row->first + lane)) {
                near[pair / 64] |= UINT64_C(1) << pair % 64;
            }
        }
    }
}
