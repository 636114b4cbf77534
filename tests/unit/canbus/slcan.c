/* SPDX-License-Identifier: Apache-2.0 */
/* The text of slcan: commands and frames as Lawicel's manual has them, FD frames as CANable's. */
#include "canbus/slcan.h"
#include "tests/test.h"

static struct slcan_request parse(const char *text)
{
    struct slcan_request request;

    slcan_parse(text, strlen(text), &request);
    return request;
}

TEST(frames_are_read_and_written)
{
    static const struct {
        const char *text;
        struct bus_frame frame;
    } rows[] = {
        {"t10021133", {.id = 0x100, .len = 2, .data = {0x11, 0x33}}},
        {"t7FF0", {.id = 0x7ff}},
        {"T0000010021133", {.id = 0x100, .flags = FRAME_EXTENDED, .len = 2, .data = {0x11, 0x33}}},
        {"r1003", {.id = 0x100, .flags = FRAME_REMOTE, .len = 3}},
        {"R1FFFFFFF0", {.id = 0x1fffffff, .flags = FRAME_REMOTE | FRAME_EXTENDED}},
        {"d1009000102030405060708090A0B",
         {.id = 0x100,
          .flags = FRAME_FD,
          .len = 12,
          .data = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}}},
        {"B000001001AA",
         {.id = 0x100, .flags = FRAME_FD | FRAME_BRS | FRAME_EXTENDED, .len = 1, .data = {0xaa}}},
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct slcan_request request = parse(rows[i].text);
        char text[SLCAN_TEXT_MAX];
        size_t length;

        assert_int_equal(request.command, SLCAN_FRAME);
        assert_memory_equal(&request.frame, &rows[i].frame, sizeof rows[i].frame);
        length = slcan_format(&rows[i].frame, false, text);
        assert_int_equal(length, strlen(rows[i].text) + 1);
        assert_memory_equal(text, rows[i].text, length - 1);
        assert_string_equal(text + length - 1, "\r");
    }
}

TEST(a_time_stamp_is_milliseconds_of_a_minute)
{
    struct bus_frame frame = {.id = 0x1, .len = 1, .data = {0xab}, .time_ns = 61234567890};
    char text[SLCAN_TEXT_MAX];

    slcan_format(&frame, true, text);
    assert_string_equal(text, "t0011AB04D2\r"); /* 1234 ms */
    frame.flags = FRAME_ERROR;
    assert_int_equal(slcan_format(&frame, true, text), 0);
}

TEST(settings_are_read)
{
    static const struct {
        const char *text;
        enum slcan_command command;
        int64_t value;
    } rows[] = {
        {"S0", SLCAN_BIT_RATE, 10000},
        {"S8", SLCAN_BIT_RATE, 1000000},
        {"Y2", SLCAN_DATA_RATE, 2000000},
        {"Y8", SLCAN_DATA_RATE, 8000000},
        {"O", SLCAN_OPEN, 0},
        {"L", SLCAN_OPEN, 1},
        {"C", SLCAN_CLOSE, 0},
        {"Z1", SLCAN_TIME_STAMP, 1},
        {"F", SLCAN_STATUS, 0},
        {"V", SLCAN_VERSION, 0},
        {"N", SLCAN_SERIAL, 0},
        {"", SLCAN_ACCEPTED, 0},
        {"M00000000", SLCAN_ACCEPTED, 0},
        {"mffffffff", SLCAN_ACCEPTED, 0},
    };
    static const char *const wrong[] = {
        "S9",       "S",          "S88",       "Y0",        "Y9",    "O1",         "Z2",
        "Z",        "FF",         "M00000001", "m00000000", "x",     "t",          "t10",
        "t1002113", "t100211333", "t10g0",     "t1009",     "t8000", "T200000000", "r1009",
        "r100211",  "d100G",      "b100900",   "\xff",
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct slcan_request request = parse(rows[i].text);

        assert_int_equal(request.command, rows[i].command);
        if (rows[i].value) {
            assert_int_equal(request.value, rows[i].value);
        }
    }
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        if (parse(wrong[i]).command != SLCAN_WRONG) {
            fail_msg("%s is taken", wrong[i]);
        }
    }
}
