/* SPDX-License-Identifier: Apache-2.0 */
/* Buses that speak CANopen: finds the nodes that a frame is for. */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

enum { NODES = CIA402_NODE_MAX + 1, NODE_ID_MASK = 0x7f };

_Static_assert((int)NODES == (int)BOARD_ADDRESSES, "a node is an address of its bus");

/* Returns the node with a Node-ID that hears; NULL: none. */
static struct cia402_node *cia402_bus_node(const struct board_bus *bus, unsigned id)
{
    struct board *board = id > 0 && id < NODES ? bus->by_address[id] : NULL;

    return board && !board_is_deaf(board) ? cia402_node_of(board) : NULL;
}

/* Returns whether a number is a command of NMT. */
static bool cia402_bus_is_command(unsigned command)
{
    return command == CIA402_NMT_START || command == CIA402_NMT_STOP ||
           command == CIA402_NMT_PRE_OPERATIONAL || command == CIA402_NMT_RESET_NODE ||
           command == CIA402_NMT_RESET_COMMUNICATION;
}

/* Obeys a command of NMT, for one node or for all. */
static void cia402_bus_receive_nmt(struct boards *boards, struct board_bus *bus,
                                   const struct bus_frame *frame)
{
    enum board_verdict verdict = frame->len != CIA402_NMT_LENGTH          ? BOARD_MALFORMED
                                 : !cia402_bus_is_command(frame->data[0]) ? BOARD_UNKNOWN
                                                                          : BOARD_OBEYED;
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);

        if (node &&
            (frame->len < CIA402_NMT_LENGTH || frame->data[1] == 0 || frame->data[1] == id)) {
            listener = &node->board;
            if (verdict == BOARD_OBEYED) {
                cia402_nmt_command(node, frame->data[0]);
            }
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

/* Passes a request to the SDO server of a node and counts the frame by its answer. */
static void cia402_bus_receive_sdo(struct boards *boards, struct cia402_node *node,
                                   const struct bus_frame *frame)
{
    enum board_verdict verdict = BOARD_MALFORMED;

    if (frame->len == CIA402_SDO_LENGTH) {
        enum cia402_abort reason = cia402_sdo_receive(node, frame->data);

        verdict = reason == CIA402_DONE ? BOARD_OBEYED
                  : reason == CIA402_ABORT_NO_OBJECT || reason == CIA402_ABORT_NO_SUB_INDEX ||
                          reason == CIA402_ABORT_COMMAND
                      ? BOARD_UNKNOWN
                      : BOARD_MALFORMED;
    }
    boards_count_frame(boards, &node->board, verdict, frame);
}

/* Passes a request of LSS to all nodes, those without a Node-ID too. */
static void cia402_bus_receive_lss(struct boards *boards, struct board_bus *bus,
                                   const struct bus_frame *frame)
{
    enum board_verdict verdict = BOARD_MALFORMED;
    struct board *listener = NULL;

    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = boards->board[i];

        if (board->bus != bus || board_is_deaf(board)) {
            continue;
        }
        listener = board;
        if (frame->len == CIA402_LSS_LENGTH) {
            bool known = cia402_lss_receive(cia402_node_of(board), frame->data);

            verdict = known ? BOARD_OBEYED : BOARD_UNKNOWN;
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

/* Passes a heartbeat or a boot-up of another node to the nodes that expect it. */
static bool cia402_bus_hear(struct boards *boards, struct board_bus *bus,
                            const struct bus_frame *frame)
{
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);

        if (node && (node->settings.consumer >> 16) == (frame->id & NODE_ID_MASK)) {
            listener = &node->board;
            cia402_nmt_hear(node, frame->id & NODE_ID_MASK);
        }
    }
    if (listener) {
        boards_count_frame(boards, listener, BOARD_OBEYED, frame);
    }
    return listener;
}

/* Passes SYNC and process data to all nodes, any of which may want them. The frame counts for the
 * last node that takes it, or for the first that refuses it. */
static bool cia402_bus_receive_process(struct boards *boards, struct board_bus *bus,
                                       const struct bus_frame *frame)
{
    enum board_verdict verdict = BOARD_OBEYED;
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);
        enum board_verdict own = BOARD_OBEYED;

        if (!node || node->state == CIA402_STOPPED) {
            continue;
        }
        if (node->settings.cob_sync == (int64_t)frame->id) {
            own = frame->len > 1 ? BOARD_MALFORMED : own;
            if (frame->len <= 1) {
                cia402_pdo_sync(node);
            }
        } else if (!cia402_pdo_receive(node, frame, &own)) {
            continue;
        }
        if (verdict == BOARD_OBEYED) {
            listener = &node->board;
            verdict = own;
        }
    }
    if (listener) {
        boards_count_frame(boards, listener, verdict, frame);
    }
    return listener;
}

/* Passes a remote frame for a TPDO to all nodes. */
static bool cia402_bus_request(struct boards *boards, struct board_bus *bus,
                               const struct bus_frame *frame)
{
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);

        if (node && cia402_pdo_request(node, frame->id)) {
            listener = &node->board;
        }
    }
    if (listener) {
        boards_count_frame(boards, listener, BOARD_OBEYED, frame);
    }
    return listener;
}

/* Answers a remote frame: node guarding, or a request of a TPDO. */
static bool cia402_bus_receive_remote(struct boards *boards, struct board_bus *bus,
                                      const struct bus_frame *frame)
{
    struct cia402_node *node = cia402_bus_node(bus, frame->id & NODE_ID_MASK);

    if ((frame->id & ~(unsigned)NODE_ID_MASK) != CIA402_HEARTBEAT) {
        return cia402_bus_request(boards, bus, frame);
    }
    if (!node) {
        return false;
    }
    cia402_nmt_guard(node);
    boards_count_frame(boards, &node->board, BOARD_OBEYED, frame);
    return true;
}

/* Passes a frame on by its identifier. Returns false when no node knows it. */
static bool cia402_bus_dispatch(struct boards *boards, struct board_bus *bus,
                                const struct bus_frame *frame)
{
    unsigned id = frame->id & NODE_ID_MASK;
    struct cia402_node *node = cia402_bus_node(bus, id);

    if (frame->flags & FRAME_REMOTE) {
        return cia402_bus_receive_remote(boards, bus, frame);
    }
    if (frame->id == CIA402_LSS_REQUEST) {
        cia402_bus_receive_lss(boards, bus, frame);
        return true;
    }
    switch (frame->id & ~(unsigned)NODE_ID_MASK) {
    case CIA402_NMT:
        if (id == 0) {
            cia402_bus_receive_nmt(boards, bus, frame);
            return true;
        }
        return false;
    case CIA402_SDO_REQUEST:
        if (node && node->state != CIA402_STOPPED) {
            cia402_bus_receive_sdo(boards, node, frame);
            return true;
        }
        return false;
    case CIA402_HEARTBEAT:
        return cia402_bus_hear(boards, bus, frame);
    default:
        return cia402_bus_receive_process(boards, bus, frame);
    }
}

/* Receives a frame of the bus (struct protocol). */
static void cia402_bus_receive(struct boards *boards, struct board_bus *bus,
                               const struct bus_frame *frame)
{
    if (!cia402_bus_dispatch(boards, bus, frame)) {
        boards->counters.foreign++;
    }
}

/* Adds a board to the bus, which needs nothing for it (struct protocol). */
static void cia402_bus_add_board(struct board_bus *bus, struct board *board)
{
    (void)bus;
    (void)board;
}

static const struct board_bus_ops cia402_bus_ops = {
    .remote = true,
    .add_board = cia402_bus_add_board,
    .receive = cia402_bus_receive,
};

struct board_bus *cia402_bus_create(struct arena *arena)
{
    struct board_bus *bus = arena_alloc(arena, 1, sizeof *bus);

    if (!bus) {
        return NULL;
    }
    bus->ops = &cia402_bus_ops;
    return bus;
}
