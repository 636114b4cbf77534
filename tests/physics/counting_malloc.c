/* SPDX-License-Identifier: Apache-2.0 */
/* The linker sends every call of the allocator to the counters here. */
#include "tests/physics/counting_malloc.h"
#include "tests/test.h"

/* Volatile: compilers assume that an allocator touches nothing else */
static volatile size_t calls;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void __wrap_free(void *memory);

void *__wrap_malloc(size_t size)
{
    calls++;
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    calls++;
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size)
{
    calls++;
    return __real_realloc(memory, size);
}

void __wrap_free(void *memory)
{
    calls++;
    __real_free(memory);
}

size_t counted_calls(void)
{
    return calls;
}

TEST(counters_see_the_allocator)
{
    size_t before = calls;
    void *volatile memory = malloc(16);

    memory = realloc(memory, 32);
    free(memory);
    memory = calloc(2, 8);
    free(memory);
    assert_int_equal(calls - before, 5);
}
