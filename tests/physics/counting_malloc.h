/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Counts what a program asks of the allocator. Such a program is linked with counting_malloc.c and
 * with -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free.
 * It adds a test, counters_see_the_allocator, so that a count of zero means what it says.
 */
#ifndef TESTS_PHYSICS_COUNTING_MALLOC_H
#define TESTS_PHYSICS_COUNTING_MALLOC_H

#include <stddef.h>

/* Calls of malloc, calloc, realloc and free so far. */
size_t counted_calls(void);

#endif
