/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A lock-free ring for one writing and one reading thread: frames to the recorder, events to the
 * log, frames between the nodes of a local bus. The caller owns the memory. All functions are
 * RT-safe.
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
    _Alignas(64) _Atomic uint32_t head; /* next slot to write, owned by the writer */
    _Alignas(64) _Atomic uint32_t tail; /* next slot to read, owned by the reader */
};

/* Initializes an empty ring in memory of count * slot_size bytes; count is a power of two. */
static inline void ring_init(struct ring *ring, void *slots, size_t slot_size, uint32_t count)
{
    ring->slots = slots;
    ring->slot_size = slot_size;
    ring->mask = count - 1;
    atomic_store_explicit(&ring->head, 0, memory_order_relaxed);
    atomic_store_explicit(&ring->tail, 0, memory_order_release);
}

/* Copies one item in; false when the ring is full. Writer only. */
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

/* Copies one item out; false when the ring is empty. Reader only. */
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

/* Returns the slot of the next item; fill it and call ring_commit. NULL = the ring is full. Writer
 * only. */
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

/* Returns the oldest item, valid until ring_drop; NULL = the ring is empty. Reader only. */
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

/* Returns the number of waiting items, exact at the time of the call for writer and reader. */
static inline uint32_t ring_count(const struct ring *ring)
{
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);

    return head - atomic_load_explicit(&ring->tail, memory_order_acquire);
}

#endif
