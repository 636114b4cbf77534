/* SPDX-License-Identifier: Apache-2.0 */
/* Bounds, arrival and length of a reference's motion. */

#include "tasks/task_private.h"
#include "tests/test.h"

#define RATE 0.5
#define ACCELERATION 2.0
#define DT 0.001

/* Moves to a goal, or for so many steps; every step keeps the bounds. Returns the steps until it
 * rests there. */
static int move_to(struct motion_profile *profile, double goal, int most)
{
    for (int i = 0; i < most; i++) {
        struct motion_profile before = *profile;

        motion_profile_step(profile, goal, RATE, ACCELERATION, DT);
        assert_true(fabs(profile->rate_rad_s) <= RATE * (1 + 1e-12));
        assert_true(fabs(profile->rate_rad_s - before.rate_rad_s) <=
                    ACCELERATION * DT * (1 + 1e-9));
        assert_true(fabs(profile->angle_rad - before.angle_rad) <= RATE * DT * (1 + 1e-12));
        if (profile->angle_rad == goal && profile->rate_rad_s == 0) {
            return i + 1;
        }
    }
    return most;
}

/* A trapezoid of rate takes distance / rate + rate / acceleration. */
TEST(takes_as_long_as_a_trapezoid)
{
    struct motion_profile profile = {0.2, 0};
    int steps = move_to(&profile, 1.2, 10000);

    assert_true(profile.angle_rad == 1.2);
    assert_true(fabs(steps * DT - (1.0 / RATE + RATE / ACCELERATION)) < 0.01);
}

/* A short way is a triangle: 2 sqrt(distance / acceleration). */
TEST(short_ways_never_reach_the_rate)
{
    struct motion_profile profile = {0, 0};
    int steps = move_to(&profile, -0.02, 10000);

    assert_true(profile.angle_rad == -0.02);
    assert_true(fabs(steps * DT - 2 * sqrt(0.02 / ACCELERATION)) < 0.01);
}

TEST(never_overshoots)
{
    for (double goal = 1e-7; goal < 2; goal *= 1.37) {
        struct motion_profile profile = {0, 0};

        for (int i = 0; i < 8000; i++) {
            motion_profile_step(&profile, goal, RATE, ACCELERATION, DT);
            assert_true(profile.angle_rad <= goal);
        }
        assert_true(profile.angle_rad == goal && profile.rate_rad_s == 0);
    }
}

TEST(turns_round_when_the_goal_does)
{
    struct motion_profile profile = {0, 0};

    assert_int_equal(move_to(&profile, 1, 700), 700);
    assert_true(profile.rate_rad_s > 0.49);
    assert_true(move_to(&profile, -1, 10000) < 10000);
    assert_true(profile.angle_rad == -1);
}
