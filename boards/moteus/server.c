/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Serves the subframes of a frame, one after the other: writes and reads of registers. What cannot
 * be read any further ends the frame; what it has written by then counts.
 */
#include "boards/moteus/private.h"

#include "canbus/frame.h"

#include <math.h>
#include <string.h>

/* A frame under way and the reply to it. */
struct moteus_exchange {
    struct board *board;
    const struct bus_frame *frame;
    unsigned at;            /* the next byte of the frame */
    bool commands, discard; /* a mode was written; the UUID is another one's */
    enum board_verdict verdict;
    bool replies; /* a reply is wanted */
    uint8_t reply[MOTEUS_DATA_MAX];
    unsigned used;
};

/* Reads a varuint; false: the frame ends before. */
static bool moteus_read_varuint(struct moteus_exchange *x, uint32_t *value)
{
    *value = 0;
    for (unsigned shift = 0; shift < 35 && x->at < x->frame->len; shift += 7) {
        uint8_t byte = x->frame->data[x->at++];

        *value |= (uint32_t)(byte & 0x7f) << shift;
        if (!(byte & 0x80)) {
            return true;
        }
    }
    return false;
}

/* Appends a varuint to the reply; false: there is no room. */
static bool moteus_write_varuint(struct moteus_exchange *x, uint32_t value)
{
    for (; x->used < MOTEUS_DATA_MAX; value >>= 7) {
        x->reply[x->used++] = (uint8_t)((value & 0x7f) | (value > 0x7f ? 0x80 : 0));
        if (value <= 0x7f) {
            return true;
        }
    }
    return false;
}

/* Notes that a part of the frame was not obeyed, the first reason counts. */
static void moteus_reject(struct moteus_exchange *x, enum board_verdict verdict)
{
    x->verdict = x->verdict == BOARD_OBEYED ? verdict : x->verdict;
}

/* Appends an error to the reply. */
static void moteus_write_error(struct moteus_exchange *x, enum moteus_subframe subframe,
                               uint32_t number, enum moteus_reason reason)
{
    unsigned used = x->used;

    moteus_reject(x, reason == MOTEUS_UNKNOWN_REGISTER ? BOARD_UNKNOWN : BOARD_MALFORMED);
    if (!moteus_write_varuint(x, subframe) || !moteus_write_varuint(x, number) ||
        !moteus_write_varuint(x, reason)) {
        x->used = used;
    }
}

/* Returns whether a mode can be commanded. Those that set single phases have none here, and there
 * is no winding whose inductance could be measured. */
static bool moteus_has_mode(double mode)
{
    return mode >= 0.0 && mode < MOTEUS_MODES &&
           !(mode >= MOTEUS_PWM && mode <= MOTEUS_VOLTAGE_FOC) && mode != MOTEUS_MEASURE_INDUCTANCE;
}

/* Begins a command with a mode: all that belongs to it has its default. The mode itself goes to the
 * command alone, for the register shows the present one. */
static void moteus_begin_command(struct moteus_board *moteus, double mode)
{
    for (size_t i = 0; i < moteus_row_count; i++) {
        const struct moteus_row *row = &moteus_rows[i];

        if (row->commanded && row->number != MOTEUS_R_MODE) {
            moteus->value[row->number] = row->initial;
        }
    }
    moteus->value[MOTEUS_R_TORQUE_FEEDFORWARD] = 0.0;
    moteus->commanded_mode = mode;
}

/* Writes a register; the frame goes on whatever the reason is. */
static enum moteus_reason moteus_write_register(struct moteus_exchange *x, uint32_t number,
                                                enum moteus_type type, const uint8_t *data)
{
    struct moteus_board *moteus = moteus_board_of(x->board);
    const struct moteus_row *row = moteus_find_row(number);
    double value;

    if (!row) {
        return MOTEUS_UNKNOWN_REGISTER;
    }
    if (row->access == MOTEUS_R) {
        return MOTEUS_READ_ONLY;
    }
    value = moteus_get(row->quantity, type, data);
    if (number == MOTEUS_R_MODE) {
        if (!moteus_has_mode(trunc(value))) {
            return MOTEUS_UNKNOWN_REGISTER;
        }
        moteus_begin_command(moteus, trunc(value));
        x->commands = true;
    } else if (number >= MOTEUS_R_UUID_MASK && number < MOTEUS_R_UUID_MASK_CAPABLE) {
        x->discard =
            value !=
            (double)(int32_t)(uint32_t)moteus->value[MOTEUS_R_UUID + number - MOTEUS_R_UUID_MASK];
    } else if (row->access == MOTEUS_W) {
        moteus_board_act(x->board, number, value);
    } else {
        moteus->value[row->same_as ? row->same_as : number] = value;
    }
    return MOTEUS_OK;
}

/* Serves a write; false: the frame ends in it, or the rest is for another controller. */
static bool moteus_serve_write(struct moteus_exchange *x, enum moteus_type type, uint32_t count,
                               uint32_t first)
{
    unsigned bytes = moteus_bytes(type);

    for (uint32_t i = 0; i < count && !x->discard; i++) {
        enum moteus_reason reason;

        if (x->at + bytes > x->frame->len) {
            return false;
        }
        reason = moteus_write_register(x, first + i, type, x->frame->data + x->at);
        if (reason != MOTEUS_OK) {
            moteus_write_error(x, MOTEUS_WRITE_ERROR, first + i, reason);
        }
        x->at += bytes;
    }
    return !x->discard;
}

/* Appends the value of a register; false: there is none, or it does not come in that type. */
static bool moteus_reply_register(struct moteus_exchange *x, uint32_t number, enum moteus_type type)
{
    const struct moteus_board *moteus = moteus_board_of(x->board);
    const struct moteus_row *row = moteus_find_row(number);

    if (!row || row->access == MOTEUS_W ||
        !moteus_put(row->quantity, type, moteus->value[row->same_as ? row->same_as : number],
                    x->reply + x->used)) {
        return false;
    }
    x->used += moteus_bytes(type);
    return true;
}

/* Serves a read; false: an error, which ends the frame. */
static bool moteus_serve_read(struct moteus_exchange *x, uint8_t subframe, uint32_t count,
                              uint32_t first)
{
    enum moteus_type type = (enum moteus_type)(subframe & 0xc);
    unsigned used = x->used;
    bool room = moteus_write_varuint(x, MOTEUS_REPLY | (subframe & 0xf)) &&
                (subframe & 3 || moteus_write_varuint(x, count)) && moteus_write_varuint(x, first);

    for (uint32_t i = 0; room && i < count; i++) {
        room = x->used + moteus_bytes(type) <= MOTEUS_DATA_MAX;
        if (room && !moteus_reply_register(x, first + i, type)) {
            x->used = used;
            moteus_write_error(x, MOTEUS_READ_ERROR, first + i, MOTEUS_UNKNOWN_REGISTER);
            return false;
        }
    }
    x->used = room ? x->used : used;
    return room;
}

/* Serves the next subframe; false: the frame cannot be read any further. */
static bool moteus_serve_subframe(struct moteus_exchange *x)
{
    uint32_t subframe, count, first = 0;

    if (!moteus_read_varuint(x, &subframe) ||
        (subframe >= MOTEUS_REPLY && subframe != MOTEUS_NOP)) {
        moteus_reject(x, BOARD_UNKNOWN);
        return false;
    }
    if (subframe == MOTEUS_NOP) {
        return true;
    }
    count = subframe & 3;
    if ((count || moteus_read_varuint(x, &count)) && moteus_read_varuint(x, &first)) {
        if (subframe < MOTEUS_READ) {
            if (moteus_serve_write(x, (enum moteus_type)(subframe & 0xc), count, first)) {
                return true;
            }
        } else if (!x->replies || moteus_serve_read(x, (uint8_t)subframe, count, first)) {
            return true;
        }
    }
    if (!x->discard) {
        moteus_reject(x, BOARD_MALFORMED);
    }
    return false;
}

/* Queues the reply in the format of the request, which becomes CAN FD where it must. */
static void moteus_queue_reply(struct moteus_exchange *x)
{
    uint32_t id = moteus_id(x->board->address, x->frame->id >> 8 & 0x7f);
    uint8_t flags = x->frame->flags & (FRAME_FD | FRAME_BRS);
    uint8_t length = frame_fd_length(x->used);

    memset(x->reply + x->used, MOTEUS_NOP, length - x->used);
    board_queue_as(
        x->board, id,
        (uint8_t)(flags | (length > 8 ? FRAME_FD : 0) | (id > 0x7ff ? FRAME_EXTENDED : 0)), length,
        x->reply);
}

enum board_verdict moteus_board_serve(struct board *board, const struct bus_frame *frame)
{
    struct moteus_exchange x = {.board = board,
                                .frame = frame,
                                .verdict = BOARD_OBEYED,
                                .replies = frame->id & MOTEUS_WANTS_REPLY};

    while (x.at < frame->len && moteus_serve_subframe(&x)) {
    }
    if (x.commands && !x.discard) {
        moteus_board_command(board);
    }
    if (x.replies && !x.discard) {
        moteus_queue_reply(&x);
    }
    return x.verdict;
}
