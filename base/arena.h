/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An arena holds all memory that lives as long as a run: robot, plant, boards, buses and loop. It
 * allocates zeroed memory until it is sealed. Sealing touches all allocated pages and can lock
 * them. Afterwards the loop allocates no memory and causes no page faults.
 */
#ifndef BASE_ARENA_H
#define BASE_ARENA_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

struct arena {
    unsigned char *memory;
    size_t capacity; /* reserved address space, bytes */
    size_t used;
    bool sealed;
};

/* Reserves `capacity` bytes of address space. A page costs memory only after its first use. Not
 * RT-safe. */
enum error_code arena_init(struct arena *arena, size_t capacity, struct error *error);

/* Returns all memory to the system. The arena may be zeroed or already finished. Not RT-safe. */
void arena_fini(struct arena *arena);

/* Returns count * size zeroed bytes, aligned to 64. The arena owns them. Returns NULL if the
 * product overflows, the capacity is used up, or the arena is sealed. Not RT-safe. */
void *arena_alloc(struct arena *arena, size_t count, size_t size);

/* Returns a copy of `text` in the arena, or NULL if no memory is left. Not RT-safe. */
char *arena_strdup(struct arena *arena, const char *text);

/* Permits a copy of `size` bytes of an arena as one block, with the gaps between its allocations.
 * Only the address sanitizer needs this call. RT-safe. */
void arena_join(void *memory, size_t size);

/* Refuses further allocations. Does not touch or lock pages. RT-safe. */
void arena_close(struct arena *arena);

/* Refuses further allocations, maps every used page and keeps its content. Not RT-safe. */
void arena_seal(struct arena *arena);

#endif
