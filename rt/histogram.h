/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A histogram of durations in fixed memory: buckets of width 1 up to 128 ns, then 64 a power of
 * two, so that a percentile read back is never below the true one and at most 1/64 above it. One
 * writing thread; others copy it with histogram_copy while it writes, or read it when it has
 * stopped. RT-safe.
 */
#ifndef RT_HISTOGRAM_H
#define RT_HISTOGRAM_H

#include <stdint.h>

enum {
    HISTOGRAM_SUB_BITS = 6,  /* 64 buckets a power of two */
    HISTOGRAM_TOP_BITS = 38, /* values from 2^38 ns (275 s) share the last bucket */
    HISTOGRAM_BUCKETS = (HISTOGRAM_TOP_BITS - HISTOGRAM_SUB_BITS + 1) << HISTOGRAM_SUB_BITS,
};

struct histogram {
    uint64_t count;
    int64_t sum, min, max; /* ns, exact */
    uint64_t bucket[HISTOGRAM_BUCKETS];
};

/* Adds a duration; zero memory is an empty histogram, and negative values count as 0. */
void histogram_add(struct histogram *histogram, int64_t ns);

/* Copies a histogram from any thread while another adds. Every sample in the copy's buckets is
 * within its min and max, and its count is that of the buckets; of samples that are being added
 * right now it has some, and its sum may differ by them. */
void histogram_copy(const struct histogram *from, struct histogram *to);

/* Returns the greatest value that falls into a bucket, ns; the last bucket takes in all above
 * its own too. */
int64_t histogram_edge(unsigned index);

/* Returns the smallest value that at least fraction (0-1) of the samples do not exceed, rounded
 * up to its bucket's upper edge, never above the greatest sample; 0 when empty. */
int64_t histogram_percentile(const struct histogram *histogram, double fraction);

#endif
