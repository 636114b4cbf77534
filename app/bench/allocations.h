/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How often memory was asked for: the program's own malloc counts and hands on to the C library's,
 * so that what shared libraries allocate counts too. Not with sanitizers, which have a malloc of
 * their own.
 */
#ifndef APP_BENCH_ALLOCATIONS_H
#define APP_BENCH_ALLOCATIONS_H

#include <stdbool.h>
#include <stddef.h>

extern const bool bench_allocations_counted;

/* By this thread so far; 0 where they are not counted. RT-safe. */
size_t bench_allocations(void);

#endif
