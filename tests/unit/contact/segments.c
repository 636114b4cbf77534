/* SPDX-License-Identifier: Apache-2.0 */
/* The distance of two straight pieces, against the least over a grid of places on both. */
#include "contact/segments.h"

#include "tests/physics/near.h"
#include "tests/unit/contact/random_number.h"
#include "tests/test.h"

enum { PLACES = 200 };

static void piece_at_random(uint64_t *seed, double length, struct segment *piece)
{
    for (int k = 0; k < 3; k++) {
        piece->from[k] = random_number(seed);
        piece->by[k] = length * random_number(seed);
    }
}

static double least_of_grid(const struct segment *p, const struct segment *q)
{
    double least = HUGE_VAL;

    for (int i = 0; i <= PLACES; i++) {
        for (int j = 0; j <= PLACES; j++) {
            double d[3];

            for (int k = 0; k < 3; k++) {
                d[k] = p->from[k] + p->by[k] * i / PLACES - q->from[k] - q->by[k] * j / PLACES;
            }
            least = fmin(least, vec3_norm(d));
        }
    }
    return least;
}

static void assert_least(const struct segment *p, const struct segment *q)
{
    double distance = sqrt(segments_distance2(p, q)), grid = least_of_grid(p, q);

    /* No place of the grid is nearer, and one is hardly farther: by no more than half a step of
     * both */
    assert_true(distance <= grid + 1e-12);
    assert_true(distance >= grid - (vec3_norm(p->by) + vec3_norm(q->by)) / (2 * PLACES));
    assert_near(distance, sqrt(segments_distance2(q, p)), 1e-12);
}

TEST(no_two_places_are_nearer)
{
    uint64_t seed = 5;
    struct segment p, q;

    for (int i = 0; i < 300; i++) {
        piece_at_random(&seed, 1, &p);
        piece_at_random(&seed, 1, &q);
        assert_least(&p, &q);

        /* Side by side, in one line or beside it; points */
        for (int k = 0; k < 3; k++) {
            q.by[k] = (i % 2 ? 0.5 : -2) * p.by[k];
        }
        assert_least(&p, &q);
        for (int k = 0; k < 3; k++) {
            q.from[k] = p.from[k] + 0.1 * i * p.by[k];
        }
        assert_least(&p, &q);
        piece_at_random(&seed, 0, &q);
        assert_least(&p, &q);
        piece_at_random(&seed, 0, &p);
        assert_least(&p, &q);
    }
}
