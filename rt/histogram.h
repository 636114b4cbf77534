/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A histogram of durations in fixed memory. Buckets are 1 ns wide up to 128 ns; above, each power
 * of two has 64 buckets. A percentile is therefore between the true value and 1/64 above it. One
 * thread writes. Others copy with histogram_copy during the run, or read after it. RT-safe.
 */
#ifndef RT_HISTOGRAM_H
#define RT_HISTOGRAM_H

#include <stdint.h>

enum {
    HISTOGRAM_SUB_BITS = 6,  /* 64 buckets per power of two */
    HISTOGRAM_TOP_BITS = 38, /* values of 2^38 ns (275 s) and more share the last bucket */
    HISTOGRAM_BUCKETS = (HISTOGRAM_TOP_BITS - HISTOGRAM_SUB_BITS + 1) << HISTOGRAM_SUB_BITS,
};

struct histogram {
    uint64_t count;
    int64_t sum, min, max; /* ns, exact */
    uint64_t bucket[HISTOGRAM_BUCKETS];
};

/* Adds a duration in ns; a negative value counts as 0. A histogram of zero bytes is empty and
 * valid. */
void histogram_add(struct histogram *histogram, int64_t ns);

/* Copies a histogram from any thread while another thread adds. In the copy, every sample is within
 * min and max, and the count equals the sum of the buckets. A sample that is being added may be
 * missing from the buckets, the sum or both. */
void histogram_copy(const struct histogram *from, struct histogram *to);

/* Returns the greatest value of a bucket, ns. The last bucket also holds all greater values. */
int64_t histogram_edge(unsigned index);

/* Returns the percentile for a fraction (0-1), ns: the upper edge of its bucket, but at most the
 * greatest sample. Returns 0 when the histogram is empty. */
int64_t histogram_percentile(const struct histogram *histogram, double fraction);

#endif
