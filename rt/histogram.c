/* SPDX-License-Identifier: Apache-2.0 */
/* Log-linear buckets. */
#include "rt/histogram.h"

#include <math.h>

enum { SUB = 1 << HISTOGRAM_SUB_BITS };

/* values below 2 SUB have a bucket each; above, the leading SUB_BITS + 1 bits choose it */
static unsigned bucket_of(uint64_t value)
{
    unsigned shift, index;

    if (value < 2 * SUB) {
        return (unsigned)value;
    }
    shift = 63u - (unsigned)__builtin_clzll(value) - HISTOGRAM_SUB_BITS;
    index = (shift << HISTOGRAM_SUB_BITS) + (unsigned)(value >> shift);
    return index < HISTOGRAM_BUCKETS ? index : HISTOGRAM_BUCKETS - 1;
}

static int64_t upper_edge(unsigned index)
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

    histogram->min = histogram->count == 0 || value < histogram->min ? value : histogram->min;
    histogram->max = value > histogram->max ? value : histogram->max;
    histogram->sum += value;
    histogram->count++;
    histogram->bucket[bucket_of((uint64_t)value)]++;
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
            int64_t edge = upper_edge(i);

            return edge < histogram->max ? edge : histogram->max;
        }
    }
    return histogram->max;
}
