/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A lock-free ring between one writing and one reading thread. It carries frames to the recorder,
 * events to the log, and frames between the nodes of a local bus. The caller owns the memory. All
 * functions are RT-safe.
 */
#ifndef BASE_RING_H
#define BASE_RING_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

struct ring {
    unsigned char *slots;
    size_t slot_size;
    uint32_t mask;                      /* number of slots - 1 */
    _Alignas(64) _Atomic uint32_t head; /* next slot to write; only the writer changes it */
    _Alignas(64) _Atomic uint32_t tail; /* next slot to read; only the reader changes it */
};

/* Initializes an empty ring in memory of count * slot_size bytes. count is a power of two. */
static inline void ring_init(struct ring *ring, void *slots, size_t slot_size, uint32_t count)
{
    ring->slots = slots;
    ring->slot_size = slot_size;
    ring->mask = count - 1;
    atomic_store_explicit(&ring->head, 0, memory_order_relaxed);
    atomic_store_explicit(&ring->tail, 0, memory_order_release);
}

/* Copies an item into the ring. Returns false if the ring is full. Only for the writer. */
static inline bool ring_push(struct ring *ring, const void *item)
{
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);

    if (head - tail > ring->mask) {
        return false;
    }
    memcpy(ring->slots + (size_t)(head & ring->mask) * ring->slot_size, item, ring->slot_size);
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
    return true;
}

/* Copies the oldest item out and removes it. Returns false if the ring is empty. Only for the
 * reader. */
static inline bool ring_pop(struct ring *ring, void *item)
{
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);

    if (head == tail) {
        return false;
    }
    memcpy(item, ring->slots + (size_t)(tail & ring->mask) * ring->slot_size, ring->slot_size);
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}

/* Returns the slot for the next item. Fill it, then call ring_commit. Returns NULL if the ring is
 * full. Only for the writer. */
static inline void *ring_back(const struct ring *ring)
{
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);

    return head - tail > ring->mask ? NULL
                                    : ring->slots + (size_t)(head & ring->mask) * ring->slot_size;
}

static inline void ring_commit(struct ring *ring)
{
    atomic_store_explicit(&ring->head, atomic_load_explicit(&ring->head, memory_order_relaxed) + 1,
                          memory_order_release);
}

/* Returns the oldest item, which is valid until ring_drop. Returns NULL if the ring is empty. Only
 * for the reader. */
static inline const void *ring_front(const struct ring *ring)
{
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);

    return head == tail ? NULL : ring->slots + (size_t)(tail & ring->mask) * ring->slot_size;
}

static inline void ring_drop(struct ring *ring)
{
    atomic_store_explicit(&ring->tail, atomic_load_explicit(&ring->tail, memory_order_relaxed) + 1,
                          memory_order_release);
}

/* Returns the number of items in the ring. Writer and reader may both call it; the number is exact
 * at the call. */
static inline uint32_t ring_count(const struct ring *ring)
{
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);

    return head - atomic_load_explicit(&ring->tail, memory_order_acquire);
}

#endif
