/* SPDX-License-Identifier: Apache-2.0 */
/* The history of signals against what a plain table would have, also when time goes back and when
 * there is more than its memory holds. */
#include "viewer/history.h"
#include "tests/test.h"

enum { SIGNALS = 5, CONSTANT = 4 };

#define STEP_NS INT64_C(1000000)

static struct arena arena;
static struct error error;

/* What signal s has at a tick in a life, of which each restore begins another; the last one never
 * changes. */
static float value_of(size_t s, int64_t tick, int life)
{
    return s == CONSTANT ? 7.0 : (double)(s * 1000) + (double)(tick % 521) + 0.5 * life;
}

static void put_rows(struct history *history, int64_t first, int64_t count, int life)
{
    for (int64_t tick = first; tick < first + count; tick++) {
        double value[SIGNALS];

        for (size_t s = 0; s < SIGNALS; s++) {
            value[s] = value_of(s, tick, life);
        }
        history_put(history, tick * STEP_NS, value);
    }
}

static struct history *make_history(size_t columns)
{
    struct history *history;

    assert_ok(arena_init(&arena, (size_t)128 << 20, &error));
    assert_ok(history_create(SIGNALS, columns, &arena, &history, &error));
    return history;
}

FIXTURE(tear_down)
{
    arena_fini(&arena);
    return 0;
}

TEST_WITH(every_row_is_kept, NULL, tear_down)
{
    struct history *history = make_history(1000);

    assert_int_equal(history_end(history), history_begin(history));
    assert_int_equal(history_find(history, 0), 0);
    put_rows(history, 1, 5000, 0);
    assert_int_equal(history_begin(history), 0);
    assert_int_equal(history_end(history), 5000);
    for (uint64_t row = 0; row < 5000; row++) {
        assert_int_equal(history_time(history, row), (int64_t)(row + 1) * STEP_NS);
        for (size_t s = 0; s < SIGNALS; s++) {
            assert_true(history_value(history, row, s) == value_of(s, (int64_t)row + 1, 0));
        }
    }
    assert_int_equal(history_find(history, -5), 0);
    assert_int_equal(history_find(history, 1024 * STEP_NS), 1023);
    assert_int_equal(history_find(history, 1024 * STEP_NS + 1), 1024);
    assert_int_equal(history_find(history, 5000 * STEP_NS), 4999);
    assert_int_equal(history_find(history, 5001 * STEP_NS), 5000);
}

TEST_WITH(time_that_goes_back_removes_what_it_undoes, NULL, tear_down)
{
    static const int64_t back[] = {4990, 4000, 2049, 2048, 1};
    struct history *history = make_history(1000);
    int64_t last = 5000;

    put_rows(history, 1, last, 0);
    for (int life = 0; life < 5; life++) {
        put_rows(history, back[life], 700, life + 1);
        last = back[life] + 699;
        assert_int_equal(history_end(history), last);
        for (int64_t tick = 1; tick <= last; tick++) {
            float value = history_value(history, (uint64_t)tick - 1, 1);

            assert_int_equal(history_time(history, (uint64_t)tick - 1), tick * STEP_NS);
            assert_true(tick < back[life] || value == value_of(1, tick, life + 1));
        }
        put_rows(history, last + 1, 5000 - last, life + 1);
    }
}

TEST_WITH(chosen_signals_reach_back_the_longest, NULL, tear_down)
{
    enum { COLUMNS = 40, LONG = 100 * HISTORY_ROWS };
    struct history *history = make_history(COLUMNS);
    uint64_t begin;

    history_choose(history, 2);
    put_rows(history, 1, LONG, 0);
    begin = history_begin(history);

    /* All that there is room for is of the chosen one, but for the last columns */
    assert_true(LONG - begin >= (uint64_t)(COLUMNS - 8) * HISTORY_ROWS);
    assert_true(history_value(history, begin, 2) == value_of(2, (int64_t)begin + 1, 0));
    assert_true(isnan(history_value(history, begin, 1)));
    assert_true(history_value(history, begin, CONSTANT) == 7.0F ||
                isnan(history_value(history, begin, CONSTANT)));
    assert_true(history_value(history, LONG - 1, 1) == value_of(1, LONG, 0));
}

TEST_WITH(blocks_are_bounded, NULL, tear_down)
{
    const int64_t count = (int64_t)(HISTORY_BLOCKS + 3) * HISTORY_ROWS + 5;
    struct history *history = make_history(10);

    for (int64_t tick = 1; tick <= count; tick++) {
        history_put(history, tick, (double[SIGNALS]){1.0, 2.0, 3.0, 4.0, 5.0});
    }
    assert_int_equal(history_end(history), count);
    assert_int_equal(history_begin(history), 4 * HISTORY_ROWS);
    assert_true(history_value(history, history_begin(history), 3) == 4.0F);
}

TEST_WITH(the_last_choices_count, NULL, tear_down)
{
    enum { COLUMNS = 24, LONG = 60 * HISTORY_ROWS };
    struct history *history;
    struct arena other;
    double value[HISTORY_CHOSEN + 1];

    assert_ok(arena_init(&other, (size_t)64 << 20, &error));
    assert_int_equal(history_create(HISTORY_CHOSEN + 1, COLUMNS, &other, &history, &error), 0);
    for (size_t s = 0; s <= HISTORY_CHOSEN; s++) {
        history_choose(history, s); /* the first one falls out */
    }
    for (int64_t tick = 1; tick <= LONG; tick++) {
        for (size_t s = 0; s <= HISTORY_CHOSEN; s++) {
            value[s] = s <= 1 ? (double)tick : 1.0;
        }
        history_put(history, tick * STEP_NS, value);
    }
    assert_true(isnan(history_value(history, LONG - 20 * HISTORY_ROWS, 0)));
    assert_true(history_value(history, LONG - 20 * HISTORY_ROWS, 1) > 0.0F);
    arena_fini(&other);
    assert_ok(arena_init(&arena, 4096, &error));
    assert_int_equal(history_create(SIGNALS, 10, &arena, &history, &error), ERROR_MEMORY);
}
