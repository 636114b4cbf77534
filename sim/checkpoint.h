/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checkpoints: copies of memory spans. A restore writes the copy back to the same addresses, so
 * pointers into and out of the spans stay valid. A hole is a part of a span that other threads
 * write; it is neither saved nor restored. A restore writes only words that differ, so other
 * threads may read memory that never changes.
 */
#ifndef SIM_CHECKPOINT_H
#define SIM_CHECKPOINT_H

#include "base/arena.h"
#include "base/error.h"

struct span {
    void *memory;
    size_t size;
};

struct checkpoint;

/* Reserves memory for `copies` copies of the spans `moving` without the holes. Holes may have any
 * address but must not overlap each other. The arrays are borrowed for the call. Memory from arena.
 * ERROR_MEMORY. Not RT-safe. */
enum error_code checkpoint_create(const struct span *moving, size_t nmoving,
                                  const struct span *hole, size_t nhole, size_t copies,
                                  struct arena *arena, struct checkpoint **checkpoint,
                                  struct error *error);

/* Save the spans to a copy, and restore them from a saved copy. RT-safe. */
void checkpoint_save(struct checkpoint *checkpoint, size_t copy);
void checkpoint_restore(const struct checkpoint *checkpoint, size_t copy);

#endif
