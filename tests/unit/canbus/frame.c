/* SPDX-License-Identifier: Apache-2.0 */
/* Legal and illegal frames, and their length on the wire. */
#include "canbus/frame.h"

#include "base/array.h"
#include "tests/test.h"

TEST(accepts_legal_frames_only)
{
    static const struct {
        uint32_t id;
        uint8_t flags, len;
        bool valid;
    } cases[] = {
        {0, 0, 0, true},
        {0x7FF, 0, 8, true},
        {0x800, 0, 0, false},
        {0x123, 0, 9, false},
        {0x1FFFFFFF, FRAME_EXTENDED, 8, true},
        {0x20000000, FRAME_EXTENDED, 8, false},
        {0x123, FRAME_REMOTE, 8, true},
        {0x123, FRAME_REMOTE, 9, false},
        {0x123, FRAME_REMOTE | FRAME_FD, 0, false},
        {0x123, FRAME_BRS, 0, false},
        {0x123, FRAME_ESI, 0, false},
        {0x123, FRAME_FD | FRAME_BRS | FRAME_ESI, 64, true},
        {0x1FFFFFFF, FRAME_FD | FRAME_EXTENDED, 48, true},
        {0x800, FRAME_FD, 8, false},
        {0x1FFFFFFF, FRAME_ERROR, 8, true},
        {0x20000000, FRAME_ERROR, 8, false},
        {0x4, FRAME_ERROR, 9, false},
        {0x4, FRAME_ERROR | FRAME_EXTENDED, 8, false},
        {0x4, FRAME_ERROR | FRAME_REMOTE, 8, false},
        {0x4, FRAME_ERROR | FRAME_FD, 8, false},
        {0x123, 1 << 6, 8, false},
        {0x123, 1 << 7, 8, false},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct bus_frame frame = {.id = cases[i].id, .flags = cases[i].flags, .len = cases[i].len};

        if (frame_valid(&frame) != cases[i].valid) {
            fail_msg("case %zu", i);
        }
    }
}

TEST(accepts_exactly_the_lengths_of_fd)
{
    unsigned legal = 0;

    for (unsigned len = 0; len < 256; len++) {
        struct bus_frame frame = {.id = 1, .flags = FRAME_FD, .len = (uint8_t)len};

        legal += frame_valid(&frame);
    }
    assert_int_equal(legal, 16); /* one for each value of the 4-bit length code */
}

TEST(makes_a_classic_frame_with_zeroes_behind_its_data)
{
    const uint8_t data[] = {0xFF, 4, 5};
    struct bus_frame frame = frame_make(0x70F, 2, data);

    assert_int_equal(frame.id, 0x70F);
    assert_int_equal(frame.flags, 0);
    assert_int_equal(frame.len, 2);
    assert_int_equal(frame.data[0], 0xFF);
    assert_int_equal(frame.data[1], 4);
    for (size_t i = 2; i < sizeof frame.data; i++) {
        assert_int_equal(frame.data[i], 0);
    }
    frame = frame_make(0x80, 0, NULL);
    assert_int_equal(frame.len, 0);
}

/* The fields of the format, bit by bit, from ISO 11898-1. */
TEST(counts_the_bits_of_a_frame_field_by_field)
{
    /* SOF, identifier, RTR, IDE, r0, DLC, CRC, CRC delimiter, ACK, ACK delimiter, EOF,
     * interframe */
    const unsigned standard = 1 + 11 + 1 + 1 + 1 + 4 + 15 + 1 + 1 + 1 + 7 + 3;
    const unsigned extended = standard + 1 + 18 + 1; /* SRR, 18 more bits, r1 */
    /* SOF, identifier, RRS, IDE, FDF, res, BRS, ESI, DLC; the CRC field has a fixed stuff bit
     * before its first bit and after every fourth: stuff count 4 + CRC 17 = 21 bits and 6 of
     * those */
    const unsigned fd17 = 1 + 11 + 1 + 1 + 1 + 1 + 1 + 1 + 4 + 4 + 17 + 6 + 1 + 1 + 1 + 7 + 3;
    const unsigned fd21 = fd17 - 17 - 6 + 21 + 7;

    for (unsigned n = 0; n <= 8; n++) {
        struct bus_frame frame = {.id = 1, .len = (uint8_t)n};

        assert_int_equal(frame_bits(&frame), standard + 8 * n);
        frame.flags = FRAME_EXTENDED;
        assert_int_equal(frame_bits(&frame), extended + 8 * n);
        frame.flags = FRAME_REMOTE;
        assert_int_equal(frame_bits(&frame), standard);
        frame.flags = FRAME_ERROR;
        assert_int_equal(frame_bits(&frame), 0);
    }
    assert_int_equal(frame_bits(&(struct bus_frame){.flags = FRAME_FD, .len = 16}), fd17 + 128);
    assert_int_equal(frame_bits(&(struct bus_frame){.flags = FRAME_FD, .len = 64}), fd21 + 512);
    assert_int_equal(frame_bits(&(struct bus_frame){.flags = FRAME_FD | FRAME_EXTENDED, .len = 8}),
                     fd17 + 64 + 19);
}

TEST(counts_the_fast_bits_of_a_frame_field_by_field)
{
    /* ESI, DLC, data, stuff count, CRC with a fixed stuff bit before it and after every four bits
     * of stuff count and CRC, CRC delimiter */
    const uint32_t fd17 = 1 + 4 + 4 + 17 + 1 + (4 + 17) / 4 + 1;
    const uint32_t fd21 = 1 + 4 + 4 + 21 + 1 + (4 + 21) / 4 + 1;
    struct bus_frame frame = {.flags = FRAME_FD | FRAME_BRS};

    for (uint8_t n = 0; n <= 16; n = (uint8_t)(n < 8 ? n + 1 : n + 4)) {
        frame.len = n;
        assert_int_equal(frame_fast_bits(&frame), fd17 + 8u * n);
    }
    frame.len = 64;
    assert_int_equal(frame_fast_bits(&frame), fd21 + 512);
    frame.flags |= FRAME_EXTENDED;
    assert_int_equal(frame_fast_bits(&frame), fd21 + 512);
    frame.flags = FRAME_FD;
    assert_int_equal(frame_fast_bits(&frame), 0);
    assert_int_equal(frame_fast_bits(&(struct bus_frame){.len = 8}), 0);
}

TEST(rounds_up_to_the_lengths_of_fd)
{
    static const uint8_t length[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    size_t k = 0;

    for (unsigned n = 0; n <= 64; n++) {
        k += length[k] < n;
        assert_int_equal(frame_fd_length(n), length[k]);
    }
}

TEST(puts_and_gets_in_the_byte_order_of_its_name)
{
    uint8_t bytes[4];

    put_u32_le(bytes, 0x89ABCDEF);
    assert_memory_equal(bytes, "\xEF\xCD\xAB\x89", 4);
    assert_int_equal(get_u32_le(bytes), 0x89ABCDEF);
    assert_int_equal(get_i32_le(bytes), (int32_t)0x89ABCDEF);
    assert_int_equal(get_u16_be((const uint8_t *)"\x80\x01"), 0x8001);
    put_u16_le(bytes, 0x8001);
    assert_int_equal(get_i16_le(bytes), -32767);
}
