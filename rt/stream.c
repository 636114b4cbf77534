/* SPDX-License-Identifier: Apache-2.0 */
/* A ring of signal rows whose period the reader sets. */
#include "rt/stream.h"

#include "base/ring.h"

struct stream {
    struct ring ring;
    _Atomic uint64_t period; /* in ticks; 0 = no reader */
    uint64_t lost;           /* written by the loop only */
};

enum error_code stream_create(size_t nsignal, uint32_t capacity, struct arena *arena,
                              struct stream **out, struct error *error)
{
    struct stream *stream = arena_alloc(arena, 1, sizeof *stream);
    size_t size = sizeof(struct stream_row) + nsignal * sizeof(double);
    void *slots = arena_alloc(arena, capacity, size);

    if (!stream || !slots) {
        return error_set(error, ERROR_MEMORY, "no memory left for a stream of %zu signals",
                         nsignal);
    }
    ring_init(&stream->ring, slots, size, capacity);
    *out = stream;
    return ERROR_NONE;
}

double *stream_begin(struct stream *stream, uint64_t tick, int64_t time_ns)
{
    uint64_t period = atomic_load_explicit(&stream->period, memory_order_relaxed);
    struct stream_row *row;

    if (period == 0 || tick % period != 0) {
        return NULL;
    }
    row = ring_back(&stream->ring);
    if (!row) {
        stream->lost++;
        return NULL;
    }
    row->tick = tick;
    row->time_ns = time_ns;
    row->lost = stream->lost;
    return row->value;
}

void stream_commit(struct stream *stream)
{
    ring_commit(&stream->ring);
}

void stream_want(struct stream *stream, uint64_t period_ticks)
{
    atomic_store_explicit(&stream->period, period_ticks, memory_order_relaxed);
}

const struct stream_row *stream_front(const struct stream *stream)
{
    return ring_front(&stream->ring);
}

void stream_drop(struct stream *stream)
{
    ring_drop(&stream->ring);
}
