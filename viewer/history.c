/* SPDX-License-Identifier: Apache-2.0 */
/* Stores rows of signals in blocks of columns from one pool. */
#include "viewer/history.h"

#include <math.h>
#include <string.h>

/* Values of a column's slot if the column is not in the pool. */
enum { COLUMN_CONSTANT = -1, COLUMN_DROPPED = -2 };

struct history_column {
    int32_t slot;
    float constant; /* all values, if the slot is COLUMN_CONSTANT */
};

struct history_block {
    uint64_t first; /* number of its first row */
    size_t count;
    int64_t time_ns[HISTORY_ROWS];
    struct history_column *column; /* by signal; the open block has its columns in the stage */
};

struct history {
    size_t nsignal;
    struct history_block *block; /* HISTORY_BLOCKS, a ring */
    uint64_t oldest, next;       /* block numbers, counted from the first one */
    bool open;                   /* the newest block accepts rows */
    uint64_t bare;               /* blocks before this number have only chosen signals */
    float (*stage)[HISTORY_ROWS];
    float (*pool)[HISTORY_ROWS];
    int32_t *spare; /* free slots of the pool */
    size_t nspare;
    size_t chosen[HISTORY_CHOSEN]; /* most recently chosen first */
    size_t nchosen;
    bool *is_chosen; /* by signal */
};

enum error_code history_create(size_t nsignal, size_t columns, struct arena *arena,
                               struct history **out, struct error *error)
{
    struct history *history = arena_alloc(arena, 1, sizeof *history);
    struct history_column *column =
        arena_alloc(arena, (size_t)HISTORY_BLOCKS * nsignal + 1, sizeof *column);

    if (history) {
        history->nsignal = nsignal;
        history->block = arena_alloc(arena, HISTORY_BLOCKS, sizeof *history->block);
        history->stage = arena_alloc(arena, nsignal + 1, sizeof *history->stage);
        history->pool = arena_alloc(arena, columns, sizeof *history->pool);
        history->spare = arena_alloc(arena, columns, sizeof *history->spare);
        history->is_chosen = arena_alloc(arena, nsignal + 1, sizeof *history->is_chosen);
    }
    if (!history || !column || !history->block || !history->stage || !history->pool ||
        !history->spare || !history->is_chosen) {
        return error_set(error, ERROR_MEMORY, "no memory left for the history of %zu signals",
                         nsignal);
    }
    for (size_t b = 0; b < HISTORY_BLOCKS; b++) {
        history->block[b].column = column + b * nsignal;
    }
    /* Fill the stack of free slots so that the first slot is used first */
    while (history->nspare < columns) {
        history->spare[history->nspare] = (int32_t)(columns - 1 - history->nspare);
        history->nspare++;
    }
    *out = history;
    return ERROR_NONE;
}

/* ---- blocks ---- */

/* Returns the block with this number. */
static struct history_block *history_block(const struct history *history, uint64_t number)
{
    return &history->block[number % HISTORY_BLOCKS];
}

/* Frees the columns of a block. Columns of chosen signals are kept unless chosen_too. The open
 * block has no columns in the pool. */
static void history_drop_block(struct history *history, uint64_t number, bool chosen_too)
{
    struct history_block *block = history_block(history, number);

    if (history->open && number == history->next - 1) {
        return;
    }
    for (size_t s = 0; s < history->nsignal; s++) {
        if (chosen_too || !history->is_chosen[s]) {
            /* Free a column; its values then read as NAN */
            if (block->column[s].slot >= 0) {
                history->spare[history->nspare++] = block->column[s].slot;
            }
            block->column[s].slot = COLUMN_DROPPED;
        }
    }
}

/* Drops the oldest block. */
static void history_drop_oldest(struct history *history)
{
    history_drop_block(history, history->oldest++, true);
    history->bare = history->bare > history->oldest ? history->bare : history->oldest;
}

/* Takes a slot from the pool; drops the oldest columns until a slot is free. Returns -1 if only the
 * requesting block is left. */
static int32_t history_take_slot(struct history *history, uint64_t asking)
{
    while (history->nspare == 0) {
        if (history->bare < asking) {
            history_drop_block(history, history->bare++, false);
        } else if (history->oldest < asking) {
            history_drop_oldest(history);
        } else {
            return -1;
        }
    }
    return history->spare[--history->nspare];
}

/* Closes the open block: moves its columns from the stage to the pool. A column of equal values
 * needs no slot. */
static void history_close_block(struct history *history)
{
    struct history_block *block = history_block(history, history->next - 1);

    history->open = false;
    for (size_t s = 0; s < history->nsignal; s++) {
        const float *value = history->stage[s];
        struct history_column *column = &block->column[s];
        size_t i = 1;

        while (i < block->count && value[i] == value[0]) {
            i++;
        }
        *column = (struct history_column){COLUMN_CONSTANT, value[0]};
        if (i < block->count) {
            int32_t slot = history_take_slot(history, history->next - 1);

            column->slot = slot < 0 ? COLUMN_DROPPED : slot;
            if (slot >= 0) {
                memcpy(history->pool[slot], value, block->count * sizeof *value);
            }
        }
    }
}

/* ---- rows ---- */

/* Returns the index of a block's first row at or after a time. */
static size_t block_find(const struct history_block *block, int64_t time_ns)
{
    size_t low = 0, high = block->count;

    while (low < high) {
        size_t middle = (low + high) / 2;

        if (block->time_ns[middle] < time_ns) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* Removes the rows at and after a time. */
static void history_cut(struct history *history, int64_t time_ns)
{
    while (history->next > history->oldest &&
           history_block(history, history->next - 1)->time_ns[0] >= time_ns) {
        history_drop_block(history, history->next - 1, true);
        history->next--;
        history->open = false;
    }
    history->bare = history->bare < history->next ? history->bare : history->next;
    if (history->next > history->oldest) {
        struct history_block *block = history_block(history, history->next - 1);

        block->count = block_find(block, time_ns);
    }
}

void history_put(struct history *history, int64_t time_ns, const double *value)
{
    struct history_block *block;

    /* If time went back, remove the rows at and after the new time */
    if (history->next > history->oldest) {
        block = history_block(history, history->next - 1);
        if (block->count > 0 && block->time_ns[block->count - 1] >= time_ns) {
            history_cut(history, time_ns);
        }
    }
    if (!history->open) {
        uint64_t first = history_end(history);

        /* Open the next block; drop the oldest block if there are HISTORY_BLOCKS */
        if (history->next - history->oldest == HISTORY_BLOCKS) {
            history_drop_oldest(history);
        }
        *history_block(history, history->next) = (struct history_block){
            .first = first, .column = history_block(history, history->next)->column};
        history->next++;
        history->open = true;
    }
    block = history_block(history, history->next - 1);
    block->time_ns[block->count] = time_ns;
    for (size_t s = 0; s < history->nsignal; s++) {
        history->stage[s][block->count] = (float)value[s];
    }
    if (++block->count == HISTORY_ROWS) {
        history_close_block(history);
    }
}

void history_choose(struct history *history, size_t signal)
{
    size_t at = 0;

    /* Move the chosen signal to the front; a full list loses its last signal */
    while (at < history->nchosen && history->chosen[at] != signal) {
        at++;
    }
    if (at == history->nchosen) {
        if (history->nchosen == HISTORY_CHOSEN) {
            at--;
            history->is_chosen[history->chosen[at]] = false;
        } else {
            history->nchosen++;
        }
    }
    memmove(history->chosen + 1, history->chosen, at * sizeof *history->chosen);
    history->chosen[0] = signal;
    history->is_chosen[signal] = true;
}

uint64_t history_end(const struct history *history)
{
    const struct history_block *block;

    if (history->next == history->oldest) {
        return history->next > 0 ? history_block(history, history->next)->first : 0;
    }
    block = history_block(history, history->next - 1);
    return block->first + block->count;
}

uint64_t history_begin(const struct history *history)
{
    return history->next == history->oldest ? history_end(history)
                                            : history_block(history, history->oldest)->first;
}

/* Finds the block of a stored row by bisection. */
static const struct history_block *history_block_of(const struct history *history, uint64_t row)
{
    uint64_t low = history->oldest, high = history->next - 1;

    while (low < high) {
        uint64_t middle = (low + high + 1) / 2;

        if (history_block(history, middle)->first <= row) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return history_block(history, low);
}

uint64_t history_find(const struct history *history, int64_t time_ns)
{
    uint64_t low = history->oldest, high = history->next;

    /* Find the first block whose last row is at or after the time */
    while (low < high) {
        uint64_t middle = (low + high) / 2;
        const struct history_block *block = history_block(history, middle);

        if (block->count == 0 || block->time_ns[block->count - 1] < time_ns) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low == history->next) {
        return history_end(history);
    }
    return history_block(history, low)->first + block_find(history_block(history, low), time_ns);
}

int64_t history_time(const struct history *history, uint64_t row)
{
    const struct history_block *block = history_block_of(history, row);

    return block->time_ns[row - block->first];
}

float history_value(const struct history *history, uint64_t row, size_t signal)
{
    const struct history_block *block = history_block_of(history, row);
    size_t at = (size_t)(row - block->first);

    if (history->open && block == history_block(history, history->next - 1)) {
        return history->stage[signal][at];
    }
    return block->column[signal].slot >= 0 ? history->pool[block->column[signal].slot][at]
           : block->column[signal].slot == COLUMN_CONSTANT ? block->column[signal].constant
                                                           : NAN;
}
