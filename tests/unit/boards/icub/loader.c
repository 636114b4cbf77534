/* SPDX-License-Identifier: Apache-2.0 */
/* The bootloader of iCub boards, with the frames of class 7 that a loader program sends: how long
 * it waits, what it says, and what it makes of a download. */
#include "tests/unit/boards/board_bench.h"

enum { LOADER = 0x701, ANSWER = 0x710 }; /* to motor board 1, and from it */

/* Sends to board 1 and checks the one answer of the next tick; NULL: none. */
static void loader_ask(struct board_bench *bench, const char *request, const char *answer)
{
    bench_say(bench, 0, LOADER, request);
    if (answer) {
        bench_expect(bench, 0, ANSWER, answer);
    } else {
        assert_int_equal(bench_sent(bench, 0, ANSWER), 0);
    }
}

TEST_ON(start_resets_into_a_bootloader_of_a_dsp, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "1E 64 00; 49 7F 00 00 00; 09 50");
    loader_ask(bench, "04", "04 01"); /* a ping of the application */
    assert_true(bench->motor[0].bridge_on);
    loader_ask(bench, "00", "00 01");
    assert_false(bench->motor[0].bridge_on);
    bench_send(bench, 0, 0x001, "1F"); /* the application is not there */
    loader_ask(bench, "FF", "FF 00 02 51");
    assert_int_equal(bench->count[0], 1);
    bench_say(bench, 0, 0x70f, "FF"); /* nor for what goes to everyone */
    bench_expect(bench, 0, 0x710, "FF 00 02 51");
    bench_expect(bench, 0, 0x720, "FF 04 02 51 57");
    bench_expect(bench, 0, 0x7d0, "FF 06 03 00 05");
    loader_ask(bench, "02 00 00 00 00", "02 01"); /* does not lead back ... */
    loader_ask(bench, "FF", "FF 00 02 51");
    loader_ask(bench, "04", "04 01"); /* ... this does, to a board after power-up */
    loader_ask(bench, "FF", "FF 04 02 51 57");
    bench_ask(bench, "1F", "1F 00 00");
    bench_ask(bench, "07", "07 00 00");
}

TEST_ON(without_a_host_the_application_starts_after_five_seconds, board_bench, bench)
{
    bench_open(bench);
    loader_ask(bench, "00", "00 01");
    bench_ticks(bench, 4999);
    bench_ask(bench, "07", "07 00 00");
    bench_open(bench);
    loader_ask(bench, "00", "00 01");
    bench_ticks(bench, 4998);
    bench_say(bench, 0, 0x001, "07"); /* at the beginning of the last tick */
    assert_int_equal(bench->count[0], 0);
}

/* Discovery, or a START that reaches the bootloader, as loader programs send a second one. */
TEST_ON(a_host_that_finds_the_bootloader_keeps_it_there, board_bench, bench)
{
    static const struct {
        uint32_t id;
        const char *frame, *answer;
    } hosts[] = {
        {0x701, "FF", "FF 00 02 51"}, {0x70f, "FF", "FF 00 02 51"}, {0x701, "00", "00 01"}};

    for (size_t i = 0; i < sizeof hosts / sizeof *hosts; i++) {
        for (int from_power_up = 0; from_power_up < 2; from_power_up++) {
            bench_configure(bench);
            bench->board[0].boot_ns = from_power_up ? INT64_C(5000000000) : 0;
            bench_start(bench);
            if (!from_power_up) {
                loader_ask(bench, "00", "00 01");
            }
            bench_ticks(bench, 4000);
            bench_say(bench, 0, hosts[i].id, hosts[i].frame);
            bench_expect(bench, 0, ANSWER, hosts[i].answer);
            bench_ticks(bench, 20000);
            loader_ask(bench, "FF", "FF 00 02 51");
            loader_ask(bench, "04", "04 01");
            loader_ask(bench, "FF", "FF 04 02 51 57");
        }
    }
}

/* Two lines, of fourteen bytes at 0x0084 of program memory and of four at 0x2000 of data memory. */
static void send_download(struct board_bench *bench)
{
    loader_ask(bench, "01 0E 84 00 00", NULL);
    loader_ask(bench, "03 10 11 12 13 14 15", NULL);
    loader_ask(bench, "03 16 17 18 19 1A 1B", NULL);
    loader_ask(bench, "03 1C 1D", "03 01"); /* once for the whole line */
    loader_ask(bench, "01 04 00 20 01", NULL);
    loader_ask(bench, "03 FF EE DD CC", "03 01");
    loader_ask(bench, "02 84 00 00 00", "02 01");
}

/* The checksum is that of zlib.crc32 over 84 00 00, the fourteen, 00 20 01, the four. */
TEST_ON(a_download_is_kept_and_told, bench_configure, bench)
{
    struct board_firmware firmware;
    struct board_event event;

    bench->board[0].keep_firmware = true;
    bench_start(bench);
    assert_false(boards_firmware(bench->boards, 0, &firmware));
    loader_ask(bench, "00", "00 01");
    bench_ticks(bench, 250);
    loader_ask(bench, "00", "00 01"); /* as canLoader does */
    send_download(bench);
    assert_true(boards_firmware(bench->boards, 0, &firmware));
    assert_int_equal(firmware.lines, 2);
    assert_int_equal(firmware.bytes, 18);
    assert_int_equal(firmware.crc, 0xd7312c31);
    for (unsigned word = 0; word < 0x20000; word++) {
        unsigned expected = 0xffff;

        if (word >= 0x84 && word < 0x84 + 7) {
            expected = 0x1110 + 0x0202 * (word - 0x84);
        } else if (word == 0x12000 || word == 0x12001) {
            expected = word == 0x12000 ? 0xeeff : 0xccdd;
        }
        assert_int_equal(firmware.image[word], expected);
    }
    loader_ask(bench, "04", "04 01");
    assert_true(bench_event(bench, BOARD_EVENT_FIRMWARE, &event));
    assert_int_equal(event.a, 18);
    assert_int_equal(event.b, 0xd7312c31);
    assert_false(bench_event(bench, BOARD_EVENT_FIRMWARE, &event));
    assert_true(boards_firmware(bench->boards, 0, &firmware)); /* still there in the application */

    /* the next one begins with nothing, and may end without anything */
    loader_ask(bench, "00", "00 01");
    assert_false(boards_firmware(bench->boards, 0, &firmware));
    assert_int_equal(firmware.image[0x84], 0xffff);
    loader_ask(bench, "04", "04 01");
    assert_false(bench_event(bench, BOARD_EVENT_FIRMWARE, &event));
}

TEST_ON(what_is_no_download_is_not_acknowledged, bench_configure, bench)
{
    struct board_firmware firmware;

    bench->board[0].boot_ns = INT64_C(5000000000);
    bench_start(bench);
    loader_ask(bench, "01 02 00 00 00", NULL); /* without START */
    loader_ask(bench, "03 01 02", NULL);
    loader_ask(bench, "02 00 00 00 00", NULL);
    assert_int_equal(bench_counters(bench).malformed, 3);
    loader_ask(bench, "00", "00 01");
    loader_ask(bench, "03 01 02", NULL);       /* without ADDRESS */
    loader_ask(bench, "01 02 00 00", NULL);    /* too short */
    loader_ask(bench, "01 04 00 00 00", NULL); /* a line of four bytes gets five */
    loader_ask(bench, "03 01 02", NULL);
    loader_ask(bench, "03 03 04 05", NULL);
    loader_ask(bench, "03 03 04", NULL); /* that line is lost */
    loader_ask(bench, "01 00 00 00 00", NULL);
    loader_ask(bench, "03", NULL);
    assert_int_equal(bench_counters(bench).malformed, 8);
    assert_false(boards_firmware(bench->boards, 0, &firmware));

    /* the longest line, over the end of the memory */
    loader_ask(bench, "01 FF FF FF 00", NULL);
    for (int i = 0; i < 36; i++) {
        loader_ask(bench, "03 01 02 03 04 05 06 07", NULL);
    }
    loader_ask(bench, "03 01 02 03", "03 01");
    assert_true(boards_firmware(bench->boards, 0, &firmware));
    assert_int_equal(firmware.bytes, 255);
    assert_null(firmware.image);
    loader_ask(bench, "04", "04 01");
    loader_ask(bench, "01 02 00 00 00", NULL); /* nothing to the application */
    assert_int_equal(bench_counters(bench).malformed, 8);
}

/* Loader programs address START to a board, and the lines of the file to everyone. */
TEST_ON(a_download_to_everyone_is_for_boards_that_were_started, bench_configure, bench)
{
    struct board_firmware firmware;

    bench->board[1].boot_ns = INT64_C(5000000000); /* in its bootloader, but not started */
    bench_start(bench);
    loader_ask(bench, "00", "00 01");
    loader_ask(bench, "00", "00 01");
    bench_say(bench, 0, 0x70f, "01 04 00 20 01; 03 FF EE DD CC");
    bench_expect(bench, 0, ANSWER, "03 01");
    bench_say(bench, 0, 0x70f, "02 84 00 00 00");
    bench_expect(bench, 0, ANSWER, "02 01");
    assert_int_equal(bench->count[0], 1);
    assert_true(boards_firmware(bench->boards, 0, &firmware));
    assert_int_equal(firmware.bytes, 4);

    /* END leads every board out of its bootloader, and is nothing to an application */
    bench_say(bench, 0, 0x70f, "04");
    bench_expect(bench, 0, ANSWER, "04 01");
    bench_expect(bench, 0, 0x720, "04 01");
    bench_say(bench, 0, 0x70f, "04; 00");
    assert_int_equal(bench->count[0], 0);
    assert_int_equal(bench_counters(bench).malformed, 0);
}

TEST_ON(other_boards_say_in_the_bootloader_what_they_are, bench_open, bench)
{
    bench_say(bench, 0, 0x70d, "00 00"); /* STRAIN: with a byte whether the EEPROM goes too */
    bench_expect(bench, 0, 0x7d0, "00 01");
    bench_say(bench, 0, 0x70d, "FF");
    bench_expect(bench, 0, 0x7d0, "FF 06 03 00");
}
