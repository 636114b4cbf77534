/* SPDX-License-Identifier: Apache-2.0 */
/* Motor boards of the compact protocol: telemetry, modes, faults, state. */
#include "tests/unit/boards/compact/compact_bench.h"

TEST(telemetry_carries_position_deflection_current_and_torque)
{
    const struct field *fields = compact_message(COMPACT_TELEMETRY)->fields;
    struct board_bench bench;
    int64_t v[FIELDS_MAX];

    start(&bench);
    bench.sense[1] =
        (struct motor_sense){.q = -1.25, .qm = -1.2, .current_a = -3.21, .torque_nm = 19.77};
    for (int t = 0; t < 6; t++) {
        bench_tick(&bench);
        assert_int_equal(bench_sent(&bench, 0, 0x100), 1);
        assert_int_equal(bench_sent(&bench, 0, 0x102), 1);
        assert_true(fields_decode(fields, bench_find(&bench, 0, 0x101)->data, 8, v));
        assert_near((double)v[0] * COMPACT_POSITION_RAD, -1.2, 1.0 / MOTOR_TICKS_PER_RAD);
        assert_near((double)v[1] * COMPACT_POSITION_RAD, 0.05, 1.0 / TICKS_PER_RAD);
        assert_near((double)v[2] * COMPACT_CURRENT_A, -3.21, 0.0051);
        assert_near((double)v[3] * COMPACT_TORQUE_NM, 19.77, 0.0161);
        assert_int_equal(v[4], t & 3);
    }
    /* at the ends the fields saturate */
    bench.sense[1] =
        (struct motor_sense){.q = -1.25, .qm = 25.0, .current_a = -100.0, .torque_nm = 100.0};
    bench_tick(&bench);
    assert_true(fields_decode(fields, bench_find(&bench, 0, 0x101)->data, 8, v));
    assert_int_equal(v[0], (1 << 21) - 1);
    assert_int_equal(v[1], INT16_MAX);
    assert_int_equal(v[2], -2048);
    assert_int_equal(v[3], 2047);
    bench_stop(&bench);
}

TEST(telemetry_reads_bit_for_bit_as_documented)
{
    struct board_bench bench;
    uint64_t bits = 0;
    const struct bus_frame *frame;

    configure(&bench);
    bench.board[0].axis[0].joint_ticks_per_rad = bench.board[0].axis[0].motor_ticks_per_rad = 1e5;
    bench_start(&bench);
    bench.sense[0] =
        (struct motor_sense){.q = 0.5, .qm = -0.25, .current_a = 1.0, .torque_nm = -3.2};
    bench_tick(&bench);
    frame = bench_find(&bench, 0, 0x100);
    for (int i = 0; i < 8; i++) {
        bits |= (uint64_t)frame->data[i] << 8 * i;
    }
    assert_int_equal(bits & 0x3fffff, (uint32_t)-25000 & 0x3fffff);
    assert_int_equal(bits >> 22 & 0xffff, (uint16_t)INT16_MIN); /* -0.75 rad is out of range */
    assert_int_equal(bits >> 38 & 0xfff, 100);
    assert_int_equal(bits >> 50 & 0xfff, (uint32_t)-100 & 0xfff);
    assert_int_equal(bits >> 62, 0);
    bench_stop(&bench);
}

TEST(an_fd_frame_carries_all_axes_of_a_board)
{
    const struct field *fields = compact_message(COMPACT_TELEMETRY_FD)->fields;
    const struct bus_frame *frame;
    struct board_bench bench;
    int64_t v[FIELDS_MAX];

    start(&bench);
    for (int t = 0; t < 40; t++) {
        bench.sense[4] = (struct motor_sense){
            .q = 1.5, .qm = 1.0 - t * 1e-3, .current_a = 12.345, .torque_nm = -54.321};
        bench_tick(&bench);
    }
    frame = bench_find(&bench, 1, compact_id(COMPACT_TELEMETRY_FD, 7));
    assert_non_null(frame);
    assert_int_equal(frame->flags, FRAME_FD | FRAME_BRS);
    assert_int_equal(frame->len, 32);
    assert_true(fields_decode(fields, frame->data + 16, 16, v));
    assert_near((double)v[0] * COMPACT_POSITION_RAD, 1.0 - 0.039, 3e-5);
    assert_int_equal(v[1], 150000);
    assert_near((double)v[2] * COMPACT_VELOCITY_RAD_S, -1.0, 0.02);
    assert_int_equal(v[3], 12345);
    assert_int_equal(v[4], -54321);
    assert_int_equal(v[5], COMPACT_OFF);
    assert_int_equal(v[6], 0);
    assert_int_equal(v[7], 39 & 0xf);
    assert_int_equal(bench_sent(&bench, 1, 0x100), 0);

    /* A fault of one axis that opens its bridge shows in its half alone; a limit is none */
    bench.sense[3].q = 2.6;
    bench.sense[4].winding_c = 200.0;
    bench_ticks(&bench, 2);
    frame = bench_find(&bench, 1, compact_id(COMPACT_TELEMETRY_FD, 7));
    assert_true(fields_decode(fields, frame->data, 16, v));
    assert_int_equal(v[6], 0);
    assert_true(fields_decode(fields, frame->data + 16, 16, v));
    assert_int_equal(v[6], 1);
    bench_stop(&bench);
}

TEST(the_mode_frame_reaches_the_slots_that_it_names)
{
    struct board_bench bench;

    start(&bench);
    bench_send(&bench, 0, 0x020, "01 05 00 00 00"); /* voltage, slots 0 and 2 */
    bench_tick(&bench);
    assert_true(bench.motor[0].bridge_on && bench.motor[2].bridge_on);
    assert_false(bench.motor[1].bridge_on);
    assert_int_equal(bench_sent(&bench, 0, 0x200), 1); /* told at once */
    assert_int_equal(bench_find(&bench, 0, 0x200)->data[0] & 7, COMPACT_VOLTAGE);
    assert_false(bench.motor[3].bridge_on);
    send_fd(&bench, 0x020, "02 03 00 00 00");
    bench_tick(&bench);
    assert_true(bench.motor[3].bridge_on && bench.motor[4].bridge_on);
    bench_send(&bench, 0, 0x020, "00 FF FF FF FF");
    bench_tick(&bench);
    assert_false(bench.motor[0].bridge_on || bench.motor[2].bridge_on);
    assert_int_equal(bench_counters(&bench).malformed, 0);
    bench_send(&bench, 0, 0x020, "07 01 00 00 00"); /* nobody can order a fault */
    bench_send(&bench, 0, 0x020, "01 01 00 00");
    bench_send(&bench, 0, 0x020, "01 01 00 00 00 00");
    assert_int_equal(bench_counters(&bench).malformed, 2);
    assert_int_equal(bench_counters(&bench).foreign, 1); /* four bytes name no slot */
    bench_stop(&bench);
}

TEST(voltages_are_2_mv_a_count_and_short_frames_leave_slots_alone)
{
    struct board_bench bench;

    start(&bench);
    bench_send(&bench, 0, 0x020, "01 07 00 00 00");
    bench_send(&bench, 0, 0x040, "E8 03 18 FC FF 7F 00 00"); /* 1000, -1000, 32767, no slot */
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 2.0, 1e-12);
    assert_near(bench.motor[1].voltage_v, -2.0, 1e-12);
    assert_near(bench.motor[2].voltage_v, SUPPLY_V, 1e-12); /* 65.5 V is more than there is */
    bench_send(&bench, 0, 0x040, "D0 07");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 4.0, 1e-12);
    assert_near(bench.motor[1].voltage_v, -2.0, 1e-12);
    bench_send(&bench, 0, 0x040, "D0 07 00");
    bench_send(&bench, 0, 0x040, "");
    assert_int_equal(bench_counters(&bench).malformed, 2);
    bench_send(&bench, 0, 0x041, "D0 07"); /* slots 4 to 7 are nobody's */
    assert_int_equal(bench_counters(&bench).foreign, 1);
    /* FD: padding stands for slots that do not exist */
    send_fd(&bench, 0x020, "01 03 00 00 00");
    send_fd(&bench, 0x040, "E8 03 18 FC 00 00 00 00 00 00 00 00");
    bench_tick(&bench);
    assert_near(bench.motor[3].voltage_v, 2.0, 1e-12);
    assert_near(bench.motor[4].voltage_v, -2.0, 1e-12);
    bench_stop(&bench);
}

TEST(a_stale_command_becomes_0_volts_and_is_told)
{
    struct board_event event;
    struct board_bench bench;
    char text[256];

    configure(&bench);
    bench.board[0].command_timeout_ns = 20000000;
    bench_start(&bench);
    bench_send(&bench, 0, 0x020, "01 01 00 00 00");
    bench_send(&bench, 0, 0x040, "E8 03");
    bench_ticks(&bench, 20);
    assert_near(bench.motor[0].voltage_v, 2.0, 1e-12);
    bench_tick(&bench);
    assert_true(bench.motor[0].bridge_on); /* it brakes */
    assert_true(bench.motor[0].voltage_v == 0.0);
    assert_int_equal(bench_find(&bench, 0, 0x200)->data[1], COMPACT_FAULT_STALE);
    assert_true(bench_event(&bench, BOARD_EVENT_TIMEOUT, &event));
    board_event_format(bench.boards, &event, text, sizeof text);
    assert_non_null(
        strstr(text, "leg 1 (bus 0, address 4): axis 0: the voltage command timed out"));
    assert_int_equal(bench_counters(&bench).timeouts, 1);
    bench_send(&bench, 0, 0x040, "E8 03");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, 2.0, 1e-12);
    assert_int_equal(bench_find(&bench, 0, 0x200)->data[1], 0);
    bench_stop(&bench);
}

TEST(faults_open_the_bridge_until_the_host_says_off)
{
    static const unsigned bits[] = {COMPACT_FAULT_UNDER_VOLTAGE, COMPACT_FAULT_OVER_VOLTAGE,
                                    COMPACT_FAULT_OVER_CURRENT,  COMPACT_FAULT_MOTOR_ENCODER,
                                    COMPACT_FAULT_LINK_ENCODER,  COMPACT_FAULT_TORQUE_SENSOR,
                                    COMPACT_FAULT_TEMPERATURE};

    for (size_t f = 0; f < sizeof bits / sizeof *bits; f++) {
        struct board_bench bench;

        start(&bench);
        bench_send(&bench, 0, 0x020, "01 01 00 00 00");
        bench_tick(&bench);
        bench.sensors.supply_v = f == 0 ? 20.0 : f == 1 ? 61.0 : SUPPLY_V;
        bench.sense[0].current_a = f == 2 ? 24.0 : 0.0; /* twice the limit: 3.3 ms */
        bench.sense[0].qm = f == 3 ? (double)NAN : 0.0;
        bench.sense[0].q = f == 4 ? (double)NAN : 0.0;
        bench.sense[0].torque_nm = f == 5 ? (double)NAN : 0.0;
        bench.sense[0].winding_c = f == 6 ? 130.0 : 0.0;
        bench_ticks(&bench, f == 2 ? 4 : 1);
        assert_true(bench.motor[0].bridge_on);
        bench_tick(&bench);
        assert_false(bench.motor[0].bridge_on);
        assert_true(boards_fault(bench.boards));
        assert_int_equal(bench_find(&bench, 0, 0x200)->data[0] & 7, COMPACT_FAULT);
        assert_int_equal(bench_find(&bench, 0, 0x200)->data[1], bits[f]);
        bench.sensors.supply_v = SUPPLY_V;
        bench.sense[0] = (struct motor_sense){0};
        bench_tick(&bench);
        bench_send(&bench, 0, 0x020, "01 01 00 00 00");
        bench_tick(&bench);
        assert_false(bench.motor[0].bridge_on);
        bench_send(&bench, 0, 0x020, "00 01 00 00 00");
        bench_send(&bench, 0, 0x020, "01 01 00 00 00");
        bench_tick(&bench);
        assert_true(bench.motor[0].bridge_on);
        assert_false(boards_fault(bench.boards));
        bench_stop(&bench);
    }
}

TEST(beyond_a_limit_only_the_way_back_is_obeyed)
{
    struct board_bench bench;

    start(&bench);
    bench.sense[0].q = 2.6; /* upper limit 2.5 */
    bench_tick(&bench);
    assert_int_equal(get_u16_le(bench_find(&bench, 0, 0x200)->data + 1), COMPACT_FAULT_LIMIT);
    bench_send(&bench, 0, 0x020, "01 01 00 00 00");
    bench_send(&bench, 0, 0x040, "E8 03");
    bench_tick(&bench);
    assert_true(bench.motor[0].voltage_v == 0.0);
    bench_send(&bench, 0, 0x040, "18 FC");
    bench_tick(&bench);
    assert_near(bench.motor[0].voltage_v, -2.0, 1e-12);
    bench_stop(&bench);
}

TEST(state_comes_every_50_ms_and_says_how_many_commands_came)
{
    struct board_bench bench;
    size_t sent = 0;

    start(&bench);
    bench.sense[0].winding_c = 41.0;
    for (int t = 0; t < 500; t++) {
        bench_send(&bench, 0, 0x040, "00 00");
        bench_tick(&bench);
        sent += bench_sent(&bench, 0, 0x200);
        if (bench_sent(&bench, 0, 0x200)) {
            const uint8_t *data = bench_find(&bench, 0, 0x200)->data;

            assert_int_equal(data[0] >> 4, (t + 1) & 0xf);
            assert_int_equal(get_u16_le(data + 3), 48000);
            assert_int_equal(data[5], 41);
        }
    }
    assert_int_equal(sent, 10);
    bench_stop(&bench);
}

/* A servo valve has no current: the voltage moves it, and the mode that would control one is
 * malformed and changes nothing, also where it is asked of several axes. */
TEST(a_valve_has_no_current_mode)
{
    struct board_bench bench;

    configure(&bench);
    bench.board[0].axis[0].valve = true;
    bench_start(&bench);
    bench_send(&bench, 0, compact_id(COMPACT_MODE, 0), "02 03 00 00 00");
    bench_tick(&bench);
    assert_int_equal(bench_counters(&bench).malformed, 1);
    assert_false(bench.motor[0].bridge_on);
    assert_true(bench.motor[1].bridge_on);
    bench_send(&bench, 0, compact_id(COMPACT_MODE, 0), "01 01 00 00 00");
    bench_send(&bench, 0, compact_id(COMPACT_COMMAND, 0), "E8 03");
    bench_tick(&bench);
    assert_int_equal(bench_counters(&bench).malformed, 1);
    assert_true(bench.motor[0].bridge_on);
    assert_near(bench.motor[0].voltage_v, 2.0, 1e-12);
    bench_stop(&bench);
}
