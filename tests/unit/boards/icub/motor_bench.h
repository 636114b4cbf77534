/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of the iCub motor boards share: asking for the mode, setting it, waiting for a
 * slot. */
#ifndef TESTS_UNIT_BOARDS_ICUB_MOTOR_BENCH_H
#define TESTS_UNIT_BOARDS_ICUB_MOTOR_BENCH_H

#include "tests/unit/boards/board_bench.h"

#define POLICY_7F "49 7F 00 00 00"

static inline uint8_t mode_of(struct board_bench *bench)
{
    const struct bus_frame *reply;

    bench_say(bench, 0, 0x001, "07");
    reply = bench_find(bench, 0, 0x010);
    assert_non_null(reply);
    return reply->data[1];
}

static inline void set_mode(struct board_bench *bench, unsigned mode)
{
    char text[16];

    snprintf(text, sizeof text, "09 %02X", mode);
    bench_send(bench, 0, 0x001, text);
}

/* Runs until the tick that sent slot 3, so that the next one is slot 0. */
static inline void to_slot_0(struct board_bench *bench)
{
    bench_ticks(bench, (int)((4 - bench->sensors.time_ns / 1000000 % 4) % 4));
}

static const unsigned running[] = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x50};
enum { RUNNING = sizeof running / sizeof *running };

#endif
