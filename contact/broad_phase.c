/* SPDX-License-Identifier: Apache-2.0 */
/* The broad phase at work: rows of balls, as many at a time as there are lanes. */
#include "contact/broad_phase.h"

#include "contact/lanes.h"

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
            int pair = row->pair[__builtin_ctz(meets)];

            near[pair / 64] |= UINT64_C(1) << pair % 64;
        }
    }
}
