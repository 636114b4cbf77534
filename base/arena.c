/* SPDX-License-Identifier: Apache-2.0 */
/* Implements the arena: a bump allocator over reserved address space. */
#include "base/arena.h"

#include <errno.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* The address sanitizer detects accesses to arena memory that is not allocated, even inside a page.
 * Without the sanitizer these macros are empty. */
#if __has_include(<sanitizer/asan_interface.h>)
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(at, size) ((void)(at), (void)(size))
#define ASAN_UNPOISON_MEMORY_REGION(at, size) ((void)(at), (void)(size))
#endif

enum {
    ALIGNMENT = 64,
    POISONED = 4096,    /* poisoned bytes after the allocated bytes */
    PRESENT = 256 << 10 /* bytes that one call maps */
};

/* An arena of at least this size, in bytes, holds the data of a run. It uses huge pages if the
 * system has them: they reduce TLB misses. */
#define HUGE_FROM ((size_t)256 << 20)

/* Returns the offset where the poisoned bytes after the used memory end. */
static size_t arena_poison_end(const struct arena *arena)
{
    return arena->capacity - arena->used < POISONED ? arena->capacity : arena->used + POISONED;
}

enum error_code arena_init(struct arena *arena, size_t capacity, struct error *error)
{
    void *memory = mmap(NULL, capacity, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);

    memset(arena, 0, sizeof *arena);
    if (memory == MAP_FAILED) {
        return error_set_errno(error, errno, "cannot reserve %zu bytes of memory", capacity);
    }
    arena->memory = memory;
    arena->capacity = capacity;
    if (capacity >= HUGE_FROM) {
        madvise(memory, capacity, MADV_HUGEPAGE);
    }
    return ERROR_NONE;
}

void arena_fini(struct arena *arena)
{
    if (arena->memory) {
        ASAN_UNPOISON_MEMORY_REGION(arena->memory, arena_poison_end(arena));
        munmap(arena->memory, arena->capacity);
    }
    memset(arena, 0, sizeof *arena);
}

void *arena_alloc(struct arena *arena, size_t count, size_t size)
{
    size_t before = arena->used, bytes, start = (before + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;

    if (arena->sealed || __builtin_mul_overflow(count, size, &bytes) || start > arena->capacity ||
        bytes > arena->capacity - start) {
        return NULL;
    }
    arena->used = start + bytes;

    /* Map the next pages with one call, instead of one page fault for each page. A large
     * allocation is not mapped in advance, because the program may never use it. Kernels before
     * 5.14 refuse the call, which is harmless. */
    size_t from = (before + PRESENT - 1) / PRESENT * PRESENT;
    size_t to = (arena->used + PRESENT - 1) / PRESENT * PRESENT;

    if (from < to && to <= arena->capacity && bytes <= PRESENT) {
        madvise(arena->memory + from, to - from, MADV_POPULATE_WRITE);
    }
    ASAN_UNPOISON_MEMORY_REGION(arena->memory + start, bytes);
    ASAN_POISON_MEMORY_REGION(arena->memory + arena->used, arena_poison_end(arena) - arena->used);
    return arena->memory + start;
}

char *arena_strdup(struct arena *arena, const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = arena_alloc(arena, size, 1);

    if (copy) {
        memcpy(copy, text, size);
    }
    return copy;
}

void arena_join(void *memory, size_t size)
{
    ASAN_UNPOISON_MEMORY_REGION(memory, size);
}

void arena_close(struct arena *arena)
{
    arena->sealed = true;
}

__attribute__((no_sanitize("address"))) void arena_seal(struct arena *arena)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE);

    arena_close(arena);
    if (!madvise(arena->memory, arena->used, MADV_POPULATE_WRITE)) {
        return;
    }
    /* Kernels before 5.14 lack the call: write one byte in each page. Another running thread may
     * own this byte, so an atomic exchange writes its present value. */
    for (size_t at = 0; at < arena->used; at += page) {
        unsigned char *touch = arena->memory + at;
        unsigned char is = __atomic_load_n(touch, __ATOMIC_RELAXED);

        __atomic_compare_exchange_n(touch, &is, is, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
    }
}
