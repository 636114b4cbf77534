/* SPDX-License-Identifier: Apache-2.0 */
/* Measures times of a benchmark. */
#include "app/bench/timing.h"

#include <stdlib.h>
#include <time.h>

double bench_cpu_s(void)
{
    struct timespec now;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Orders doubles for qsort. */
static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

void bench_sort(double *value, size_t count)
{
    qsort(value, count, sizeof *value, compare_doubles);
}

double bench_median(double *value, size_t count)
{
    bench_sort(value, count);
    return value[count / 2];
}
