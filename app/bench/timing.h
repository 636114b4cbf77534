/* SPDX-License-Identifier: Apache-2.0 */
/* Measures times of a benchmark: the CPU time of the calling thread, and medians. Not RT-safe. */
#ifndef APP_BENCH_TIMING_H
#define APP_BENCH_TIMING_H

#include <stddef.h>

/* Returns the CPU time of the calling thread, s. */
double bench_cpu_s(void);

/* Sorts the values, ascending. */
void bench_sort(double *value, size_t count);

/* Returns the median of at least one value, of an even number the upper one of the middle; sorts
 * the values. */
double bench_median(double *value, size_t count);

#endif
