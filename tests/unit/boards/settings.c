/* SPDX-License-Identifier: Apache-2.0 */
/* Settings of axes beside the bus: the same values and ranges as over it, for all that boards speak. */
#include "boards/compact/protocol.h"
#include "boards/foc/protocol.h"
#include "tests/unit/boards/boards_rig.h"

static size_t find(const struct rig *rig, size_t board, size_t axis, const char *name,
                   struct board_setting *setting)
{
    for (size_t i = 0; i < boards_settings(rig->boards, board, axis); i++) {
        boards_setting(rig->boards, board, axis, i, setting);
        if (strcmp(setting->name, name) == 0) {
            return i;
        }
    }
    fail_msg("there is no %s", name);
    return 0;
}

static double get(const struct rig *rig, size_t board, size_t axis, const char *name)
{
    struct board_setting setting;

    return boards_get(rig->boards, board, axis, find(rig, board, axis, name, &setting));
}

static bool set(struct rig *rig, size_t board, size_t axis, const char *name, double value)
{
    struct board_setting setting;

    return boards_set(rig->boards, board, axis, find(rig, board, axis, name, &setting), value);
}

static void icub_boards_have_what_the_host_sets(void **state)
{
    struct rig rig;
    uint64_t changes;

    (void)state;
    rig_configure(&rig);
    rig_start(&rig);
    changes = boards_settings_changes(rig.boards);
    rig_send(&rig, 0, 0x001, "D2 10 00 20 00 30 00 04"); /* SET_POSITION_PID, axis 1 */
    rig_tick(&rig);
    assert_true(boards_settings_changes(rig.boards) > changes);
    assert_true(get(&rig, 0, 1, "position_kp") == 0x10);
    assert_true(get(&rig, 0, 1, "position_ki") == 0x20);
    assert_true(get(&rig, 0, 1, "position_kd") == 0x30);
    assert_true(get(&rig, 0, 1, "position_shift") == 4.0);
    assert_true(get(&rig, 0, 0, "position_kp") == 0.0);
    assert_true(set(&rig, 0, 1, "position_kp", -32768.0));
    assert_false(set(&rig, 0, 1, "position_kp", -32769.0));
    assert_false(set(&rig, 0, 1, "position_kp", 0.5));
    assert_false(set(&rig, 0, 1, "position_kp", (double)NAN));
    assert_false(set(&rig, 0, 1, "current_limit", -1.0));
    assert_true(get(&rig, 0, 1, "position_kp") == -32768.0);
    rig_stop(&rig);
}

static void voltages_are_no_settings(void **state)
{
    struct rig rig;
    uint64_t changes;

    (void)state;
    rig_configure(&rig);
    rig_start(&rig);
    changes = boards_settings_changes(rig.boards);
    for (int i = 0; i < 10; i++) {
        rig_send(&rig, 0, 0x001, i & 1 ? "72 10 00" : "F2 10 00"); /* SET_OPEN_LOOP */
        rig_tick(&rig);
    }
    assert_int_equal(boards_settings_changes(rig.boards), changes);
    rig_stop(&rig);
}

static void spare_axes_and_sensors_have_none(void **state)
{
    struct rig rig;

    (void)state;
    rig_configure(&rig);
    rig_start(&rig);
    assert_true(boards_settings(rig.boards, 0, 0) > 10);
    assert_int_equal(boards_settings(rig.boards, 1, 1), 0);
    assert_int_equal(boards_settings(rig.boards, 2, 0), 0);
    assert_int_equal(boards_settings(rig.boards, 3, 0), 0);
    rig_stop(&rig);
}

static void foc_gains_are_the_same_however_they_were_set(void **state)
{
    static const struct boards_bus_config buses[RIG_BUSES] = {{.personality = BOARD_FOC},
                                                              {.personality = BOARD_ICUB}};
    struct rig rig;

    (void)state;
    rig_configure(&rig);
    rig.board[0] = rig_motor("hip", 0, 1, 0, -1);
    rig.board[1] = rig_motor("knee", 0, 3, 1, -1);
    rig.board[2].torque_joint[2] = -1;
    for (int i = 0; i < 2; i++) {
        rig.board[i].axis[0].gear = 100.0;
    }
    rig.config.bus = buses;
    rig_start(&rig);
    rig_send(&rig, 0, 0x001, "5B 01 06");
    rig_send(&rig, 0, 0x001, "65 92 00 E3 00 00 00 0F"); /* mantissas 146 and 227, shift 15 */
    rig_tick(&rig);
    assert_true(get(&rig, 0, 0, "current_kp") == 146.0 / 32768.0);
    assert_true(get(&rig, 0, 0, "current_ki") == 227.0 / 32768.0);
    /* one of them anew leaves the other */
    assert_true(set(&rig, 0, 0, "current_kp", 0.01));
    assert_true(get(&rig, 0, 0, "current_kp") == 0.01);
    assert_true(get(&rig, 0, 0, "current_ki") == 227.0 / 32768.0);
    assert_false(set(&rig, 0, 0, "current_kp", 40000.0));
    assert_true(set(&rig, 0, 0, "current_peak", 9000.0));
    assert_true(get(&rig, 0, 0, "current_peak") == 9000.0);
    assert_true(get(&rig, 1, 0, "current_kp") == 0.0);
    rig_stop(&rig);
}

static void compact_settings_may_change_while_the_axis_runs(void **state)
{
    static const struct boards_bus_config buses[RIG_BUSES] = {{.personality = BOARD_COMPACT},
                                                              {.personality = BOARD_COMPACT}};
    struct board_setting setting;
    struct rig rig;

    (void)state;
    rig_configure(&rig);
    rig.board[0] = rig_motor("leg 1", 0, 4, 0, 1);
    rig.board[1] = rig_motor("arm", 1, 7, 3, 4);
    rig.config.nboard = 2;
    rig.config.bus = buses;
    for (int i = 0; i < 2; i++) {
        rig.board[i].axis[2].joint = rig.board[i].axis[3].joint = -1;
    }
    rig_start(&rig);
    rig_send(&rig, 0, compact_id(COMPACT_MODE, 0), "02 FF FF FF"); /* all in current mode */
    rig_tick(&rig);
    assert_true(set(&rig, 0, 1, "current_kp", 1234.0));
    assert_true(get(&rig, 0, 1, "current_kp") == 1234.0);
    find(&rig, 0, 1, "current_limit", &setting);
    assert_true(setting.min == 1.0 && setting.max == 12000.0); /* the board's own */
    assert_string_equal(setting.unit, "mA");
    assert_false(set(&rig, 0, 1, "current_limit", 12001.0));
    rig_stop(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(icub_boards_have_what_the_host_sets),
        cmocka_unit_test(voltages_are_no_settings),
        cmocka_unit_test(spare_axes_and_sensors_have_none),
        cmocka_unit_test(foc_gains_are_the_same_however_they_were_set),
        cmocka_unit_test(compact_settings_may_change_while_the_axis_runs),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
