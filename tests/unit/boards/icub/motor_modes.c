/* SPDX-License-Identifier: Apache-2.0 */
/* The control modes of iCub motor boards: how an axis comes into each, gently or strictly. */
#include "tests/unit/boards/icub/motor_bench.h"

TEST_ON(any_running_mode_is_entered_from_idle_with_the_bridge_on, board_bench, bench)
{
    for (size_t i = 0; i < RUNNING; i++) {
        bench_open(bench);
        bench_tick(bench);
        assert_false(bench->motor[0].bridge_on);
        set_mode(bench, running[i]);
        assert_int_equal(mode_of(bench), running[i]);
        assert_true(bench->motor[0].bridge_on);
        assert_false(bench->motor[1].bridge_on);
        assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
        set_mode(bench, i % 2 ? 0x00 : 0x09);
        assert_int_equal(mode_of(bench), 0x00);
        assert_false(bench->motor[0].bridge_on);
    }
}

TEST_ON(one_running_mode_follows_another_directly, bench_open, bench)
{
    for (size_t i = 0; i < RUNNING; i++) {
        for (size_t j = 0; j < RUNNING; j++) {
            set_mode(bench, running[i]);
            set_mode(bench, running[j]);
            assert_int_equal(mode_of(bench), running[j]);
            assert_true(bench->motor[0].bridge_on);
        }
    }
}

TEST_ON(values_that_are_no_mode_are_refused, bench_open, bench)
{
    unsigned refused = 0;

    for (unsigned mode = 0; mode < 256; mode++) {
        bool known = mode <= 0x09 || mode == 0x50;

        if (!known) {
            set_mode(bench, mode);
            refused++;
        }
    }
    assert_int_equal(mode_of(bench), 0x00);
    assert_int_equal(bench_counters(bench).malformed, refused);
}

TEST_ON(only_force_idle_leaves_a_fault, bench_open, bench)
{
    set_mode(bench, 0x50);
    bench_tick(bench);
    bench->sense[0].current_a = -60.0;
    bench_ticks(bench, 2);
    bench->sense[0].current_a = 0.0;
    assert_int_equal(mode_of(bench), 0xa0);
    for (size_t i = 0; i < RUNNING; i++) {
        set_mode(bench, running[i]);
        assert_int_equal(mode_of(bench), 0xa0);
    }
    set_mode(bench, 0x00);
    assert_int_equal(mode_of(bench), 0xa0);
    bench_send(bench, 0, 0x001, "04 03 00 00 01 00 00 00");
    assert_int_equal(mode_of(bench), 0xa0);
    assert_false(bench->motor[0].bridge_on);
    set_mode(bench, 0x09);
    assert_int_equal(mode_of(bench), 0x00);
    assert_false(bench->motor[0].bridge_on);
    set_mode(bench, 0x50);
    assert_int_equal(mode_of(bench), 0x50);
}

TEST_ON(a_mode_change_clears_the_voltage_and_holds_the_position, bench_open, bench)
{
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "72 4D 01"); /* kept in any mode ... */
    bench_ask(bench, "73", "73 4D 01");
    bench->sense[0].q = 0.5;
    bench_tick(bench);
    set_mode(bench, 0x50); /* ... and cleared by a change */
    bench_ask(bench, "73", "73 00 00");
    bench_ask(bench, "16", "16 88 13 00 00"); /* 5000 */
    bench_say(bench, 0, 0x001, "72 4D 01");
    assert_near(bench->motor[0].voltage_v, SUPPLY_V * 333.0 / 1333.0, 1e-12);
    set_mode(bench, 0x01);
    bench_ask(bench, "73", "73 00 00");
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    bench_say(bench, 0, 0x001, "72 4D 01"); /* acts in mode 0x50 only */
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
}

TEST_ON(discovery_stops_motors_when_asked_to, board_bench, bench)
{
    for (int stops = 0; stops < 2; stops++) {
        bench_configure(bench);
        bench->board[0].discovery_stops_motors = stops;
        bench_start(bench);
        bench_send(bench, 0, 0x001, POLICY_7F);
        set_mode(bench, 0x50);
        bench_tick(bench);
        bench_say(bench, 0, 0x70f, "FF");
        assert_int_equal(bench->motor[0].bridge_on, !stops);
        to_slot_0(bench);
        bench_tick(bench);
        assert_int_equal(bench_sent(bench, 0, 0x111), !stops);
    }
}

/* ---- strict boards ---- */

static void ask_mode(struct board_bench *bench, const char *mode, const char *told, bool on)
{
    bench_send(bench, 0, 0x001, mode);
    bench_ask(bench, "07", told);
    assert_int_equal(bench->motor[0].bridge_on, on);
}

static const char *const position_pid[] = {"1E 01 00", "20 00 00", "22 00 00", "24 00 00",
                                           "26 00 00", "28 00 00", "2A 35 05"};
enum { POSITION_PID = sizeof position_pid / sizeof *position_pid };

/* A bench with a strict board 1, which tells its texts. */
static void open_strict(struct board_bench *bench, bool require_calibration)
{
    bench_configure(bench);
    bench->board[0].strict = true;
    bench->board[0].require_calibration = require_calibration;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "49 20 00 00 00");
}

static void state_protocol_and_gains(struct board_bench *bench)
{
    bench_send(bench, 0, 0x001, "5B 01 06");
    for (int i = 0; i < POSITION_PID; i++) {
        bench_send(bench, 0, 0x001, position_pid[i]);
    }
    bench_tick(bench);
}

/* The texts of the last tick as a host puts them together, each behind a '|'; numbers and parts
 * count on as they must. */
static void read_texts(const struct board_bench *bench, unsigned *number, char *texts, size_t size)
{
    unsigned part = 0;
    size_t used = 0;

    texts[0] = '\0';
    for (size_t i = 0; i < bench->count[0]; i++) {
        const struct bus_frame *frame = &bench->frame[0][i];

        if (frame->id != 0x116) {
            continue;
        }
        assert_true(frame->data[0] == 0x06 || frame->data[0] == 0x86);
        assert_int_equal(frame->data[1], *number << 4 | part);
        assert_true(frame->len > 2 && (frame->len == 8 || frame->data[0] == 0x86));
        used += (size_t)snprintf(texts + used, size - used, "%s%.*s", part ? "" : "|",
                                 frame->len - 2, (const char *)frame->data + 2);
        part++;
        if (frame->data[0] == 0x86) {
            part = 0;
            *number = (*number + 1) % 4;
        }
    }
    assert_int_equal(part, 0);
}

static void expect_texts(struct board_bench *bench, unsigned *number, const char *mode,
                         const char *expected)
{
    char texts[128];

    bench_say(bench, 0, 0x001, mode);
    read_texts(bench, number, texts, sizeof texts);
    assert_string_equal(texts, expected);
}

TEST_ON(a_strict_axis_that_is_owed_something_goes_into_fault, board_bench, bench)
{
    open_strict(bench, false);
    ask_mode(bench, "09 50", "07 A0 00", false); /* no protocol */
    ask_mode(bench, "09 50", "07 A0 00", false);
    ask_mode(bench, "09 00", "07 A0 00", false);
    ask_mode(bench, "09 09", "07 00 00", false);
    bench_say(bench, 0, 0x001, "5B 01 07"); /* a host that is too new */
    ask_mode(bench, "09 50", "07 A0 00", false);
    ask_mode(bench, "09 09", "07 00 00", false);
    bench_say(bench, 0, 0x001, "5B 01 06");
    for (int i = 0; i < POSITION_PID; i++) {
        ask_mode(bench, "09 50", "07 A0 00", false);
        ask_mode(bench, "09 09", "07 00 00", false);
        bench_send(bench, 0, 0x001, position_pid[i]);
    }
    ask_mode(bench, "09 50", "07 50 00", true);
    bench_send(bench, 0, 0x001, "89 50"); /* the other axis has no gains */
    bench_ask(bench, "87", "87 A0 00");
    assert_false(bench->motor[1].bridge_on);
    assert_true(bench->motor[0].bridge_on);
}

TEST_ON(a_strict_axis_may_have_to_be_calibrated_first, board_bench, bench)
{
    open_strict(bench, true);
    bench_send(bench, 0, 0x001, "04 03 00 00 01 00 00 00"); /* neither protocol nor gains */
    bench_ask(bench, "07", "07 A0 00");
    ask_mode(bench, "09 09", "07 00 00", false);
    state_protocol_and_gains(bench);
    ask_mode(bench, "09 50", "07 A0 00", false);
    ask_mode(bench, "09 09", "07 00 00", false);
    bench_send(bench, 0, 0x001, "04 03 00 00 00 00 00 00"); /* p2 = 0 calibrates nothing */
    ask_mode(bench, "09 09", "07 00 00", false);
    ask_mode(bench, "09 50", "07 A0 00", false);
    ask_mode(bench, "09 09", "07 00 00", false);
    bench_send(bench, 0, 0x001, "04 03 00 00 01 00 00 00");
    bench_ask(bench, "07", "07 60 00");
    bench_ticks(bench, 200);
    ask_mode(bench, "09 50", "07 50 00", true);
}

TEST_ON(a_strict_axis_keeps_its_references_in_the_same_mode, board_bench, bench)
{
    open_strict(bench, false);
    state_protocol_and_gains(bench);
    ask_mode(bench, "09 50", "07 50 00", true);
    bench_send(bench, 0, 0x001, "72 4D 01");
    ask_mode(bench, "09 50", "07 50 00", true);
    bench_ask(bench, "73", "73 4D 01");
    ask_mode(bench, "09 01", "07 01 00", true);
    bench_ask(bench, "73", "73 00 00");
    ask_mode(bench, "09 09", "07 00 00", false);
    /* what it does not have is a fault, from idle and from another mode */
    ask_mode(bench, "09 06", "07 A0 00", false);
    ask_mode(bench, "09 09", "07 00 00", false);
    ask_mode(bench, "09 01", "07 01 00", true);
    ask_mode(bench, "09 0A", "07 A0 00", false);
}

TEST_ON(a_strict_board_prints_what_the_firmware_prints, board_bench, bench)
{
    unsigned number = 0;

    open_strict(bench, true);
    expect_texts(bench, &number, "09 50", "|can protocol NOT ack");
    expect_texts(bench, &number, "09 50", "");
    expect_texts(bench, &number, "09 09", "|CMODE SET:0");
    bench_send(bench, 0, 0x001, "5B 01 06");
    expect_texts(bench, &number, "89 01", "|PID IS NOT SET 1");
    state_protocol_and_gains(bench);
    expect_texts(bench, &number, "09 01", "|calib failed 0");
    expect_texts(bench, &number, "09 09", "|CMODE SET:0");
    bench_send(bench, 0, 0x001, "04 03 00 00 01 00 00 00");
    bench_ticks(bench, 200);
    expect_texts(bench, &number, "09 01", "|CMODE SET:1|PWM ENA:0");
    expect_texts(bench, &number, "09 01", "");
    expect_texts(bench, &number, "09 50", "|CMODE SET:80");
    expect_texts(bench, &number, "09 00", "|PWM DIS:0");
    expect_texts(bench, &number, "09 00", "");
}

TEST_ON(modes_of_the_table_that_no_firmware_has_are_refused, bench_open, bench)
{
    ask_mode(bench, "09 0A", "07 00 00", false);
    ask_mode(bench, "09 0B", "07 00 00", false);
    ask_mode(bench, "09 60", "07 00 00", false);
    assert_int_equal(bench_counters(bench).malformed, 3);
}

TEST_ON(calibration_is_that_of_the_absolute_encoder, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "04 00 00 00 01 00 00 00"); /* hard stops: not on this board */
    assert_int_equal(bench_counters(bench).malformed, 1);
    bench_ask(bench, "07", "07 00 00");
    bench_send(bench, 0, 0x001, "04 03 00 00 00 00 00 00"); /* p2 = 0 */
    bench_ask(bench, "07", "07 A0 00");
    assert_int_equal(bench_counters(bench).malformed, 1);
}

/* Of a servo valve: all but the current mode; torque is that of its sensor. */
TEST_ON(a_valve_has_no_current_mode, bench_configure, bench)
{
    bench->board[0].axis[0].valve = true;
    bench_start(bench);
    set_mode(bench, ICUB_MODE_CURRENT);
    assert_int_equal(mode_of(bench), ICUB_MODE_IDLE);
    assert_false(bench->motor[0].bridge_on);
    set_mode(bench, ICUB_MODE_TORQUE);
    assert_int_equal(mode_of(bench), ICUB_MODE_TORQUE);
    set_mode(bench, ICUB_MODE_CURRENT);
    assert_int_equal(mode_of(bench), ICUB_MODE_TORQUE);
    set_mode(bench, ICUB_MODE_OPEN_LOOP);
    assert_int_equal(mode_of(bench), ICUB_MODE_OPEN_LOOP);
}
