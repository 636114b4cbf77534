/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rows of signals from the loop to one other thread while it runs, for clients that have subscribed
 * to some of them (control/control.h). The reader sets the period of rows; the loop fills a row
 * of all signals in place, and never waits: rows that find the ring full are counted, and the next
 * row carries the count. Without a reader it costs the loop one load.
 */
#ifndef RT_STREAM_H
#define RT_STREAM_H

#include "base/arena.h"
#include "base/error.h"

#include <stddef.h>
#include <stdint.h>

struct stream_row {
    uint64_t tick;
    int64_t time_ns; /* virtual */
    uint64_t lost;   /* rows that were due since the stream began and found the ring full */
    double value[];  /* of each signal */
};

struct stream;

/* Holds capacity rows, a power of two. Memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code stream_create(size_t nsignal, uint32_t capacity, struct arena *arena,
                              struct stream **stream, struct error *error);

/* The loop's side, RT-safe: returns, after each tick, where its values go if a row is due and
 * there is room for it, to be published with stream_commit before the next call; else NULL. */
double *stream_begin(struct stream *stream, uint64_t tick, int64_t time_ns);
void stream_commit(struct stream *stream);

/* The reader's side, RT-safe: asks for a row at each tick that is a multiple of period, 0 = no
 * rows. Rows that wait in the ring are of the earlier period. */
void stream_want(struct stream *stream, uint64_t period_ticks);

/* Returns the oldest row, which stays until stream_drop; NULL = none waits. */
const struct stream_row *stream_front(const struct stream *stream);
void stream_drop(struct stream *stream);

#endif
