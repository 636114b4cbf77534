/* SPDX-License-Identifier: Apache-2.0 */
/* Rows of signals between two threads: at the ticks that were asked for, none lost in silence. */
#include "rt/stream.h"
#include "tests/test.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

enum { SIGNALS = 5, ROWS = 8, TICKS = 200000 };

static struct arena arena;
static struct stream *stream;

FIXTURE(set_up)
{
    struct error error;

    return arena_init(&arena, 1 << 20, &error) ||
           stream_create(SIGNALS, ROWS, &arena, &stream, &error);
}

FIXTURE(tear_down)
{
    arena_fini(&arena);
    return 0;
}

static void run(uint64_t from, uint64_t to)
{
    for (uint64_t tick = from; tick < to; tick++) {
        double *value = stream_begin(stream, tick, (int64_t)tick * 1000);

        if (value) {
            for (int i = 0; i < SIGNALS; i++) {
                value[i] = (double)tick * (i + 1);
            }
            stream_commit(stream);
        }
    }
}

TEST_WITH(nobody_asks_nothing_comes, set_up, tear_down)
{
    run(0, 100);
    assert_null(stream_front(stream));
}

TEST_WITH(rows_come_at_multiples_of_the_period, set_up, tear_down)
{
    const struct stream_row *row;

    stream_want(stream, 10);
    run(1, 31);
    for (uint64_t tick = 10; tick <= 30; tick += 10) {
        row = stream_front(stream);
        assert_non_null(row);
        assert_int_equal(row->tick, tick);
        assert_int_equal(row->time_ns, (int64_t)tick * 1000);
        assert_int_equal(row->lost, 0);
        assert_true(row->value[SIGNALS - 1] == (double)tick * SIGNALS);
        stream_drop(stream);
    }
    assert_null(stream_front(stream));
}

TEST_WITH(rows_that_find_no_room_are_counted, set_up, tear_down)
{
    stream_want(stream, 1);
    run(0, ROWS + 3);
    for (int i = 0; i < ROWS; i++) {
        assert_int_equal(stream_front(stream)->tick, i);
        assert_int_equal(stream_front(stream)->lost, 0);
        stream_drop(stream);
    }
    run(ROWS + 3, ROWS + 4);
    assert_int_equal(stream_front(stream)->tick, ROWS + 3);
    assert_int_equal(stream_front(stream)->lost, 3);
}

static void *write_rows(void *context)
{
    atomic_bool *written = context;

    run(1, TICKS + 1);
    atomic_store(written, true);
    return NULL;
}

TEST_WITH(a_reader_beside_the_writer_gets_whole_rows, set_up, tear_down)
{
    uint64_t last = 0, lost = 0, rows = 0, wrong = 0;
    atomic_bool written = false;
    pthread_t writer;

    stream_want(stream, 1);
    assert_int_equal(pthread_create(&writer, NULL, write_rows, &written), 0);
    for (;;) {
        bool over = atomic_load(&written);
        const struct stream_row *row = stream_front(stream);

        if (!row && over) {
            break;
        }
        if (!row) {
            sched_yield();
            continue;
        }
        for (int i = 0; i < SIGNALS; i++) {
            wrong += row->value[i] != (double)row->tick * (i + 1);
        }
        /* What is missing between two rows is what the second one counts */
        wrong += row->tick - last - 1 != row->lost - lost;
        last = row->tick;
        lost = row->lost;
        rows++;
        stream_drop(stream);
    }
    pthread_join(writer, NULL);
    assert_int_equal(wrong, 0);
    assert_int_equal(rows + lost, last);
}
