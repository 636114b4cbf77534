/* SPDX-License-Identifier: Apache-2.0 */
/* Writes events of boards as lines of a log. Not called in the loop. */
#include "boards/board_private.h"

#include <inttypes.h>
#include <stdio.h>

/* Writes the names of fault bits, separated by commas. */
static void event_list_faults(const struct protocol *protocol, uint32_t bits, char *text,
                              size_t size)
{
    const char *const *names = protocol->fault_names;
    size_t used = 0;

    text[0] = '\0';
    for (size_t i = 0; names[i]; i++) {
        if (bits >> i & 1 && used < size) {
            used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", names[i]);
        }
    }
}

/* Writes what an event says, without time and board. */
static void event_describe(const struct protocol *protocol, const struct board_event *event,
                           char *text, size_t size)
{
    char faults[128];
    unsigned axis = event->axis;
    uint32_t a = event->a, b = event->b;

    switch (event->kind) {
    /* Of an axis */
    case BOARD_EVENT_MODE:
        snprintf(text, size, "axis %u from %s to %s%s", axis, protocol->mode_name(a),
                 protocol->mode_name(b), protocol->modes_are_states ? "" : " mode");
        return;
    case BOARD_EVENT_FAULT:
        event_list_faults(protocol, a, faults, sizeof faults);
        snprintf(text, size, "axis %u has a fault: %s", axis, faults);
        return;
    case BOARD_EVENT_TIMEOUT:
        snprintf(text, size, "axis %u: the %s%scommand timed out, %s", axis,
                 protocol->modes_are_states ? "" : protocol->mode_name(a),
                 protocol->modes_are_states ? "" : " ", protocol->timeout_text);
        return;
    case BOARD_EVENT_SOURCE_LOST:
        snprintf(text, size, "axis %u: torque source %" PRIu32 " timed out, motor switched off",
                 axis, a);
        return;
    case BOARD_EVENT_LIMIT:
        snprintf(text, size, "axis %u is beyond its position limit at %" PRId32 " %s", axis,
                 (int32_t)a, protocol->limit_text);
        return;

    /* Of a frame */
    case BOARD_EVENT_UNKNOWN:
        snprintf(text, size, "unknown command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;
    case BOARD_EVENT_MALFORMED:
        snprintf(text, size,
                 "wrong length or value in command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;

    /* Of a board */
    case BOARD_EVENT_ADDRESS:
        snprintf(text, size, "address changed from %" PRIu32 " to %" PRIu32, a, b);
        return;
    case BOARD_EVENT_RESTART:
        snprintf(text, size, "%s", a ? "bootloader entered" : "application started");
        return;
    case BOARD_EVENT_FIRMWARE:
        snprintf(text, size, "firmware received, %" PRIu32 " bytes, CRC-32 %08" PRIx32, a, b);
        return;
    case BOARD_EVENT_OVERFLOW:
        snprintf(text, size, "frames lost, %" PRIu32 " so far", a);
        return;
    case BOARD_EVENT_OVER_HEATED:
        snprintf(text, size, "axis %u is too hot: %.1f degree C", axis, (int32_t)a * 0.1);
        return;
    case BOARD_EVENT_OWED:
        snprintf(text, size, "axis %u is not switched on: a strict board first wants %s", axis,
                 a == BOARD_OWED_PROTOCOL ? "GET_FIRMWARE_VERSION with its protocol"
                 : a == BOARD_OWED_PID    ? "SET_POSITION_PID and SET_POSITION_PID_LIMITS"
                                          : "a calibration");
        return;
    case BOARD_EVENT_SILENT:
        snprintf(text, size, "external board silent for %" PRIu32 " ms", a);
        return;
    case BOARD_EVENT_HEARD:
        snprintf(text, size, "external board heard");
        return;
    }
    snprintf(text, size, "event %d", (int)event->kind);
}

void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size)
{
    const struct board *board = boards->board[event->board];
    char what[192];

    event_describe(board->bus->config.protocol, event, what, sizeof what);
    snprintf(text, size, "%.6f s: %s (bus %d, address %d): %s", (double)event->time_ns * 1e-9,
             board->config.name, event->bus, event->address, what);
}
