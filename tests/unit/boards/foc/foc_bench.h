/* SPDX-License-Identifier: Apache-2.0 */
/* The bench of the 2FOC boards. */
#ifndef TESTS_UNIT_BOARDS_FOC_FOC_BENCH_H
#define TESTS_UNIT_BOARDS_FOC_FOC_BENCH_H

#include "boards/foc/protocol.h"
#include "boards/protocol_list.h"
#include "tests/unit/boards/board_bench.h"

#define GEAR 100.0
#define ROTOR_TICKS 4096.0

static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_foc},
                                                            {.protocol = &protocol_icub}};

/* bus 0: 2FOC boards 1 (joint 0) and 3 (joint 1), pseudo-STRAIN, F/T; bus 1: an iCub board. */
static inline void configure(struct board_bench *bench)
{
    bench_configure(bench);
    for (int i = 0; i < 2; i++) {
        bench->board[i] = bench_motor(i ? "knee" : "hip", 0, i ? 3 : 1, i, -1);
        bench->board[i].axis[0].gear = GEAR;
        bench->board[i].axis[0].motor_ticks_per_rad = GEAR * ROTOR_TICKS / (2.0 * M_PI);
    }
    bench->board[2].torque_joint[2] = -1;
    bench->config.bus = buses;
}

/* Protocol, motor, current limits (4 A nominal, 8 A peak, 20 A), current PID (shift 15). */
static inline void make_idle(struct board_bench *bench, uint32_t id)
{
    bench_send(bench, 0, id, "5B 01 06");
    bench_send(bench, 0, id, "77 01 00 10 00 00 0E");
    bench_send(bench, 0, id, "48 00 A0 0F 40 1F 20 4E");
    bench_say(bench, 0, id, "65 92 00 E3 00 00 00 0F");
}

static inline void start(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
    make_idle(bench, 0x001);
    make_idle(bench, 0x003);
}

static inline void enter(struct board_bench *bench, const char *mode)
{
    bench_send(bench, 0, 0x001, mode);
}

/* The host's period: targets, then a tick. */
static inline void target(struct board_bench *bench, const char *hex)
{
    bench_say(bench, 0, 0x10f, hex);
}

BENCH(start, struct board_bench, bench_stop)

#endif
