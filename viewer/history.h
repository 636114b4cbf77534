/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The history of a run's signals at full rate, for plots that are selected later. It holds rows of
 * all signals as published by the loop (sim/simulator.h), in single precision, within a fixed
 * amount of memory.
 *
 * Rows are stored in blocks of HISTORY_ROWS, with a column per signal. A column of equal values
 * takes no memory. When the memory is full, columns of signals that no client has chosen are
 * dropped first, from the oldest block on. If no block has such columns, or if there are
 * HISTORY_BLOCKS blocks, the oldest block is dropped. The HISTORY_CHOSEN most recently chosen
 * signals therefore reach back the longest: 10 minutes at 1 kHz. Times increase. After a reset, the
 * first new row removes the stored rows at and after its time.
 *
 * Rows are numbered from the first one; a removed row's number is used again. Not RT-safe.
 */
#ifndef VIEWER_HISTORY_H
#define VIEWER_HISTORY_H

#include "base/arena.h"
#include "base/error.h"

#include <stdint.h>

enum {
    HISTORY_ROWS = 1024,    /* rows per block */
    HISTORY_BLOCKS = 600,   /* maximum number of blocks */
    HISTORY_CHOSEN = 32,    /* number of signals kept the longest */
    HISTORY_COLUMNS = 24576 /* columns of all blocks: 96 MiB of values */
};

struct history;

/* Allocates the history in the arena. nsignal: values of a row. columns: HISTORY_COLUMNS, or fewer
 * in a test. Returns ERROR_MEMORY. */
enum error_code history_create(size_t nsignal, size_t columns, struct arena *arena,
                               struct history **history, struct error *error);

/* Appends a row. */
void history_put(struct history *history, int64_t time_ns, const double *value);

/* Marks a signal as chosen. If HISTORY_CHOSEN signals are chosen, it replaces the earliest
 * choice. */
void history_choose(struct history *history, size_t signal);

/* history_begin returns the number of the oldest row, history_end the number of the next row. */
uint64_t history_begin(const struct history *history);
uint64_t history_end(const struct history *history);

/* Returns the number of the first row at or after a time; history_end if there is none. */
uint64_t history_find(const struct history *history, int64_t time_ns);

/* Return the time and a value of a row between history_begin and history_end - 1. NAN: the value
 * was dropped. */
int64_t history_time(const struct history *history, uint64_t row);
float history_value(const struct history *history, uint64_t row, size_t signal);

#endif
