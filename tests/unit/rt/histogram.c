/* SPDX-License-Identifier: Apache-2.0 */
/* Percentiles of the log-linear histogram against those of the sorted samples. */
#include "rt/histogram.h"
#include "tests/test.h"

#include <pthread.h>
#include <stdatomic.h>

enum { SAMPLES = 20001 };

static uint64_t random_state = 0x9e3779b97f4a7c15;

static double uniform(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (double)(random_state >> 11) * 0x1p-53;
}

static int compare(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;

    return (x > y) - (x < y);
}

/* Nearest rank: the smallest sample that at least this fraction does not exceed */
static int64_t true_percentile(const int64_t *sorted, size_t count, double fraction)
{
    size_t rank = (size_t)ceil(fraction * (double)count);

    return sorted[rank > 0 ? rank - 1 : 0];
}

static void check_against_sorted(int64_t *sample, size_t count)
{
    static const double fractions[] = {0.0,  0.001, 0.01, 0.1,   0.25,   0.5,
                                       0.75, 0.9,   0.99, 0.999, 0.9999, 1.0};
    struct histogram *histogram = test_calloc(1, sizeof *histogram);
    int64_t sum = 0;

    for (size_t i = 0; i < count; i++) {
        histogram_add(histogram, sample[i]);
        sum += sample[i];
    }
    qsort(sample, count, sizeof *sample, compare);
    for (size_t i = 0; i < sizeof fractions / sizeof fractions[0]; i++) {
        int64_t expected = true_percentile(sample, count, fractions[i]);
        int64_t found = histogram_percentile(histogram, fractions[i]);

        assert_true(found >= expected);
        assert_true((double)(found - expected) <= (double)expected / 64.0);
    }
    assert_int_equal(histogram->count, count);
    assert_int_equal(histogram->sum, sum);
    assert_int_equal(histogram->min, sample[0]);
    assert_int_equal(histogram->max, sample[count - 1]);
    assert_int_equal(histogram_percentile(histogram, 1.0), sample[count - 1]);
    test_free(histogram);
}

TEST(percentiles_are_within_a_64th_above_the_sorted_samples)
{
    int64_t *sample = test_calloc(SAMPLES, sizeof *sample);

    for (int kind = 0; kind < 4; kind++) {
        for (size_t i = 0; i < SAMPLES; i++) {
            double u = uniform();
            double values[] = {
                u * 200.0,                            /* exact buckets */
                u * 1e6,                              /* uniform */
                exp(u * 25.0),                        /* over eleven decades */
                u < 0.99 ? 3e4 + u : 3.6e7 + 1e6 * u, /* two heaps */
            };

            sample[i] = (int64_t)values[kind];
        }
        check_against_sorted(sample, SAMPLES);
    }
    test_free(sample);
}

TEST(every_edge_of_a_bucket_is_within_the_error)
{
    for (int64_t power = 1; power < INT64_C(1) << 37; power *= 2) {
        for (int64_t offset = -1; offset <= 1; offset++) {
            int64_t sample[2] = {power + offset, INT64_C(1) << 37};

            check_against_sorted(sample, 2);
        }
    }
}

TEST(edge_is_the_greatest_value_of_its_bucket)
{
    struct histogram *histogram = test_calloc(1, sizeof *histogram);

    for (unsigned i = 0; i < HISTOGRAM_BUCKETS - 1; i++) {
        histogram_add(histogram, histogram_edge(i));
        assert_int_equal(histogram->bucket[i], 1);
        histogram_add(histogram, histogram_edge(i) + 1);
        assert_int_equal(histogram->bucket[i + 1], 1);
        histogram->bucket[i + 1] = 0;
    }
    test_free(histogram);
}

TEST(an_empty_histogram_has_zero_percentiles)
{
    struct histogram *histogram = test_calloc(1, sizeof *histogram);

    assert_int_equal(histogram_percentile(histogram, 0.5), 0);
    assert_int_equal(histogram_percentile(histogram, 1.0), 0);
    test_free(histogram);
}

TEST(negative_and_enormous_values_are_taken_in)
{
    struct histogram *histogram = test_calloc(1, sizeof *histogram);

    histogram_add(histogram, -5);
    histogram_add(histogram, INT64_MAX);
    assert_int_equal(histogram->min, 0);
    assert_int_equal(histogram_percentile(histogram, 0.5), 0);
    assert_int_equal(histogram_percentile(histogram, 0.99), INT64_MAX);
    test_free(histogram);
}

struct writer {
    struct histogram histogram;
    atomic_bool ended;
};

static void *write_samples(void *context)
{
    struct writer *writer = context;

    for (int i = 0; i < 400000; i++) {
        histogram_add(&writer->histogram, 1000 + (int64_t)(uniform() * 1e6));
    }
    atomic_store(&writer->ended, true);
    return NULL;
}

TEST(a_copy_beside_the_writer_agrees_with_itself)
{
    struct writer *writer = test_calloc(1, sizeof *writer);
    struct histogram *copy = test_calloc(1, sizeof *copy);
    uint64_t last = 0, wrong = 0;
    pthread_t thread;
    bool ended;

    assert_int_equal(pthread_create(&thread, NULL, write_samples, writer), 0);
    do {
        ended = atomic_load(&writer->ended);
        histogram_copy(&writer->histogram, copy);
        wrong += copy->count < last;
        last = copy->count;
        if (copy->count > 0) {
            wrong += copy->min < 1000 || copy->max > 1001000 || copy->min > copy->max;
            wrong += histogram_percentile(copy, 1.0) > copy->max ||
                     histogram_percentile(copy, 0.0) < copy->min;
        }
    } while (!ended);
    pthread_join(thread, NULL);
    assert_int_equal(wrong, 0);
    assert_int_equal(copy->count, 400000);
    assert_memory_equal(copy, &writer->histogram, sizeof *copy);
    test_free(copy);
    test_free(writer);
}
