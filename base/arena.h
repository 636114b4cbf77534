/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One arena for everything that lives as long as the program runs a rig: robot, plant, boards,
 * buses, loop. It hands out zeroed memory until it is sealed; sealing touches and locks what was
 * handed out, so that the loop afterwards neither allocates nor faults a page.
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

/* Gives all memory back to the system. Allowed on a zeroed or finished arena. Not RT-safe. */
void arena_fini(struct arena *arena);

/* Returns count * size zeroed bytes, aligned to 64; owned by the arena. NULL when the product
 * overflows, the capacity is used up or the arena is sealed. Not RT-safe. */
void *arena_alloc(struct arena *arena, size_t count, size_t size);

/* Returns a copy of text in the arena; NULL = no memory. Not RT-safe. */
char *arena_strdup(struct arena *arena, const char *text);

/* Declares that size bytes of an arena, which hold several pieces and the gaps between them, may be
 * copied as a whole; it matters to the address sanitizer only. RT-safe. */
void arena_join(void *memory, size_t size);

/* Refuses further allocation; does nothing else. RT-safe. */
void arena_close(struct arena *arena);

/* Refuses further allocation and touches every page in use; with lock also mlocks them. An error
 * of mlock is reported, the arena is sealed all the same. Not RT-safe. */
enum error_code arena_seal(struct arena *arena, bool lock, struct error *error);

#endif
