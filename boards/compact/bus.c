/* SPDX-License-Identifier: Apache-2.0 */
/* Buses that speak the compact protocol: dispatches each frame to the nodes and axes that it is
 * for. */
#include "boards/compact/private.h"

#include "canbus/frame.h"

_Static_assert(COMPACT_NODE_MAX + 1 == BOARD_ADDRESSES, "a node is an address of its bus");

/* Obeys MODE: a mode for each of the slots in its mask. */
static void compact_bus_receive_mode(struct boards *boards, struct compact_bus *bus,
                                     const struct bus_frame *frame)
{
    struct board *listener = NULL;
    enum board_verdict verdict = BOARD_OBEYED;
    int64_t values[FIELDS_MAX];
    bool refused = false;

    fields_decode(compact_message(COMPACT_MODE)->fields, frame->data, frame->len, values);
    if (frame->len != COMPACT_MODE_LENGTH ||
        (values[0] != COMPACT_OFF && values[0] != COMPACT_VOLTAGE &&
         values[0] != COMPACT_CURRENT)) {
        verdict = BOARD_MALFORMED;
    }
    /* The frame counts once, as refused when one axis refuses it */
    for (unsigned slot = 0; slot < bus->slots; slot++) {
        struct board *board = &bus->slot[slot].motor->node.board;

        if (board_is_deaf(board) || !(values[1] >> slot & 1)) {
            continue;
        }
        listener = board;
        board_hear(board);
        if (verdict == BOARD_OBEYED) {
            enum compact_mode mode = (enum compact_mode)values[0];

            refused = !compact_axis_command_mode(board, bus->slot[slot].axis, mode) || refused;
        }
    }
    boards_count_frame(boards, listener, refused ? BOARD_MALFORMED : verdict, frame);
}

/* Obeys COMMAND: set-points of consecutive slots from the group's first one on. */
static void compact_bus_receive_command(struct boards *boards, struct compact_bus *bus,
                                        const struct bus_frame *frame)
{
    unsigned first = (frame->id & 0x1f) * COMPACT_GROUP;
    struct board *listener = NULL;
    bool whole = frame->len > 0 && frame->len % 2 == 0;

    for (unsigned i = 0; i < (frame->len + 1u) / 2 && first + i < bus->slots; i++) {
        struct board *board = &bus->slot[first + i].motor->node.board;

        if (board_is_deaf(board)) {
            continue;
        }
        listener = board;
        board_hear(board);
        if (whole) {
            compact_axis_command(board, bus->slot[first + i].axis, get_i16_le(frame->data + 2 * i));
        }
    }
    if (frame->len == 0 && first < bus->slots) {
        listener = &bus->slot[first].motor->node.board;
    }
    boards_count_frame(boards, listener, whole ? BOARD_OBEYED : BOARD_MALFORMED, frame);
}

/* Obeys DISCOVER: every node queues its identity. */
static void compact_bus_receive_discover(struct boards *boards, struct board_bus *bus,
                                         const struct bus_frame *frame)
{
    struct board *listener = NULL;

    for (unsigned node = 1; node < BOARD_ADDRESSES; node++) {
        struct board *board = bus->by_address[node];

        if (board && !board_is_deaf(board)) {
            listener = board;
            board_hear(board);
            if (frame->len == 0) {
                compact_node_identify(compact_node_of(board));
            }
        }
    }
    boards_count_frame(boards, listener, frame->len ? BOARD_MALFORMED : BOARD_OBEYED, frame);
}

/* Obeys REQUEST: reads or writes a parameter of a node and queues REPLY. */
static void compact_bus_receive_request(struct boards *boards, struct board_bus *bus,
                                        const struct bus_frame *frame)
{
    struct board *board = bus->by_address[frame->id & 0x1f];
    bool write = frame->len > 0 && frame->data[0] & COMPACT_WRITE;
    enum compact_result result = COMPACT_WRONG_LENGTH;
    enum board_verdict verdict = BOARD_OBEYED;
    int64_t values[FIELDS_MAX] = {0};
    uint8_t data[8] = {0};

    if (!board || board_is_deaf(board)) {
        boards->counters.foreign++;
        return;
    }
    fields_decode(compact_message(COMPACT_REQUEST)->fields, frame->data, frame->len, values);
    if (frame->len == (write ? COMPACT_WRITE_LENGTH : COMPACT_READ_LENGTH)) {
        struct compact_node *node = compact_node_of(board);

        result =
            node->ops->parameter(node, (unsigned)values[0], (unsigned)values[2], write, &values[3]);
    }
    /* REPLY repeats the request with the value in force and the result */
    values[4] = result;
    fields_encode(compact_message(COMPACT_REPLY)->fields, values, data);
    board_queue(board, compact_id(COMPACT_REPLY, board->address), COMPACT_REPLY_LENGTH, data);
    if (result != COMPACT_OK) {
        verdict = result == COMPACT_UNKNOWN_PARAMETER ? BOARD_UNKNOWN : BOARD_MALFORMED;
    }
    boards_count_frame(boards, board, verdict, frame);
}

/* Dispatches a frame by the function in its identifier (struct board_bus_ops). */
static void compact_bus_receive(struct boards *boards, struct board_bus *bus,
                                const struct bus_frame *frame)
{
    bool first = (frame->id & 0x1f) == 0;

    switch (frame->id >> 5) {
    case COMPACT_MODE:
        if (first) {
            compact_bus_receive_mode(boards, compact_bus_of(bus), frame);
            return;
        }
        break;
    case COMPACT_COMMAND:
        compact_bus_receive_command(boards, compact_bus_of(bus), frame);
        return;
    case COMPACT_DISCOVER:
        if (first) {
            compact_bus_receive_discover(boards, bus, frame);
            return;
        }
        break;
    case COMPACT_REQUEST:
        compact_bus_receive_request(boards, bus, frame);
        return;
    default:
        break;
    }
    boards->counters.foreign++;
}

/* Gives the axes of a new motor board the next slots. */
static void compact_bus_add_board(struct board_bus *bus, struct board *board)
{
    struct compact_bus *compact = compact_bus_of(bus);

    for (unsigned i = 0; i < BOARD_AXES_MAX && board_joint(board, i) >= 0; i++) {
        compact->slot[compact->slots++] =
            (struct compact_slot){.motor = compact_motor_of(board), .axis = i};
    }
}

static const struct board_bus_ops compact_bus_ops = {
    .add_board = compact_bus_add_board,
    .receive = compact_bus_receive,
};

struct board_bus *compact_bus_create(struct arena *arena)
{
    struct compact_bus *compact = arena_alloc(arena, 1, sizeof *compact);

    if (!compact) {
        return NULL;
    }
    compact->bus.ops = &compact_bus_ops;
    return &compact->bus;
}
