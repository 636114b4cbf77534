/* SPDX-License-Identifier: Apache-2.0 */
/* The messages of a compact bus, from its table. */
#include "boards/compact/messages.h"

#include "boards/board_private.h"
#include "boards/compact/table.h"
#include "canbus/frame.h"

/* Returns whether a board sends or takes the message of a row. */
static bool row_applies(const struct compact_message *row, const struct board_config *board,
                        bool fd)
{
    bool motor = board->kind == BOARD_MOTOR, ft = board->kind == BOARD_FT;
    bool inertial = board->kind == BOARD_INERTIAL;

    switch (row->function) {
    case COMPACT_TELEMETRY:
        return motor && !fd;
    case COMPACT_TELEMETRY_FD:
        return motor && fd;
    case COMPACT_STATE:
        return motor;
    case COMPACT_FORCE:
    case COMPACT_MOMENT:
        return ft && !fd;
    case COMPACT_WRENCH_FD:
        return ft && fd;
    case COMPACT_FT_STATE:
        return ft;
    case COMPACT_ACCELERATION:
    case COMPACT_RATE:
    case COMPACT_ORIENTATION:
    case COMPACT_MAGNETIC:
        return inertial && !fd;
    case COMPACT_INERTIAL_FD:
        return inertial && fd;
    case COMPACT_INERTIAL_STATE:
        return inertial;
    default:
        return true;
    }
}

/* Returns the name of the message that answers; NULL when there is none. */
static const char *row_answer(const struct compact_message *row)
{
    return row->function == COMPACT_REQUEST    ? compact_message(COMPACT_REPLY)->name
           : row->function == COMPACT_DISCOVER ? compact_message(COMPACT_IDENTITY)->name
                                               : NULL;
}

/* Visits the message of a row with its number; repeats: how often the row's fields follow each
 * other, slot: of the first of them, -1: none. */
static void visit_row(struct message_walk *walk, const struct compact_message *row, int board,
                      unsigned number, unsigned repeats, int slot)
{
    int64_t period_ns = (int64_t)row->period_ms * MS;
    struct message message = {
        .name = row->name,
        .id = compact_id(row->function, number),
        .base = compact_id(row->function, 0),
        .step = row->by == COMPACT_BY_NONE ? 0 : 1,
        .number = number,
        .counts = row->by == COMPACT_BY_SLOT    ? MESSAGE_OF_SLOT
                  : row->by == COMPACT_BY_GROUP ? MESSAGE_OF_GROUP
                                                : MESSAGE_OF_NODE,
        .fd = walk->bus->fd,
        .sender = row->from_host ? MESSAGE_NO_BOARD : board,
        .receiver = row->from_host ? board : MESSAGE_NO_BOARD,
        .from_host = row->from_host,
        .code = MESSAGE_NO_CODE,
        .answer = row_answer(row),
        .section = row->from_host ? MESSAGE_FROM_HOST : MESSAGE_FROM_BOARDS,
        .fields = row->fields,
        .repeats = (uint8_t)repeats,
        .slot = slot,
        .list = row->by == COMPACT_BY_GROUP || row->function == COMPACT_TELEMETRY_FD,
    };

    /* The telemetry period is the rig's; the other periods are fixed */
    if (row->period_ms == 1 && board >= 0 && walk->config->board[board].period_ns > 0) {
        period_ns = walk->config->board[board].period_ns;
    }
    message.cycle_ns = (uint32_t)period_ns;
    message.length = (uint8_t)(row->length * repeats);
    if (message.fd) {
        message.length = frame_fd_length(message.length);
    }
    message_visit(walk, &message);
}

void compact_visit_board(struct message_walk *walk, int index, unsigned first_slot)
{
    const struct board_config *board = &walk->config->board[index];
    unsigned axes = board_config_axes(board);

    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];
        bool list = row->function == COMPACT_TELEMETRY_FD;

        if (!row_applies(row, board, walk->bus->fd)) {
            continue;
        }
        /* One message for the node, or one for each slot of its axes */
        if (row->by == COMPACT_BY_NODE) {
            visit_row(walk, row, index, board->address, list ? axes : 1,
                      list ? (int)first_slot : -1);
        } else if (row->by == COMPACT_BY_SLOT) {
            for (unsigned k = 0; k < axes; k++) {
                visit_row(walk, row, index, first_slot + k, 1, (int)(first_slot + k));
            }
        }
    }
}

void compact_visit_broadcasts(struct message_walk *walk)
{
    unsigned group = walk->bus->fd ? COMPACT_SLOTS : COMPACT_GROUP;

    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];

        if (row->by == COMPACT_BY_NONE) {
            visit_row(walk, row, MESSAGE_NO_BOARD, 0, 1, -1);
        }
        for (unsigned slot = 0; row->by == COMPACT_BY_GROUP && slot < walk->slots; slot += group) {
            visit_row(walk, row, MESSAGE_NO_BOARD, slot / COMPACT_GROUP,
                      walk->slots - slot < group ? walk->slots - slot : group, (int)slot);
        }
    }
}
