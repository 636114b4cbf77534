/* SPDX-License-Identifier: Apache-2.0 */
/* Random numbers: the published sequence, streams of their own, distributions. */
#include "base/random.h"
#include "tests/test.h"

TEST(the_sequence_is_that_of_splitmix64)
{
    struct random_stream stream = {0};

    assert_true(random_bits(&stream) == UINT64_C(0xe220a8397b1dcdaf));
    assert_true(random_bits(&stream) == UINT64_C(0x6e789e6aa1b965f4));
    assert_true(random_bits(&stream) == UINT64_C(0x06c45d188009454f));
}

TEST(a_stream_depends_on_seed_and_name_alone)
{
    struct random_stream a = random_named(7, "encoder"), again = random_named(7, "encoder");
    struct random_stream other_name = random_named(7, "current");
    struct random_stream other_seed = random_named(8, "encoder");

    for (int i = 0; i < 100; i++) {
        const uint64_t bits = random_bits(&a);

        assert_true(bits == random_bits(&again));
        assert_true(bits != random_bits(&other_name));
        assert_true(bits != random_bits(&other_seed));
    }
}

TEST(uniform_numbers_fill_zero_to_one)
{
    enum { DRAWS = 100000 };
    struct random_stream stream = random_named(1, "uniform");
    double sum = 0.0, least = 1.0, most = 0.0;

    for (int i = 0; i < DRAWS; i++) {
        const double value = random_uniform(&stream);

        sum += value;
        least = fmin(least, value);
        most = fmax(most, value);
    }
    assert_true(least >= 0.0 && least < 1e-3 && most < 1.0 && most > 1.0 - 1e-3);
    assert_true(fabs(sum / DRAWS - 0.5) < 0.005);
}

TEST(gaussian_numbers_have_mean_zero_and_variance_one)
{
    enum { DRAWS = 100000 };
    struct random_stream stream = random_named(1, "gaussian");
    double sum = 0.0, squares = 0.0;

    for (int i = 0; i < DRAWS; i++) {
        const double value = random_gaussian(&stream);

        sum += value;
        squares += value * value;
    }
    assert_true(fabs(sum / DRAWS) < 0.02);
    assert_true(fabs(squares / DRAWS - 1.0) < 0.03);
}

TEST(gaps_fill_their_share_of_time_with_their_mean_length)
{
    enum { STEPS = 1000000 };
    const double share = 0.2, dwell = 0.05, step = 0.001;
    struct random_stream stream = random_named(1, "gap");
    size_t open = 0, gaps = 0;
    bool gap = false;

    for (int i = 0; i < STEPS; i++) {
        const bool before = gap;

        gap = random_gap(&stream, gap, share, dwell, step);
        open += gap;
        gaps += gap && !before;
    }
    assert_true(fabs((double)open / STEPS - share) < 0.02);
    assert_true(fabs((double)open / (double)gaps * step - dwell) < 0.005);
    assert_true(random_gap(&stream, false, 1.0, dwell, step));
    assert_false(random_gap(&stream, false, 0.0, dwell, step));
}
