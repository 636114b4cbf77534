/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A sequence lock. One writer publishes a value without waiting. Any number of readers copy it
 * whole. An odd sequence number means that a write is in progress. The value is stored in atomic
 * words, so that a reader that races with the writer has defined behavior.
 */
#ifndef RT_SNAPSHOT_H
#define RT_SNAPSHOT_H

#include "base/arena.h"

#include <stdatomic.h>
#include <stdint.h>

enum { SNAPSHOT_GAPS = 8 };

struct snapshot {
    _Atomic uint64_t sequence;
    size_t words;
    _Atomic uint64_t *word;
    size_t ngap;
    struct snapshot_gap {
        size_t from, to;
    } gap[SNAPSHOT_GAPS]; /* ranges of words that are not copied */
};

/* Creates a snapshot for values of `size` bytes (a multiple of 8). Memory from arena. ERROR_MEMORY.
 * Not RT-safe. */
enum error_code snapshot_create(size_t size, struct arena *arena, struct snapshot **snapshot,
                                struct error *error);

/* Excludes the bytes from `from` to `to` (multiples of 8) from every copy. These bytes must always
 * be 0, such as the unused ends of arrays. Call it before the first write, at most SNAPSHOT_GAPS
 * times, with ascending ranges. Not RT-safe. */
void snapshot_leave_out(struct snapshot *snapshot, size_t from, size_t to);

/* Publishes a value. From one thread only. RT-safe. */
void snapshot_write(struct snapshot *snapshot, const void *value);

/* Copies the last whole value and returns how many values have been written, 0 = none. Retries
 * while a write is in progress: not RT-safe for a reader with a higher priority than the writer. */
uint64_t snapshot_read(const struct snapshot *snapshot, void *value);

#endif
