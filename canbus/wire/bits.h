/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A frame as bits on the wire (ISO 11898-1:2015): how many, stuff bits included, and which.
 *
 * Classic frames are stuffed from SOF to the end of the CRC, so their length depends on the CRC-15.
 * FD frames are stuffed from SOF to the end of the data; the CRC field has stuff bits at fixed
 * places and counts the others, so their length depends on the CRC not at all. With a bit rate
 * switch the bits behind BRS up to and with the CRC delimiter go at the data rate: the switch is at
 * the sample points of those two bits, and what the first of them loses the second gains when both
 * rates sample at the same fraction of a bit.
 *
 * All RT-safe but wire_tables_make, which is only slow.
 */
#ifndef CANBUS_WIRE_BITS_H
#define CANBUS_WIRE_BITS_H

#include "canbus/frame.h"

#include <stddef.h>

enum {
    WIRE_INTERMISSION_BITS = 3,
    WIRE_EOF_BITS = 7,
    WIRE_DELIMITER_BITS = 8,  /* of an error frame */
    WIRE_ERROR_FLAG_BITS = 6, /* of one node */
    WIRE_BITS_MAX = 800,      /* of a frame: 64 bytes, 29-bit identifier, every stuff bit */
};

/* Bits from SOF to EOF, the intermission not counted. */
struct wire_length {
    uint16_t nominal, data; /* at the nominal and at the data bit rate */
};

/* Tables for a byte at a time: CRC-15; the stuff bits of eight bits after a run, and the run
 * that they leave. */
struct wire_tables {
    uint16_t crc15[256];
    uint16_t stuff[8 * 256];
};

void wire_tables_make(struct wire_tables *tables);

/* Computes the exact length of a valid data or remote frame. */
struct wire_length wire_frame_length(const struct wire_tables *tables,
                                     const struct bus_frame *frame);

/* Computes the greatest length of a frame of this format and data length over all identifiers
 * and data: a stuff bit after the first five bits and after every four from there on, and, for
 * FD, the one bit of the ACK field that a receiver's delay may add. 8 bytes: 132 bits, with the
 * intermission 135; 29-bit identifier 157 and 160. */
struct wire_length wire_worst_length(uint8_t flags, uint8_t len);

/* Returns the duration of a length in ns, each part rounded to the nanosecond. */
int64_t wire_length_ns(struct wire_length length, int64_t bitrate, int64_t data_bitrate);

/* Where the parts of an encoded frame begin, as indices of bits. */
struct wire_bits {
    uint8_t bit[WIRE_BITS_MAX]; /* 0 = dominant; the ACK slot as the sender sends it, recessive */
    size_t count;               /* SOF to EOF */
    size_t control;             /* first bit behind the arbitration field */
    size_t fast, slow;          /* bits [fast, slow) go at the data rate; equal without BRS */
    size_t crc_end;             /* the CRC delimiter */
    size_t ack;                 /* the ACK slot */
};

/* Writes every bit of a valid data or remote frame. */
void wire_frame_encode(const struct bus_frame *frame, struct wire_bits *bits);

/* Returns what decides the arbitration, as a number; the lower one wins. 11 bits of base
 * identifier, RTR or SRR, IDE, 18 bits of identifier, RTR: so a data frame beats the remote
 * frame of the same identifier, and a standard frame the extended ones of the same base. */
uint32_t wire_priority(const struct bus_frame *frame);

#endif
