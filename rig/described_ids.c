/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks that the boards on a bus with a described protocol have unique identifiers. The loader of
 * the protocol file refuses conflicts inside the file (boards/described/load.c). This file checks
 * conflicts from numbers in the rig: addresses, and slots of axes.
 */
#include "boards/described/protocol.h"
#include "boards/messages.h"
#include "rig/builder_private.h"

struct id_check {
    struct rig_builder *b;
    size_t bus;
    size_t outer, inner; /* numbers of messages visited by the outer and the inner loop */
    struct message message;
    enum error_code code;
};

/* Returns the board that sends a message, or its only receiver. NULL = none. */
static const struct board_config *message_board(const struct id_check *check,
                                                const struct message *message)
{
    int board = message->from_host ? message->receiver : message->sender;

    return board == MESSAGE_NO_BOARD ? NULL : &check->b->rig->boards.board[board];
}

/* Returns whether two messages can have the same identifier and cannot be distinguished, or collide
 * on the bus. */
static bool messages_collide(const struct message *x, const struct message *y)
{
    const struct described_frame *a = x->row, *b = y->row;

    if (x->extended != y->extended || ((x->id ^ y->id) & ~(x->id_mask | y->id_mask))) {
        return false;
    }

    /* Answers of several drives with one identifier need the address in the data */
    if (!x->from_host && !y->from_host && x->sender != y->sender) {
        return described_find_field(a, DESCRIBED_ADDRESS) < 0 ||
               described_find_field(b, DESCRIBED_ADDRESS) < 0;
    }
    return a->index <= b->index ? !described_told_apart(a, b) : !described_told_apart(b, a);
}

/* Returns the place of a board's address in the rig file. Without a board, returns the place of the
 * bus. */
static const struct yaml_mark *board_mark(const struct id_check *check,
                                          const struct board_config *board)
{
    const struct rig_bus *bus = &check->b->bus[check->bus];
    const struct raw_bus *raw = &check->b->raw->bus[check->bus];

    return board ? yaml_place(
                       &raw->board[board - check->b->rig->boards.board - bus->first_board].mark,
                       "address")
                 : &raw->mark;
}

/* Compares a message of the inner loop with the message of the outer loop, which comes later. */
static bool check_inner(void *context, const struct message *message)
{
    struct id_check *check = context;
    const struct message *later = &check->message;
    const struct board_config *x = message_board(check, message), *y = message_board(check, later);

    if (check->inner++ == check->outer) {
        return false;
    }
    if (messages_collide(message, later)) {
        check->code = yaml_error(
            check->b->error, board_mark(check, y),
            "found %s%s, whose frame %s has the identifier 0x%x that frame %s of %s%s (line %d) "
            "has too, expected other addresses, or identifiers of their own in protocol %s",
            y ? "board " : "the axes of the bus", y ? y->name : "", later->name,
            (unsigned)later->id, message->name, x ? "board " : "all axes", x ? x->name : "",
            board_mark(check, x)->line, check->b->bus[check->bus].described->name);
    }
    return !check->code;
}

/* Compares a message with all earlier messages. */
static bool check_outer(void *context, const struct message *message)
{
    struct id_check *check = context;

    check->message = *message;
    check->inner = 0;
    boards_messages(&check->b->rig->boards, (int)check->bus, check_inner, check);
    check->outer++;
    return !check->code;
}

enum error_code rig_check_described_ids(struct rig_builder *b, size_t bus)
{
    struct id_check check = {.b = b, .bus = bus};

    boards_messages(&b->rig->boards, (int)bus, check_outer, &check);
    return check.code;
}
