/* SPDX-License-Identifier: Apache-2.0 */
/* Force-torque boards of the compact protocol. */
#include "tests/unit/boards/compact/compact_bench.h"

TEST(force_and_moment_are_cut_at_the_full_scale)
{
    struct board_bench bench;

    start(&bench);
    bench.ft = (struct ft_sense){.force_n = {12.34, -100.0, 9999.0},
                                 .torque_nm = {1.0, -50.0, 0.002},
                                 .peak_n = {-3000.0, -100.0, 9999.0}};
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x15f, "7B 00 18 FC 20 4E");           /* 123, -1000, 2000 N */
    bench_expect(&bench, 0, 0x17f, "F4 01 E0 B1 01 00");           /* 500, -40 Nm, 1 */
    assert_int_equal(bench_find(&bench, 0, 0x23f)->data[0], 0x15); /* fz, my, fx at its peak */
    assert_int_equal(get_u16_le(bench_find(&bench, 0, 0x23f)->data + 1), COMPACT_FAULT_SATURATED);
    /* tare, by value and at once */
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 31), "A1 00 0A 00 00 00");
    bench_tick(&bench);
    assert_int_equal(get_i16_le(bench_find(&bench, 0, 0x15f)->data), 133);
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 31), "A1 FF 01 00 00 00");
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x15f, "00 00 00 00 00 00");
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 31), "A0 02 E8 03 00 00"); /* 1 N */
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 31), "A1 FF 00 00 00 00");
    bench_ticks(&bench, 2);
    assert_int_equal(get_i16_le(bench_find(&bench, 0, 0x15f)->data + 4), 10);
    bench_stop(&bench);
}
