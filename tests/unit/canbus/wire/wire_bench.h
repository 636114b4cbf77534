/* SPDX-License-Identifier: Apache-2.0 */
/* A wire whose events are kept, for tests of it. */
#ifndef TESTS_UNIT_CANBUS_WIRE_WIRE_BENCH_H
#define TESTS_UNIT_CANBUS_WIRE_WIRE_BENCH_H

#include "base/random.h"
#include "canbus/port.h"
#include "canbus/wire/wire.h"
#include "canbus/wire/bits.h"
#include "tests/unit/canbus/wire/wire_force.h"
#include "tests/unit/canbus/wire/wire_reference.h"
#include "tests/test.h"

enum { WIRE_LOG_MAX = 1 << 17 };

#define US INT64_C(1000)
#define MS INT64_C(1000000)

struct wire_log {
    struct wire_event event;
    struct bus_frame frame;
};

struct wire_bench {
    struct arena arena;
    struct wire *wire;
    struct wire_log *log;
    size_t count;
    int64_t last_ns;
    struct wire_tables tables;
};

static inline void bench_notify(void *context, const struct wire_event *event)
{
    struct wire_bench *bench = context;
    struct wire_log *entry = &bench->log[bench->count % WIRE_LOG_MAX];

    assert_true(event->time_ns >= bench->last_ns);
    bench->last_ns = event->time_ns;
    entry->event = *event;
    if (event->frame) {
        entry->frame = *event->frame;
    }
    bench->count++;
}

static inline void bench_open(struct wire_bench *bench, struct wire_config config)
{
    struct error error;

    memset(bench, 0, sizeof *bench);
    assert_ok(arena_init(&bench->arena, (size_t)256 << 20, &error));
    bench->log = arena_alloc(&bench->arena, WIRE_LOG_MAX, sizeof *bench->log);
    assert_non_null(bench->log);
    config.bitrate = config.bitrate ? config.bitrate : 1000000;
    config.nodes = config.nodes ? config.nodes : 3;
    config.queue = config.queue ? config.queue : 64;
    config.notify = bench_notify;
    config.context = bench;
    assert_no_error(wire_create(&config, &bench->arena, &bench->wire, &error), error.text);
    wire_tables_make(&bench->tables);
}

static inline void bench_close(struct wire_bench *bench)
{
    arena_fini(&bench->arena);
}

static inline struct bus_frame bench_frame(uint32_t id, uint8_t len)
{
    const uint8_t data[8] = {1, 2, 3, 4, 5, 6, 7, 8};

    return frame_make(id, len, data);
}

/* Duration by the reference encoder, without the intermission. */
static inline int64_t bench_duration(const struct bus_frame *frame, int64_t bitrate,
                                     int64_t data_bitrate)
{
    unsigned nominal, data;

    reference_length(frame, &nominal, &data);
    return (int64_t)nominal * 1000000000 / bitrate +
           (data ? (int64_t)data * 1000000000 / data_bitrate : 0);
}

/* The n-th event of a kind, NULL when there are fewer. */
static inline const struct wire_log *bench_event(const struct wire_bench *bench,
                                                 enum wire_event_kind kind, size_t n)
{
    for (size_t i = 0; i < bench->count && i < WIRE_LOG_MAX; i++) {
        if (bench->log[i].event.kind == kind && n-- == 0) {
            return &bench->log[i];
        }
    }
    return NULL;
}

static inline size_t bench_events(const struct wire_bench *bench, enum wire_event_kind kind)
{
    size_t count = 0;

    while (bench_event(bench, kind, count)) {
        count++;
    }
    return count;
}

static inline struct wire_node_stats bench_node(const struct wire_bench *bench, size_t node)
{
    struct wire_node_stats stats;

    wire_node_stats(bench->wire, node, &stats);
    return stats;
}

static inline struct wire_stats bench_stats(const struct wire_bench *bench)
{
    struct wire_stats stats;

    wire_stats(bench->wire, &stats);
    return stats;
}

#endif
