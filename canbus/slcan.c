/* SPDX-License-Identifier: Apache-2.0 */
/* Reads and writes the text of the slcan (Lawicel) protocol; canbus/slcan.h describes it. */
#include "canbus/slcan.h"

#include "base/array.h"

/* Letters of frames with their flags. */
static const struct slcan_letter {
    char letter;
    uint8_t flags;
} letters[] = {
    {'t', 0},
    {'T', FRAME_EXTENDED},
    {'r', FRAME_REMOTE},
    {'R', FRAME_REMOTE | FRAME_EXTENDED},
    {'d', FRAME_FD},
    {'D', FRAME_FD | FRAME_EXTENDED},
    {'b', FRAME_FD | FRAME_BRS},
    {'B', FRAME_FD | FRAME_BRS | FRAME_EXTENDED},
};

/* Nominal bit rates in bit/s by the digit behind S. */
static const int64_t bit_rates[] = {10000,  20000,  50000,  100000, 125000,
                                    250000, 500000, 800000, 1000000};

/* ---- reading ---- */

/* Reads a frame: letter, identifier, length code and data; false = it is malformed. */
static bool slcan_read_frame(const struct slcan_letter *letter, const char *text, size_t size,
                             struct bus_frame *frame)
{
    size_t id_digits = letter->flags & FRAME_EXTENDED ? 8 : 3, at = 1 + id_digits;
    uint32_t code, byte;

    *frame = (struct bus_frame){.flags = letter->flags};
    if (size < at + 1 || !hex_read(text + 1, id_digits, &frame->id) ||
        !hex_read(text + at, 1, &code)) {
        return false;
    }
    at++;
    if (!(letter->flags & FRAME_FD) && code > 8) {
        return false;
    }
    frame->len = frame_lengths[code];
    if (size != at + (letter->flags & FRAME_REMOTE ? 0u : 2u * frame->len)) {
        return false;
    }
    for (size_t i = 0; i < frame->len && !(letter->flags & FRAME_REMOTE); i++) {
        if (!hex_read(text + at + 2 * i, 2, &byte)) {
            return false;
        }
        frame->data[i] = (uint8_t)byte;
    }
    return frame_valid(frame);
}

/* Reads the digit of a command of one letter and one digit; false = it is missing or above
 * `most`. */
static bool slcan_read_setting(const char *text, size_t size, int most, int64_t *value)
{
    *value = size == 2 ? hex_value(text[1]) : -1;
    return *value >= 0 && *value <= most;
}

/* Reads a command other than a frame, and its value; SLCAN_WRONG = unknown or malformed. */
static enum slcan_command slcan_read_command(const char *text, size_t size, int64_t *value)
{
    const bool alone = size == 1;
    uint32_t filter;

    switch (text[0]) {
    /* Bit rates */
    case 'S':
        if (!slcan_read_setting(text, size, (int)ARRAY_COUNT(bit_rates) - 1, value)) {
            return SLCAN_WRONG;
        }
        *value = bit_rates[*value];
        return SLCAN_BIT_RATE;
    case 'Y':
        if (!slcan_read_setting(text, size, 8, value) || *value == 0) {
            return SLCAN_WRONG;
        }
        *value *= 1000000;
        return SLCAN_DATA_RATE;

    /* Opening, closing and reports of the channel */
    case 'O':
    case 'L':
        *value = text[0] == 'L';
        return alone ? SLCAN_OPEN : SLCAN_WRONG;
    case 'C':
        return alone ? SLCAN_CLOSE : SLCAN_WRONG;
    case 'Z':
        return slcan_read_setting(text, size, 1, value) ? SLCAN_TIME_STAMP : SLCAN_WRONG;
    case 'F':
        return alone ? SLCAN_STATUS : SLCAN_WRONG;
    case 'V':
    case 'v':
        return alone ? SLCAN_VERSION : SLCAN_WRONG;
    case 'N':
        return alone ? SLCAN_SERIAL : SLCAN_WRONG;

    /* Commands that are accepted and have no effect */
    case 'X':
    case 'W':
        return slcan_read_setting(text, size, 1, value) ? SLCAN_ACCEPTED : SLCAN_WRONG;
    case 'M':
    case 'm':
        /* Only the filter (code and mask) that accepts everything is supported */
        return size == 9 && hex_read(text + 1, 8, &filter) &&
                       filter == (text[0] == 'M' ? 0 : UINT32_MAX)
                   ? SLCAN_ACCEPTED
                   : SLCAN_WRONG;
    default:
        return SLCAN_WRONG;
    }
}

void slcan_parse(const char *text, size_t size, struct slcan_request *request)
{
    *request = (struct slcan_request){.command = SLCAN_WRONG};
    if (size == 0) {
        request->command = SLCAN_ACCEPTED; /* clients send empty commands to clear the line */
        return;
    }
    for (size_t i = 0; i < ARRAY_COUNT(letters); i++) {
        if (letters[i].letter == text[0]) {
            request->command = slcan_read_frame(&letters[i], text, size, &request->frame)
                                   ? SLCAN_FRAME
                                   : SLCAN_WRONG;
            return;
        }
    }
    request->command = slcan_read_command(text, size, &request->value);
}

/* ---- writing ---- */

size_t slcan_format(const struct bus_frame *frame, bool stamped, char text[SLCAN_TEXT_MAX])
{
    const uint8_t kept = FRAME_EXTENDED | FRAME_REMOTE | FRAME_FD | FRAME_BRS;
    char *to = text;
    uint32_t code = 0;

    if (frame->flags & FRAME_ERROR) {
        return 0;
    }
    /* Letter, identifier, length code, data and time stamp (ms within a minute) */
    for (size_t i = 0; i < ARRAY_COUNT(letters); i++) {
        if (letters[i].flags == (frame->flags & kept)) {
            *to++ = letters[i].letter;
        }
    }
    to = hex_put(to, frame->id, frame->flags & FRAME_EXTENDED ? 8 : 3);
    while (frame_lengths[code] < frame->len) {
        code++;
    }
    to = hex_put(to, code, 1);
    for (size_t i = 0; i < frame->len && !(frame->flags & FRAME_REMOTE); i++) {
        to = hex_put(to, frame->data[i], 2);
    }
    if (stamped) {
        to = hex_put(to, (uint32_t)(frame->time_ns / 1000000 % SLCAN_MINUTE_MS), 4);
    }
    *to++ = '\r';
    *to = '\0';
    return (size_t)(to - text);
}
