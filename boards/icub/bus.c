/* SPDX-License-Identifier: Apache-2.0 */
/* Buses with iCub boards: dispatches each frame to the boards that it is for, and the torques
 * from one board to another. */
#include "boards/icub/board.h"

#include "canbus/frame.h"

#include <string.h>

/* Returns whether a management command to everyone is one for this board: discovery always, and
 * what follows the START of a download while the bootloader runs that has had one. A loader
 * program addresses START to each board and the lines of the file to all of them at once. */
static bool icub_board_takes_broadcast(const struct icub_board *board,
                                       const struct bus_frame *frame)
{
    if (frame->len == 0) {
        return false;
    }
    switch (frame->data[0]) {
    case ICUB_DISCOVER:
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_RUN:
    case ICUB_UPDATE_DATA:
        return icub_board_is_downloading(board);
    case ICUB_UPDATE_END:
        return board->board.in_bootloader;
    default:
        return false;
    }
}

/* Returns whether a command is one for this board, by class and address. */
static bool icub_board_is_addressed(const struct icub_board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);

    if (cls == ICUB_MANAGEMENT) {
        return (frame->id & 0xf) != ICUB_EVERYONE || icub_board_takes_broadcast(board, frame);
    }
    return cls == board->ops->command_class;
}

/* Hands a command to the board, or to all boards, that it is addressed to. */
static void icub_bus_receive_command(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    unsigned to = frame->id & 0xf;
    unsigned first = to == ICUB_EVERYONE ? 1 : to;
    unsigned last = to == ICUB_EVERYONE ? ICUB_ADDRESS_MAX : to;
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    /* A broadcast counts once, with the worst that a board made of it */
    for (unsigned address = first; address <= last; address++) {
        struct board *board = bus->by_address[address];
        enum board_verdict verdict;

        if (!board || board->away || !icub_board_is_addressed(icub_board_of(board), frame)) {
            continue;
        }
        board_hear(board);
        verdict = icub_board_receive(icub_board_of(board), frame);
        if (!listener || verdict > worst) {
            listener = board;
            worst = verdict;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

/* Hands DESIRED_TARGETS (boards/foc) to all boards: the one frame of class 1 that a host sends. */
static void icub_bus_receive_targets(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    if (frame->id != icub_id(ICUB_PERIODIC_MOTOR, ICUB_HOST, ICUB_EVERYONE)) {
        boards->counters.foreign++;
        return;
    }
    for (unsigned address = 1; address <= ICUB_ADDRESS_MAX; address++) {
        struct board *board = bus->by_address[address];

        if (board && !board_is_deaf(board) && icub_board_of(board)->ops->targets) {
            listener = board;
            board_hear(board);
            worst = icub_board_of(board)->ops->targets(icub_board_of(board), frame)
                        ? worst
                        : BOARD_MALFORMED;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, enum icub_analog_type type,
                          const uint8_t *data, int64_t time_ns)
{
    struct torque_source *source = &icub_bus_of(bus)->source[address];
    unsigned first = type == ICUB_FORCE ? 0 : BOARD_CHANNELS / 2;

    for (unsigned i = 0; i < BOARD_CHANNELS / 2; i++) {
        source->value[first + i] = (int16_t)(get_u16_le(data + 2 * i) - ICUB_STRAIN_ZERO);
    }
    source->time_ns = time_ns;
    source->heard = true;
}

/* Takes a frame of a STRAIN board that is not ours: hardware on the bus, whose torques a motor
 * board may use. */
static void icub_bus_receive_strain(struct boards *boards, struct board_bus *bus,
                                    const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    uint8_t source = frame->id >> 4 & 0xf;

    boards->counters.foreign++;
    if ((type == ICUB_FORCE || type == ICUB_TORQUE) && source >= 1 && source <= ICUB_ADDRESS_MAX &&
        !bus->by_address[source] &&
        (frame->len == ICUB_STRAIN_LENGTH || frame->len == ICUB_STRAIN_SATURATED_LENGTH)) {
        icub_bus_hear_strain(bus, source, (enum icub_analog_type)type, frame->data, boards->now_ns);
    }
}

/* Dispatches a frame by its class (struct board_bus_ops). */
static void icub_bus_receive(struct boards *boards, struct board_bus *bus,
                             const struct bus_frame *frame)
{
    switch (frame->id >> 8) {
    case ICUB_POLLING_MOTOR:
    case ICUB_POLLING_ANALOG:
    case ICUB_MANAGEMENT:
        icub_bus_receive_command(boards, bus, frame);
        break;
    case ICUB_PERIODIC_MOTOR:
        icub_bus_receive_targets(boards, bus, frame);
        break;
    case ICUB_PERIODIC_ANALOG:
        icub_bus_receive_strain(boards, bus, frame);
        break;
    default:
        boards->counters.foreign++;
        break;
    }
}

/* Gives a new board its name as additional information. */
static void icub_bus_add_board(struct board_bus *bus, struct board *board)
{
    struct icub_board *icub = icub_board_of(board);

    (void)bus;
    memcpy(icub->info, board->config.name, strnlen(board->config.name, sizeof icub->info));
}

static const struct board_bus_ops icub_bus_ops = {
    .add_board = icub_bus_add_board,
    .receive = icub_bus_receive,
};

struct board_bus *icub_bus_create(struct arena *arena)
{
    struct icub_bus *icub = arena_alloc(arena, 1, sizeof *icub);

    if (!icub) {
        return NULL;
    }
    icub->bus.ops = &icub_bus_ops;
    return &icub->bus;
}
