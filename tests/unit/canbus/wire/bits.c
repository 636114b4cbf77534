/* SPDX-License-Identifier: Apache-2.0 */
/* Frames as bits: the published lengths, known CRCs and priorities. The fuzz target wire holds
 * lengths and bits against the reference encoder. */
#include "base/random.h"

#include "base/array.h"
#include "canbus/wire/bits.h"
#include "tests/unit/canbus/wire/wire_reference.h"
#include "tests/test.h"

static struct wire_tables tables;

FIXTURE(set_up)
{
    wire_tables_make(&tables);
    return 0;
}

/* Any valid frame; every second one of few different bits, so that there is much to stuff. */
static struct bus_frame any_frame(struct random_stream *random)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    static const uint8_t poor[] = {0x00, 0xFF, 0xF0, 0x0F, 0x07, 0xF8, 0x83, 0x1F};
    const uint64_t pick = random_bits(random);
    struct bus_frame frame = {.id = (uint32_t)random_bits(random)};

    if (pick & 1) {
        frame.flags |= FRAME_EXTENDED;
    }
    if (pick & 2) {
        frame.flags |= FRAME_FD | (pick & 4 ? FRAME_BRS : 0) | (pick & 8 ? FRAME_ESI : 0);
        frame.len = lengths[pick >> 8 & 15];
    } else {
        frame.flags |= (pick & 28) == 0 ? FRAME_REMOTE : 0;
        frame.len = (uint8_t)((pick >> 8) % 9);
    }
    if (pick & 32) {
        frame.id = (pick >> 16) & 64 ? UINT32_MAX : 0;
        frame.id ^= 1u << (pick >> 24) % 29;
    }
    frame.id &= frame.flags & FRAME_EXTENDED ? 0x1FFFFFFF : 0x7FF;
    for (int i = 0; i < 64; i++) {
        frame.data[i] = pick & 64 ? poor[random_bits(random) % 8] : (uint8_t)random_bits(random);
    }
    return frame;
}

/* Davis, Burns, Bril, Lukkien 2007: 55, 65, ... 135 bits with the intermission; 29 bits: 80 + 10
 * n. */
TEST(worst_classic_lengths_are_the_published_ones)
{
    for (uint8_t n = 0; n <= 8; n++) {
        assert_int_equal(wire_worst_length(0, n).nominal + WIRE_INTERMISSION_BITS, 55 + 10 * n);
        assert_int_equal(wire_worst_length(FRAME_EXTENDED, n).nominal + WIRE_INTERMISSION_BITS,
                         80 + 10 * n);
        assert_int_equal(wire_worst_length(FRAME_REMOTE, n).nominal + WIRE_INTERMISSION_BITS, 55);
    }
}

/* The study's table: nominal 1 Mbit/s, with the intermission, in ns. */
TEST(worst_fd_durations_are_the_published_ones)
{
    static const struct {
        int data_mbit;
        uint8_t len;
        int64_t ns;
    } table[] = {
        {2, 8, 91000},  {2, 24, 173500}, {2, 48, 293500}, {2, 64, 373500}, {5, 8, 56800},
        {5, 12, 64800}, {5, 24, 89800},  {5, 48, 137800}, {5, 64, 169800}, {8, 8, 48250},
        {8, 12, 53250}, {8, 24, 68875},  {8, 48, 98875},  {8, 64, 118875},
    };

    for (size_t i = 0; i < ARRAY_COUNT(table); i++) {
        struct wire_length length = wire_worst_length(FRAME_FD | FRAME_BRS, table[i].len);

        length.nominal += WIRE_INTERMISSION_BITS;
        assert_int_equal(wire_length_ns(length, 1000000, table[i].data_mbit * 1000000),
                         table[i].ns);
    }
}

/* The bound leaves out that some bits of the header have fixed values and that the CRC is not
 * free. */
TEST(the_worst_case_is_nearly_met_by_real_frames)
{
    struct random_stream random = random_named(3, "frames");
    struct bus_frame frame = {.id = 0x078, .len = 8};
    unsigned longest = 0, nominal, data;

    /* Five equal bits, then again and again four that equal the stuff bit before them, in the
     * header as in the data: 00000 1111 0000, 000 00 1111 0000 1111 ... */
    for (int n = 0; n < 200000; n++) {
        for (int i = 0; i < 8; i++) {
            frame.data[i] = i < 6 ? 0x3C : (uint8_t)random_bits(&random);
        }
        reference_length(&frame, &nominal, &data);
        longest = nominal > longest ? nominal : longest;
        assert_int_equal(wire_frame_length(&tables, &frame).nominal, nominal);
    }
    assert_true(longest >= 128 && longest <= 132);
}

/* CRC-15/CAN of "123456789" is 0x059E, CRC-17/CAN-FD 0x04F03, CRC-21/CAN-FD 0x0ED841, the latter
 * two with a start value of 0 (catalogue of parametrised CRC algorithms): the reference itself. */
TEST(the_reference_computes_the_catalogued_crcs)
{
    struct reference text = {.count = 0};

    for (const char *c = "123456789"; *c; c++) {
        reference_number(&text, (uint8_t)*c, 8);
    }
    assert_int_equal(reference_crc(&text, 15, 0x4599, 0), 0x059E);
    assert_int_equal(reference_crc(&text, 17, 0x1685B, 0), 0x04F03);
    assert_int_equal(reference_crc(&text, 21, 0x102899, 0), 0x0ED841);
}

/* The CRC has a distance: one bit of data changes other bits too. */
TEST(a_changed_bit_of_data_changes_the_crc)
{
    struct random_stream random = random_named(4, "frames");

    for (int n = 0; n < 2000; n++) {
        struct bus_frame frame = any_frame(&random), other;
        struct wire_bits a, b;
        size_t differing = 0;

        if (!frame.len || (frame.flags & (FRAME_REMOTE | FRAME_FD))) {
            continue;
        }
        other = frame;
        other.data[random_bits(&random) % frame.len] ^= 1u << random_bits(&random) % 8;
        wire_frame_encode(&frame, &a);
        wire_frame_encode(&other, &b);
        for (size_t i = 0; i < a.count && i < b.count; i++) {
            differing += a.bit[i] != b.bit[i];
        }
        assert_true(differing >= 2 || a.count != b.count);
    }
}

TEST(priorities_follow_the_arbitration_field)
{
    const struct bus_frame frames[] = {
        {.id = 0x000},
        {.id = 0x122},
        {.id = 0x123},
        {.id = 0x123, .flags = FRAME_REMOTE},
        {.id = 0x123u << 18, .flags = FRAME_EXTENDED},
        {.id = 0x123u << 18, .flags = FRAME_EXTENDED | FRAME_REMOTE},
        {.id = 0x123u << 18 | 1, .flags = FRAME_EXTENDED},
        {.id = 0x124},
        {.id = 0x7FF},
        {.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED},
        {.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED | FRAME_REMOTE},
    };
    struct random_stream random = random_named(5, "frames");

    for (size_t i = 1; i < ARRAY_COUNT(frames); i++) {
        assert_true(wire_priority(&frames[i - 1]) < wire_priority(&frames[i]));
    }
    /* Whose bits are dominant first */
    for (int n = 0; n < 100000; n++) {
        struct bus_frame a = any_frame(&random), b = any_frame(&random);
        uint32_t of_a = wire_priority(&a), of_b = wire_priority(&b);
        struct reference bits_a, bits_b;
        size_t i = 0;

        if (n % 2) {
            b.id = b.flags & FRAME_EXTENDED ? (a.flags & FRAME_EXTENDED ? a.id : a.id << 18)
                                            : (a.flags & FRAME_EXTENDED ? a.id >> 18 : a.id);
            of_b = wire_priority(&b);
        }
        reference_fields(&a, &bits_a);
        reference_fields(&b, &bits_b);
        while (i < 33 && bits_a.bit[i] == bits_b.bit[i]) {
            i++;
        }
        if (of_a != of_b) {
            assert_int_equal(of_a < of_b, bits_a.bit[i] < bits_b.bit[i]);
        }
    }
}

TEST_GROUP(set_up, NULL)
