/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Number and values of the bits of a frame on the wire (ISO 11898-1:2015), including stuff bits.
 *
 * Classic frames have stuff bits from SOF to the end of the CRC, so their length depends on the
 * CRC-15. FD frames have stuff bits from SOF to the end of the data. Their CRC field has stuff bits
 * at fixed places and counts the others, so the length does not depend on the CRC. With a bit rate
 * switch, the bits behind BRS up to the CRC delimiter use the data rate. The rate changes at the
 * sample points of BRS and of the CRC delimiter. If both rates sample at the same fraction of a
 * bit, the first loses the time that the second gains.
 *
 * All RT-safe; wire_tables_make is only slow.
 */
#ifndef CANBUS_WIRE_BITS_H
#define CANBUS_WIRE_BITS_H

#include "canbus/frame.h"

enum {
    WIRE_INTERMISSION_BITS = 3,
    WIRE_EOF_BITS = 7,
    WIRE_DELIMITER_BITS = 8,  /* delimiter of an error frame */
    WIRE_ERROR_FLAG_BITS = 6, /* error flag of one node */
    WIRE_BITS_MAX = 800,      /* longest frame: 64 bytes, 29-bit identifier, all stuff bits */
};

/* Number of bits from SOF to EOF, without intermission. */
struct wire_length {
    uint16_t nominal, data; /* at the nominal and at the data bit rate */
};

/* Tables by byte. crc15: CRC-15. stuff: stuff bits of a byte that follows a run of equal bits, and
 * the run at its end. */
struct wire_tables {
    uint16_t crc15[256];
    uint16_t stuff[8 * 256];
};

void wire_tables_make(struct wire_tables *tables);

/* Computes the exact length of a valid data or remote frame. */
struct wire_length wire_frame_length(const struct wire_tables *tables,
                                     const struct bus_frame *frame);

/* Computes the greatest length of a frame of this format and data length, for any identifier and
 * data. It assumes a stuff bit after the first five bits, and then after every four bits. For FD,
 * it adds the bit by which a receiver's delay may extend the ACK field. 8 bytes: 132 bits, with
 * intermission 135; with a 29-bit identifier 157 and 160. */
struct wire_length wire_worst_length(uint8_t flags, uint8_t len);

/* Returns the duration of a length in ns, each part rounded to the nanosecond. */
int64_t wire_length_ns(struct wire_length length, int64_t bitrate, int64_t data_bitrate);

/* An encoded frame, and the bit indices where its parts begin. */
struct wire_bits {
    /* 0 = dominant; the ACK slot is recessive, as the sender sends it */
    uint8_t bit[WIRE_BITS_MAX];
    size_t count;      /* SOF to EOF */
    size_t control;    /* first bit behind the arbitration field */
    size_t fast, slow; /* bits [fast, slow) use the data rate; equal without BRS */
    size_t crc_end;    /* the CRC delimiter */
    size_t ack;        /* the ACK slot */
};

/* Writes every bit of a valid data or remote frame. */
void wire_frame_encode(const struct bus_frame *frame, struct wire_bits *bits);

/* Returns the arbitration priority as a number; the lower one wins. It consists of 11 bits of base
 * identifier, RTR or SRR, IDE, 18 bits of identifier, RTR. A data frame therefore wins over a
 * remote frame with the same identifier, and a standard frame over extended frames with the same
 * base. */
uint32_t wire_priority(const struct bus_frame *frame);

#endif
