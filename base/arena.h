/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One arena for all memory that lives as long as a rig runs: robot, plant, boards, buses, loop. It
 * allocates zeroed memory until it is sealed. Sealing touches and locks all allocated pages, so
 * that the loop neither allocates nor causes a page fault.
 */
#ifndef BASE_ARENA_H
#define BASE_ARENA_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

struct arena {
    unsigned char *memory;
    size_t capacity; /* bytes of address space reserved */
    size_t used;
    bool sealed;
};

/* Reserves capacity bytes of address space (pages cost nothing until touched). Not RT-safe. */
enum error_code arena_init(struct arena *arena, size_t capacity, struct error *error);

/* Returns all memory to the system. Allowed on a zeroed or finished arena. Not RT-safe. */
void arena_fini(struct arena *arena);

/* Returns count * size zeroed bytes, aligned to 64 and owned by the arena. NULL when the product
 * overflows, the capacity is used up, or the arena is sealed. Not RT-safe. */
void *arena_alloc(struct arena *arena, size_t count, size_t size);

/* Returns a copy of text in the arena; NULL = out of memory. Not RT-safe. */
char *arena_strdup(struct arena *arena, const char *text);

/* Declares that size bytes of an arena may be copied as a block, although they contain several
 * allocations and the gaps between them. Only the address sanitizer needs this. RT-safe. */
void arena_join(void *memory, size_t size);

/* Refuses further allocations and does nothing else. RT-safe. */
void arena_close(struct arena *arena);

/* Refuses further allocations and touches every used page; with lock also locks them (mlock). If
 * mlock fails, returns its error; the arena is still sealed. Not RT-safe. */
enum error_code arena_seal(struct arena *arena, bool lock, struct error *error);

#endif
