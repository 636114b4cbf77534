/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Buses with iCub boards, persona A or B: which board a frame is for, its row in the tables, and
 * class 7, which every board has.
 */
#include "boards/board_private.h"

#include "boards/foc/protocol.h"
#include "canbus/frame.h"

static const int64_t BOOTLOADER_NS = (int64_t)ICUB_BOOTLOADER_MS * MS;

/* ---- commands ---- */

static void icub_board_discover(struct board *board, uint32_t reply_id)
{
    const uint8_t data[] = {ICUB_DISCOVER, board->ops->type, board->ops->major, board->ops->minor,
                            board->ops->build};

    /* a bootloader has no build number to tell: that is how hosts know it */
    board_queue(board, reply_id, board->in_bootloader ? 4 : 5, data);
    if (!board->in_bootloader && board->ops->discovered) {
        board->ops->discovered(board);
    }
}

static bool icub_board_manage(struct board *board, const struct bus_frame *frame,
                              const int64_t *request)
{
    uint32_t reply_id = icub_id(ICUB_MANAGEMENT, board->address, frame->id >> 4);

    switch ((enum icub_management_command)frame->data[0]) {
    case ICUB_DISCOVER:
        icub_board_discover(board, reply_id);
        return true;
    case ICUB_GET_ADDITIONAL_INFO:
        if (!board->ops->no_info) {
            board_queue_info(board, reply_id);
        }
        return true;
    case ICUB_SET_ADDITIONAL_INFO:
        board_set_info(board, request);
        return true;
    case ICUB_SET_CAN_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);
    case ICUB_START_UPDATE:
        board_enter_bootloader(board, BOOTLOADER_NS);
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_DATA:
        if (board->in_bootloader) {
            board_enter_bootloader(board, BOOTLOADER_NS);
        }
        return true;
    case ICUB_UPDATE_RUN:
        if (board->in_bootloader) {
            board_leave_bootloader(board);
        }
        return true;
    case ICUB_UPDATE_END:
        board_queue(board, reply_id, 2, (const uint8_t[]){ICUB_UPDATE_END, 1});
        return true;
    }
    return false;
}

static const struct icub_command *icub_board_find_command(const struct board *board,
                                                          enum icub_class cls, uint8_t first)
{
    const struct board_ops *ops = board->ops;
    uint8_t code = ops->axis_bit ? first & (uint8_t)~ICUB_AXIS_BIT : first;

    if (cls == ICUB_MANAGEMENT) {
        return icub_management_command(first);
    }
    return code < ops->command_count && ops->commands[code].kind ? &ops->commands[code] : NULL;
}

static bool icub_board_obey(struct board *board, const struct bus_frame *frame,
                            const struct icub_command *command, const int64_t *request)
{
    int64_t reply[FIELDS_MAX] = {0};
    uint8_t data[8] = {frame->data[0]};
    bool answer = command->reply_length > 0;

    if (!board->ops->command(board, frame, request, reply, &answer)) {
        return false;
    }
    if (answer) {
        fields_encode(command->reply, reply, data + 1);
        board_queue(board,
                    icub_id((enum icub_class)(frame->id >> 8), board->address, frame->id >> 4),
                    command->reply_length, data);
    }
    return true;
}

static enum board_verdict icub_board_receive(struct board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    const struct icub_command *command;
    int64_t request[FIELDS_MAX] = {0};
    bool obeyed;

    if (frame->len == 0) {
        return BOARD_MALFORMED;
    }
    command = icub_board_find_command(board, cls, frame->data[0]);
    if (!command) {
        return BOARD_UNKNOWN;
    }
    if (frame->len < command->request_min || frame->len > command->request_max ||
        !fields_decode(command->request, frame->data + 1, frame->len - 1u, request)) {
        return BOARD_MALFORMED;
    }
    if (cls == ICUB_MANAGEMENT) {
        obeyed = icub_board_manage(board, frame, request);
    } else {
        obeyed = board->in_bootloader || icub_board_obey(board, frame, command, request);
    }
    return obeyed ? BOARD_OBEYED : BOARD_MALFORMED;
}

static bool icub_board_is_addressed(const struct board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    bool everyone = (frame->id & 0xf) == ICUB_EVERYONE;

    if (cls == ICUB_MANAGEMENT) {
        /* of the management commands only discovery may go to everyone */
        return !everyone || (frame->len > 0 && frame->data[0] == ICUB_DISCOVER);
    }
    return cls == board->ops->command_class;
}

static void icub_bus_receive_command(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    unsigned to = frame->id & 0xf;
    unsigned first = to == ICUB_EVERYONE ? 1 : to;
    unsigned last = to == ICUB_EVERYONE ? ICUB_ADDRESS_MAX : to;
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    for (unsigned address = first; address <= last; address++) {
        struct board *board = bus->by_address[address];
        enum board_verdict verdict;

        if (!board || board->away || !icub_board_is_addressed(board, frame)) {
            continue;
        }
        verdict = icub_board_receive(board, frame);
        if (!listener || verdict > worst) {
            listener = board;
            worst = verdict;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

/* DESIRED_TARGETS of persona B */
static void icub_bus_receive_targets(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    if (frame->id != FOC_DESIRED_TARGETS_ID) {
        boards->counters.foreign++;
        return;
    }
    for (unsigned address = 1; address <= ICUB_ADDRESS_MAX; address++) {
        struct board *board = bus->by_address[address];

        if (board && board->ops->targets && !board_is_deaf(board)) {
            listener = board;
            worst = board->ops->targets(board, frame) ? worst : BOARD_MALFORMED;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, unsigned type,
                          const uint8_t *data, int64_t time_ns)
{
    struct torque_source *source = &bus->source[address];
    unsigned first = type == ICUB_FORCE ? 0 : BOARD_CHANNELS / 2;

    for (unsigned i = 0; i < BOARD_CHANNELS / 2; i++) {
        source->value[first + i] = (int16_t)(get_u16_le(data + 2 * i) - ICUB_STRAIN_ZERO);
    }
    source->time_ns = time_ns;
    source->heard = true;
}

/* A STRAIN board that is not ours: hardware on the bus, whose torques a motor board may use. */
static void icub_bus_receive_strain(struct boards *boards, struct board_bus *bus,
                                    const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    uint8_t source = frame->id >> 4 & 0xf;

    boards->counters.foreign++;
    if ((type == ICUB_FORCE || type == ICUB_TORQUE) && source >= 1 && source <= ICUB_ADDRESS_MAX &&
        !bus->by_address[source] &&
        (frame->len == ICUB_STRAIN_LENGTH || frame->len == ICUB_STRAIN_SATURATED_LENGTH)) {
        icub_bus_hear_strain(bus, source, type, frame->data, boards->time_ns);
    }
}

void icub_bus_receive(struct boards *boards, struct board_bus *bus, const struct bus_frame *frame)
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
