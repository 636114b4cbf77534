/* SPDX-License-Identifier: Apache-2.0 */
/* Moteus controllers against frames written by hand from the documents "CAN Protocol" and
 * "Register Reference" of github.com/mjbots/moteus (firmware 1.1.0): subframes, scales,
 * modes, watchdog, faults, paths. */
#include "base/array.h"
#include "tests/unit/boards/board_bench.h"

#define OHM 0.8
#define HENRY 0.0004
#define BEMF 4.0 /* V s/rad and N m/A, at the link */

static const struct boards_bus_config buses[BENCH_BUSES] = {
    {.protocol = &protocol_moteus, .fd = true}, {.protocol = &protocol_icub}};

/* bus 0: controllers 1 (joint 0) and 9 (joint 1); bus 1: an iCub board. */
static void configure(struct board_bench *bench)
{
    bench_configure(bench);
    for (int i = 0; i < 2; i++) {
        struct board_axis_config *axis = &bench->board[i].axis[0];

        bench->board[i] = bench_motor(i ? "knee" : "hip", 0, i ? 9 : 1, i, -1);
        axis->gear = 10.0;
        axis->winding_ohm = OHM;
        axis->winding_h = HENRY;
        axis->bemf_v_s_rad = axis->torque_nm_a = BEMF;
        axis->temperature_limit_c = 90.0;
    }
    bench->board[2] = bench->board[4];
    bench->config.nboard = 3;
    bench->config.bus = buses;
    bench->sense[0].winding_c = bench->sense[1].winding_c = 20.0;
}

static inline void set_up(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
}

/* A frame of CAN FD with bit rate switch arrives. */
static void say(struct board_bench *bench, uint32_t id, const char *hex)
{
    struct bus_frame frame = {.id = id,
                              .flags = FRAME_FD | FRAME_BRS | (id > 0x7ff ? FRAME_EXTENDED : 0)};

    frame.len = bench_bytes(hex, frame.data);
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
}

static void expect(const struct board_bench *bench, uint32_t id, unsigned flags, const char *hex)
{
    const struct bus_frame *frame = bench_find(bench, 0, id);
    uint8_t data[64], len = bench_bytes(hex, data);

    assert_int_equal(bench_sent(bench, 0, id), 1);
    assert_int_equal(frame->flags, flags);
    if (frame->len != len || memcmp(frame->data, data, len) != 0) {
        for (int i = 0; i < frame->len; i++) {
            print_error("%02X ", frame->data[i]);
        }
        fail_msg("is not %s", hex);
    }
}

/* Controller 1 is asked by the host 0 and answers in the next tick. */
static void ask(struct board_bench *bench, const char *request, const char *reply)
{
    say(bench, 0x8001, request);
    bench_tick(bench);
    expect(bench, 0x100, FRAME_FD | FRAME_BRS, reply);
}

/* Repeats a frame without a reply every millisecond. */
static void keep(struct board_bench *bench, const char *hex, int ticks)
{
    while (ticks-- > 0) {
        say(bench, 0x0001, hex);
        bench_tick(bench);
    }
}

/* A command takes effect behind its frame, so that what the frame reads is as before. */
static void command(struct board_bench *bench, const char *hex)
{
    keep(bench, hex, 1);
}

/* Returns a register of controller 1 as a float. */
static double value_of(struct board_bench *bench, unsigned number)
{
    char request[16];
    uint32_t bits;
    float value;

    if (number < 0x80) {
        snprintf(request, sizeof request, "1D %02X", number);
    } else {
        snprintf(request, sizeof request, "1D %02X %02X", (number & 0x7f) | 0x80, number >> 7);
    }
    say(bench, 0x8001, request);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x100), 1);
    bits = get_u32_le(bench_find(bench, 0, 0x100)->data + (number < 0x80 ? 2 : 3));
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

BENCH(set_up, struct board_bench, bench_stop)

TEST_ON(the_example_of_the_document, set_up, bench)
{
    bench->sense[0].qm = 0.008003 * 2.0 * M_PI; /* 80 of 0.0001 turn */
    bench->sense[0].current_a = -1.442 / BEMF;  /* -144 of 0.01 N m */
    bench->sensors.supply_v = 12.0;
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F", 20); /* position, NaN: it is about to go on */
    ask(bench, "01 00 0A 07 20 60 00 20 01 50 FF 14 04 00 13 0D",
        "24 04 00 0A 00 50 00 00 00 70 FF 23 0D 18 14 00");
    /* what was commanded: 96 of 0.0001 turn, 288 of 0.00025 turn/s, -176 of 0.01 N m */
    assert_near(value_of(bench, 0x020), 0.0096, 1e-7);
    assert_near(value_of(bench, 0x021), 0.072, 1e-7);
    assert_near(value_of(bench, 0x022), -1.76, 1e-6);
}

TEST_ON(a_value_comes_in_each_type_by_its_scale, set_up, bench)
{
    bench->sense[0].qm = -0.25001 * 2.0 * M_PI;
    bench->sense[0].current_a = 1.2501;
    bench_tick(bench);
    bench_ticks(bench, 60); /* the velocity comes to rest */
    ask(bench, "11 01 15 01 19 01", "21 01 E7 25 01 3C F6 29 01 57 9E FF FF 50 50 50");
    ask(bench, "11 04 15 04 19 04", "21 04 01 25 04 0C 00 29 04 E2 04 00 00 50 50 50");
    ask(bench, "11 0D 15 0D 19 0D", "21 0D 60 25 0D E0 01 29 0D 7F BB 00 00 50 50 50");
    /* 47999: 48 / 0.001 in floats, cut off */
    /* scales: 1 in each type; the current position by the lowest integer and by NaN */
    ask(bench, "01 00 00 01 20 80 11 23 15 23 19 23 1D 23 50 50 50",
        "21 23 7F 25 23 FF 7F 29 23 FF FF FF 7F 2D 23 00 00 80 3F 50");
    ask(bench, "11 20 15 20 19 20 1D 20",
        "21 20 80 25 20 00 80 29 20 00 00 00 80 2D 20 00 00 C0 7F "
        "50");
    /* beyond what an integer holds it stays at the end that is no NaN */
    bench->sense[0].qm = 400.0 * 2.0 * M_PI;
    bench_tick(bench);
    ask(bench, "11 01 15 01", "21 01 7F 25 01 FF 7F");
    bench->sense[0].qm = -400.0 * 2.0 * M_PI;
    bench_tick(bench);
    ask(bench, "11 01 15 01", "21 01 81 25 01 01 80");
}

TEST_ON(what_does_not_exist_is_an_error_in_the_reply, set_up, bench)
{
    ask(bench, "01 08 00 01 0F 00 11 0F", "30 08 01 30 0F 02 21 0F 00 50 50 50");
    ask(bench, "11 0F 11 08 11 0F", "21 0F 00 31 08 01");          /* the rest is not read */
    ask(bench, "12 0F", "31 10 01");                               /* none of a part */
    ask(bench, "11 81 02", "31 81 02 01");                         /* a version is an int32 */
    ask(bench, "1A 81 02", "2A 81 02 00 01 01 00 05 00 00 00 50"); /* 1.1.0, map 5 */
    ask(bench, "01 00 05 01 00 10 01 00 FF", "30 00 01 30 00 01 30 00 01 50 50 50");
    ask(bench, "40 01 11 0F", ""); /* a diagnostic stream */
    ask(bench, "11", "");
    assert_int_equal(bench_counters(bench).unknown, 6);
    assert_int_equal(bench_counters(bench).malformed, 1);
    assert_near(value_of(bench, 0), 0.0, 0.0); /* stopped, as before */
}

/* What Controller.make_write_gpio, make_read_gpio, make_aux_pwm and make_set_trim send, and replies
 * by the scales of the firmware. */
TEST_ON(the_pins_of_the_ports_are_registers, set_up, bench)
{
    static const struct {
        const char *request, *reply;
    } rows[] = {
        {"12 5E", "22 5E 00 00"},
        {"02 5C 05 1F 12 5E", "22 5E 05 1F"}, /* outputs: their command is their status */
        {"01 5C E2 13 5C 11 5F", "23 5C 02 1F 02 21 5F 1F"}, /* five pins a port */
        {"0D 5D 00 00 C0 7F 12 5C", "22 5C 02 00"},
        {"05 5D 01 01 16 5E", "26 5E 02 00 01 00"},
        {"01 5E 01 01 60 01 01 71 FB 11 71", "30 5E 02 30 60 02 21 71 FB 50 50 50"},
        {"09 71 03 00 00 00 19 71", "29 71 03 00 00 00"},
        /* a part of the supply: kept within 0 to 1, in any mode, also over a new command */
        {"0D 76 00 00 00 3F 1D 76", "2D 76 00 00 00 3F"},
        {"01 77 40 05 78 00 40 11 77 15 78", "21 77 40 25 78 00 40"},
        {"0E 7E 00 00 00 40 00 00 80 BF 12 7E", "22 7E 7F 00"},
        {"0D 7B 00 00 C0 7F 11 7B", "21 7B 7F"},
        {"01 00 00 11 76 11 77 11 7E", "21 76 3F 21 77 40 21 7E 7F 50 50 50"},
        /* nothing is connected: analog inputs, PWM inputs, encoder 2 */
        {"10 05 60", "20 05 60 00 00 00 00 00"},
        {"10 05 68", "20 05 68 00 00 00 00 00"},
        {"14 04 72", "24 04 72 00 00 00 80 00 00 00 80 50"},
        {"12 54 11 56", "22 54 00 00 31 56 01"},
        {"11 65 11 00", "31 65 01"},
        {"01 72 01", "30 72 02"},
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        ask(bench, rows[i].request, rows[i].reply);
    }
}

TEST_ON(a_reply_goes_to_who_asks_in_the_format_of_the_question, set_up, bench)
{
    struct bus_frame frame = {.id = 0x8109, .flags = FRAME_EXTENDED, .len = 2, .data = {0x11, 0}};

    say(bench, 0x0001, "11 00");
    bench_tick(bench);
    assert_int_equal(bench->count[0], 0); /* no reply is wanted */
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    bench_tick(bench);
    expect(bench, 0x901, FRAME_EXTENDED, "21 00 00"); /* from 9 to 1, classic */
    frame.data[0] = 0x1c;
    frame.data[1] = 3;
    frame.data[2] = 1;
    frame.len = 3;
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    bench_tick(bench);
    assert_int_equal(bench_find(bench, 0, 0x901)->flags, FRAME_EXTENDED | FRAME_FD);
    /* a prefix, an address of nobody, the broadcast */
    say(bench, 0x18001, "11 00");
    say(bench, 0x8002, "11 00");
    assert_int_equal(bench_counters(bench).foreign, 2);
    say(bench, 0x807f, "50");
    bench_tick(bench);
    expect(bench, 0x100, FRAME_FD | FRAME_BRS, "");
    expect(bench, 0x900, FRAME_FD | FRAME_BRS | FRAME_EXTENDED, "");
}

TEST_ON(a_uuid_selects_a_controller, set_up, bench)
{
    char masked[64];
    const uint8_t *uuid;

    say(bench, 0x807f, "18 04 D0 02 11 D8 02");
    bench_tick(bench);
    assert_int_equal(bench_find(bench, 0, 0x900)->data[23], 1); /* it can be selected */
    uuid = bench_find(bench, 0, 0x900)->data + 4;
    assert_memory_not_equal(uuid, bench_find(bench, 0, 0x100)->data + 4, 16);
    snprintf(masked, sizeof masked, "09 D4 02 %02X %02X %02X %02X 01 00 0F 11 0D", uuid[0], uuid[1],
             uuid[2], uuid[3]);
    say(bench, 0x807f, masked);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x100), 0);
    expect(bench, 0x900, FRAME_FD | FRAME_BRS | FRAME_EXTENDED, "21 0D 60");
    bench_ticks(bench, 10);
    assert_true(bench->motor[1].bridge_on); /* the brake */
    assert_false(bench->motor[0].bridge_on);
}

TEST_ON(a_drive_needs_some_milliseconds_to_begin, set_up, bench)
{
    command(bench, "01 00 08 0D 1B 00 00 40 C1"); /* -12 V */
    ask(bench, "11 00", "21 00 03");              /* it calibrates */
    assert_false(bench->motor[0].bridge_on);
    bench_ticks(bench, 10);
    ask(bench, "11 00", "21 00 08");
    assert_true(bench->motor[0].bridge_on);
    assert_near(bench->motor[0].voltage_v, -12.0, 1e-9);
    bench_ticks(bench, 1000); /* voltages know no watchdog */
    assert_near(bench->motor[0].voltage_v, -12.0, 1e-9);
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    assert_false(bench->motor[0].bridge_on);
}

TEST_ON(a_torque_is_a_current, set_up, bench)
{
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F", 20);
    /* 12 N m, both gains scaled to 0 */
    command(bench, "01 00 0A 0D 22 00 00 40 41 02 23 00 00");
    assert_near(bench_lacking_a(bench, 0), 3.0, 1e-6);
    ask(bench, "11 00 15 34", "21 00 0A 25 34 B0 04");
    /* as many amperes, and no more than the rig allows, 12 A */
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    keep(bench, "01 00 09 0D 1C 00 00 40 40", 12);
    ask(bench, "11 0F", "21 0F 00");
    command(bench, "01 00 09 0D 1C 00 00 C8 42");
    ask(bench, "11 0F", "21 0F 63");
}

/* Position errors become torque by kp, and velocities by kd; max torque holds. */
TEST_ON(the_position_loop_pulls_back, set_up, bench)
{
    const double kd = BEMF * BEMF / OHM * 2.0 * M_PI, kp = 40.0 * kd; /* of a turn */

    /* at 0, held; then it is 0.01 turn away, at rest again after some time */
    keep(bench, "01 00 0A 0D 20 00 00 00 00", 20);
    bench->sense[0].qm = 0.01 * 2.0 * M_PI;
    keep(bench, "01 00 0A 0D 20 00 00 00 00", 60);
    assert_near(value_of(bench, 0x03b), 0.01, 1e-5);
    assert_near(value_of(bench, 0x030), -kp * 0.01, 0.01);
    assert_near(value_of(bench, 0x034), -kp * 0.01, 0.01);
    keep(bench, "01 00 0A 0D 20 00 00 00 00 0D 25 00 00 00 40", 2); /* at most 2 N m */
    assert_near(value_of(bench, 0x034), -2.0, 1e-6);
    ask(bench, "11 0F", "21 0F 66");                       /* 102: the torque limits it */
    keep(bench, "01 00 0A 0D 20 00 00 00 00 01 23 3F", 2); /* 63 of 127 */
    assert_near(value_of(bench, 0x030), -kp * 0.01 * 63.0 / 127.0, 0.01);
    /* within 0.02 turn nothing pulls, beyond it does */
    keep(bench, "01 00 0D 0E 40 0A D7 A3 BC 0A D7 A3 3C", 2);
    assert_near(value_of(bench, 0x034), 0.0, 1e-9);
    bench->sense[0].qm = 0.03 * 2.0 * M_PI;
    keep(bench, "01 00 0D 0E 40 0A D7 A3 BC 0A D7 A3 3C", 60);
    assert_near(value_of(bench, 0x034), -kp * 0.01, 0.05);
}

TEST_ON(a_command_is_valid_until_the_watchdog, set_up, bench)
{
    struct board_event event;

    keep(bench, "01 00 0A 0D 20 00 00 C0 7F 0D 22 00 00 00 41", 20);
    bench_ticks(bench, 98);
    ask(bench, "11 00", "21 00 0A");
    bench_ticks(bench, 3);
    ask(bench, "11 00", "21 00 0B");
    assert_true(bench_event(bench, BOARD_EVENT_TIMEOUT, &event));
    assert_int_equal(event.a, 10);
    assert_int_equal(bench_counters(bench).timeouts, 1);
    /* it brakes: 5 N m at the most against the motion, and no more is obeyed but a stop */
    for (int i = 1; i <= 100; i++) {
        bench->sense[0].qm = i * 2e-3;
        bench_tick(bench);
    }
    assert_true(bench->motor[0].bridge_on);
    assert_near(value_of(bench, 0x034), -5.0, 1e-6);
    command(bench, "01 00 0A");
    ask(bench, "11 00", "21 00 0B");
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F", 20);
    ask(bench, "11 00", "21 00 0A");
    /* 20 ms of its own; NaN: never */
    command(bench, "01 00 0A 0D 20 00 00 C0 7F 05 27 14 00");
    bench_ticks(bench, 18);
    ask(bench, "11 00", "21 00 0A");
    bench_ticks(bench, 3);
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F 05 27 00 80", 20);
    bench_ticks(bench, 5000);
    ask(bench, "11 00", "21 00 0A");
}

TEST_ON(between_its_bounds_only_the_feedforward_acts, set_up, bench)
{
    /* Bounds, turns. The motor at 0.05 turn is between, below and above them */
    static const struct {
        float lower, upper;
        double position; /* of the spring, rad; NAN = none */
    } rows[] = {{-1.0F, 1.0F, NAN}, {0.125F, 1.0F, 0.25 * M_PI}, {-1.0F, 0.0F, 0.0}};

    bench->sense[0].qm = 0.1 * M_PI;
    bench_ticks(bench, 60);
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        const struct current_law *law = &bench->command.motor[0].law;
        const bool free = isnan(rows[i].position);
        uint8_t bytes[8];
        char text[64];

        memcpy(bytes, &rows[i].lower, 4);
        memcpy(bytes + 4, &rows[i].upper, 4);
        snprintf(text, sizeof text,
                 "01 00 0D 0E 40 %02X %02X %02X %02X %02X %02X %02X %02X 0D 42 00 00 00 3F",
                 bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]);
        keep(bench, text, 20);
        assert_true(law->on);
        assert_near(law->current_a, 0.5 / BEMF, 1e-6);
        assert_true(free == (law->stiffness_a_rad == 0.0) && free == (law->damping_a_s_rad == 0.0));
        assert_true(free || fabs(law->position_rad - rows[i].position) < 1e-3);
    }
}

TEST_ON(a_fault_stays_until_a_stop, set_up, bench)
{
    static const struct {
        const char *name, *reply;
        double supply_v, winding_c, qm, current_a;
    } cases[] = {{"over-voltage", "21 00 01 21 0F 22", 61.0, 20.0, 0.0, 0.0},
                 {"under-voltage", "21 00 01 21 0F 28", 3.9, 20.0, 0.0, 0.0},
                 {"over-temperature", "21 00 01 21 0F 26", 48.0, 91.0, 0.0, 0.0},
                 {"encoder", "21 00 01 21 0F 23", 48.0, 20.0, (double)NAN, 0.0},
                 {"current sensor", "21 00 01 21 0F 23", 48.0, 20.0, 0.0, (double)INFINITY}};
    struct board_event event;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        keep(bench, "01 00 0A 0D 20 00 00 C0 7F", 20);
        assert_true(bench->motor[0].bridge_on);
        bench->sensors.supply_v = cases[i].supply_v;
        bench->sense[0].winding_c = cases[i].winding_c;
        bench->sense[0].qm = cases[i].qm;
        bench->sense[0].current_a = cases[i].current_a;
        bench_ticks(bench, 2);
        bench->sensors.supply_v = 48.0;
        bench->sense[0] = (struct motor_sense){.winding_c = 20.0};
        bench_ticks(bench, 2);
        assert_false(bench->motor[0].bridge_on);
        assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
        assert_true(boards_fault(bench->boards));
        command(bench, "01 00 0A");
        ask(bench, "11 00 11 0F", cases[i].reply);
        command(bench, "01 00 00");
        ask(bench, "11 00 11 0F", "21 00 00 21 0F 00");
    }
    /* Outside of its limits, 2.5 rad, it does not begin, unless it is told to ignore them */
    bench->sense[0].qm = 2.6;
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F", 20);
    ask(bench, "11 00 11 0F", "21 00 01 21 0F 27");
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    keep(bench, "01 00 0A 0D 20 00 00 C0 7F 01 2D 01", 20);
    ask(bench, "11 00", "21 00 0A");
    command(bench, "01 00 00");
    ask(bench, "11 00", "21 00 00");
    bench->sense[0].qm = 0.0;
}

/* A stop position is refused with a limit of speed or acceleration, also the default one; in other
 * modes it has no meaning. */
TEST_ON(a_stop_position_needs_both_limits_lifted, set_up, bench)
{
    static const struct {
        const char *command, *reply;
    } cases[] = {
        {"01 00 0A 0D 26 00 00 00 00", "21 00 01 21 0F 2D"},
        {"01 00 0A 0D 26 00 00 00 00 0D 28 00 00 80 BF", "21 00 01 21 0F 2D"},
        {"01 00 0A 0D 26 00 00 00 00 0D 29 00 00 80 BF", "21 00 0A 21 0F 00"}, /* no speed limit */
        {"01 00 0A 0D 26 00 00 00 00 0E 28 00 00 00 40 00 00 80 BF", "21 00 01 21 0F 2D"},
        {"01 00 0A 0D 26 00 00 00 00 0E 28 00 00 80 BF 00 00 80 BF", "21 00 0A 21 0F 00"},
        {"01 00 0A 0D 26 00 00 C0 7F", "21 00 0A 21 0F 00"},
        {"01 00 0C 0D 26 00 00 00 00", "21 00 0C 21 0F 00"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        keep(bench, cases[i].command, 20);
        ask(bench, "11 00 11 0F", cases[i].reply);
        command(bench, "01 00 00");
        ask(bench, "11 00 11 0F", "21 00 00 21 0F 00");
    }
}

/* From 0 with 1 turn/s to the stop at 0.125 turn, and from there back with -1 turn/s to -0.125. */
TEST_ON(a_velocity_ends_at_the_stop_position, set_up, bench)
{
    keep(bench, "01 00 0A", 20);
    for (int back = 0; back < 2; back++) {
        const char *moves = back ? "01 00 0A 0E 20 00 00 C0 7F 00 00 80 BF 0D 26 00 00 00 BE "
                                   "0E 28 00 00 80 BF 00 00 80 BF"
                                 : "01 00 0A 0E 20 00 00 C0 7F 00 00 80 3F 0D 26 00 00 00 3E "
                                   "0E 28 00 00 80 BF 00 00 80 BF";
        double way = back ? -0.25 : 0.125;

        keep(bench, moves, back ? 200 : 100);
        assert_near(value_of(bench, 0x038), back ? -0.075 : 0.1, 0.003);
        assert_near(value_of(bench, 0x039), way > 0.0 ? 1.0 : -1.0, 1e-6);
        keep(bench, moves, 100);
        assert_near(value_of(bench, 0x038), back ? -0.125 : 0.125, 1e-6);
        assert_true(value_of(bench, 0x039) == 0.0);
    }
}

/* Both encoders have a speed: the motor's of the output, the link's of the joint. */
TEST_ON(each_encoder_tells_its_own_speed, set_up, bench)
{
    for (int t = 0; t < 100; t++) {
        bench->sense[0].qm = 2.0 * M_PI * 2e-3 * t; /* 2 turn/s */
        bench->sense[0].q = 2.0 * M_PI * 0.5e-3 * t;
        bench_tick(bench);
    }
    assert_near(value_of(bench, 0x051), 2.0, 0.02);
    bench->sense[0].q += 2.0 * M_PI * 0.5e-3;
    assert_near(value_of(bench, 0x053), 0.5, 0.3);
}

/* With an acceleration of 1 turn/s2 a quarter of a turn takes 1 s: half of it up to 0.5 turn/s. */
TEST_ON(a_path_keeps_to_its_limits, set_up, bench)
{
    static const char quarter[] = "01 00 0A 0D 20 00 00 80 3E 0D 29 00 00 80 3F 02 23 00 00 "
                                  "1E 38 11 0B";
    double fastest = 0.0, before = 0.0;
    int done = 0;

    keep(bench, "01 00 0A 0D 20 00 00 00 00", 20);
    for (int t = 0; t < 1100; t++) {
        const uint8_t *reply;
        float path[2]; /* position, velocity of the tick before */

        say(bench, 0x8001, quarter);
        bench_tick(bench);
        assert_int_equal(bench_sent(bench, 0, 0x100), 1);
        reply = bench_find(bench, 0, 0x100)->data;
        memcpy(path, reply + 2, sizeof path);
        assert_true(fabs((double)path[1] - before) <= 2.001e-3); /* the last step is cut short */
        before = (double)path[1];
        fastest = fmax(fastest, before);
        if (t == 500) {
            assert_near((double)path[0], 0.125, 0.001);
        }
        done = done == 0 && t > 0 && reply[12] == 1 ? t : done;
    }
    assert_near(fastest, 0.5, 0.002);
    assert_in_range(done, 995, 1010);
    assert_near(value_of(bench, 0x038), 0.25, 1e-6);
    /* a velocity alone, at most 0.2 turn/s */
    keep(bench, "01 00 0A 0E 20 00 00 C0 7F 00 00 80 3F 0D 28 CD CC 4C 3E 02 23 00 00", 100);
    assert_near(value_of(bench, 0x039), 0.2, 1e-6);
    /* without limits at once */
    keep(bench, "01 00 0A 0D 20 00 00 00 3E 0D 28 00 00 80 BF 0D 29 00 00 80 BF 02 23 00 00", 1);
    assert_near(value_of(bench, 0x038), 0.125, 1e-6);
}

TEST_ON(the_position_can_be_set, set_up, bench)
{
    bench->sense[0].qm = 0.33 * 2.0 * M_PI;
    bench->sense[0].q = -0.25 * 2.0 * M_PI;
    bench_tick(bench);
    assert_near(value_of(bench, 0x001), 0.33, 1e-5);
    assert_near(value_of(bench, 0x006), 0.75, 1e-4); /* the link, within a turn */
    assert_near(value_of(bench, 0x050), 0.3, 1e-3);  /* the rotor, gear 10 */
    say(bench, 0x0001, "0D B1 02 00 00 00 3F");      /* exactly 0.5 */
    bench_tick(bench);
    assert_near(value_of(bench, 0x001), 0.5, 1e-6);
    say(bench, 0x0001, "0D B0 02 00 00 00 00"); /* the nearest to 0 that a rotor's turn allows */
    bench_tick(bench);
    assert_near(value_of(bench, 0x001), 0.0, 1e-6);
    say(bench, 0x0001, "0D B0 02 C3 F5 A8 3E"); /* to 0.33 */
    bench_tick(bench);
    assert_near(value_of(bench, 0x001), 0.3, 1e-6);
}
