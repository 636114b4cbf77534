/* SPDX-License-Identifier: Apache-2.0 */
/* The CAN frame, classic or FD, of all parts of the simulator. RT-safe. */
#ifndef CANBUS_FRAME_H
#define CANBUS_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    FRAME_EXTENDED = 1 << 0, /* 29-bit identifier */
    FRAME_REMOTE = 1 << 1,   /* remote request; no data */
    FRAME_ERROR = 1 << 2, /* error frame: id holds the CAN_ERR_ class bits of linux/can/error.h */
    FRAME_FD = 1 << 3,    /* CAN FD format */
    FRAME_BRS = 1 << 4,   /* FD: bit rate switch */
    FRAME_ESI = 1 << 5,   /* FD: sender is error passive */
};

struct bus_frame {
    uint32_t id;
    uint8_t flags;
    uint8_t len; /* bytes of data: 0-8 classic; 0-8, 12, 16, 20, 24, 32, 48, 64 FD */
    uint8_t data[64];
    /* The sending node, if the sending port has several (local_bus_join); 0 on other ports.
     * Unused in received frames. */
    uint16_t node;
    int64_t time_ns; /* time of reception or sending, on the port's clock */
};

/* Data lengths in bytes, indexed by the data length code (DLC). */
extern const uint8_t frame_lengths[16];

/* Returns the shortest FD length that holds `bytes` bytes (at most 64). */
uint8_t frame_fd_length(unsigned bytes);

/* Checks whether a frame is valid: identifier in range, length possible in its format, no
 * contradictory flags. */
bool frame_valid(const struct bus_frame *frame);

/* Returns the length of a frame on the wire in bits, with the 3 bits of intermission but without
 * stuff bits. Classic: 47 + 8 n, with a 29-bit identifier 67 + 8 n (n = 0 for remote frames; ISO
 * 11898-1). FD: 62 + 8 n up to 16 bytes, 67 + 8 n above (CRC of 21 instead of 17 bits), 19 more for
 * a 29-bit identifier. This includes the stuff count and the fixed stuff bits of the CRC field. All
 * bits count at the nominal rate; with a bit rate switch this is an upper bound of the time. Error
 * frames have 0 bits, because they are messages of the controller. */
static inline uint32_t frame_bits(const struct bus_frame *frame)
{
    const bool extended = frame->flags & FRAME_EXTENDED;

    if (frame->flags & FRAME_ERROR) {
        return 0;
    }
    /* Overhead from SOF to the intermission; FD frames of more than 16 bytes have CRC-21 (4 bits
     * more and a fixed stuff bit) */
    if (frame->flags & FRAME_FD) {
        return (frame->len <= 16 ? 62u : 67u) + (extended ? 19u : 0u) + 8u * frame->len;
    }
    /* Overhead from SOF to the intermission of a classic frame */
    return (extended ? 67u : 47u) + ((frame->flags & FRAME_REMOTE) ? 0u : 8u * frame->len);
}

/* Returns the number of bits of frame_bits() at the data rate. With a bit rate switch: the bits
 * from the switch to the end of the CRC. Otherwise 0. */
uint32_t frame_fast_bits(const struct bus_frame *frame);

/* Makes a classic data frame with a standard identifier; len <= 8; data beyond len is zero. */
struct bus_frame frame_make(uint32_t id, uint8_t len, const uint8_t *data);

/* Checks whether a frame has one of `count` standard identifiers. */
static inline bool frame_has_standard_id(const struct bus_frame *frame, const uint32_t *id,
                                         size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (frame->id == id[i] && !(frame->flags & FRAME_EXTENDED)) {
            return true;
        }
    }
    return false;
}

/* Returns the value of a hexadecimal digit; -1 = not a digit. */
static inline int hex_value(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : -1;
}

/* Reads a number of `digits` hexadecimal digits; false = a character is not a digit. */
static inline bool hex_read(const char *text, size_t digits, uint32_t *value)
{
    *value = 0;
    for (size_t i = 0; i < digits; i++) {
        if (hex_value(text[i]) < 0) {
            return false;
        }
        *value = *value << 4 | (uint32_t)hex_value(text[i]);
    }
    return true;
}

/* Writes a number with `digits` hexadecimal digits. Returns the end. */
static inline char *hex_put(char *at, uint32_t value, int digits)
{
    while (digits-- > 0) {
        *at++ = "0123456789ABCDEF"[value >> 4 * digits & 0xF];
    }
    return at;
}

/* Read and write numbers byte by byte in a given byte order; there are no packed structs. */
static inline uint16_t get_u16_le(const uint8_t *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}

static inline int16_t get_i16_le(const uint8_t *p)
{
    return (int16_t)get_u16_le(p);
}

static inline uint32_t get_u32_le(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline int32_t get_i32_le(const uint8_t *p)
{
    return (int32_t)get_u32_le(p);
}

static inline uint16_t get_u16_be(const uint8_t *p)
{
    return (uint16_t)(p[0] << 8 | p[1]);
}

static inline void put_u16_le(uint8_t *p, uint16_t value)
{
    p[0] = (uint8_t)value;
    p[1] = (uint8_t)(value >> 8);
}

static inline void put_u32_le(uint8_t *p, uint32_t value)
{
    put_u16_le(p, (uint16_t)value);
    put_u16_le(p + 2, (uint16_t)(value >> 16));
}

#endif
