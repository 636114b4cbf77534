/* SPDX-License-Identifier: Apache-2.0 */
/* What every node of a compact bus has: identity, parameters, telemetry period, restart. */
#include "tests/unit/boards/compact/compact_bench.h"

TEST(discovery_tells_kind_axes_and_first_slot)
{
    struct board_bench bench;

    start(&bench);
    bench_send(&bench, 0, 0x7e0, "");
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x7c4, "02 02 00 01 01 00 0C 00");
    bench_expect(&bench, 0, 0x7d4, "02 01 02 01 01 00 0C 00");
    bench_expect(&bench, 0, 0x7df, "03 00 00 01 01 00 04 00");
    bench_send(&bench, 0, 0x7e0, "00");
    assert_int_equal(bench_counters(&bench).malformed, 1);
    bench_stop(&bench);
}

TEST(parameters_are_read_written_and_refused)
{
    struct board_bench bench;

    start(&bench);
    request(&bench, "00 00", "00 00 02 00 00 00 00");
    request(&bench, "01 00", "01 00 0C 00 00 01 00");
    request(&bench, "03 00", "03 00 00 00 00 00 00");
    request(&bench, "12 00", "12 00 E0 2E 00 00 00");             /* 12 A */
    request(&bench, "92 01 88 13 00 00", "92 01 88 13 00 00 00"); /* axis 1: 5 A */
    request(&bench, "12 01", "12 01 88 13 00 00 00");
    request(&bench, "12 00", "12 00 E0 2E 00 00 00");
    request(&bench, "92 00 E1 2E 00 00", "92 00 E0 2E 00 00 03"); /* above the board's own */
    request(&bench, "92 00 00 00 00 00", "92 00 E0 2E 00 00 03");
    request(&bench, "12 02", "12 02 00 00 00 00 02"); /* no third axis */
    request(&bench, "7F 00", "7F 00 00 00 00 00 01");
    request(&bench, "80 00 01 00 00 00", "80 00 02 00 00 00 04"); /* read only */
    request(&bench, "90 00 01 00 00 00", "90 00 00 00 00 00 04");
    request(&bench, "12", "12 00 00 00 00 00 05");
    request(&bench, "12 00 00", "12 00 00 00 00 00 05");
    request(&bench, "92 00 01", "92 00 00 00 00 00 05");
    request(&bench, "93 00 00 00 00 80", "93 00 00 00 00 80 00"); /* min as low as one likes */
    request(&bench, "94 00 FF FF FF 7F", "94 00 FF FF FF 7F 00");
    bench_send(&bench, 0, 0x020, "01 01 00 00 00");
    request(&bench, "92 00 88 13 00 00", "92 00 E0 2E 00 00 06"); /* not while it runs */
    request(&bench, "87 00 01 00 00 00", "87 00 00 00 00 00 06");
    bench_stop(&bench);
}

TEST(telemetry_has_the_period_that_the_host_sets)
{
    struct board_bench bench;
    size_t sent = 0;

    start(&bench);
    request(&bench, "85 00 04 00 00 00", "85 00 04 00 00 00 00");
    for (int t = 0; t < 100; t++) {
        bench_tick(&bench);
        sent += bench_sent(&bench, 0, 0x100);
    }
    assert_int_equal(sent, 25);
    request(&bench, "85 00 00 00 00 00", "85 00 00 00 00 00 00");
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x100), 0);
    assert_int_equal(bench_sent(&bench, 0, 0x102), 1);
    request(&bench, "85 00 00 01 00 00", "85 00 00 00 00 00 03");
    bench_stop(&bench);
}

TEST(what_is_saved_survives_a_restart)
{
    struct board_bench bench;

    start(&bench);
    request(&bench, "92 00 88 13 00 00", "92 00 88 13 00 00 00");
    request(&bench, "08 00", "08 00 00 00 00 00 00");
    request(&bench, "88 00 01 00 00 00", "88 00 01 00 00 00 00");
    request(&bench, "92 00 70 17 00 00", "92 00 70 17 00 00 00");
    request(&bench, "87 00 01 00 00 00", "87 00 01 00 00 00 00");
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x100), 0);
    bench_send(&bench, 0, compact_id(COMPACT_REQUEST, 4), "12 00"); /* nobody is at home */
    assert_int_equal(bench_counters(&bench).foreign, 1);
    for (int t = 0; t < 200 && !bench_sent(&bench, 0, 0x7c4); t++) {
        bench_tick(&bench);
    }
    bench_expect(&bench, 0, 0x7c4, "02 02 00 01 01 00 0C 00"); /* it says that it is back */
    request(&bench, "12 00", "12 00 88 13 00 00 00");
    bench_stop(&bench);
}

TEST(a_board_that_boots_is_silent)
{
    struct board_bench bench;

    configure(&bench);
    bench.board[0].boot_ns = 50000000;
    bench_start(&bench);
    bench_send(&bench, 0, 0x7e0, "");
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x7c4), 0);
    assert_int_equal(bench_sent(&bench, 0, 0x7d4), 1);
    bench_ticks(&bench, 49);
    assert_int_equal(bench_sent(&bench, 0, 0x7c4), 1);
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x100), 1);
    bench_stop(&bench);
}
