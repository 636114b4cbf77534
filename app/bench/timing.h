/* SPDX-License-Identifier: Apache-2.0 */
/* Times of a benchmark: the CPU time of the calling thread, and medians. Not RT-safe. */
#ifndef APP_BENCH_TIMING_H
#define APP_BENCH_TIMING_H

#include <stddef.h>

/* CPU time of the calling thread, s. */
double bench_cpu_s(void);

/* Sorts the values, ascending. */
void bench_sort(double *value, size_t count);

/* The median of at least one value; sorts them. */
double bench_median(double *value, size_t count);

#endif
