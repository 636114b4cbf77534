/* SPDX-License-Identifier: Apache-2.0 */
/* Replaces malloc, calloc and realloc in the whole program by functions that count. */
#include "app/bench/bench.h"

#include <stdlib.h>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

const bool bench_allocations_counted = true;

static _Thread_local size_t count;

/* The allocation functions of glibc, under the names that glibc exports for replacements */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *memory, size_t size);

void *malloc(size_t size)
{
    count++;
    return __libc_malloc(size);
}

void *calloc(size_t n, size_t size)
{
    count++;
    return __libc_calloc(n, size);
}

void *realloc(void *memory, size_t size)
{
    count++;
    return __libc_realloc(memory, size);
}

size_t bench_allocations(void)
{
    return count;
}

#else

const bool bench_allocations_counted = false;

size_t bench_allocations(void)
{
    return 0;
}

#endif
