/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Streams rows of signals from the loop to one reader thread during a run (control/control.h). The
 * reader sets the period of the rows. The loop fills each row in place and never waits. When the
 * ring is full it drops the row, and the next row carries the number dropped. Without a reader it
 * costs the loop one load instruction.
 */
#ifndef RT_STREAM_H
#define RT_STREAM_H

#include "base/arena.h"
#include "base/error.h"

#include <stdint.h>

struct stream_row {
    uint64_t tick;
    int64_t time_ns; /* virtual time */
    uint64_t lost;   /* rows dropped since the stream began because the ring was full */
    double value[];  /* one value per signal */
};

struct stream;

/* Creates a stream of `capacity` rows, a power of two. Memory from arena. ERROR_MEMORY. Not
 * RT-safe. */
enum error_code stream_create(size_t nsignal, uint32_t capacity, struct arena *arena,
                              struct stream **stream, struct error *error);

/* Begins a row. Call it in the loop after each tick. Returns the array for the row's signals, or
 * NULL when no row is due or the ring is full. Publish the row with stream_commit before the next
 * call. RT-safe. */
double *stream_begin(struct stream *stream, uint64_t tick, int64_t time_ns);
void stream_commit(struct stream *stream);

/* Requests a row at each tick that is a multiple of period_ticks; 0 = no rows. Rows already in the
 * ring have the earlier period. Call it in the reader's thread. RT-safe. */
void stream_want(struct stream *stream, uint64_t period_ticks);

/* Returns the oldest row, or NULL when none waits. The row is valid until stream_drop. */
const struct stream_row *stream_front(const struct stream *stream);
void stream_drop(struct stream *stream);

#endif
