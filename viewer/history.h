/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The history of a run's signals at full rate, for plots that begin when they are chosen: rows of
 * all signals as the loop has told them (sim/simulator.h), in single precision, within a memory
 * that is fixed at the start.
 *
 * Rows are kept in blocks of HISTORY_ROWS, each signal's part of a block as a column of its own; a
 * column whose values are all equal takes no memory. Where there is no room for another column, the
 * oldest block that still has columns of signals that nobody has chosen loses those; where there is
 * none, the oldest block is dropped, and in any case when there are HISTORY_BLOCKS. So the last
 * HISTORY_CHOSEN signals that somebody has chosen reach back the longest: 10 minutes at 1 kHz.
 * Times grow: a row that is not later than the last one, as after a reset, removes what it undoes.
 *
 * Rows are counted from the first one on; one that is removed gives its number to the next. Not
 * RT-safe.
 */
#ifndef VIEWER_HISTORY_H
#define VIEWER_HISTORY_H

#include "base/arena.h"
#include "base/error.h"

#include <stddef.h>
#include <stdint.h>

enum {
    HISTORY_ROWS = 1024,    /* of a block */
    HISTORY_BLOCKS = 600,   /* at most */
    HISTORY_CHOSEN = 32,    /* signals that are kept the longest */
    HISTORY_COLUMNS = 24576 /* of all blocks: 96 MiB of values */
};

struct history;

/* Makes room for rows of nsignal values and for columns, HISTORY_COLUMNS or fewer for a test, from
 * arena. ERROR_MEMORY. */
enum error_code history_create(size_t nsignal, size_t columns, struct arena *arena,
                               struct history **history, struct error *error);

/* Appends a row. */
void history_put(struct history *history, int64_t time_ns, const double *value);

/* Makes a signal one of those that are kept the longest, in place of the one that was chosen the
 * longest ago. */
void history_choose(struct history *history, size_t signal);

/* Return the number of the oldest row, and of the row that comes next. */
uint64_t history_begin(const struct history *history);
uint64_t history_end(const struct history *history);

/* Returns the number of the first row at or after a time; history_end when there is none. */
uint64_t history_find(const struct history *history, int64_t time_ns);

/* Return the time and a value of a row from history_begin to before history_end; NAN = the value
 * was dropped. */
int64_t history_time(const struct history *history, uint64_t row);
float history_value(const struct history *history, uint64_t row, size_t signal);

#endif
