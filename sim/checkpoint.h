/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Copies of memory, to be put back where it was: pointers into it and out of it stay good. Of what
 * it is told to copy it leaves holes alone, which are what other threads write, and on the way back
 * writes only the words that differ, so that another thread may read what nobody ever changes.
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

/* Sets memory aside for so many copies of what is in `moving` and in no hole; holes may lie anywhere
 * and overlap nothing but what moves. What moves may be several pieces of an arena. Borrowed for the call. Not RT-safe. */
enum error_code checkpoint_create(const struct span *moving, size_t nmoving,
                                  const struct span *hole, size_t nhole, size_t copies,
                                  struct arena *arena, struct checkpoint **checkpoint,
                                  struct error *error);

/* Bytes of one copy. */
size_t checkpoint_size(const struct checkpoint *checkpoint);

/* To a copy, and back from one that was kept. RT-safe. */
void checkpoint_keep(struct checkpoint *checkpoint, size_t copy);
void checkpoint_back(const struct checkpoint *checkpoint, size_t copy);

#endif
