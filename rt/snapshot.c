/* SPDX-License-Identifier: Apache-2.0 */
/* Implements a sequence lock. The memory orders follow Boehm, Can Seqlocks Get Along with
 * Programming Language Memory Models?, 2012. The reader makes no read-modify-write. */
#include "rt/snapshot.h"

#include <sched.h>
#include <string.h>

enum error_code snapshot_create(size_t size, struct arena *arena, struct snapshot **snapshot,
                                struct error *error)
{
    struct snapshot *made = arena_alloc(arena, 1, sizeof *made);

    if (!made || !(made->word = arena_alloc(arena, size / 8, 8))) {
        return error_set(error, ERROR_MEMORY, "no memory left for a snapshot of %zu bytes", size);
    }
    made->words = size / 8;
    *snapshot = made;
    return ERROR_NONE;
}

void snapshot_leave_out(struct snapshot *snapshot, size_t from, size_t to)
{
    snapshot->gap[snapshot->ngap++] = (struct snapshot_gap){from / 8, to / 8};
}

/* Writes the words `first` to `end` of a value. */
static void write_words(_Atomic uint64_t *to, const unsigned char *from, size_t first, size_t end)
{
#pragma GCC unroll 8
    for (size_t i = first; i < end; i++) {
        uint64_t word;

        memcpy(&word, from + 8 * i, 8);
        /* Release: a reader that sees this word also sees the odd sequence number */
        atomic_store_explicit(&to[i], word, memory_order_release);
    }
}

void snapshot_write(struct snapshot *snapshot, const void *value)
{
    uint64_t sequence = atomic_load_explicit(&snapshot->sequence, memory_order_relaxed);
    size_t first = 0;

    /* Keep the sequence number odd while the words are written, then make it even */
    atomic_store_explicit(&snapshot->sequence, sequence + 1, memory_order_relaxed);
    for (size_t g = 0; g < snapshot->ngap; g++) {
        write_words(snapshot->word, value, first, snapshot->gap[g].from);
        first = snapshot->gap[g].to;
    }
    write_words(snapshot->word, value, first, snapshot->words);
    atomic_store_explicit(&snapshot->sequence, sequence + 2, memory_order_release);
}

uint64_t snapshot_read(const struct snapshot *snapshot, void *value)
{
    unsigned char *to = value;

    for (;;) {
        uint64_t before = atomic_load_explicit(&snapshot->sequence, memory_order_acquire);

        for (size_t i = 0; i < snapshot->words; i++) {
            uint64_t word = atomic_load_explicit(&snapshot->word[i], memory_order_acquire);

            memcpy(to + 8 * i, &word, 8);
        }
        if (!(before & 1) &&
            atomic_load_explicit(&snapshot->sequence, memory_order_relaxed) == before) {
            return before / 2;
        }
        sched_yield();
    }
}
