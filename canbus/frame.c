/* SPDX-License-Identifier: Apache-2.0 */
/* Checks whether a frame is legal, and counts its bits on the wire, without stuff bits. */
#include "canbus/frame.h"

#include <assert.h>
#include <string.h>

const uint8_t frame_lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

uint8_t frame_fd_length(unsigned bytes)
{
    size_t code = 0;

    while (code < 15 && frame_lengths[code] < bytes) {
        code++;
    }
    return frame_lengths[code];
}

bool frame_valid(const struct bus_frame *frame)
{
    const uint8_t known =
        FRAME_EXTENDED | FRAME_REMOTE | FRAME_ERROR | FRAME_FD | FRAME_BRS | FRAME_ESI;
    const uint8_t flags = frame->flags;

    /* Most frames are of classic CAN with a standard identifier */
    if (!flags) {
        return frame->id <= 0x7FFu && frame->len <= 8;
    }
    /* Only known flags, in valid combinations */
    if (flags & ~known) {
        return false;
    }
    /* An error frame has no format; FD has no remote frames, classic CAN no second bit rate */
    if ((flags & FRAME_ERROR) && flags != FRAME_ERROR) {
        return false;
    }
    if ((flags & FRAME_FD) ? (flags & FRAME_REMOTE) : (flags & (FRAME_BRS | FRAME_ESI))) {
        return false;
    }
    /* Identifier and length must fit the format */
    if (frame->id > ((flags & (FRAME_EXTENDED | FRAME_ERROR)) ? 0x1FFFFFFFu : 0x7FFu)) {
        return false;
    }
    return (flags & FRAME_FD) ? frame_fd_length(frame->len) == frame->len : frame->len <= 8;
}

uint32_t frame_fast_bits(const struct bus_frame *frame)
{
    /* At the nominal rate: 17 bits from SOF to the switch (36 with a 29-bit identifier), ACK and
     * its delimiter, EOF and intermission */
    const uint32_t slow = (frame->flags & FRAME_EXTENDED ? 36u : 17u) + 2u + 7u + 3u;

    return frame->flags & FRAME_BRS ? frame_bits(frame) - slow : 0;
}

struct bus_frame frame_make(uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame frame = {.id = id, .len = len};

    assert(len <= 8);
    if (len) {
        memcpy(frame.data, data, len);
    }
    return frame;
}
