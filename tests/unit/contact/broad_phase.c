/* SPDX-License-Identifier: Apache-2.0 */
/* The broad phase, against each pair's balls by themselves. */
#include "contact/broad_phase.h"

#include "tests/unit/contact/random_number.h"
#include "tests/test.h"

static struct error error;

enum { SURFACES = 29, PAIRS = SURFACES * (SURFACES - 1) / 2 };

static struct contact_surface surface[SURFACES];
static struct contact_pair pair[PAIRS];
static struct contact_config config = {.surface = surface, .pair = pair, .nsurface = SURFACES};

/* Every fourth pair left out; the first and the last surface are half-spaces, on a body. */
static void make_pairs(int body)
{
    for (int i = 0; i < SURFACES; i++) {
        bool plane = i == 0 || i == SURFACES - 1;

        surface[i] = (struct contact_surface){.shape = plane ? CONTACT_HALF_SPACE : CONTACT_SPHERE,
                                              .body = plane ? body : 0};
    }
    config.npair = 0;
    for (int a = 0; a < SURFACES; a++) {
        for (int b = a + 1; b < SURFACES; b++) {
            if ((a + b) % 4 && (a || b != SURFACES - 1)) {
                pair[config.npair++] = (a * b) % 3 ? (struct contact_pair){.a = a, .b = b}
                                                   : (struct contact_pair){.a = b, .b = a};
            }
        }
    }
}

static bool pair_meets(const struct broad_balls *ball, const struct contact_pair *p)
{
    bool plane = surface[p->a].shape == CONTACT_HALF_SPACE;
    int a = plane ? p->a : p->b, b = plane ? p->b : p->a;

    if (surface[a].shape == CONTACT_HALF_SPACE) {
        return ball->x[a] * ball->x[b] + ball->y[a] * ball->y[b] + ball->z[a] * ball->z[b] +
                   ball->reach[a] <
               ball->reach[b];
    }
    return sqrt(pow(ball->x[a] - ball->x[b], 2) + pow(ball->y[a] - ball->y[b], 2) +
                pow(ball->z[a] - ball->z[b], 2)) < ball->reach[a] + ball->reach[b];
}

/* A walk of all surfaces by steps of up to 5 mm, with a jump of all after every fiftieth, from one
 * question to the next; half-spaces on a body walk too. */
static void walk(int body)
{
    struct arena arena CLOSED_BY(arena_fini);
    struct broad_phase broad;
    uint64_t seed = 3, near[(PAIRS + 63) / 64];
    size_t met = 0;

    make_pairs(body);
    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_ok(broad_phase_make(&config, &arena, &broad, &error));
    assert_int_equal(broad.nword, (config.npair + 63) / 64);
    for (int s = 0; s < SURFACES; s++) {
        broad.ball.reach[s] = 0.4 + 0.3 * random_number(&seed);
        /* As capsules without length they part no more than the balls do */
        broad.capsule[s].radius = broad.ball.reach[s];
    }
    for (int i = 0; i < 2000; i++) {
        double step = i % 50 ? 0.005 : 1;

        for (int s = 0; s < SURFACES; s++) {
            double *axis[] = {&broad.ball.x[s], &broad.ball.y[s], &broad.ball.z[s]};

            for (int k = 0; k < 3 && (i == 0 || body >= 0 || (s > 0 && s < SURFACES - 1)); k++) {
                *axis[k] = step * random_number(&seed) + (i % 50 ? *axis[k] : 0);
            }
        }
        broad_phase_find(&broad, near);
        for (size_t p = 0; p < config.npair; p++) {
            bool found = near[p / 64] >> p % 64 & 1;

            assert_int_equal(found, pair_meets(&broad.ball, &pair[p]));
            met += found;
        }
    }
    assert_true(met > 10000 && met < 1000 * config.npair);
}

TEST(finds_the_pairs_whose_balls_meet_and_no_others)
{
    walk(-1);
}

TEST(half_spaces_that_move_are_found_too)
{
    walk(0);
}

CLOSED_BENCH(arena, struct arena, arena_fini)

/* Makes two long capsules side by side, `apart` m from each other. */
static void two_capsules(struct arena *arena, double apart, struct broad_capsule capsule,
                         struct broad_phase *broad)
{
    for (int i = 0; i < 2; i++) {
        surface[i] = (struct contact_surface){.shape = CONTACT_CAPSULE};
    }
    pair[0] = (struct contact_pair){.a = 0, .b = 1};
    config.npair = 1;
    assert_ok(arena_init(arena, 1 << 20, &error));
    assert_ok(broad_phase_make(&config, arena, broad, &error));
    for (int i = 0; i < 2; i++) {
        broad->ball.x[i] = apart * i;
        broad->ball.y[i] = broad->ball.z[i] = 0;
        broad->ball.reach[i] = 1.1;
        broad->capsule[i] = capsule;
    }
}

/* A long capsule that turns about its center comes near another with its end alone. */
TEST_ON(a_capsule_that_turns_is_found, arena, arena)
{
    struct broad_phase broad;
    uint64_t near[1];
    int met = 0;

    two_capsules(arena, 0.8, (struct broad_capsule){.half = {0, 0, 1}, .radius = 0.1}, &broad);
    for (double angle = 0; angle < 1; angle += 0.001) {
        broad.capsule[0].half[0] = sin(angle);
        broad.capsule[0].half[2] = cos(angle);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 0.8 - sin(angle) < 0.2);
        met += (int)near[0];
    }
    assert_true(met > 100);
}

TEST_ON(long_capsules_side_by_side_are_apart_though_their_balls_meet, arena, arena)
{
    struct broad_phase broad;
    uint64_t near[1];

    two_capsules(arena, 0.3, (struct broad_capsule){.half = {0, 0.6, 0.8}, .radius = 0.1}, &broad);
    broad_phase_find(&broad, near);
    assert_int_equal(near[0], 0);
    broad.ball.x[1] = 0.19;
    broad_phase_find(&broad, near);
    assert_int_equal(near[0], 1);
}

TEST_ON(a_pair_with_a_slack_is_near_when_it_overlaps_by_more, arena, arena)
{
    struct broad_phase broad;
    uint64_t near[(PAIRS + 63) / 64];

    for (int i = 0; i < 2; i++) {
        surface[i].shape = CONTACT_CAPSULE;
    }
    pair[0] = (struct contact_pair){.a = 0, .b = 1, .slack_m = 0.05};
    config.npair = 1;
    assert_ok(arena_init(arena, 1 << 20, &error));
    assert_ok(broad_phase_make(&config, arena, &broad, &error));

    /* Radii of 0.1 each: they meet at 0.15 and not at 0.2, however they come there */
    for (int i = 0; i < 1000; i++) {
        broad.ball.x[1] = 0.1501 + 0.1 * sin(0.05 * i);
        for (int k = 0; k < 2; k++) {
            broad.ball.reach[k] = broad.capsule[k].radius = 0.1;
            broad.ball.y[k] = broad.ball.z[k] = 0;
        }
        broad.ball.x[0] = 0;
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], broad.ball.x[1] < 0.15);
    }
}

/* ---- the list, which is kept until a surface has moved too far ---- */

/* Two surfaces far from the origin along all axes, with this distance along axis k. */
static void place_two(struct broad_phase *broad, int k, double distance)
{
    for (int i = 0; i < 2; i++) {
        double *const at[] = {&broad->ball.x[i], &broad->ball.y[i], &broad->ball.z[i]};

        *at[0] = 3;
        *at[1] = 4;
        *at[2] = 5;
        *at[k] += i * distance;
    }
}

/* Makes the broad phase of one pair: a surface of this shape and body, and a capsule. */
static void make_two(enum contact_shape first, int body, struct arena *arena,
                     struct broad_phase *broad)
{
    for (int i = 2; i < SURFACES; i++) {
        surface[i] = (struct contact_surface){.shape = CONTACT_SPHERE};
    }
    surface[0] = (struct contact_surface){.shape = first, .body = body};
    surface[1] = (struct contact_surface){.shape = CONTACT_CAPSULE};
    pair[0] = (struct contact_pair){.a = 0, .b = 1};
    config.npair = 1;
    assert_ok(arena_init(arena, 1 << 20, &error));
    assert_ok(broad_phase_make(&config, arena, broad, &error));
}

/* Two capsules that move and turn toward each other along axis k: each center by x, each end by x
 * too, as much as the bound of their motion allows. */
static void approach(struct broad_phase *broad, int k, double distance, double x)
{
    place_two(broad, k, distance - 2 * x);
    for (int i = 0; i < 2; i++) {
        double *const at[] = {&broad->ball.x[i], &broad->ball.y[i], &broad->ball.z[i]};
        double *half = broad->capsule[i].half;

        *at[k] += x;
        half[k] = i ? -x : x;
        half[(k + 1) % 3] = sqrt(1 - x * x);
        half[(k + 2) % 3] = 0;
        broad->capsule[i].radius = 0.1;
        broad->ball.reach[i] = 1.1;
    }
}

TEST(capsules_that_approach_and_turn_at_once_are_found_in_the_kept_list)
{
    for (int k = 0; k < 3; k++) {
        struct arena arena CLOSED_BY(arena_fini);
        struct broad_phase broad;
        uint64_t near[1];

        /* A gap of 3 cm, within the margin of 4 cm */
        make_two(CONTACT_CAPSULE, -1, &arena, &broad);
        approach(&broad, k, 0.23, 0);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 0);

        /* The list is kept: another one would be empty without rows */
        broad.nrow = 0;
        approach(&broad, k, 0.23, 0.00749);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 0);
        approach(&broad, k, 0.23, 0.00751);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 1);
        approach(&broad, k, 0.23, 0.00999);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 1);

        /* Beyond the margin it is made again */
        approach(&broad, k, 0.23, 0.01001);
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], 0);
    }
}

/* A ball comes near another ball, or a half-space, by less than the margin. */
TEST(balls_are_found_in_the_kept_list)
{
    for (int plane = 0; plane < 2; plane++) {
        for (int k = 0; k < 3; k++) {
            const double far = plane ? 0.113 : 0.22, close = plane ? 0.0999 : 0.1999;
            struct arena arena CLOSED_BY(arena_fini);
            struct broad_phase broad;
            uint64_t near[1];

            make_two(plane ? CONTACT_HALF_SPACE : CONTACT_SPHERE, -1, &arena, &broad);
            for (int step = 0; step < 2; step++) {
                place_two(&broad, k, step ? close : far);
                for (int i = 0; i < 2; i++) {
                    broad.ball.reach[i] = broad.capsule[i].radius = 0.1;
                }
                if (plane) {
                    /* The surface of a half-space at 3, 4 or 5 m, solid below it */
                    broad.ball.x[0] = k == 0;
                    broad.ball.y[0] = k == 1;
                    broad.ball.z[0] = k == 2;
                    broad.ball.reach[0] = -(3 + k);
                } else if (step) {
                    /* Half of the way by each of them */
                    double *const at[] = {broad.ball.x, broad.ball.y, broad.ball.z};

                    at[k][0] += (far - close) / 2;
                    at[k][1] += (far - close) / 2;
                }
                broad_phase_find(&broad, near);
                assert_int_equal(near[0], step);
                broad.nrow = 0;
            }
        }
    }
}

/* A capsule that leans over a plane reaches down by its radius and the height of its end, or by the
 * radius of its ball if that is less. */
TEST(a_leaning_capsule_is_near_a_plane_when_its_end_is)
{
    for (int side = -1; side <= 1; side += 2) {
        for (int ball = 0; ball < 2; ball++) {
            const double reach = ball ? 0.5 : 1.1;
            struct arena arena CLOSED_BY(arena_fini);
            struct broad_phase broad;
            uint64_t near[1];

            make_two(CONTACT_HALF_SPACE, -1, &arena, &broad);
            broad.ball.x[0] = broad.ball.y[0] = broad.ball.reach[0] = 0;
            broad.ball.z[0] = 1;
            broad.ball.x[1] = broad.ball.y[1] = 0;
            broad.ball.reach[1] = reach;
            broad.capsule[1].radius = 0.1;
            for (double lean = 0; lean < 1.5; lean += 0.1) {
                const double below = fmin(reach, sin(lean) + 0.1);

                broad.capsule[1].half[0] = cos(lean);
                broad.capsule[1].half[2] = side * sin(lean);
                for (int i = -1; i <= 1; i += 2) {
                    broad.ball.z[1] = below + 1e-6 * i;
                    broad_phase_find(&broad, near);
                    assert_int_equal(near[0], i < 0);
                }
            }
        }
    }
}

TEST_ON(a_half_space_that_rises_to_a_ball_is_found, arena, arena)
{
    struct broad_phase broad;
    uint64_t near[1];

    make_two(CONTACT_HALF_SPACE, 0, arena, &broad);
    broad.ball.x[0] = broad.ball.y[0] = broad.ball.x[1] = broad.ball.y[1] = 0;
    broad.ball.z[0] = broad.ball.z[1] = 1;
    broad.ball.reach[1] = broad.capsule[1].radius = 0.1;
    for (double height = 0; height < 1; height += 0.05) {
        broad.ball.reach[0] = -height;
        broad_phase_find(&broad, near);
        assert_int_equal(near[0], height > 0.9);
    }
}

TEST_ON(without_memory_it_is_not_made, arena, arena)
{
    struct broad_phase broad;

    make_pairs(-1);
    assert_ok(arena_init(arena, 4096, &error));
    assert_int_equal(broad_phase_make(&config, arena, &broad, &error), ERROR_MEMORY);
}
