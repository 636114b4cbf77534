/* SPDX-License-Identifier: Apache-2.0 */
/* The bench of the boards on CANopen buses. */
#ifndef TESTS_UNIT_BOARDS_CIA402_CIA402_BENCH_H
#define TESTS_UNIT_BOARDS_CIA402_CIA402_BENCH_H

#include "boards/cia402/protocol.h"
#include "boards/protocol_list.h"
#include "tests/unit/boards/board_bench.h"

static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_cia402},
                                                            {.protocol = &protocol_cia402}};

/* bus 0: drive 4 (joints 0, 1), drive 20 (joint 2), F/T node 31; bus 1: drive 7 (joints 3, 4) and
 * inertial node 8. */
static inline void configure(struct board_bench *bench)
{
    bench_configure(bench);
    bench->board[0] = bench_motor("leg 1", 0, 4, 0, 1);
    bench->board[1] = bench_motor("leg 2", 0, 20, 2, -1);
    bench->board[2] = bench->board[3];
    bench->board[2].address = 31;
    bench->board[3] = bench_motor("arm", 1, 7, 3, 4);
    bench->board[4] =
        (struct board_config){.name = "trunk", .kind = BOARD_INERTIAL, .bus = 1, .address = 8};
    bench->config.bus = buses;
    for (int i = 0; i < BENCH_BOARDS; i++) {
        for (int k = 0; k < BOARD_AXES_MAX; k++) {
            struct board_axis_config *axis = &bench->board[i].axis[k];

            axis->winding_ohm = 0.664;
            axis->winding_h = 0.12e-3;
            axis->bemf_v_s_rad = 4.1;
            axis->joint = k < 2 && bench->board[i].kind == BOARD_MOTOR ? axis->joint : -1;
        }
    }
}

static inline void start(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
    bench_tick(bench);
}

/* ---- SDO ---- */

/* Sends a request to a node of bus 0 and checks its one answer. */
static inline void sdo(struct board_bench *bench, unsigned node, const char *request,
                       const char *answer)
{
    bench_say(bench, 0, CIA402_SDO_REQUEST + node, request);
    bench_expect(bench, 0, CIA402_SDO_REPLY + node, answer);
}

/* The data of a node's one answer to what is written or read; index and sub-index are right. */
static inline uint32_t sdo_exchange(struct board_bench *bench, size_t bus, unsigned node,
                                    unsigned command, unsigned index, unsigned sub, uint32_t value,
                                    unsigned *answer)
{
    struct bus_frame frame = {.id = CIA402_SDO_REQUEST + node, .len = 8};
    const struct bus_frame *reply;

    frame.data[0] = (uint8_t)command;
    put_u16_le(frame.data + 1, (uint16_t)index);
    frame.data[3] = (uint8_t)sub;
    put_u32_le(frame.data + 4, value);
    boards_receive(bench->boards, bench->now_ns, bus, &frame);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, bus, CIA402_SDO_REPLY + node), 1);
    reply = bench_find(bench, bus, CIA402_SDO_REPLY + node);
    assert_int_equal(reply->len, 8);
    assert_memory_equal(reply->data + 1, frame.data + 1, 3);
    *answer = reply->data[0];
    return get_u32_le(reply->data + 4);
}

/* Writes so many bytes; returns the abort code, 0 = done. */
static inline uint32_t sdo_write(struct board_bench *bench, size_t bus, unsigned node,
                                 unsigned index, unsigned sub, unsigned bytes, uint32_t value)
{
    unsigned answer;
    uint32_t data =
        sdo_exchange(bench, bus, node, 0x23 | (4 - bytes) << 2, index, sub, value, &answer);

    assert_true(answer == 0x60 || answer == 0x80);
    return answer == 0x60 ? 0 : data;
}

/* Reads a value of up to four bytes; it is there. */
static inline uint32_t sdo_read(struct board_bench *bench, size_t bus, unsigned node,
                                unsigned index, unsigned sub)
{
    unsigned answer;
    uint32_t data = sdo_exchange(bench, bus, node, 0x40, index, sub, 0, &answer);

    assert_int_equal(answer & 0xe3, 0x43);
    return data;
}

#define WRITE(index, sub, bytes, value)                                                            \
    assert_int_equal(sdo_write(bench, 0, 4, index, sub, bytes, (uint32_t)(value)), 0)
#define READ(index, sub) sdo_read(bench, 0, 4, index, sub)

static inline void nmt(struct board_bench *bench, unsigned command, unsigned node)
{
    struct bus_frame frame = {
        .id = CIA402_NMT, .len = 2, .data = {(uint8_t)command, (uint8_t)node}};

    boards_receive(bench->boards, bench->now_ns, 0, &frame);
}

BENCH(start, struct board_bench, bench_stop)

#endif
