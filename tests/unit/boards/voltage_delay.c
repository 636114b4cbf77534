/* SPDX-License-Identifier: Apache-2.0 */
/* Voltages that reach the bridges some ticks after the boards have set them. */
#include "tests/unit/boards/fault_bench.h"

enum { DELAY = 3, TICKS = 40 };

/* Begins a bench with a delay; leg1's first axis is on in open loop. */
static void delay_begin(struct fault_bench *bench, const char *fault, size_t ticks)
{
    begin(bench, fault);
    bench_stop(&bench->base);
    bench->base.config.voltage_delay_ticks = ticks;
    bench_start(&bench->base);
    enable(bench);
}

/* Records the voltage of joint 0 for some ticks, at duties that change. */
static void delay_record(const char *fault, size_t ticks, double voltage[TICKS])
{
    static const char *const duty[] = {"72 4D 01", "72 00 01", "72 00 FF"};
    static struct fault_bench bench;

    delay_begin(&bench, fault, ticks);
    for (int k = 0; k < TICKS; k++) {
        bench_send(&bench.base, 0, 0x001, duty[k / 5 % 3]);
        tick(&bench);
        voltage[k] = bench.base.motor[0].voltage_v;
    }
    end(&bench);
}

TEST(voltages_arrive_so_many_ticks_later)
{
    static const char *const fault[] = {NULL, "board leg1 hung watchdog=1 0.02..0.021"};

    for (size_t f = 0; f < 2; f++) {
        double now[TICKS], late[TICKS];

        delay_record(fault[f], 0, now);
        delay_record(fault[f], DELAY, late);
        assert_true(now[10] != now[9] && now[TICKS - 1] != 0.0);
        for (int k = DELAY; k < TICKS; k++) {
            assert_true(late[k] == now[k - DELAY]);
        }
    }
}

/* Bridges open at once, and a board in another's place is left alone. */
TEST(bridges_open_at_once_and_external_boards_are_left_alone)
{
    static struct fault_bench bench;

    delay_begin(&bench, NULL, DELAY);
    bench_send(&bench.base, 0, 0x001, "72 4D 01");
    for (int k = 0; k < 10; k++) {
        tick(&bench);
    }
    assert_true(bench.base.motor[0].bridge_on && bench.base.motor[0].voltage_v > 0.0);
    boards_shut_down(bench.base.boards, bench.base.now_ns, &bench.base.command);
    assert_false(bench.base.motor[0].bridge_on);
    end(&bench);

    begin(&bench, NULL);
    bench_stop(&bench.base);
    bench.base.config.voltage_delay_ticks = DELAY;
    bench.base.board[4].external = true;
    bench_start(&bench.base);
    bench.base.motor[3].voltage_v = 7.0;
    for (int k = 0; k < 10; k++) {
        tick(&bench);
        assert_true(bench.base.motor[3].voltage_v == 7.0);
    }
    end(&bench);
}
