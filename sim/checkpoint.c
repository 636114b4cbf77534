/* SPDX-License-Identifier: Apache-2.0 */
/* Copies spans of memory to a checkpoint, and puts them back. */
#include "sim/checkpoint.h"

#include <stdint.h>
#include <string.h>

enum { BLOCK = 256 }; /* bytes compared at once, a multiple of the word size */

struct checkpoint {
    size_t size, nspan;
    struct span *span;
    unsigned char *copy;
};

/* Returns the address after a span. */
static unsigned char *span_end(const struct span *span)
{
    return (unsigned char *)span->memory + span->size;
}

/* Returns the hole with the lowest address that overlaps [from, to); NULL = none. */
static const struct span *span_first_hole(const struct span *hole, size_t nhole,
                                          const unsigned char *from, const unsigned char *to)
{
    const struct span *first = NULL;

    for (size_t i = 0; i < nhole; i++) {
        const unsigned char *begin = hole[i].memory;

        if (hole[i].size > 0 && begin < to && span_end(&hole[i]) > from &&
            (!first || begin < (const unsigned char *)first->memory)) {
            first = &hole[i];
        }
    }
    return first;
}

enum error_code checkpoint_create(const struct span *moving, size_t nmoving,
                                  const struct span *hole, size_t nhole, size_t copies,
                                  struct arena *arena, struct checkpoint **out, struct error *error)
{
    struct checkpoint *made = arena_alloc(arena, 1, sizeof *made);

    if (!made || !(made->span = arena_alloc(arena, nmoving + nhole, sizeof *made->span))) {
        return error_set(error, ERROR_MEMORY, "no memory left for checkpoints");
    }
    for (size_t i = 0; i < nmoving; i++) {
        arena_join(moving[i].memory, moving[i].size);

        /* Cuts a span at the holes and adds its parts; each hole adds at most one span */
        unsigned char *from = moving[i].memory, *to = span_end(&moving[i]);

        while (from < to) {
            const struct span *gap = span_first_hole(hole, nhole, from, to);
            unsigned char *until = gap ? gap->memory : to;

            if (until > from) {
                made->span[made->nspan++] = (struct span){from, (size_t)(until - from)};
                made->size += (size_t)(until - from);
            }
            from = gap ? span_end(gap) : to;
        }
    }
    made->copy = arena_alloc(arena, copies, made->size);
    if (!made->copy) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu checkpoints of %zu bytes",
                         copies, made->size);
    }
    *out = made;
    return ERROR_NONE;
}

void checkpoint_save(struct checkpoint *c, size_t copy)
{
    unsigned char *to = c->copy + copy * c->size;

    for (size_t i = 0; i < c->nspan; i++) {
        memcpy(to, c->span[i].memory, c->span[i].size);
        to += c->span[i].size;
    }
}

/* Restores a block word by word. Writes only words that differ, because other threads may read the
 * rest. */
static void checkpoint_restore_words(unsigned char *to, const unsigned char *from, size_t size)
{
    size_t at = 0;

    for (; at + sizeof(uint64_t) <= size; at += sizeof(uint64_t)) {
        uint64_t is, was;

        memcpy(&is, to + at, sizeof is);
        memcpy(&was, from + at, sizeof was);
        if (is != was) {
            memcpy(to + at, &was, sizeof was);
        }
    }
    for (; at < size; at++) {
        if (to[at] != from[at]) {
            to[at] = from[at];
        }
    }
}

void checkpoint_restore(const struct checkpoint *c, size_t copy)
{
    const unsigned char *from = c->copy + copy * c->size;

    for (size_t i = 0; i < c->nspan; i++) {
        unsigned char *to = c->span[i].memory;

        /* Compare in blocks first, because most of the memory does not differ */
        for (size_t at = 0; at < c->span[i].size; at += BLOCK) {
            size_t part = c->span[i].size - at < BLOCK ? c->span[i].size - at : BLOCK;

            if (memcmp(to + at, from + at, part) != 0) {
                checkpoint_restore_words(to + at, from + at, part);
            }
        }
        from += c->span[i].size;
    }
}
