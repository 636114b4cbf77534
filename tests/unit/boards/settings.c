/* SPDX-License-Identifier: Apache-2.0 */
/* Settings of axes beside the bus: the same values and ranges as over it, for all that boards
 * speak. */
#include "tests/unit/boards/board_bench.h"

static size_t find(const struct board_bench *bench, size_t board, size_t axis, const char *name,
                   struct board_setting *setting)
{
    for (size_t i = 0; i < boards_settings(bench->boards, board, axis); i++) {
        boards_setting(bench->boards, board, axis, i, setting);
        if (strcmp(setting->name, name) == 0) {
            return i;
        }
    }
    fail_msg("there is no %s", name);
    return 0;
}

static double get(const struct board_bench *bench, size_t board, size_t axis, const char *name)
{
    struct board_setting setting;

    return boards_get(bench->boards, board, axis, find(bench, board, axis, name, &setting));
}

static bool set(struct board_bench *bench, size_t board, size_t axis, const char *name,
                double value)
{
    struct board_setting setting;

    return boards_set(bench->boards, board, axis, find(bench, board, axis, name, &setting), value);
}

TEST_ON(icub_boards_have_what_the_host_sets, bench_open, bench)
{
    uint64_t changes;

    changes = boards_settings_changes(bench->boards);
    bench_say(bench, 0, 0x001, "D2 10 00 20 00 30 00 04"); /* SET_POSITION_PID, axis 1 */
    assert_true(boards_settings_changes(bench->boards) > changes);
    assert_true(get(bench, 0, 1, "position_kp") == 0x10);
    assert_true(get(bench, 0, 1, "position_ki") == 0x20);
    assert_true(get(bench, 0, 1, "position_kd") == 0x30);
    assert_true(get(bench, 0, 1, "position_shift") == 4.0);
    assert_true(get(bench, 0, 0, "position_kp") == 0.0);
    assert_true(set(bench, 0, 1, "position_kp", -32768.0));
    assert_false(set(bench, 0, 1, "position_kp", -32769.0));
    assert_false(set(bench, 0, 1, "position_kp", 0.5));
    assert_false(set(bench, 0, 1, "position_kp", (double)NAN));
    assert_false(set(bench, 0, 1, "current_limit", -1.0));
    assert_true(get(bench, 0, 1, "position_kp") == -32768.0);
}

TEST_ON(voltages_are_no_settings, bench_open, bench)
{
    uint64_t changes;

    changes = boards_settings_changes(bench->boards);
    for (int i = 0; i < 10; i++) {
        bench_say(bench, 0, 0x001, i & 1 ? "72 10 00" : "F2 10 00"); /* SET_OPEN_LOOP */
    }
    assert_int_equal(boards_settings_changes(bench->boards), changes);
}

TEST_ON(spare_axes_and_sensors_have_none, bench_open, bench)
{
    assert_true(boards_settings(bench->boards, 0, 0) > 10);
    assert_int_equal(boards_settings(bench->boards, 1, 1), 0);
    assert_int_equal(boards_settings(bench->boards, 2, 0), 0);
    assert_int_equal(boards_settings(bench->boards, 3, 0), 0);
}

TEST_ON(foc_gains_are_the_same_however_they_were_set, bench_configure, bench)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_foc},
                                                                {.protocol = &protocol_icub}};

    bench->board[0] = bench_motor("hip", 0, 1, 0, -1);
    bench->board[1] = bench_motor("knee", 0, 3, 1, -1);
    bench->board[2].torque_joint[2] = -1;
    for (int i = 0; i < 2; i++) {
        bench->board[i].axis[0].gear = 100.0;
    }
    bench->config.bus = buses;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "5B 01 06");
    bench_say(bench, 0, 0x001, "65 92 00 E3 00 00 00 0F"); /* mantissas 146 and 227, shift 15 */
    assert_true(get(bench, 0, 0, "current_kp") == 146.0 / 32768.0);
    assert_true(get(bench, 0, 0, "current_ki") == 227.0 / 32768.0);
    /* one of them anew leaves the other */
    assert_true(set(bench, 0, 0, "current_kp", 0.01));
    assert_true(get(bench, 0, 0, "current_kp") == 0.01);
    assert_true(get(bench, 0, 0, "current_ki") == 227.0 / 32768.0);
    assert_false(set(bench, 0, 0, "current_kp", 40000.0));
    assert_true(set(bench, 0, 0, "current_peak", 9000.0));
    assert_true(get(bench, 0, 0, "current_peak") == 9000.0);
    assert_true(get(bench, 1, 0, "current_kp") == 0.0);
}
