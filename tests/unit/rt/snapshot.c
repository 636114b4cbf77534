/* SPDX-License-Identifier: Apache-2.0 */
/* The sequence lock: what a reader gets is always one whole value, however the writer runs on. */
#include "rt/snapshot.h"
#include "tests/unit/arena_fixture.h"

#include <pthread.h>

enum { WORDS = 200, VALUES = 200000, READERS = 2 };

/* Every word is a function of the first, so that a torn value shows */
struct value {
    uint64_t word[WORDS];
};

static void fill(struct value *value, uint64_t number)
{
    for (size_t i = 0; i < WORDS; i++) {
        value->word[i] = number * (i + 1) + i;
    }
}

struct reader {
    struct snapshot *snapshot;
    uint64_t torn, backwards, read;
    pthread_t thread;
};

static void *read_all(void *context)
{
    struct reader *reader = context;
    struct value found, expected;
    uint64_t number = 0, last = 0;

    while (number < VALUES) {
        number = snapshot_read(reader->snapshot, &found);
        if (number == 0) {
            continue;
        }
        fill(&expected, number);
        for (size_t i = 0; i < WORDS; i++) {
            reader->torn += found.word[i] != expected.word[i];
        }
        reader->backwards += number < last;
        last = number;
        reader->read++;
    }
    return NULL;
}

TEST_WITH(readers_get_whole_values_while_the_writer_runs, open_arena, close_arena)
{
    struct reader reader[READERS] = {0};
    struct snapshot *snapshot;
    struct error error;
    struct value value;

    assert_ok(snapshot_create(sizeof value, &arena, &snapshot, &error));
    for (int i = 0; i < READERS; i++) {
        reader[i].snapshot = snapshot;
        assert_int_equal(pthread_create(&reader[i].thread, NULL, read_all, &reader[i]), 0);
    }
    for (uint64_t number = 1; number <= VALUES; number++) {
        fill(&value, number);
        snapshot_write(snapshot, &value);
    }
    for (int i = 0; i < READERS; i++) {
        pthread_join(reader[i].thread, NULL);
        assert_int_equal(reader[i].torn, 0);
        assert_int_equal(reader[i].backwards, 0);
        assert_true(reader[i].read > 0);
    }
}

TEST_WITH(nothing_is_read_before_the_first_write, open_arena, close_arena)
{
    struct snapshot *snapshot;
    struct error error;
    struct value value;

    assert_ok(snapshot_create(sizeof value, &arena, &snapshot, &error));
    assert_int_equal(snapshot_read(snapshot, &value), 0);
}

TEST_WITH(gaps_stay_zero, open_arena, close_arena)
{
    uint64_t value[8], found[8];
    struct snapshot *snapshot;
    struct error error;

    assert_ok(snapshot_create(sizeof value, &arena, &snapshot, &error));
    snapshot_leave_out(snapshot, 16, 32);
    snapshot_leave_out(snapshot, 56, 64);
    for (uint64_t i = 0; i < 8; i++) {
        value[i] = i + 1;
    }
    snapshot_write(snapshot, value);
    assert_int_equal(snapshot_read(snapshot, found), 1);
    for (uint64_t i = 0; i < 8; i++) {
        assert_int_equal(found[i], i == 2 || i == 3 || i == 7 ? 0 : i + 1);
    }
}
