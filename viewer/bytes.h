/* SPDX-License-Identifier: Apache-2.0 */
/* Little-endian numbers into a buffer; each returns where the next goes. RT-safe. */
#ifndef VIEWER_BYTES_H
#define VIEWER_BYTES_H

#include "canbus/frame.h"

#include <stdint.h>
#include <string.h>

static inline uint8_t *put_u8(uint8_t *to, uint8_t value)
{
    *to = value;
    return to + 1;
}

static inline uint8_t *put_u16(uint8_t *to, uint16_t value)
{
    put_u16_le(to, value);
    return to + 2;
}

static inline uint8_t *put_u32(uint8_t *to, uint32_t value)
{
    put_u32_le(to, value);
    return to + 4;
}

static inline uint8_t *put_u64(uint8_t *to, uint64_t value)
{
    put_u32_le(to, (uint32_t)value);
    put_u32_le(to + 4, (uint32_t)(value >> 32));
    return to + 8;
}

static inline uint8_t *put_f32(uint8_t *to, double value)
{
    const float narrow = (float)value;
    uint32_t bits;

    memcpy(&bits, &narrow, sizeof bits);
    return put_u32(to, bits);
}

#endif
