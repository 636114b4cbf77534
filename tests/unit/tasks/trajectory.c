/* SPDX-License-Identifier: Apache-2.0 */
/* Trajectories: what a file may say, and what is between its rows. */
#include "tasks/trajectory.h"

#include "base/array.h"

#include "tests/unit/arena_fixture.h"

static const struct trajectory_limit limits[] = {{"hip", -1, 2, 10}, {"knee", 0, 4, 0}};

static enum error_code read_bytes(const char *text, size_t size,
                                  enum trajectory_interpolation interpolation,
                                  const struct trajectory **t, struct error *error)
{
    struct csv *csv;

    return csv_open_memory("walk.csv", text, size, &csv, error)
               ? error->code
               : trajectory_read(csv, interpolation, limits, ARRAY_COUNT(limits), &arena, t, error);
}

static enum error_code read_text(const char *text, enum trajectory_interpolation interpolation,
                                 const struct trajectory **t, struct error *error)
{
    return read_bytes(text, strlen(text), interpolation, t, error);
}

TEST(between_rows_it_is_linear_or_cubic)
{
    static const char text[] = "time_s,knee_deg,hip_rad\n5,0,0\n6,90,1\n8,180,1\n";
    const struct trajectory *t;
    struct error error;
    double angle, rate;

    assert_ok(read_text(text, TRAJECTORY_LINEAR, &t, &error));
    assert_true(t->njoint == 2 && t->joint[0] == 1 && t->joint[1] == 0);
    assert_true(trajectory_length_s(t) == 3);
    trajectory_at(t, 0, 0.5, &angle, &rate);
    assert_true(fabs(angle - M_PI / 4) < 1e-12 && fabs(rate - M_PI / 2) < 1e-12);
    trajectory_at(t, 0, 2, &angle, &rate);
    assert_true(fabs(angle - M_PI * 0.75) < 1e-12 && fabs(rate - M_PI / 4) < 1e-12);

    /* At rest before, after and at both ends */
    assert_ok(read_text(text, TRAJECTORY_CUBIC, &t, &error));
    trajectory_at(t, 0, -1, &angle, &rate);
    assert_true(angle == 0 && rate == 0);
    trajectory_at(t, 0, 7, &angle, &rate);
    assert_true(fabs(angle - M_PI) < 1e-12 && rate == 0);
    trajectory_at(t, 0, 1e-9, &angle, &rate);
    assert_true(fabs(rate) < 1e-7);

    /* The weighted harmonic mean of pi/2 and pi/4 with segments of 1 s and 2 s */
    trajectory_at(t, 0, 1, &angle, &rate);
    assert_true(fabs(angle - M_PI / 2) < 1e-12);
    assert_true(fabs(rate - 9 / (5 / (M_PI / 2) + 4 / (M_PI / 4))) < 1e-12);
}

/* Rates are the derivative of angles, angles stay between the rows. */
TEST(a_cubic_is_smooth_and_never_leaves_the_rows)
{
    static const char text[] = "time_s,hip_rad\n0,0\n0.3,0.9\n0.4,1\n1,1.0\n1.2,0.2\n2,0.1\n";
    const struct trajectory *t;
    struct error error;
    double angle, rate, before, after, unused;

    assert_ok(read_text(text, TRAJECTORY_CUBIC, &t, &error));
    for (double time = 0.001; time < 1.999; time += 0.001) {
        trajectory_at(t, 0, time, &angle, &rate);
        trajectory_at(t, 0, time - 1e-6, &before, &unused);
        trajectory_at(t, 0, time + 1e-6, &after, &unused);
        assert_true(fabs((after - before) / 2e-6 - rate) < 1e-3);
        assert_true(angle >= 0 && angle <= 1);
        if (time > 0.4 && time < 1) {
            assert_true(angle == 1.0);
        }
    }
}

TEST(the_peak_between_rows_counts)
{
    /* From rest to rest: 1.5 times the mean of 7 rad/s */
    static const char text[] = "time_s,hip_rad\n0,0\n0.1,0.7\n";
    const struct trajectory *t;
    struct error error;

    assert_ok(read_text(text, TRAJECTORY_LINEAR, &t, &error));
    assert_int_equal(read_text(text, TRAJECTORY_CUBIC, &t, &error), ERROR_INPUT);
    assert_string_equal(error.text,
                        "walk.csv:3: column 2 (hip_rad): found 10.5 rad/s since the row "
                        "before, expected at most 10 rad/s, what the drive reaches");
}

TEST(what_is_wrong_is_said_with_its_place)
{
    static const struct {
        const char *text, *expected;
    } wrong[] = {
        {"", "walk.csv:1: found other titles, expected time_s"},
        {"time_s\n0\n1\n", "walk.csv:1: found other titles, expected time_s"},
        {"t,hip_rad\n", "walk.csv:1: found other titles, expected time_s"},
        {"time_s,hip\n", "walk.csv:1: column 2: found \"hip\", expected JOINT_rad or JOINT_deg"},
        {"time_s,_rad\n", "walk.csv:1: column 2: found \"_rad\", expected"},
        {"time_s,hipp_rad\n", "walk.csv:1: column 2: found joint \"hipp\", which the rig does not "
                              "drive; the nearest is hip"},
        {"time_s,hip_rad,knee_rad,hip_deg\n",
         "walk.csv:1: column 4: found joint \"hip\" again, which column 2 has"},
        {"time_s,hip_rad\n", "walk.csv:2: found 0 rows, expected 2 or more"},
        {"time_s,hip_rad\n0,0", "walk.csv:3: found 1 rows, expected 2 or more"},
        {"time_s,hip_rad\n0,0\n0,0\n",
         "walk.csv:3: column 1 (time_s): found 0, expected more than"},
        {"time_s,hip_rad\n0,0\n-1,0\n", "walk.csv:3: column 1 (time_s): found -1, expected more"},
        {"time_s,hip_rad\n0,0\n1,2.1\n", "walk.csv:3: column 2 (hip_rad): found 2.1 rad, expected "
                                         "-1 to 2 rad, the joint's limits"},
        {"time_s,knee_deg\n0,0\n1,-1\n", "walk.csv:3: column 2 (knee_deg): found -0.0174533 rad"},
        {"time_s,hip_rad\n0,0\n1,nan\n", "walk.csv:3: column 2 (hip_rad): found \"nan\""},
        {"time_s,hip_rad\n0,0\n1,inf\n", "walk.csv:3: column 2 (hip_rad): found \"inf\""},
        {"time_s,hip_rad\n0,0\n1,1e999\n", "walk.csv:3: column 2 (hip_rad): found \"1e999\""},
        {"time_s,hip_rad\n0,0\n1\n", "walk.csv:3: column 2 (hip_rad): found \"\""},
        {"time_s,hip_rad\n0,0\n1,1,1\n", "walk.csv:3: found more than 2 columns"},
        {"time_s,hip_rad\n0,0\n\n1,1\n", "walk.csv:3: column 1 (time_s): found \"\""},
        {"time_s,hip_rad\n0,0\n1e-300,1\n", "walk.csv:3: column 2 (hip_rad): found"},
    };
    const struct trajectory *t;
    struct error error;

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        assert_int_equal(read_text(wrong[i].text, TRAJECTORY_CUBIC, &t, &error), ERROR_INPUT);
        if (strncmp(error.text, wrong[i].expected, strlen(wrong[i].expected)) != 0) {
            fail_msg("\"%s\" does not begin with \"%s\"", error.text, wrong[i].expected);
        }
    }
    assert_int_equal(
        read_bytes("time_s,hip_rad\n0,0\n1,\0000\n", 22, TRAJECTORY_LINEAR, &t, &error),
        ERROR_INPUT);
    assert_string_equal(error.text, "walk.csv:3: found a zero byte, expected text");
}

TEST_GROUP(open_arena, close_arena)
