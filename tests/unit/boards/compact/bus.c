/* SPDX-License-Identifier: Apache-2.0 */
/* Compact buses, classic and FD: identity, modes, commands, telemetry, parameters, faults. */
#include "boards/compact/table.h"
#include "tests/unit/boards/board_bench.h"

static const struct boards_bus_config buses[BENCH_BUSES] = {
    {.personality = BOARD_COMPACT}, {.personality = BOARD_COMPACT, .fd = true}};

/* bus 0, classic: node 4 (joints 0, 1, slots 0, 1), node 20 (joint 2, slot 2), F/T node 31; bus 1,
 * FD: node 7 (joints 3, 4, slots 0, 1). */
static void configure(struct board_bench *bench)
{
    bench_configure(bench);
    bench->board[0] = bench_motor("leg 1", 0, 4, 0, 1);
    bench->board[1] = bench_motor("leg 2", 0, 20, 2, -1);
    bench->board[2] = bench->board[3];
    bench->board[2].address = 31;
    bench->board[3] = bench_motor("arm", 1, 7, 3, 4);
    bench->config.nboard = 4;
    bench->config.bus = buses;
    for (int i = 0; i < 4; i++) {
        bench->board[i].transmit_at_start = true;
        bench->board[i].period_ns = 1000000;
        bench->board[i].axis[2].joint = bench->board[i].axis[3].joint = -1;
    }
}

static void start(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
}

static void send_fd(struct board_bench *bench, uint32_t id, const char *hex)
{
    struct bus_frame frame = {.id = id, .flags = FRAME_FD | FRAME_BRS};

    frame.len = bench_bytes(hex, frame.data);
    boards_receive(bench->boards, bench->now_ns, 1, &frame);
}

static void request(struct board_bench *bench, const char *hex, const char *reply)
{
    bench_send(bench, 0, compact_id(COMPACT_REQUEST, 4), hex);
    bench_tick(bench);
    bench_expect(bench, 0, compact_id(COMPACT_REPLY, 4), reply);
}

static void identifiers_are_apart_and_ordered_by_urgency(void **state)
{
    (void)state;
    assert_int_equal(compact_id(COMPACT_MODE, 0), 0x020);
    assert_int_equal(compact_id(COMPACT_COMMAND, 7), 0x047);
    assert_int_equal(compact_id(COMPACT_TELEMETRY, 31), 0x11f);
    assert_int_equal(compact_id(COMPACT_REQUEST, 31), 0x69f);
    assert_int_equal(compact_id(COMPACT_DISCOVER, 0), 0x7e0);
    for (int i = 1; i < COMPACT_MESSAGES; i++) {
        assert_true(compact_messages[i - 1].function < compact_messages[i].function);
    }
    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];

        assert_int_equal(fields_bytes(row->fields), row->length);
        assert_int_equal(fields_bits(row->fields) % 8, 0);
        assert_true(fields_count(row->fields) <= FIELDS_MAX);
        assert_true(row->length * row->repeats <= 64);
        assert_ptr_equal(compact_message(row->function), row);
    }
    assert_null(compact_message(0x37)); /* where the lockstep frames are */
}

static void discovery_tells_kind_axes_and_first_slot(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void telemetry_carries_position_deflection_current_and_torque(void **state)
{
    const struct field *fields = compact_message(COMPACT_TELEMETRY)->fields;
    struct board_bench bench;
    int64_t v[FIELDS_MAX];

    (void)state;
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

static void telemetry_reads_bit_for_bit_as_documented(void **state)
{
    struct board_bench bench;
    uint64_t bits = 0;
    const struct bus_frame *frame;

    (void)state;
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

static void an_fd_frame_carries_all_axes_of_a_board(void **state)
{
    const struct field *fields = compact_message(COMPACT_TELEMETRY_FD)->fields;
    const struct bus_frame *frame;
    struct board_bench bench;
    int64_t v[FIELDS_MAX];

    (void)state;
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
    assert_int_equal(v[7], 39 & 0xf);
    assert_int_equal(bench_sent(&bench, 1, 0x100), 0);
    bench_stop(&bench);
}

static void the_mode_frame_reaches_the_slots_that_it_names(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void voltages_are_2_mv_a_count_and_short_frames_leave_slots_alone(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void an_fd_frame_on_a_classic_bus_is_foreign(void **state)
{
    struct bus_frame frame = {.id = 0x020, .flags = FRAME_FD, .len = 5, .data = {1, 1}};
    struct board_bench bench;

    (void)state;
    start(&bench);
    boards_receive(bench.boards, bench.now_ns, 0, &frame);
    assert_int_equal(bench_counters(&bench).foreign, 1);
    bench_stop(&bench);
}

static void a_stale_command_becomes_0_volts_and_is_told(void **state)
{
    struct board_event event;
    struct board_bench bench;
    char text[256];

    (void)state;
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

static void faults_open_the_bridge_until_the_host_says_off(void **state)
{
    static const unsigned bits[] = {COMPACT_FAULT_UNDER_VOLTAGE, COMPACT_FAULT_OVER_VOLTAGE,
                                    COMPACT_FAULT_OVER_CURRENT,  COMPACT_FAULT_MOTOR_ENCODER,
                                    COMPACT_FAULT_LINK_ENCODER,  COMPACT_FAULT_TORQUE_SENSOR,
                                    COMPACT_FAULT_TEMPERATURE};

    (void)state;
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

static void beyond_a_limit_only_the_way_back_is_obeyed(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void state_comes_every_50_ms_and_says_how_many_commands_came(void **state)
{
    struct board_bench bench;
    size_t sent = 0;

    (void)state;
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

static void force_and_moment_are_cut_at_the_full_scale(void **state)
{
    struct board_bench bench;

    (void)state;
    start(&bench);
    bench.ft = (struct ft_sense){{12.34, -100.0, 9999.0}, {1.0, -50.0, 0.002}};
    bench_tick(&bench);
    bench_expect(&bench, 0, 0x15f, "7B 00 18 FC 20 4E");           /* 123, -1000, 2000 N */
    bench_expect(&bench, 0, 0x17f, "F4 01 E0 B1 01 00");           /* 500, -40 Nm, 1 */
    assert_int_equal(bench_find(&bench, 0, 0x23f)->data[0], 0x14); /* fz and my */
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

static void parameters_are_read_written_and_refused(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void telemetry_has_the_period_that_the_host_sets(void **state)
{
    struct board_bench bench;
    size_t sent = 0;

    (void)state;
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

static void what_is_saved_survives_a_restart(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void a_board_that_boots_is_silent(void **state)
{
    struct board_bench bench;

    (void)state;
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

static void a_classic_half_leg_fits_1_mbit_at_1_khz(void **state)
{
    /* worst-case bits of a classic frame of n bytes: 8n + 47 + floor((34 + 8n - 1) / 4) */
    struct board_bench bench;
    double bits = 0.0;

    (void)state;
    start(&bench);
    for (int t = 0; t < 1000; t++) {
        bench_tick(&bench);
        bits += 115.0; /* COMMAND of three axes */
        for (size_t i = 0; i < bench.count[0]; i++) {
            int n = bench.frame[0][i].len;

            bits += 8 * n + 47 + (34 + 8 * n - 1) / 4;
        }
    }
    /* 3 * 135 + 2 * 115 + 115 a millisecond, and 4 STATE frames in 50 ms: 76.1 % */
    assert_near(bits, 1000.0 * (405.0 + 230.0 + 115.0) + 20.0 * 4.0 * 135.0, 4.0 * 135.0);
    assert_true(bits <= 0.77e6);
    bench_stop(&bench);
}

static void a_wrong_configuration_is_refused(void **state)
{
    static const struct {
        const char *text;
    } wrong[] = {{"1 to 31 on a compact bus"},
                 {"needs no torque board"},
                 {"both axes have the same joint"},
                 {"only compact boards speak CAN FD"},
                 {"1 to 4, for only these have a target"},
                 {"the gear must be above 0"}};
    static const struct boards_bus_config fd[BENCH_BUSES] = {{BOARD_ICUB, true},
                                                             {BOARD_ICUB, false}};
    static const struct boards_bus_config foc[BENCH_BUSES] = {{BOARD_FOC, false},
                                                              {BOARD_COMPACT, false}};

    (void)state;
    for (int i = 0; i < 6; i++) {
        struct boards *boards;
        struct error error;
        struct board_bench bench;

        configure(&bench);
        switch (i) {
        case 0:
            bench.board[1].address = 32;
            break;
        case 1:
            bench.board[2].kind = BOARD_TORQUE;
            break;
        case 2:
            bench.board[3].axis[2] = bench_axis(3);
            break;
        case 3:
            bench.config.bus = fd;
            break;
        default:
            bench.config.bus = foc;
            bench.board[0].address = i == 4 ? 5 : 4;
            break;
        }
        assert_int_equal(arena_init(&bench.arena, 64u << 20, &error), ERROR_NONE);
        assert_int_equal(boards_create(&bench.config, &bench.arena, &boards, &error), ERROR_INPUT);
        if (!strstr(error.text, wrong[i].text)) {
            fail_msg("\"%s\" does not say \"%s\"", error.text, wrong[i].text);
        }
        arena_fini(&bench.arena);
    }
}

static void events_have_the_names_of_this_protocol(void **state)
{
    static const struct {
        struct board_event event;
        const char *text;
    } cases[] = {
        {{.kind = BOARD_EVENT_MODE, .axis = 1, .a = COMPACT_OFF, .b = COMPACT_VOLTAGE},
         "axis 1 from off to voltage mode"},
        {{.kind = BOARD_EVENT_MODE, .a = COMPACT_CURRENT, .b = COMPACT_FAULT},
         "axis 0 from current to fault mode"},
        {{.kind = BOARD_EVENT_TIMEOUT, .a = COMPACT_VOLTAGE},
         "axis 0: the voltage command timed out, reference set to 0"},
        {{.kind = BOARD_EVENT_FAULT, .a = COMPACT_FAULT_TEMPERATURE},
         "axis 0 has a fault: temperature"},
        {{.kind = BOARD_EVENT_LIMIT, .a = (uint32_t)-200100},
         "axis 0 is beyond its position limit at -200100 x 1e-5 rad, only commands that lead back "
         "are obeyed"},
    };
    char text[256];
    struct board_bench bench;

    (void)state;
    start(&bench);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        board_event_format(bench.boards, &cases[i].event, text, sizeof text);
        assert_string_equal(strstr(text, "): ") + 3, cases[i].text);
    }
    bench_stop(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(identifiers_are_apart_and_ordered_by_urgency),
        cmocka_unit_test(discovery_tells_kind_axes_and_first_slot),
        cmocka_unit_test(telemetry_carries_position_deflection_current_and_torque),
        cmocka_unit_test(telemetry_reads_bit_for_bit_as_documented),
        cmocka_unit_test(an_fd_frame_carries_all_axes_of_a_board),
        cmocka_unit_test(the_mode_frame_reaches_the_slots_that_it_names),
        cmocka_unit_test(voltages_are_2_mv_a_count_and_short_frames_leave_slots_alone),
        cmocka_unit_test(an_fd_frame_on_a_classic_bus_is_foreign),
        cmocka_unit_test(a_stale_command_becomes_0_volts_and_is_told),
        cmocka_unit_test(faults_open_the_bridge_until_the_host_says_off),
        cmocka_unit_test(beyond_a_limit_only_the_way_back_is_obeyed),
        cmocka_unit_test(state_comes_every_50_ms_and_says_how_many_commands_came),
        cmocka_unit_test(force_and_moment_are_cut_at_the_full_scale),
        cmocka_unit_test(parameters_are_read_written_and_refused),
        cmocka_unit_test(telemetry_has_the_period_that_the_host_sets),
        cmocka_unit_test(what_is_saved_survives_a_restart),
        cmocka_unit_test(a_board_that_boots_is_silent),
        cmocka_unit_test(a_classic_half_leg_fits_1_mbit_at_1_khz),
        cmocka_unit_test(events_have_the_names_of_this_protocol),
        cmocka_unit_test(a_wrong_configuration_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
