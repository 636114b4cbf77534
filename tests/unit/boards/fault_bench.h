/* SPDX-License-Identifier: Apache-2.0 */
/* A bench whose board leg1 has a fault; a tick steps the faults, too. */
#ifndef TESTS_UNIT_BOARDS_FAULT_BENCH_H
#define TESTS_UNIT_BOARDS_FAULT_BENCH_H

#include "tests/unit/boards/board_bench.h"

#include "faults/faults.h"
#include "boards/sensing/sensing.h"

#define MS INT64_C(1000000)

enum { POSITION = 0x111, STRAIN_FORCE = 0x3d0 | ICUB_FORCE, RUN_MS = 200 };

static inline struct faults *arm(struct board_bench *base, struct arena *arena, const char *line)
{
    static const char *const bus[] = {"leg", "arm"};
    static const bool wire[] = {false, false};
    static const char *const board[] = {"leg1", "leg2", "torques", "ankle", "arm1"};
    static const size_t board_bus[] = {0, 0, 0, 0, 1};
    static const int address[] = {1, 2, 12, 13, 1};
    const struct fault_names names = {.nbus = 2,
                                      .bus = bus,
                                      .wire = wire,
                                      .nboard = 5,
                                      .board = board,
                                      .board_bus = board_bus,
                                      .board_address = address};
    struct faults *faults;
    struct fault fault;
    struct error error;

    assert_no_error(line && fault_parse(line, &names, &fault, &error), error.text);
    assert_ok(faults_create(&fault, line != NULL, 5, arena, &faults, &error));
    base->config.faults = faults;
    return faults;
}

/* A bench whose board leg1 has line as its fault, all boards telling from the start. */
struct fault_bench {
    struct board_bench base;
    struct arena arena;
    struct faults *faults;
    int64_t ms;
};

static inline void begin(struct fault_bench *bench, const char *line)
{
    struct error error;

    bench_configure(&bench->base);
    for (int i = 0; i < BENCH_BOARDS; i++) {
        bench->base.board[i].transmit_at_start = true;
    }
    assert_ok(arena_init(&bench->arena, 8u << 20, &error));
    bench->faults = arm(&bench->base, &bench->arena, line);
    bench_start(&bench->base);
    bench->ms = 0;
}

static inline void end(struct fault_bench *bench)
{
    bench_stop(&bench->base);
    arena_fini(&bench->arena);
}

/* A millisecond, with joint 0 at a place of its own. */
static inline void tick(struct fault_bench *bench)
{
    faults_step(bench->faults, bench->ms * MS);
    bench->base.sense[0].q = 0.01 * (double)bench->ms;
    bench->base.ft.force_n[2] = (double)bench->ms;
    bench_tick(&bench->base);
    bench->ms++;
}

static inline void run_to(struct fault_bench *bench, int64_t ms)
{
    while (bench->ms < ms) {
        tick(bench);
    }
}

static inline int32_t position(const struct fault_bench *bench)
{
    const struct bus_frame *frame = bench_find(&bench->base, 0, POSITION);

    return frame ? get_i32_le(frame->data) : INT32_MIN;
}

static inline void enable(struct fault_bench *bench)
{
    bench_send(&bench->base, 0, 0x001, "09 50");
    bench_send(&bench->base, 0, 0x001, "72 4D 01");
}

#endif
