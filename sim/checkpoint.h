/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Copies of memory that are put back where they came from: pointers into it and out of it stay
 * valid. Holes in it, which other threads write, are left alone; on the way back only the words
 * that differ are written, so that another thread may read what never changes.
 */
#ifndef SIM_CHECKPOINT_H
#define SIM_CHECKPOINT_H

#include "base/arena.h"
#include "base/error.h"

#include <stddef.h>

struct span {
    void *memory;
    size_t size;
};

struct checkpoint;

/* Reserves memory for so many copies of what is in `moving` and in no hole; holes may lie anywhere
 * but must not overlap each other. The arrays are borrowed for the call. Memory from arena.
 * ERROR_MEMORY. Not RT-safe. */
enum error_code checkpoint_create(const struct span *moving, size_t nmoving,
                                  const struct span *hole, size_t nhole, size_t copies,
                                  struct arena *arena, struct checkpoint **checkpoint,
                                  struct error *error);

/* Save to a copy, and restore from one that was saved. RT-safe. */
void checkpoint_save(struct checkpoint *checkpoint, size_t copy);
void checkpoint_restore(const struct checkpoint *checkpoint, size_t copy);

#endif
