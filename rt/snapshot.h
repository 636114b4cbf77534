/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One value that a single writer publishes without ever waiting and any number of readers copy
 * whole: a sequence lock. An odd sequence number says that a write is under way. The value travels
 * as atomic words, so that readers racing with the writer are well defined.
 */
#ifndef RT_SNAPSHOT_H
#define RT_SNAPSHOT_H

#include "base/arena.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

enum { SNAPSHOT_GAPS = 8 };

struct snapshot {
    _Atomic uint64_t sequence;
    size_t words;
    _Atomic uint64_t *word;
    size_t ngap;
    struct snapshot_gap {
        size_t from, to;
    } gap[SNAPSHOT_GAPS]; /* words that are not written */
};

/* Holds values of size bytes (a multiple of 8). Memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code snapshot_create(size_t size, struct arena *arena, struct snapshot **snapshot,
                                struct error *error);

/* Leaves bytes (multiples of 8) out of the value that are never anything but 0: the unused ends of
 * its arrays, in their order, SNAPSHOT_GAPS at most. Before the first write. Not RT-safe. */
void snapshot_leave_out(struct snapshot *snapshot, size_t from, size_t to);

/* Publishes a value. From one thread only. RT-safe. */
void snapshot_write(struct snapshot *snapshot, const void *value);

/* Copies the last whole value; repeats while a write is under way, so not RT-safe for a reader with
 * a higher priority than the writer. Returns how many values have been written, 0 when none has. */
uint64_t snapshot_read(const struct snapshot *snapshot, void *value);

#endif
