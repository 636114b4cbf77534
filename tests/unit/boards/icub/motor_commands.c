/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands of the motor boards and class 7, byte by byte. Every expected frame is written from the
 * protocol's message tables, none from the code.
 */
#include "tests/unit/boards/board_bench.h"

TEST_ON(discovery_finds_every_board_with_its_type, bench_open, bench)
{
    bench_say(bench, 0, 0x70f, "FF");
    assert_int_equal(bench->count[0], 4);
    assert_int_equal(bench->count[1], 0);
    bench_expect_frame(&bench->frame[0][0], 0x710, "FF 04 02 51 57");
    bench_expect_frame(&bench->frame[0][1], 0x720, "FF 04 02 51 57");
    bench_expect_frame(&bench->frame[0][2], 0x7c0, "FF 06 03 00 05");
    bench_expect_frame(&bench->frame[0][3], 0x7d0, "FF 06 03 00 05");
    /* one board alone, asked by host address 3 */
    bench_say(bench, 1, 0x731, "FF");
    bench_expect(bench, 1, 0x713, "FF 04 02 51 57");
}

TEST_ON(firmware_version_has_protocol_and_acknowledge, bench_open, bench)
{
    bench_ask(bench, "5B 01 06", "5B 04 02 51 57 01 06 01");
    bench_ask(bench, "DB 01 06", "DB 04 02 51 57 01 06 01"); /* the other axis */
    bench_ask(bench, "5B 01 05", "5B 04 02 51 57 01 06 01"); /* the host is older */
    bench_ask(bench, "5B 01 07", "5B 04 02 51 57 01 06 00");
    bench_ask(bench, "5B 02 00", "5B 04 02 51 57 01 06 00");
    bench_ask(bench, "5B 00 00", "5B 04 02 51 57 01 06 00");
}

TEST_ON(additional_information_is_read_and_written_in_eight_parts, bench_open, bench)
{
    static const char *const parts[] = {"0C 00 6C 65 67 20", "0C 01 31 00 00 00"}; /* "leg 1" */

    bench_say(bench, 0, 0x701, "0C");
    assert_int_equal(bench->count[0], 8);
    bench_expect_frame(&bench->frame[0][0], 0x710, parts[0]);
    bench_expect_frame(&bench->frame[0][1], 0x710, parts[1]);
    bench_expect_frame(&bench->frame[0][7], 0x710, "0C 07 00 00 00 00");
    bench_send(bench, 0, 0x701, "0D 07 61 62 63 64");
    bench_send(bench, 0, 0x001, "0D 00 41 42 43 44"); /* class 0 has the same */
    bench_send(bench, 0, 0x701, "0D 08 41 42 43 44"); /* no such part */
    bench_say(bench, 0, 0x001, "0C");
    assert_int_equal(bench->count[0], 8);
    bench_expect_frame(&bench->frame[0][0], 0x010, "0C 00 41 42 43 44");
    bench_expect_frame(&bench->frame[0][7], 0x010, "0C 07 61 62 63 64");
    assert_int_equal(bench_counters(bench).malformed, 1);
}

TEST_ON(replies_go_to_whoever_asked, bench_open, bench)
{
    bench_say(bench, 0, 0x052, "33");
    bench_expect(bench, 0, 0x025, "33 02");
}

TEST_ON(replies_keep_the_order_of_requests, bench_open, bench)
{
    bench_send(bench, 0, 0x002, "33");
    bench_send(bench, 0, 0x20d, "1B");
    bench_send(bench, 0, 0x001, "33");
    bench_say(bench, 0, 0x002, "B3");
    assert_int_equal(bench->count[0], 4);
    bench_expect_frame(&bench->frame[0][0], 0x020, "33 02");
    bench_expect_frame(&bench->frame[0][1], 0x2d0, "1B 01");
    bench_expect_frame(&bench->frame[0][2], 0x010, "33 01");
    bench_expect_frame(&bench->frame[0][3], 0x020, "B3 02");
}

/* Every SET with the GET that gives it back; replies must not be those of power-up. */
static const struct {
    const char *set, *get, *reply;
} pairs[] = {
    {"15 11 22 33 04", "16", "16 11 22 33 04"},
    {"17 34 12", "18", "18 34 12"},
    {"19 FE FF", "1A", "1A FE FF"},
    {"1E 10 27", "1F", "1F 10 27"},
    {"20 F0 D8", "21", "21 F0 D8"},
    {"22 01 00", "23", "23 01 00"},
    {"24 64 00", "25", "25 64 00"},
    {"26 CE FF", "27", "27 CE FF"},
    {"28 05 00", "29", "29 05 00"},
    {"2A 20 03", "2B", "2B 20 03"},
    {"2C E8 03 00 00", "2D", "2D E8 03 00 00"},
    {"2C 00 00 01 00", "2D", "2D FF 7F 00 00"}, /* clamped to 16 bits */
    {"2C 00 00 00 80", "2D", "2D 00 80 FF FF"},
    {"2F 58 02", "30", "30 58 02"},
    {"40 00 E0 FF FF", "41", "41 00 E0 FF FF"},
    {"42 00 20 01 00", "43", "43 00 20 01 00"},
    {"44 40 01", "45", "45 40 01"},
    {"4E 01 00 02 00 03 00 04", "4F", "4F 01 00 02 00 03 00 04"},
    {"50 01 00 02 00 03 00", "51", "51 01 00 02 00 03 00"},
    {"50 05 00 06 00 07 00 00", "51", "51 05 00 06 00 07 00"}, /* as hosts pad it */
    {"52 0A 00 0B 00 0C 00 0D", "53", "53 0A 00 0B 00 0C 00 0D"},
    {"54 0E 00 0F 00 10 00", "55", "55 0E 00 0F 00 10 00"},
    {"57 E8 03 F4 01 00 00 00", "58", "58 E8 03 F4 01 00 00 00"},
    {"59 9C FF", "5A", "5A 9C FF"},
    {"5D 0A 00 F6 FF", "5E", "5E 0A 00 F6 FF"},
    {"5F 0B 00 F5 FF", "60", "60 0B 00 F5 FF"},
    {"61 01 00 02 03 00 04", "62", "62 01 00 02 03 00 04 00"},
    {"63 07 00 00 00 00 00 00", "64", "64 07 00 00 00 00 00 00"},
    {"65 01 00 02 00 03 00 04", "66", "66 01 00 02 00 03 00 04"},
    {"70 01 02 03 04 05 06 07", "71", "71 01 02 03 04 05 06 07"},
    {"72 4D 01", "73", "73 4D 01"},
    {"72 CB FA", "73", "73 CB FA"},
    {"74 01", "75", "75 01 00"},
    {"76 03", "78", "78 03"},
    {"79 39 05", "7A", "7A 39 05"},
};

static void with_axis_bit(const char *hex, char *text, size_t size)
{
    snprintf(text, size, "%02lX%s", strtoul(hex, NULL, 16) | 0x80, hex + 2);
}

TEST_ON(every_set_is_given_back_by_its_get_on_either_axis, bench_open, bench)
{
    char set[64], get[64], reply[64];

    bench_tick(bench);
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        bench_send(bench, 0, 0x001, pairs[i].set);
        bench_ask(bench, pairs[i].get, pairs[i].reply);
        with_axis_bit(pairs[i].set, set, sizeof set);
        with_axis_bit(pairs[i].get, get, sizeof get);
        with_axis_bit(pairs[i].reply, reply, sizeof reply);
        bench_send(bench, 0, 0x001, set);
        bench_ask(bench, get, reply);
    }
    assert_int_equal(bench_counters(bench).malformed, 0);
    assert_int_equal(bench_counters(bench).unknown, 0);
}

TEST_ON(axes_keep_their_own_values, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "1E 10 00; 9E 20 00");
    bench_ask(bench, "1F", "1F 10 00");
    bench_ask(bench, "9F", "9F 20 00");
    bench_say(bench, 0, 0x002, "1F");
    bench_expect(bench, 0, 0x020, "1F 00 00"); /* zero at power-up */
}

TEST_ON(a_pid_and_its_single_gains_are_the_same_values, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "52 64 00 02 00 C8 00 06"); /* kp ki kd shift */
    bench_ask(bench, "1F", "1F 64 00");
    bench_ask(bench, "23", "23 02 00");
    bench_ask(bench, "21", "21 C8 00");
    bench_ask(bench, "29", "29 06 00");
    bench_send(bench, 0, 0x001, "54 01 00 02 00 03 00"); /* offset, output, integral */
    bench_ask(bench, "27", "27 01 00");
    bench_ask(bench, "2B", "2B 02 00");
    bench_ask(bench, "25", "25 03 00");
}

TEST_ON(state_is_told_when_asked, bench_configure, bench)
{
    bench->sense[0].q = 1.0; /* 10000 = 0x2710 ticks */
    bench_start(bench);
    bench_tick(bench);
    bench_ask(bench, "14", "14 10 27 00 00 00 00");
    bench_ask(bench, "07", "07 00 00");
    bench_ask(bench, "08", "08 01 00");
    bench_ask(bench, "16", "16 10 27 00 00");
    bench_ask(bench, "37", "37 00 00");
    bench_ask(bench, "39", "39 10 27 00 00");
    bench_ask(bench, "3A", "3A 00 00");
    bench_ask(bench, "3C", "3C 00 00");
    bench_ask(bench, "3D", "3D 00 00");
    bench_ask(bench, "3F", "3F 00 00");
    bench_ask(bench, "41", "41 E0 B1 FF FF"); /* -2 rad */
    bench_ask(bench, "43", "43 A8 61 00 00"); /* 2.5 rad */
    bench_send(bench, 0, 0x001, "09 50");
    bench_ask(bench, "07", "07 50 00");
}

/* Integrators of 1 and 2 counts a count and ms, errors of 10 and -7 counts: each axis tells its
 * own error, reference and output. */
TEST_ON(the_state_of_running_axes_is_told, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "52 00 00 01 00 00 00 00; D2 00 00 02 00 00 00 00");
    bench_say(bench, 0, 0x001, "54 00 00 35 05 FF 7F; D4 00 00 35 05 FF 7F");
    bench_say(bench, 0, 0x001, "09 08; 89 08");
    bench->sense[0].q = -10.0 / TICKS_PER_RAD;
    bench->sense[1].q = 7.0 / TICKS_PER_RAD;
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
    bench_ticks(bench, 5);
    bench_ask(bench, "3F", "3F 32 00"); /* 5 * 10 */
    bench_ask(bench, "BF", "BF AC FF"); /* 6 * 2 * -7 */
    bench_ask(bench, "37", "37 0A 00");
    bench_ask(bench, "B7", "B7 F9 FF");
    /* Moved by -10 and 7 ticks in the 32 ms of the estimate */
    bench_ask(bench, "14", "14 F6 FF FF FF F6 FF");
    bench_ask(bench, "94", "94 07 00 00 00 07 00");
    bench_ask(bench, "39", "39 00 00 00 00");
}

TEST_ON(the_encoder_reads_what_it_is_set_to, bench_configure, bench)
{
    bench->sense[0].q = 1.0;
    bench_start(bench);
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "1D E8 03 00 00");
    bench_ask(bench, "14", "14 E8 03 00 00 00 00");
    bench->sense[0].q = 1.1;
    bench_tick(bench);
    bench_ask(bench, "39", "39 E8 03 00 00"); /* the reference kept its distance */
    bench_ask(bench, "14", "14 D0 07 00 00 E8 03");
    /* calibration: 0x60 for a while, then idle with p3 as the zero */
    bench_send(bench, 0, 0x001, "04 03 00 00 01 00 E8 03");
    bench_ask(bench, "07", "07 60 00");
    bench_ask(bench, "08", "08 00 00");
    assert_false(bench->motor[0].bridge_on);
    bench_ticks(bench, 100);
    bench_ask(bench, "07", "07 00 00");
    bench_ask(bench, "08", "08 01 00");
    bench_ask(bench, "14", "14 10 27 00 00 00 00"); /* 11000 - 1000 */
    bench_send(bench, 0, 0x001, "9D FE FF FF FF");  /* axis 1 at -2 */
    bench_send(bench, 0, 0x001, "49 01 00 00 00");
    while (bench_sent(bench, 0, 0x111) == 0) {
        bench_tick(bench);
    }
    bench_expect(bench, 0, 0x111, "10 27 00 00 FE FF FF FF");
}

TEST_ON(flash_keeps_parameters_until_they_are_read, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "1E 64 00; 0A; 1E 07 00");
    bench_ask(bench, "1F", "1F 07 00");
    bench_send(bench, 0, 0x001, "0B");
    bench_ask(bench, "1F", "1F 64 00");
}

TEST_ON(the_address_moves_and_never_onto_another_board, bench_open, bench)
{
    struct board_event event;

    bench_send(bench, 0, 0x001, "32 05");
    assert_true(bench_event(bench, BOARD_EVENT_ADDRESS, &event));
    assert_int_equal(event.a, 1);
    assert_int_equal(event.b, 5);
    bench_send(bench, 0, 0x001, "33"); /* nobody there any more */
    bench_say(bench, 0, 0x005, "33");
    assert_int_equal(bench->count[0], 1);
    bench_expect(bench, 0, 0x050, "33 05");
    bench_send(bench, 0, 0x005, "32 02");
    bench_send(bench, 0, 0x705, "32 0D");
    bench_send(bench, 0, 0x005, "32 00; 32 0F");
    assert_int_equal(bench_counters(bench).malformed, 4);
    bench_send(bench, 0, 0x705, "32 01");
    bench_send(bench, 0, 0x20d, "32 0E");
    bench_say(bench, 0, 0x70f, "FF");
    assert_int_equal(bench_sent(bench, 0, 0x710), 1);
    assert_int_equal(bench_sent(bench, 0, 0x7e0), 1);
    assert_int_equal(bench_sent(bench, 0, 0x7d0), 0);
}

/* A tool that goes by a DBC sends every command with 8 bytes, whatever it pads with. */
TEST_ON(padding_is_ignored_where_the_bus_allows_it, bench_configure, bench)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.padded = true}};

    bench->config.bus = buses;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "1E 64 00 AA AA AA AA AA");
    bench_ask(bench, "1F AA AA AA AA AA AA AA", "1F 64 00");
    bench_ask(bench, "1F", "1F 64 00");
    bench_send(bench, 0, 0x001, "09 50 00 00 00 00 00 00");
    bench_ask(bench, "07 FF FF FF FF FF FF FF", "07 50 00");
    bench_send(bench, 0, 0x20d, "13 02 03 FF F0 CC CC CC");
    bench_send(bench, 0, 0x20d, "15 01 CC CC CC CC CC CC"); /* the longest: with a channel */
    bench_send(bench, 0, 0x20d, "14 03 00 00 00 00 00 00");
    bench_say(bench, 0, 0x70f, "FF 00 00 00 00 00 00 00");
    bench_expect(bench, 0, 0x2d0, "14 03 FF F0");
    bench_expect(bench, 0, 0x710, "FF 04 02 51 57");
    assert_int_equal(bench_counters(bench).malformed, 0);

    /* to eight bytes, not to any other length; and on no other bus */
    bench_send(bench, 0, 0x001, "1E 65 00 00; 1E 65 00 00 00 00 00");
    bench_send(bench, 0, 0x001, "1E 65"); /* too short stays too short */
    bench_send(bench, 1, 0x001, "1E 65 00 00 00 00 00 00");
    assert_int_equal(bench_counters(bench).malformed, 4);
    bench_ask(bench, "1F", "1F 64 00");
}

/* Every command of the table with a wrong length; none may have an effect or an answer. */
TEST_ON(wrong_lengths_are_ignored_and_counted, bench_open, bench)
{
    static const struct {
        uint32_t id;
        uint8_t code, length;
    } commands[] = {
        {0x001, 0x04, 8}, {0x001, 0x07, 1}, {0x001, 0x08, 1}, {0x001, 0x09, 2}, {0x001, 0x0a, 1},
        {0x001, 0x0b, 1}, {0x001, 0x0e, 5}, {0x001, 0x14, 1}, {0x001, 0x15, 5}, {0x001, 0x17, 3},
        {0x001, 0x19, 3}, {0x001, 0x1b, 7}, {0x001, 0x1c, 5}, {0x001, 0x1d, 5}, {0x001, 0x1e, 3},
        {0x001, 0x20, 3}, {0x001, 0x22, 3}, {0x001, 0x24, 3}, {0x001, 0x26, 3}, {0x001, 0x28, 3},
        {0x001, 0x2a, 3}, {0x001, 0x2c, 5}, {0x001, 0x2e, 1}, {0x001, 0x2f, 3}, {0x001, 0x32, 2},
        {0x001, 0x34, 8}, {0x001, 0x3e, 5}, {0x001, 0x40, 5}, {0x001, 0x42, 5}, {0x001, 0x44, 3},
        {0x001, 0x48, 5}, {0x001, 0x49, 5}, {0x001, 0x4a, 3}, {0x001, 0x4e, 8}, {0x001, 0x52, 8},
        {0x001, 0x56, 3}, {0x001, 0x57, 8}, {0x001, 0x59, 3}, {0x001, 0x5b, 3}, {0x001, 0x5d, 5},
        {0x001, 0x5f, 5}, {0x001, 0x72, 3}, {0x001, 0x73, 1}, {0x001, 0x74, 2}, {0x20d, 0x07, 2},
        {0x20d, 0x08, 2}, {0x20d, 0x18, 2}, {0x20d, 0x1a, 1}, {0x20d, 0x1c, 3}, {0x701, 0xff, 1},
        {0x701, 0x0c, 1}, {0x701, 0x0d, 6}, {0x701, 0x32, 2},
    };
    uint64_t sent = 0;

    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        for (uint8_t len = 1; len <= 8; len++) {
            struct bus_frame frame = {.id = commands[i].id, .len = len, .data = {commands[i].code}};

            if (len != commands[i].length) {
                boards_receive(bench->boards, bench->now_ns, 0, &frame);
                sent++;
            }
        }
    }
    bench_tick(bench);
    assert_int_equal(bench->count[0], 0);
    assert_int_equal(bench_counters(bench).malformed, sent);
    assert_int_equal(bench_counters(bench).frames, sent);
    assert_int_equal(bench_counters(bench).unknown, 0);
}

TEST_ON(unwelcome_frames_are_counted_by_what_they_are, bench_open, bench)
{
    static const struct bus_frame foreign[] = {
        {.id = 0x003, .len = 1, .data = {0x07}},          /* no board 3 */
        {.id = 0x000, .len = 1, .data = {0x07}},          /* to the host */
        {.id = 0x00d, .len = 1, .data = {0x07}},          /* an F/T board has no class 0 */
        {.id = 0x201, .len = 1, .data = {0x1b}},          /* nor a motor board class 2 */
        {.id = 0x111, .len = 8},                          /* telemetry of somebody */
        {.id = 0x511, .len = 8},                          /* an inertial sensor */
        {.id = 0x6f0, .len = 6},                          /* lockstep */
        {.id = 0x70f, .len = 1, .data = {0x00}},          /* only discovery is for all */
        {.id = 0x001, .len = 1, .flags = FRAME_EXTENDED}, /* 29-bit identifier */
        {.id = 0x001, .len = 1, .flags = FRAME_REMOTE},   /* remote frame */
        {.id = 0x001, .len = 1, .flags = FRAME_FD},       /* FD */
        {.id = 0x004, .len = 8, .flags = FRAME_ERROR},    /* error frame */
        {.id = 0xfff, .len = 1},                          /* no identifier */
        {.id = 0x001, .len = 64, .data = {0x07}},         /* no classic frame */
    };
    struct board_event event;
    struct boards_counters counters;

    for (size_t i = 0; i < sizeof foreign / sizeof *foreign; i++) {
        boards_receive(bench->boards, bench->now_ns, 0, &foreign[i]);
    }
    boards_receive(bench->boards, bench->now_ns, 7, &foreign[0]); /* no such bus */
    counters = bench_counters(bench);
    assert_int_equal(counters.foreign, sizeof foreign / sizeof *foreign + 1);
    assert_int_equal(counters.frames, 0);
    assert_false(boards_next_event(bench->boards, &event));

    bench_send(bench, 0, 0x001, "7F");
    assert_true(bench_event(bench, BOARD_EVENT_UNKNOWN, &event));
    assert_int_equal(event.a, 0x001);
    assert_int_equal(event.b, 0x7f);
    assert_int_equal(event.address, 1);
    bench_send(bench, 0, 0x001, "");
    assert_true(bench_event(bench, BOARD_EVENT_MALFORMED, &event));
    bench_send(bench, 0, 0x20d, "FE");
    bench_send(bench, 0, 0x701, "55");
    counters = bench_counters(bench);
    assert_int_equal(counters.frames, 4);
    assert_int_equal(counters.unknown, 3);
    assert_int_equal(counters.malformed, 1);
}

TEST_ON(a_full_reply_queue_is_told_in_status_and_overflow, bench_open, bench)
{
    struct board_event event;

    bench_send(bench, 0, 0x001, "49 14 00 00 00"); /* STATUS and OVERFLOW */
    for (int i = 0; i < BOARD_REPLIES_MAX + 3; i++) {
        bench_send(bench, 0, 0x001, "33");
        bench_send(bench, 0, 0x002, i < 2 ? "33" : "0B"); /* another board has its own quota */
    }
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x010), BOARD_REPLIES_MAX);
    assert_int_equal(bench_sent(bench, 0, 0x020), 2);
    assert_int_equal(bench_counters(bench).overflows, 3);
    assert_true(bench_event(bench, BOARD_EVENT_OVERFLOW, &event));
    bench_ticks(bench, 2); /* slot 2 */
    bench_expect(bench, 0, 0x113, "00 00 00 00 01 00 00 00");
    bench_tick(bench); /* slot 3 */
    bench_expect(bench, 0, 0x115, "");
    for (int i = 0; i < 8; i++) {
        bench_tick(bench);
        assert_int_equal(bench->count[0], 0);
    }
}

/* The real host's start-up of one axis and an F/T board, as measured. */
TEST_ON(the_hosts_start_up_sequence_is_accepted, bench_open, bench)
{
    static const char *const axis[] = {
        "1E 40 1F",
        "20 00 00",
        "22 02 00",
        "24 35 05",
        "26 00 00",
        "28 05 00",
        "2A 35 05",
        "5D 00 00 00 00",
        "4E 0A 00 01 00 00 00 0A",
        "50 00 00 35 05 C8 00 00",
        "5F 00 00 00 00",
        "61 00 00 00 00 00 00 00",
        "57 00 00 00 00 00 00 00",
        "49 7F 00 00 00",
        "40 E0 B1 FF FF",
        "42 A8 61 00 00",
        "48 E0 2E 00 00",
        "4A 04 00",
        "56 E8 03",
        "2F 35 05",
        "0E 05 05 05 05",
        "09 00",
    };
    char text[64];

    for (size_t i = 0; i < sizeof axis / sizeof *axis; i++) {
        bench_send(bench, 0, 0x001, axis[i]);
        with_axis_bit(axis[i], text, sizeof text);
        bench_say(bench, 0, 0x001, text);
        assert_int_equal(bench_sent(bench, 0, 0x010), 0);
    }
    bench_ask(bench, "5B 01 06", "5B 04 02 51 57 01 06 01");
    bench_send(bench, 0, 0x20d, "08 05");
    for (unsigned i = 0; i < 6; i++) {
        static const char *const scale[] = {"18 00 05 DC", "18 01 05 DC", "18 02 07 D0",
                                            "18 03 00 28", "18 04 00 28", "18 05 00 28"};

        snprintf(text, sizeof text, "18 %02X", i);
        bench_say(bench, 0, 0x20d, text);
        bench_expect(bench, 0, 0x2d0, scale[i]);
    }
    bench_send(bench, 0, 0x20d, "07 00");
    /* later: open loop, a quarter of the supply, stop */
    bench_say(bench, 0, 0x001, "09 50");
    bench_say(bench, 0, 0x001, "72 4D 01");
    assert_true(bench->motor[0].bridge_on);
    assert_near(bench->motor[0].voltage_v, SUPPLY_V * 333.0 / 1333.0, 1e-12);
    bench_say(bench, 0, 0x001, "09 09");
    assert_false(bench->motor[0].bridge_on);
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_counters(bench).malformed, 0);
    assert_int_equal(bench_counters(bench).unknown, 0);
    assert_int_equal(bench_counters(bench).foreign, 0);
}
