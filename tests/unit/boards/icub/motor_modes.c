/* SPDX-License-Identifier: Apache-2.0 */
/* The control modes of iCub motor boards: how an axis comes into each, gently or strictly. */
#include "tests/unit/boards/icub/motor_bench.h"

static void any_running_mode_is_entered_from_idle_with_the_bridge_on(void **state)
{
    (void)state;
    for (size_t i = 0; i < RUNNING; i++) {
        struct board_bench bench;

        bench_open(&bench);
        bench_tick(&bench);
        assert_false(bench.motor[0].bridge_on);
        set_mode(&bench, running[i]);
        assert_int_equal(mode_of(&bench), running[i]);
        assert_true(bench.motor[0].bridge_on);
        assert_false(bench.motor[1].bridge_on);
        assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
        set_mode(&bench, i % 2 ? 0x00 : 0x09);
        assert_int_equal(mode_of(&bench), 0x00);
        assert_false(bench.motor[0].bridge_on);
        bench_stop(&bench);
    }
}

static void one_running_mode_follows_another_directly(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_open(&bench);
    for (size_t i = 0; i < RUNNING; i++) {
        for (size_t j = 0; j < RUNNING; j++) {
            set_mode(&bench, running[i]);
            set_mode(&bench, running[j]);
            assert_int_equal(mode_of(&bench), running[j]);
            assert_true(bench.motor[0].bridge_on);
        }
    }
    bench_stop(&bench);
}

static void values_that_are_no_mode_are_refused(void **state)
{
    struct board_bench bench;
    unsigned refused = 0;

    (void)state;
    bench_open(&bench);
    for (unsigned mode = 0; mode < 256; mode++) {
        bool known = mode <= 0x09 || mode == 0x50;

        if (!known) {
            set_mode(&bench, mode);
            refused++;
        }
    }
    assert_int_equal(mode_of(&bench), 0x00);
    assert_int_equal(bench_counters(&bench).malformed, refused);
    bench_stop(&bench);
}

static void only_force_idle_leaves_a_fault(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_open(&bench);
    set_mode(&bench, 0x50);
    bench_tick(&bench);
    bench.sense[0].current_a = -60.0;
    bench_ticks(&bench, 2);
    bench.sense[0].current_a = 0.0;
    assert_int_equal(mode_of(&bench), 0xa0);
    for (size_t i = 0; i < RUNNING; i++) {
        set_mode(&bench, running[i]);
        assert_int_equal(mode_of(&bench), 0xa0);
    }
    set_mode(&bench, 0x00);
    assert_int_equal(mode_of(&bench), 0xa0);
    bench_send(&bench, 0, 0x001, "04 03 00 00 01 00 00 00");
    assert_int_equal(mode_of(&bench), 0xa0);
    assert_false(bench.motor[0].bridge_on);
    set_mode(&bench, 0x09);
    assert_int_equal(mode_of(&bench), 0x00);
    assert_false(bench.motor[0].bridge_on);
    set_mode(&bench, 0x50);
    assert_int_equal(mode_of(&bench), 0x50);
    bench_stop(&bench);
}

static void a_mode_change_clears_the_voltage_and_holds_the_position(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_open(&bench);
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01"); /* kept in any mode ... */
    bench_ask(&bench, "73", "73 4D 01");
    bench.sense[0].q = 0.5;
    bench_tick(&bench);
    set_mode(&bench, 0x50); /* ... and cleared by a change */
    bench_ask(&bench, "73", "73 00 00");
    bench_ask(&bench, "16", "16 88 13 00 00"); /* 5000 */
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, SUPPLY_V * 333.0 / 1333.0, 1e-12);
    set_mode(&bench, 0x01);
    bench_ask(&bench, "73", "73 00 00");
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench_send(&bench, 0, 0x001, "72 4D 01"); /* acts in mode 0x50 only */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 0.0, 0.0);
    bench_stop(&bench);
}

static void discovery_stops_motors_when_asked_to(void **state)
{
    (void)state;
    for (int stops = 0; stops < 2; stops++) {
        struct board_bench bench;

        bench_configure(&bench);
        bench.board[0].discovery_stops_motors = stops;
        bench_start(&bench);
        bench_send(&bench, 0, 0x001, POLICY_7F);
        set_mode(&bench, 0x50);
        bench_tick(&bench);
        bench_send(&bench, 0, 0x70f, "FF");
        bench_tick(&bench);
        assert_int_equal(bench.motor[0].bridge_on, !stops);
        to_slot_0(&bench);
        bench_tick(&bench);
        assert_int_equal(bench_sent(&bench, 0, 0x111), !stops);
        bench_stop(&bench);
    }
}

/* ---- strict boards ---- */

static void ask_mode(struct board_bench *bench, const char *mode, const char *told, bool on)
{
    bench_send(bench, 0, 0x001, mode);
    bench_ask(bench, "07", told);
    assert_int_equal(bench->motor[0].bridge_on, on);
}

static void a_strict_board_drives_only_when_it_knows_host_and_gains(void **state)
{
    static const char *const pids[] = {"1E 01 00", "20 00 00", "22 00 00", "24 00 00",
                                       "26 00 00", "28 00 00", "2A 35 05"};
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.board[0].strict = true;
    bench_start(&bench);
    ask_mode(&bench, "09 50", "07 50 00", false); /* no protocol */
    ask_mode(&bench, "09 00", "07 00 00", false);
    bench_send(&bench, 0, 0x001, "5B 01 06");
    bench_tick(&bench);
    for (int i = 0; i < 7; i++) {
        ask_mode(&bench, "09 50", "07 50 00", false);
        ask_mode(&bench, "09 00", "07 00 00", false);
        bench_send(&bench, 0, 0x001, pids[i]);
    }
    ask_mode(&bench, "09 50", "07 50 00", true);
    /* what it does not have resets a running axis, and from idle leads to position mode */
    bench_send(&bench, 0, 0x001, "72 4D 01");
    bench_ask(&bench, "73", "73 4D 01");
    ask_mode(&bench, "09 06", "07 50 00", true);
    bench_ask(&bench, "73", "73 00 00");
    ask_mode(&bench, "09 09", "07 00 00", false);
    ask_mode(&bench, "09 0A", "07 01 00", true);
    bench_stop(&bench);
}

static void a_strict_board_prints_what_the_firmware_prints(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_configure(&bench);
    bench.board[0].strict = true;
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "49 20 00 00 00");
    bench_send(&bench, 0, 0x001, "09 0A"); /* no protocol, no such mode: a fault */
    bench_tick(&bench);
    assert_int_equal(bench_sent(&bench, 0, 0x116), 4 + 3);
    bench_expect_frame(bench_find(&bench, 0, 0x116), 0x116, "06 10 63 61 6E 20 70 72");
    bench_ask(&bench, "07", "07 A0 00");
    bench_stop(&bench);
}

static void modes_of_the_table_that_no_firmware_has_are_refused(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_open(&bench);
    ask_mode(&bench, "09 0A", "07 00 00", false);
    ask_mode(&bench, "09 0B", "07 00 00", false);
    ask_mode(&bench, "09 60", "07 00 00", false);
    assert_int_equal(bench_counters(&bench).malformed, 3);
    bench_stop(&bench);
}

static void calibration_is_that_of_the_absolute_encoder(void **state)
{
    struct board_bench bench;

    (void)state;
    bench_open(&bench);
    bench_send(&bench, 0, 0x001, "04 00 00 00 01 00 00 00"); /* hard stops: not on this board */
    assert_int_equal(bench_counters(&bench).malformed, 1);
    bench_ask(&bench, "07", "07 00 00");
    bench_send(&bench, 0, 0x001, "04 03 00 00 00 00 00 00"); /* p2 = 0 */
    bench_ask(&bench, "07", "07 A0 00");
    assert_int_equal(bench_counters(&bench).malformed, 1);
    bench_stop(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_running_mode_is_entered_from_idle_with_the_bridge_on),
        cmocka_unit_test(one_running_mode_follows_another_directly),
        cmocka_unit_test(values_that_are_no_mode_are_refused),
        cmocka_unit_test(only_force_idle_leaves_a_fault),
        cmocka_unit_test(a_mode_change_clears_the_voltage_and_holds_the_position),
        cmocka_unit_test(discovery_stops_motors_when_asked_to),
        cmocka_unit_test(a_strict_board_drives_only_when_it_knows_host_and_gains),
        cmocka_unit_test(a_strict_board_prints_what_the_firmware_prints),
        cmocka_unit_test(modes_of_the_table_that_no_firmware_has_are_refused),
        cmocka_unit_test(calibration_is_that_of_the_absolute_encoder),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
