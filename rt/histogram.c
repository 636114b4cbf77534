/* SPDX-License-Identifier: Apache-2.0 */
/* Implements a histogram with log-linear buckets. The writer stores each field atomically, at the
 * cost of a plain store, and stores the bucket last. */
#include "rt/histogram.h"

#include <math.h>

enum { SUB = 1 << HISTOGRAM_SUB_BITS };

/* Returns the bucket of a value. Each value below 2 SUB has its own bucket. Above, the leading
 * SUB_BITS + 1 bits of the value select the bucket. */
static unsigned histogram_bucket_of(uint64_t value)
{
    unsigned shift, index;

    if (value < 2 * SUB) {
        return (unsigned)value;
    }
    shift = 63u - (unsigned)__builtin_clzll(value) - HISTOGRAM_SUB_BITS;
    index = (shift << HISTOGRAM_SUB_BITS) + (unsigned)(value >> shift);
    return index < HISTOGRAM_BUCKETS ? index : HISTOGRAM_BUCKETS - 1;
}

int64_t histogram_edge(unsigned index)
{
    unsigned shift;

    if (index < 2 * SUB) {
        return index;
    }
    shift = (index >> HISTOGRAM_SUB_BITS) - 1;
    return (int64_t)((((uint64_t)(index & (SUB - 1)) + SUB + 1) << shift) - 1);
}

void histogram_add(struct histogram *histogram, int64_t ns)
{
    int64_t value = ns > 0 ? ns : 0;
    uint64_t *bucket = &histogram->bucket[histogram_bucket_of((uint64_t)value)];

    if (histogram->count == 0 || value < histogram->min) {
        __atomic_store_n(&histogram->min, value, __ATOMIC_RELAXED);
    }
    if (value > histogram->max) {
        __atomic_store_n(&histogram->max, value, __ATOMIC_RELAXED);
    }
    __atomic_store_n(&histogram->sum, histogram->sum + value, __ATOMIC_RELAXED);
    __atomic_store_n(&histogram->count, histogram->count + 1, __ATOMIC_RELAXED);
    /* Release: a reader that sees this sample also sees a min and max that include it */
    __atomic_store_n(bucket, *bucket + 1, __ATOMIC_RELEASE);
}

void histogram_copy(const struct histogram *from, struct histogram *to)
{
    to->count = 0;
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        to->bucket[i] = __atomic_load_n(&from->bucket[i], __ATOMIC_ACQUIRE);
        to->count += to->bucket[i];
    }
    to->sum = __atomic_load_n(&from->sum, __ATOMIC_RELAXED);
    to->min = __atomic_load_n(&from->min, __ATOMIC_RELAXED);
    to->max = __atomic_load_n(&from->max, __ATOMIC_RELAXED);
}

int64_t histogram_percentile(const struct histogram *histogram, double fraction)
{
    double wanted = ceil(fraction * (double)histogram->count);
    uint64_t seen = 0;

    if (histogram->count == 0) {
        return 0;
    }
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS - 1; i++) {
        seen += histogram->bucket[i];
        if (seen > 0 && (double)seen >= wanted) {
            int64_t edge = histogram_edge(i);

            return edge < histogram->max ? edge : histogram->max;
        }
    }
    return histogram->max;
}
