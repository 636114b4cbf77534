/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Counts allocations: the program's own malloc counts and calls the C library's, so that
 * allocations of shared libraries count too. Not with sanitizers, which have their own malloc.
 */
#ifndef APP_BENCH_ALLOCATIONS_H
#define APP_BENCH_ALLOCATIONS_H

#include <stdbool.h>
#include <stddef.h>

/* Whether this build counts allocations: with glibc, and without sanitizers. */
extern const bool bench_allocations_counted;

/* Returns the number of allocations by this thread so far; 0 where they are not counted.
 * RT-safe. */
size_t bench_allocations(void);

#endif
