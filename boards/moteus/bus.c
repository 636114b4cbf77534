/* SPDX-License-Identifier: Apache-2.0 */
/* A bus of moteus controllers: finds those that a frame is for. */
#include "boards/moteus/private.h"

/* Obeys a frame for one controller, or for all of them (struct board_bus_ops). */
static void moteus_bus_receive(struct boards *boards, struct board_bus *bus,
                               const struct bus_frame *frame)
{
    unsigned destination = frame->id & 0xff;
    bool all = destination == MOTEUS_BROADCAST;
    enum board_verdict verdict = BOARD_OBEYED;
    struct board *listener = NULL;

    /* Above the two bytes of addresses stands a prefix, which is 0 here */
    for (unsigned address = 1; address < BOARD_ADDRESSES && frame->id <= 0xffff; address++) {
        struct board *board = bus->by_address[address];

        if (board && (all || address == destination) && !board_is_deaf(board)) {
            listener = board;
            board_hear(board);
            verdict = moteus_board_serve(board, frame);
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

/* Takes a board as it is: an address is all that it needs (struct board_bus_ops). */
static void moteus_bus_add_board(struct board_bus *bus, struct board *board)
{
    (void)bus;
    (void)board;
}

static const struct board_bus_ops moteus_bus_ops = {
    .add_board = moteus_bus_add_board,
    .extended = true,
    .receive = moteus_bus_receive,
};

struct board_bus *moteus_bus_create(struct arena *arena)
{
    struct board_bus *bus = arena_alloc(arena, 1, sizeof *bus);

    if (bus) {
        bus->ops = &moteus_bus_ops;
    }
    return bus;
}
