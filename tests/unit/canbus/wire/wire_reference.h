/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The reference for canbus/wire/bits.c, written from the text of ISO 11898-1:2015 and independent
 * of it: a frame as a string of characters, built field by field and bit by bit. '0' and '1' are
 * bits of the frame, 'o' and 'i' are stuff bits (dominant, recessive). No tables, no words, no
 * shortcuts.
 */
#ifndef TESTS_UNIT_CANBUS_WIRE_WIRE_REFERENCE_H
#define TESTS_UNIT_CANBUS_WIRE_WIRE_REFERENCE_H

#include "canbus/frame.h"

#include <string.h>

struct reference {
    char bit[1024];
    size_t count;
    size_t brs_end;   /* behind the BRS bit */
    size_t delimiter; /* the CRC delimiter */
};

static inline int reference_value(char bit)
{
    return bit == '1' || bit == 'i';
}

static inline void reference_put(struct reference *to, int value)
{
    to->bit[to->count++] = value ? '1' : '0';
}

static inline void reference_number(struct reference *to, uint32_t number, int width)
{
    for (int i = width - 1; i >= 0; i--) {
        reference_put(to, (int)(number / (1u << i) % 2));
    }
}

/* SOF to the end of the data, not stuffed */
static inline void reference_fields(const struct bus_frame *frame, struct reference *to)
{
    static const uint8_t dlc_length[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    const int extended = (frame->flags & FRAME_EXTENDED) != 0;
    const int remote = (frame->flags & FRAME_REMOTE) != 0, fd = (frame->flags & FRAME_FD) != 0;
    uint32_t dlc = 0;

    to->count = to->brs_end = 0;
    reference_put(to, 0); /* SOF */
    if (extended) {
        reference_number(to, frame->id / 262144, 11); /* the base identifier */
        reference_put(to, 1);                         /* SRR */
        reference_put(to, 1);                         /* IDE */
        reference_number(to, frame->id % 262144, 18); /* the identifier extension */
        reference_put(to, remote);                    /* RTR; RRS is dominant */
        if (!fd) {
            reference_put(to, 0); /* r1 */
        }
    } else {
        reference_number(to, frame->id, 11);
        reference_put(to, remote); /* RTR; RRS is dominant */
        reference_put(to, 0);      /* IDE */
    }
    if (fd) {
        reference_put(to, 1); /* FDF */
        reference_put(to, 0); /* res */
        reference_put(to, (frame->flags & FRAME_BRS) != 0);
        to->brs_end = to->count;
        reference_put(to, (frame->flags & FRAME_ESI) != 0);
    } else {
        reference_put(to, 0); /* r0, where FD has FDF */
    }
    while (dlc_length[dlc] != frame->len) {
        dlc++;
    }
    reference_number(to, dlc, 4);
    for (int i = 0; i < frame->len && !remote; i++) {
        reference_number(to, frame->data[i], 8);
    }
}

/* A shift register of `width` bits, as the standard draws it. */
static inline uint32_t reference_crc(const struct reference *of, int width, uint32_t polynomial,
                                     uint32_t start)
{
    uint32_t reg = start;

    for (size_t i = 0; i < of->count; i++) {
        uint32_t next = (uint32_t)reference_value(of->bit[i]) ^ (reg >> (width - 1));

        reg = (reg << 1) % (1u << width);
        if (next) {
            reg ^= polynomial;
        }
    }
    return reg;
}

/* After five equal bits, stuff bits included, the opposite one; `last`: also behind the last
 * bit. */
static inline int reference_stuff(const struct reference *from, struct reference *to, int last)
{
    int stuffed = 0;

    to->count = 0;
    to->brs_end = 0;
    for (size_t i = 0; i < from->count; i++) {
        int equal = 1;

        to->bit[to->count++] = from->bit[i];
        if (i + 1 == from->brs_end) {
            to->brs_end = to->count;
        }
        for (size_t k = 2; k <= 5 && k <= to->count; k++) {
            equal += equal == (int)k - 1 && reference_value(to->bit[to->count - k]) ==
                                                reference_value(to->bit[to->count - 1]);
        }
        if (equal == 5 && (last || i + 1 < from->count)) {
            char stuff = reference_value(to->bit[to->count - 1]) ? 'o' : 'i';

            to->bit[to->count++] = stuff;
            stuffed++;
        }
    }
    return stuffed;
}

static inline void reference_trailer(struct reference *to)
{
    to->delimiter = to->count;
    reference_put(to, 1);         /* CRC delimiter */
    reference_put(to, 1);         /* ACK slot, recessive from the sender */
    reference_put(to, 1);         /* ACK delimiter */
    reference_number(to, 127, 7); /* EOF */
}

static inline void reference_classic(const struct bus_frame *frame, struct reference *to)
{
    struct reference plain;

    reference_fields(frame, &plain);
    /* x15 + x14 + x10 + x8 + x7 + x4 + x3 + 1 */
    reference_number(&plain,
                     reference_crc(&plain, 15,
                                   1u << 14 | 1u << 10 | 1u << 8 | 1u << 7 | 1u << 4 | 1u << 3 | 1u,
                                   0),
                     15);
    reference_stuff(&plain, to, 1);
    reference_trailer(to);
}

static inline void reference_fd(const struct bus_frame *frame, struct reference *to)
{
    /* stuff bits modulo 8, Gray-coded, with a parity bit: the table of the standard */
    static const char *const count_code[8] = {"0000", "0011", "0110", "0101",
                                              "1100", "1111", "1010", "1001"};
    struct reference plain, check;
    int stuffed, width = frame->len <= 16 ? 17 : 21;
    uint32_t crc;

    reference_fields(frame, &plain);
    stuffed = reference_stuff(&plain, to, 0);
    /* the CRC sees the dynamic stuff bits and the stuff count, not the fixed stuff bits */
    plain = *to;
    check.count = 0;
    for (int i = 0; i < 4; i++) {
        reference_put(&plain, count_code[stuffed % 8][i] == '1');
        reference_put(&check, count_code[stuffed % 8][i] == '1');
    }
    crc = width == 17
              /* x17 + x16 + x14 + x13 + x11 + x6 + x4 + x3 + x + 1 */
              ? reference_crc(&plain, 17,
                              1u << 16 | 1u << 14 | 1u << 13 | 1u << 11 | 1u << 6 | 1u << 4 |
                                  1u << 3 | 1u << 1 | 1u,
                              1u << 16)
              /* x21 + x20 + x13 + x11 + x7 + x4 + x3 + 1 */
              : reference_crc(&plain, 21,
                              1u << 20 | 1u << 13 | 1u << 11 | 1u << 7 | 1u << 4 | 1u << 3 | 1u,
                              1u << 20);
    reference_number(&check, crc, width);
    for (size_t i = 0; i < check.count; i++) {
        if (i % 4 == 0) {
            char stuff = reference_value(to->bit[to->count - 1]) ? 'o' : 'i';

            to->bit[to->count++] = stuff;
        }
        to->bit[to->count++] = check.bit[i];
    }
    reference_trailer(to);
}

static inline void reference_encode(const struct bus_frame *frame, struct reference *to)
{
    if (frame->flags & FRAME_FD) {
        reference_fd(frame, to);
    } else {
        reference_classic(frame, to);
    }
}

/* Bits from SOF to EOF at the nominal and at the data rate. */
static inline void reference_length(const struct bus_frame *frame, unsigned *nominal,
                                    unsigned *data)
{
    struct reference bits;

    reference_encode(frame, &bits);
    *data = frame->flags & FRAME_BRS ? (unsigned)(bits.delimiter + 1 - bits.brs_end) : 0;
    *nominal = (unsigned)bits.count - *data;
}

#endif
