/* SPDX-License-Identifier: Apache-2.0 */
/* The ring between two threads. */
#include "base/ring.h"
#include "tests/test.h"

#include <pthread.h>
#include <sched.h>

enum { SLOTS = 8, ITEMS = 200000 };

/* An item that would show a torn copy */
struct item {
    uint64_t number, complement, pad[5];
};

static struct item slots[SLOTS];
static struct ring ring;

FIXTURE(empty_ring)
{
    ring_init(&ring, slots, sizeof slots[0], SLOTS);
    return 0;
}

static struct item make(uint64_t number)
{
    return (struct item){number, ~number, {number, number, number, number, number}};
}

TEST_WITH(takes_as_many_items_as_it_has_slots, empty_ring, NULL)
{
    struct item item;

    for (uint64_t i = 0; i < SLOTS; i++) {
        item = make(i);
        assert_int_equal(ring_count(&ring), i);
        assert_true(ring_push(&ring, &item));
    }
    assert_false(ring_push(&ring, &item));
    assert_int_equal(ring_count(&ring), SLOTS);
}

TEST_WITH(gives_items_back_in_order_and_then_none, empty_ring, NULL)
{
    struct item item;

    for (uint64_t i = 0; i < 5; i++) {
        item = make(i);
        assert_true(ring_push(&ring, &item));
    }
    for (uint64_t i = 0; i < 5; i++) {
        assert_true(ring_pop(&ring, &item));
        assert_int_equal(item.number, i);
    }
    assert_false(ring_pop(&ring, &item));
}

TEST_WITH(carries_on_when_its_counters_wrap, empty_ring, NULL)
{
    struct item item;

    atomic_store(&ring.head, UINT32_MAX - 2);
    atomic_store(&ring.tail, UINT32_MAX - 2);
    for (uint64_t round = 0; round < 3; round++) {
        for (uint64_t i = 0; i < SLOTS; i++) {
            item = make(round * SLOTS + i);
            assert_true(ring_push(&ring, &item));
        }
        assert_false(ring_push(&ring, &item));
        assert_int_equal(ring_count(&ring), SLOTS);
        for (uint64_t i = 0; i < SLOTS; i++) {
            assert_true(ring_pop(&ring, &item));
            assert_int_equal(item.number, round * SLOTS + i);
        }
        assert_false(ring_pop(&ring, &item));
    }
}

static void *write_items(void *unused)
{
    (void)unused;
    for (uint64_t i = 0; i < ITEMS;) {
        struct item item = make(i);

        if (ring_push(&ring, &item)) {
            i++;
        } else {
            sched_yield();
        }
    }
    return NULL;
}

TEST_WITH(passes_every_item_whole_and_in_order_between_two_threads, empty_ring, NULL)
{
    pthread_t writer;
    uint64_t wrong = 0;

    assert_int_equal(pthread_create(&writer, NULL, write_items, NULL), 0);
    for (uint64_t i = 0; i < ITEMS;) {
        struct item item;

        if (ring_pop(&ring, &item)) {
            wrong += item.number != i || item.complement != ~i || item.pad[4] != i;
            i++;
        } else {
            sched_yield();
        }
    }
    assert_int_equal(pthread_join(writer, NULL), 0);
    assert_int_equal(wrong, 0);
    assert_int_equal(ring_count(&ring), 0);
}
