/* SPDX-License-Identifier: Apache-2.0 */
/* The bench of the boards on compact buses. */
#ifndef TESTS_UNIT_BOARDS_COMPACT_COMPACT_BENCH_H
#define TESTS_UNIT_BOARDS_COMPACT_COMPACT_BENCH_H

#include "boards/compact/table.h"
#include "boards/protocol_list.h"
#include "tests/unit/boards/board_bench.h"

static const struct boards_bus_config buses[BENCH_BUSES] = {
    {.protocol = &protocol_compact}, {.protocol = &protocol_compact, .fd = true}};

/* bus 0, classic: node 4 (joints 0, 1, slots 0, 1), node 20 (joint 2, slot 2), F/T node 31; bus 1,
 * FD: node 7 (joints 3, 4, slots 0, 1). */
static inline void configure(struct board_bench *bench)
{
    bench_configure(bench);
    bench->board[0] = bench_motor("leg 1", 0, 4, 0, 1);
    bench->board[1] = bench_motor("leg 2", 0, 20, 2, -1);
    bench->board[2] = bench->board[3];
    bench->board[2].address = 31;
    bench->board[3] = bench_motor("arm", 1, 7, 3, 4);
    bench->config.nboard = 4;
    bench->config.bus = buses;
    for (int i = 0; i < 4; i++) {
        bench->board[i].transmit_at_start = true;
        bench->board[i].period_ns = 1000000;
        bench->board[i].axis[2].joint = bench->board[i].axis[3].joint = -1;
    }
}

static inline void start(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
}

static inline void send_fd(struct board_bench *bench, uint32_t id, const char *hex)
{
    struct bus_frame frame = {.id = id, .flags = FRAME_FD | FRAME_BRS};

    frame.len = bench_bytes(hex, frame.data);
    boards_receive(bench->boards, bench->now_ns, 1, &frame);
}

static inline void request(struct board_bench *bench, const char *hex, const char *reply)
{
    bench_send(bench, 0, compact_id(COMPACT_REQUEST, 4), hex);
    bench_tick(bench);
    bench_expect(bench, 0, compact_id(COMPACT_REPLY, 4), reply);
}

#endif
