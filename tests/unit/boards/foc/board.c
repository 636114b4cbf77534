/* SPDX-License-Identifier: Apache-2.0 */
/* A bus of 2FOC boards: configuration, targets, answers, modes, limits and faults. */
#include "tests/unit/boards/foc/foc_bench.h"

TEST_ON(every_target_is_answered_by_every_board_with_two_frames, start, bench)
{
    bench_tick(bench);
    assert_null(bench_find(bench, 0, 0x110)); /* silence without targets */
    bench->sense[0].qm = 2.0 * M_PI / GEAR;   /* one revolution of the rotor */
    bench->sense[0].current_a = -1.234;
    bench_tick(bench);
    bench_ticks(bench, 40); /* the estimate of the velocity comes to rest */
    target(bench, "00 00 00 00 00 00 00 00");
    bench_expect(bench, 0, 0x110, "2E FB 00 00 00 00 01 00");
    bench_expect(bench, 0, 0x113, "00 00 00 00 00 00 00 00");
    bench_expect(bench, 0, 0x130, "00 00 00 00 00 00 00 00");
    bench_expect(bench, 0, 0x133, "00 00 00 00 00 00 00 00");
    bench_send(bench, 0, 0x10f, "00 00 00 00 00 00 00 00");
    target(bench, "00 00 00 00 00 00 00 00");
    assert_int_equal(bench_sent(bench, 0, 0x110), 2);
    /* a frame of two targets is none for address 3 */
    target(bench, "00 00 00 00");
    assert_int_equal(bench_sent(bench, 0, 0x110), 1);
    assert_int_equal(bench_sent(bench, 0, 0x130), 0);
    assert_int_equal(bench_counters(bench).malformed, 1);
    for (int i = 0; i < 20; i++) {
        bench_send(bench, 0, 0x10f, "00 00 00 00 00 00 00 00");
    }
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x110), 8); /* the board's buffer */
    assert_int_equal(bench_counters(bench).overflows, 24);
}

TEST_ON(velocity_is_in_icubdeg_a_millisecond, start, bench)
{
    for (int i = 1; i <= 30; i++) {
        bench->sense[0].qm = i * 1e-3 * 2.0; /* 2 rad/s at the link */
        bench_tick(bench);
    }
    target(bench, "00 00");
    /* 2 rad/s * 100 / 2 pi * 65.536 icubdeg/ms a rev/s = 2086; the last tick it stood */
    assert_near((double)get_i16_le(bench_find(bench, 0, 0x110)->data + 2), 2086.0 / 2.0, 10.0);
}

TEST_ON(a_board_is_idle_only_when_it_has_everything, board_bench, bench)
{
    static const char *const steps[] = {"5B 01 06", "77 01 00 10 00 00 0E",
                                        "48 00 A0 0F 40 1F 20 4E", "65 92 00 E3 00 00 00 0F"};

    for (int missing = 0; missing < 4; missing++) {
        configure(bench);
        bench_start(bench);
        for (int i = 0; i < 4; i++) {
            if (i != missing) {
                bench_send(bench, 0, 0x001, steps[i]);
            }
        }
        target(bench, "00 00");
        assert_int_equal(bench_find(bench, 0, 0x113)->data[0], 0xb0);
        enter(bench, "09 50");
        target(bench, "00 10");
        assert_int_equal(bench_find(bench, 0, 0x113)->data[0], 0xb0);
        assert_false(bench->motor[0].bridge_on);
        if (missing > 0) { /* without the protocol the rest has been refused */
            bench_say(bench, 0, 0x001, steps[missing]);
            bench_expect(bench, 0, 0x113, "00 00 00 00 00 00 00 00"); /* told unasked */
        }
    }
}

BENCH(configure, struct board_bench, bench_stop)

TEST_ON(only_the_very_protocol_is_acknowledged, configure, bench)
{
    bench_start(bench);
    bench_ask(bench, "5B 01 05", "5B 08 03 06 1F 01 06 00");
    bench_ask(bench, "5B 02 06", "5B 08 03 06 1F 01 06 00");
    bench_ask(bench, "5B 01 06", "5B 08 03 06 1F 01 06 01");
    bench_ask(bench, "07", "07 B0");
    bench_ask(bench, "33", "33 01");
}

TEST_ON(discovery_tells_a_2foc_and_asks_of_more_are_not_answered, start, bench)
{
    bench_say(bench, 0, 0x70f, "FF");
    bench_expect(bench, 0, 0x710, "FF 08 03 06 1F");
    bench_expect(bench, 0, 0x730, "FF 08 03 06 1F");
    bench_expect(bench, 0, 0x7d0, "FF 06 03 00 05"); /* the STRAIN board beside them */
    bench_say(bench, 0, 0x701, "0C");
    assert_int_equal(bench_sent(bench, 0, 0x710), 0);
    /* bit 7 of a command is no axis here, and GETs of other boards are not there */
    bench_send(bench, 0, 0x001, "89 50; 14; 51");
    assert_int_equal(bench_counters(bench).unknown, 3);
}

TEST_ON(open_loop_is_a_share_of_the_supply_up_to_95_percent, start, bench)
{
    enter(bench, "09 50");
    target(bench, "80 3E"); /* 16000: 50 % */
    assert_true(bench->motor[0].bridge_on);
    assert_near(bench->motor[0].voltage_v, 0.5 * SUPPLY_V, 1e-9);
    bench_expect(bench, 0, 0x113, "50 00 80 3E 00 00 00 00");
    target(bench, "00 83"); /* -32000 */
    assert_near(bench->motor[0].voltage_v, -0.95 * SUPPLY_V, 1e-9);
    bench_expect(bench, 0, 0x113, "50 00 40 89 00 00 00 00");
    assert_false(bench->motor[1].bridge_on);
    enter(bench, "09 00");
    target(bench, "00 10");
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench->motor[0].voltage_v == 0.0);
}

TEST_ON(a_mode_begins_with_set_point_0, board_bench, bench)
{
    static const char *const modes[] = {"09 50", "09 06", "09 0A", "09 0B", "09 01"};

    for (int m = 0; m < 5; m++) {
        start(bench);
        enter(bench, "09 50");
        target(bench, "80 3E");
        enter(bench, modes[m]);
        bench_tick(bench);
        assert_true(bench->motor[0].bridge_on);
        assert_near(bench->motor[0].law.on ? bench_lacking_a(bench, 0) : bench->motor[0].voltage_v,
                    0.0, 1e-9);
    }
}

TEST_ON(modes_that_a_2foc_has_not_are_refused, start, bench)
{
    static const char *const modes[] = {"09 02", "09 03", "09 04", "09 08", "09 60", "09 A0"};

    for (int m = 0; m < 6; m++) {
        enter(bench, modes[m]);
        target(bench, "00 10 00 00 00 00 00 00");
        assert_int_equal(bench_find(bench, 0, 0x113)->data[0], 0);
    }
    assert_int_equal(bench_counters(bench).malformed, 6);
}

TEST_ON(a_set_point_expires_after_50_ms, start, bench)
{
    struct board_event event;
    char text[256];

    enter(bench, "09 50");
    target(bench, "80 3E");
    bench_ticks(bench, 49);
    assert_true(bench->motor[0].bridge_on);
    bench_ticks(bench, 2);
    assert_false(bench->motor[0].bridge_on);
    assert_true(boards_fault(bench->boards));
    assert_true(bench_event(bench, BOARD_EVENT_TIMEOUT, &event));
    board_event_format(bench->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "axis 0: the voltage command timed out, a fault"));
    assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
    assert_int_equal(event.a, FOC_FAULT_SET_POINT_EXPIRED);
    board_event_format(bench->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "hip (bus 0, address 1): axis 0 has a fault: set-point expired"));
    target(bench, "80 3E");
    bench_expect(bench, 0, 0x113, "A0 00 00 00 00 40 00 00");
    enter(bench, "09 50"); /* no way out */
    target(bench, "00 00");
    assert_int_equal(bench_find(bench, 0, 0x113)->data[0], 0xa0);
    enter(bench, "09 09");
    target(bench, "00 00");
    bench_expect(bench, 0, 0x113, "00 00 00 00 00 00 00 00");
    bench_ticks(bench, 200); /* nothing expires in idle */
    assert_false(boards_fault(bench->boards));
}

TEST_ON(faults_have_their_bits, board_bench, bench)
{
    static const struct {
        const char *what, *status;
    } faults[] = {{"over-current", "A0 00 00 00 10 00 00 00"},
                  {"under-voltage", "A0 00 00 00 40 00 00 00"},
                  {"encoder", "A0 08 00 00 00 00 08 00"},
                  {"over-voltage", "A0 00 00 00 20 00 00 00"},
                  {"I2t", "A0 00 00 00 00 00 40 00"}};

    for (int f = 0; f < 5; f++) {
        start(bench);
        enter(bench, "09 50");
        target(bench, "00 00");
        if (f == 0) {
            bench->sense[0].current_a = -20.5; /* above the overload */
        } else if (f == 1) {
            bench->sensors.supply_v = 20.0;
        } else if (f == 2) {
            bench->sense[0].qm = (double)NAN;
        } else if (f == 3) {
            bench->sensors.supply_v = nextafter(60.0, 100.0);
        } else {
            bench->sense[0].current_a = 12.0;
        }
        /* I2t: (12^2 - 4^2) t = (8^2 - 4^2) * 10.24 s gives 3.84 s */
        for (int t = 0; t < (f < 4 ? 2 : 3830); t++) {
            target(bench, "00 00");
            assert_true(f < 4 || bench->motor[0].bridge_on);
        }
        for (int t = 0; t < 20; t++) {
            target(bench, "00 00");
        }
        bench_expect(bench, 0, 0x113, faults[f].status);
        assert_false(bench->motor[0].bridge_on);
    }
}

TEST_ON(a_current_is_for_the_drive_s_own_controller, start, bench)
{
    enter(bench, "09 06");
    target(bench, "DC 05");
    assert_near(bench_lacking_a(bench, 0), 1.5, 1e-9);
    assert_near(bench->motor[0].law.limit_a, 8.0, 1e-9); /* the peak */
}

TEST_ON(open_loop_holds_the_current_at_its_peak, start, bench)
{
    double before;

    enter(bench, "09 50");
    target(bench, "80 3E");
    before = bench->motor[0].voltage_v;
    bench->sense[0].current_a = 9.0; /* peak 8 */
    target(bench, "80 3E");
    for (int t = 0; t < 50; t++) {
        target(bench, "80 3E");
    }
    assert_true(bench->motor[0].voltage_v < before - 1.0);
    bench->sense[0].current_a = 1.0;
    for (int t = 0; t < 50; t++) {
        target(bench, "80 3E");
    }
    assert_near(bench->motor[0].voltage_v, before, 1e-9);
}

TEST(floats_set_the_same_gains_as_integers)
{
    struct board_bench a CLOSED_BY(bench_stop), b CLOSED_BY(bench_stop);

    start(&a);
    start(&b);
    bench_send(&a, 0, 0x001, "69 00 20 00 10 00 00 0F"); /* kp 0.25, ki 0.125 */
    bench_send(&b, 0, 0x001, "69 01 00 00 80 3E");       /* kp = 0.25f */
    bench_send(&b, 0, 0x001, "7D 01 03 00 00 00 00 3E"); /* ki = 0.125f */
    enter(&a, "09 0A");
    enter(&b, "09 0A");
    for (int t = 0; t < 10; t++) {
        target(&a, "F4 01");
        target(&b, "F4 01");
        assert_true(fabs(a.motor[0].voltage_v) > 0.1);
        assert_near(a.motor[0].voltage_v, b.motor[0].voltage_v, 0.001 * SUPPLY_V + 1e-9);
    }
}

/* Answers by the layouts of embot_prot_can_motor_polling (robotology/icub-firmware). Rows without a
 * command ask for what the board has after power-up and make_idle. */
TEST(settings_are_told_as_they_were_set)
{
    static const struct {
        const char *set, *get, *answer;
    } rows[] = {
        {NULL, "53", "53 00 00 00 00 00 00 00"},
        {NULL, "66", "66 92 00 E3 00 00 00 0F"},
        {NULL, "6A", "6A 0C 00 10 00 00 00 0A"},
        {NULL, "55", "55 00 00 02 00 01 00"},
        {NULL, "68", "68 00 00 1F 00 15 00"},
        {NULL, "6C", "6C 00 00 0C 00 0B 00"},
        {NULL, "7A", "7A 00 00"},
        {NULL, "7B", "7B 01 00 10 00 00 0E 24"}, /* a tolerance of 36 unless stated */
        {NULL, "7C", "7C 00 A0 0F 40 1F 20 4E"},
        {"52 01 00 FE FF 03 00 04", "53", "53 01 00 FE FF 03 00 04"},
        {"65 FF 7F 00 80 05 00 00", "66", "66 FF 7F 00 80 05 00 00"},
        {"69 01 00 02 00 FD FF 0F", "6A", "6A 01 00 02 00 FD FF 0F"},
        {"54 01 00 FE FF 03 00", "55", "55 01 00 FE FF 03 00"},
        {"67 01 00 FE FF 03 00 00", "68", "68 01 00 FE FF 03 00"},
        {"6B 01 00 FE FF 03 00", "6C", "6C 01 00 FE FF 03 00"},
        {"79 20 03", "7A", "7A 20 03"},
        /* the host's flags, also where Hall sensors exclude the others; pairs of poles */
        {"77 EF 01 02 03 04 0F 06", "7B", "7B 2F 01 02 03 04 0E 06"},
        {"48 FF 01 00 02 00 03 00", "7C", "7C 00 01 00 02 00 03 00"},
        {"48 40 1F 00 00", "7C", "7C 00 A0 0F 40 1F 20 4E"},
        /* integers and floats are the same gains; a float keeps the shift of the integers */
        {"65 20 00 10 00 04 00 06", "7E 00 02", "7E 00 02 00 00 00 00 3F"},
        {"65 20 00 10 00 04 00 06", "7E 00 03", "7E 00 03 00 00 00 80 3E"},
        {"65 20 00 10 00 04 00 06", "7E 00 04", "7E 00 04 00 00 00 80 3D"},
        {"69 20 00 10 00 04 00 06", "7E 01 04", "7E 01 04 00 00 00 80 3D"},
        {"52 20 00 10 00 04 00 06", "7E 02 03", "7E 02 03 00 00 00 80 3E"},
        {"7D 02 04 00 CD CC 4C 40", "7E 02 04", "7E 02 04 00 CD CC 4C 40"}, /* 3.2 */
        {"7D 00 02 00 33 33 53 40", "66", "66 FF 7F E3 00 00 00 0F"},       /* 3.3 * 2^15 */
        {"65 01 00 02 00 03 00 04; 7D 00 03 00 00 00 80 BF", "66", "66 01 00 F0 FF 03 00 04"},
        {"52 00 00 00 00 00 00 03; 7D 02 02 00 33 33 53 40", "53", "53 1A 00 00 00 00 00 03"},
        {"69 01 00 00 80 3E", "6A", "6A 00 01 10 00 00 00 0A"}, /* 0.25 */
        /* other parameters and loops are none that the firmware tells */
        {"7D 02 06 00 00 00 80 3F", "7E 02 06", "7E 0F 0F 00 00 00 00 00"},
        {NULL, "7E 03 02", "7E 0F 0F 00 00 00 00 00"},
        {NULL, "7E 00 01", "7E 0F 0F 00 00 00 00 00"},
    };
    struct board_bench bench;

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        start(&bench);
        if (rows[i].set) {
            bench_send(&bench, 0, 0x001, rows[i].set);
        }
        bench_ask(&bench, rows[i].get, rows[i].answer);
        assert_int_equal(bench_counters(&bench).malformed, 0);
        bench_stop(&bench);
    }
}

TEST_ON(position_mode_counts_from_where_it_began, start, bench)
{
    bench->sense[0].qm = 0.5;
    bench_ticks(bench, 2);
    bench_send(bench, 0, 0x001, "7D 02 02 00 00 00 80 3F"); /* kp 1 of +-32000 an icubdeg */
    enter(bench, "09 01");
    target(bench, "00 00");
    assert_near(bench->motor[0].voltage_v, 0.0, 1e-9);
    target(bench, "80 0C"); /* 3200: 10 % */
    assert_near(bench->motor[0].voltage_v, 0.1 * SUPPLY_V, 1e-9);
}

TEST_ON(the_index_calibrates_the_encoder, start, bench)
{
    bench_send(bench, 0, 0x001, "77 09 00 10 00 00 0E");
    target(bench, "00 00");
    assert_int_equal(bench_find(bench, 0, 0x113)->data[1], FOC_QE_NOT_CALIBRATED);
    bench->sense[0].qm = 1.01 * 2.0 * M_PI / GEAR;
    bench_tick(bench);
    target(bench, "00 00");
    assert_int_equal(bench_find(bench, 0, 0x113)->data[1], 0);
}

TEST_ON(status_can_be_thinned_out, configure, bench)
{
    size_t sent = 0;

    bench->board[0].status_period_ns = 10000000;
    bench_start(bench);
    make_idle(bench, 0x001);
    for (int t = 0; t < 100; t++) {
        target(bench, "00 00");
        sent += bench_sent(bench, 0, 0x113);
        assert_int_equal(bench_sent(bench, 0, 0x110), 1);
    }
    assert_int_equal(sent, 10);
}

/* In answers to DESIRED_TARGETS, every 200 ms of board 1 and 400 ms of board 3, of a board that has
 * a thermometer: real boards send nothing that nobody asked for. */
TEST_ON(the_temperature_comes_with_answers_of_boards_with_a_thermometer, board_bench, bench)
{
    static const struct {
        const char *motor_1, *motor_3;
        bool asked;
        size_t sent_1, sent_3;
    } cases[] = {{"77 05 00 10 00 00 0E", "77 04 00 10 00 00 0E", false, 0, 0},
                 {"77 01 00 10 00 00 0E", "77 06 00 10 00 00 0E", true, 0, 0}, /* none; Hall */
                 {"77 05 00 10 00 00 0E", "77 01 00 10 00 00 0E", true, 6, 0},
                 {"77 05 00 10 00 00 0E", "77 0D 00 10 00 00 0E", true, 6, 3}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t one = 0, three = 0;

        start(bench);
        bench_send(bench, 0, 0x001, cases[i].motor_1);
        bench_send(bench, 0, 0x003, cases[i].motor_3);
        bench->sense[0].winding_c = 41.5;
        bench_tick(bench);
        for (int t = 0; t < 1200; t++) {
            if (cases[i].asked) {
                bench_send(bench, 0, 0x10f, "00 00 00 00 00 00 00 00");
            }
            bench_tick(bench);
            if (bench_sent(bench, 0, 0x11c)) {
                assert_int_equal(bench_sent(bench, 0, 0x110), 1);
                bench_expect(bench, 0, 0x11c, "00 00 9F 01");
            }
            one += bench_sent(bench, 0, 0x11c);
            three += bench_sent(bench, 0, 0x13c);
            assert_true(cases[i].asked || bench->count[0] == 0);
        }
        assert_int_equal(one, cases[i].sent_1);
        assert_int_equal(three, cases[i].sent_3);
    }
}

TEST_ON(wrong_lengths_are_refused, start, bench)
{
    static const char *const frames[] = {"09",
                                         "09 50 00",
                                         "48 00 00 00",
                                         "48 00 A0 0F 40 1F",
                                         "65 01",
                                         "65 01 00 00 00 00 00 00 00",
                                         "77 01 00 10 00 00",
                                         "79 00",
                                         "7D 00 02",
                                         "7E 00",
                                         "7E 00 02 00",
                                         "52 01 00 FE FF 03 00",
                                         "54 01 00 FE FF 03",
                                         "53 00",
                                         "65 01 00 02 00 03 00 10" /* shift 16 */,
                                         "5B",
                                         "5B 01",
                                         "02 01 00",
                                         "72 00",
                                         "17 00 00",
                                         "65 03 00 00 80 3F",
                                         "7D 03 02 00 00 00 80 3F",
                                         "7D 00 01 00 00 00 80 3F",
                                         "65 01 00 00 C0 7F" /* not a number */,
                                         "02 09 00 00 80 3F",
                                         "32 00"};

    for (size_t i = 0; i < sizeof frames / sizeof *frames; i++) {
        struct bus_frame frame = {.id = 0x001};
        uint64_t before = bench_counters(bench).malformed;

        frame.len = bench_bytes(frames[i], frame.data);
        if (frame.len <= 8) {
            boards_receive(bench->boards, bench->now_ns, 0, &frame);
            if (bench_counters(bench).malformed != before + 1) {
                fail_msg("%s was taken", frames[i]);
            }
        }
    }
}

TEST_ON(restarting_forgets_the_configuration, start, bench)
{
    bench_send(bench, 0, 0x701, "00");
    target(bench, "00 00");
    assert_int_equal(bench_sent(bench, 0, 0x110), 0);
    bench_ticks(bench, 5001);
    target(bench, "00 00");
    assert_int_equal(bench_find(bench, 0, 0x113)->data[0], 0xb0);
}

TEST_ON(another_protocol_on_another_bus_is_not_disturbed, start, bench)
{
    bench_send(bench, 1, 0x10f, "00 10 00 10 00 10 00 10"); /* no such frame among iCub boards */
    assert_int_equal(bench_counters(bench).foreign, 1);
    bench_say(bench, 1, 0x001, "09 50; 72 35 05");
    assert_near(bench->motor[3].voltage_v, SUPPLY_V, 1e-9);
    assert_false(bench->motor[0].bridge_on);
}

/* Of a servo valve: those modes that end in a voltage. */
TEST_ON(a_valve_has_no_modes_of_current, configure, bench)
{
    bench->board[0].axis[0].valve = true;
    bench_start(bench);
    make_idle(bench, 0x001);
    enter(bench, "09 06");
    enter(bench, "09 0B");
    bench_tick(bench);
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench_counters(bench).malformed + bench_counters(bench).unknown == 2);
    enter(bench, "09 50");
    bench_tick(bench);
    assert_true(bench->motor[0].bridge_on);
    assert_true(bench_counters(bench).malformed + bench_counters(bench).unknown == 2);
}
