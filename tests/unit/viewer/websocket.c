/* SPDX-License-Identifier: Apache-2.0 */
/* WebSockets: the examples of RFC 6455, and what a browser would never send. */
#include "viewer/websocket.h"
#include "tests/test.h"

static struct websocket_frame frame;

TEST(a_key_is_answered_as_in_rfc_6455_section_1_3)
{
    char accept[WEBSOCKET_ACCEPT];

    websocket_accept("dGhlIHNhbXBsZSBub25jZQ==", accept);
    assert_string_equal(accept, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
}

TEST(a_masked_text_is_read_as_in_rfc_6455_section_5_7)
{
    const uint8_t hello[] = {0x81, 0x85, 0x37, 0xfa, 0x21, 0x3d, 0x7f, 0x9f, 0x4d, 0x51, 0x58};
    uint8_t data[sizeof hello];

    for (size_t size = 0; size < sizeof hello; size++) {
        memcpy(data, hello, sizeof hello);
        assert_int_equal(websocket_read(data, size, 1000, &frame), 0);
    }
    memcpy(data, hello, sizeof hello);
    assert_int_equal(websocket_read(data, sizeof hello, 1000, &frame), 1);
    assert_int_equal(frame.opcode, WEBSOCKET_TEXT);
    assert_true(frame.final);
    assert_int_equal(frame.used, sizeof hello);
    assert_int_equal(frame.size, 5);
    assert_memory_equal(frame.payload, "Hello", 5);
}

TEST(a_length_is_judged_before_its_bytes_have_come)
{
    uint8_t two_gigabytes[] = {0x82, 0xff, 0, 0, 0, 0, 0x7f, 0xff, 0, 0};
    uint8_t all_bits[] = {0x82, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff};
    uint8_t just_right[] = {0x82, 0xfe, 0x03, 0xe8}, one_more[] = {0x82, 0xfe, 0x03, 0xe9};

    assert_int_equal(websocket_read(two_gigabytes, sizeof two_gigabytes, 1000, &frame),
                     WEBSOCKET_TOO_BIG);
    assert_int_equal(websocket_read(all_bits, sizeof all_bits, 1000, &frame), WEBSOCKET_TOO_BIG);
    assert_int_equal(websocket_read(just_right, sizeof just_right, 1000, &frame), 0);
    assert_int_equal(websocket_read(one_more, sizeof one_more, 1000, &frame), WEBSOCKET_TOO_BIG);
}

TEST(frames_against_the_protocol_are_refused)
{
    uint8_t unmasked[] = {0x81, 0x05}, reserved[] = {0xc1, 0x80}, unknown[] = {0x83, 0x80},
            future[] = {0x8b, 0x80}, long_ping[] = {0x89, 0xfe}, half_close[] = {0x08, 0x80};
    uint8_t *wrong[] = {unmasked, reserved, unknown, future, long_ping, half_close};

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(websocket_read(wrong[i], 2, 1000, &frame), WEBSOCKET_PROTOCOL);
    }
}

TEST(headers_have_the_shortest_length)
{
    const uint8_t small[] = {0x81, 125}, middle[] = {0x82, 126, 0x01, 0x00},
                  large[] = {0x82, 127, 0, 0, 0, 0, 0, 1, 0, 0};
    uint8_t header[WEBSOCKET_HEADER];

    assert_int_equal(websocket_header(header, WEBSOCKET_TEXT, 125), 2);
    assert_memory_equal(header, small, 2);
    assert_int_equal(websocket_header(header, WEBSOCKET_BINARY, 256), 4);
    assert_memory_equal(header, middle, 4);
    assert_int_equal(websocket_header(header, WEBSOCKET_BINARY, 65536), 10);
    assert_memory_equal(header, large, 10);
}
