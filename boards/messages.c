/* SPDX-License-Identifier: Apache-2.0 */
/* The list of messages, walked bus by bus; see the header. */
#include "boards/messages.h"

#include "boards/board_private.h"
#include "boards/cia402/frames.h"
#include "boards/compact/table.h"
#include "boards/described/protocol.h"
#include "boards/foc/table.h"
#include "canbus/frame.h"

enum { ICUB_SLOT_NS = ICUB_SLOTS * MS };

struct walk {
    const struct boards_config *config;
    int bus;
    bool (*visit)(void *context, const struct message *message);
    void *context;
    bool going;
};

static void walk_visit(struct walk *walk, const struct message *message)
{
    walk->going = walk->going && walk->visit(walk->context, message);
}

/* ---- iCub buses ---- */

static void walk_icub_command(struct walk *walk, int board, unsigned cls, unsigned address,
                              unsigned code, const struct icub_command *row)
{
    struct message message = {
        .name = row->name,
        .id = icub_id((enum icub_class)cls, ICUB_HOST, address),
        .sender = MESSAGE_NO_BOARD,
        .receiver = board,
        .from_host = true,
        .length = row->request_max,
        .shortest = row->request_min,
        .code = (int)code,
        .fields = row->request,
        .first_byte = 1,
        .repeats = 1,
        .slot = -1,
    };

    walk_visit(walk, &message);
    if (row->reply_length) {
        message.id = icub_id((enum icub_class)cls, address, ICUB_HOST);
        message.sender = board;
        message.receiver = MESSAGE_NO_BOARD;
        message.from_host = false;
        message.length = row->reply_length;
        message.shortest = 0;
        message.fields = row->reply;
        walk_visit(walk, &message);
    }
}

static void walk_icub_commands(struct walk *walk, int board, unsigned cls, unsigned address,
                               const struct icub_command *rows, unsigned count)
{
    for (unsigned code = 0; code < count; code++) {
        if (rows[code].kind) {
            walk_icub_command(walk, board, cls, address, code, &rows[code]);
        }
    }
}

static uint32_t icub_frame_cycle_ns(const struct board_config *board, bool foc, unsigned type)
{
    int64_t period_ns = board->period_ns > 0 ? board->period_ns : MS;

    if (board->kind == BOARD_INERTIAL) {
        return (uint32_t)period_ns;
    }
    if (board->kind != BOARD_MOTOR) {
        return type == ICUB_FORCE || type == ICUB_TORQUE ? (uint32_t)period_ns : 0;
    }
    if (foc) {
        return type == FOC_ADDITIONAL_STATUS
                   ? foc_additional_status_ms(board->address) * (uint32_t)MS
               : type == FOC_STATUS && board->status_period_ns > MS
                   ? (uint32_t)board->status_period_ns
                   : (uint32_t)MS;
    }
    return type == ICUB_STATUS || type == ICUB_ADDITIONAL_STATUS || type == ICUB_OVERFLOW ||
                   type == ICUB_PRINT
               ? 0
               : (uint32_t)ICUB_SLOT_NS;
}

static void walk_icub_frames(struct walk *walk, int index, bool foc)
{
    const struct board_config *board = &walk->config->board[index];
    bool motor = board->kind == BOARD_MOTOR, inertial = board->kind == BOARD_INERTIAL;
    enum icub_class cls = motor      ? ICUB_PERIODIC_MOTOR
                          : inertial ? ICUB_PERIODIC_INERTIAL
                                     : ICUB_PERIODIC_ANALOG;
    const struct icub_frame_type *rows = inertial ? icub_inertial_frames
                                         : !motor ? icub_analog_frames
                                         : foc    ? foc_frames
                                                  : icub_motor_frames;

    for (unsigned type = 0; type < 16; type++) {
        struct message message = {
            .name = rows[type].name,
            .id = icub_id(cls, board->address, type),
            .sender = index,
            .receiver = MESSAGE_NO_BOARD,
            .length = rows[type].length,
            .code = MESSAGE_NO_CODE,
            .cycle_ns = icub_frame_cycle_ns(board, foc, type),
            .fields = rows[type].fields,
            .repeats = 1,
            .slot = -1,
        };

        if (message.name && !(foc && motor && type == FOC_DESIRED_TARGETS)) {
            walk_visit(walk, &message);
        }
    }
}

static void walk_icub_board(struct walk *walk, int index, bool foc)
{
    const struct board_config *board = &walk->config->board[index];
    bool motor = board->kind == BOARD_MOTOR;

    walk_icub_frames(walk, index, foc);
    if (motor) {
        walk_icub_commands(walk, index, ICUB_POLLING_MOTOR, board->address,
                           foc ? foc_commands : icub_motor_commands, ICUB_MOTOR_COMMANDS);
    } else {
        walk_icub_commands(walk, index, ICUB_POLLING_ANALOG, board->address,
                           board->kind == BOARD_INERTIAL ? icub_inertial_commands
                                                         : icub_strain_commands,
                           ICUB_STRAIN_COMMANDS);
    }
    for (unsigned code = 0; code < 256; code++) {
        const struct icub_command *row = icub_management_command((uint8_t)code);

        if (row && code != ICUB_DISCOVER) {
            walk_icub_command(walk, index, ICUB_MANAGEMENT, board->address, code, row);
        }
    }
}

/* What a host sends to everyone: DISCOVER, which each board answers, and DESIRED_TARGETS, which
 * has a target for each of four addresses. */
static void walk_icub_broadcasts(struct walk *walk, bool foc)
{
    const struct icub_command *row = icub_management_command(ICUB_DISCOVER);
    const struct message discover = {
        .name = row->name,
        .id = icub_id(ICUB_MANAGEMENT, ICUB_HOST, ICUB_EVERYONE),
        .sender = MESSAGE_NO_BOARD,
        .receiver = MESSAGE_NO_BOARD,
        .from_host = true,
        .length = row->request_max,
        .code = ICUB_DISCOVER,
        .first_byte = 1,
        .repeats = 1,
        .slot = -1,
    };
    const struct message targets = {
        .name = foc_frames[FOC_DESIRED_TARGETS].name,
        .id = FOC_DESIRED_TARGETS_ID,
        .sender = MESSAGE_NO_BOARD,
        .receiver = MESSAGE_NO_BOARD,
        .from_host = true,
        .length = FOC_TARGETS_LENGTH,
        .code = MESSAGE_NO_CODE,
        .cycle_ns = MS,
        .fields = foc_frames[FOC_DESIRED_TARGETS].fields,
        .repeats = 1,
        .slot = -1,
    };

    /* DESIRED_TARGETS only where 2FOC boards listen */
    walk_visit(walk, &discover);
    if (foc) {
        walk_visit(walk, &targets);
    }
}

static void walk_discovery_reply(struct walk *walk, int index)
{
    const struct icub_command *row = icub_management_command(ICUB_DISCOVER);
    const struct message reply = {
        .name = row->name,
        .id = icub_id(ICUB_MANAGEMENT, walk->config->board[index].address, ICUB_HOST),
        .sender = index,
        .receiver = MESSAGE_NO_BOARD,
        .length = row->reply_length,
        .code = ICUB_DISCOVER,
        .fields = row->reply,
        .first_byte = 1,
        .repeats = 1,
        .slot = -1,
    };

    walk_visit(walk, &reply);
}

/* ---- compact buses ---- */

static bool compact_row_applies(const struct compact_message *row, const struct board_config *board,
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

/* Visits the message of a row with its number; repeats: how often the row's fields follow. */
static void walk_compact_row(struct walk *walk, const struct compact_message *row, int board,
                             unsigned number, unsigned repeats)
{
    int64_t period_ns = (int64_t)row->period_ms * MS;
    struct message message = {
        .name = row->name,
        .id = compact_id(row->function, number),
        .fd = walk->config->bus[walk->bus].fd,
        .sender = row->from_host ? MESSAGE_NO_BOARD : board,
        .receiver = row->from_host ? board : MESSAGE_NO_BOARD,
        .from_host = row->from_host,
        .code = MESSAGE_NO_CODE,
        .fields = row->fields,
        .repeats = (uint8_t)repeats,
        .slot = row->by == COMPACT_BY_SLOT ? (int)number : -1,
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
    walk_visit(walk, &message);
}

static void walk_compact_board(struct walk *walk, int index, unsigned first_slot)
{
    const struct board_config *board = &walk->config->board[index];
    unsigned axes = board_config_axes(board);

    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];

        if (!compact_row_applies(row, board, walk->config->bus[walk->bus].fd)) {
            continue;
        }
        if (row->by == COMPACT_BY_NODE) {
            walk_compact_row(walk, row, index, board->address,
                             row->function == COMPACT_TELEMETRY_FD ? axes : 1);
        } else if (row->by == COMPACT_BY_SLOT) {
            for (unsigned k = 0; k < axes; k++) {
                walk_compact_row(walk, row, index, first_slot + k, 1);
            }
        }
    }
}

static void walk_compact_broadcasts(struct walk *walk, unsigned slots)
{
    bool fd = walk->config->bus[walk->bus].fd;

    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];

        if (row->by == COMPACT_BY_NONE) {
            walk_compact_row(walk, row, MESSAGE_NO_BOARD, 0, 1);
        } else if (row->by == COMPACT_BY_GROUP) {
            unsigned group = fd ? COMPACT_SLOTS : COMPACT_GROUP;

            for (unsigned slot = 0; slot < slots; slot += group) {
                walk_compact_row(walk, row, MESSAGE_NO_BOARD, slot / COMPACT_GROUP,
                                 slots - slot < group ? slots - slot : group);
            }
        }
    }
}

/* ---- cia402 buses ---- */

/* Those of a board, or, with none, of the host to all. */
static void walk_cia402_board(struct walk *walk, int index, unsigned first_slot)
{
    const struct board_config *board =
        index == MESSAGE_NO_BOARD ? NULL : &walk->config->board[index];
    struct cia402_frame frame;

    for (unsigned row = 0; cia402_frame_row(board, row, &frame); row++) {
        const struct message message = {
            .name = frame.name,
            .id = frame.id,
            .sender = frame.from_host ? MESSAGE_NO_BOARD : index,
            .receiver = frame.from_host ? index : MESSAGE_NO_BOARD,
            .from_host = frame.from_host,
            .length = frame.length,
            .code = MESSAGE_NO_CODE,
            .cycle_ns = frame.cycle_ns,
            .fields = frame.fields,
            .repeats = frame.repeats,
            .slot = frame.axis < 0 ? -1 : (int)first_slot + frame.axis,
        };

        walk_visit(walk, &message);
    }
}

/* ---- described buses ---- */

/* How often a frame comes: its own period, the telemetry's, or with the host's set-points, which
 * come once a tick, and their answers. */
static uint32_t described_cycle_ns(const struct walk *walk,
                                   const struct described_protocol *protocol, size_t index,
                                   const struct board_config *board)
{
    const struct described_frame *frame = &protocol->frame[index];
    int64_t tick_ns = walk->config->tick_ns > MS ? walk->config->tick_ns : MS;

    if (frame->period_ns > 0) {
        return (uint32_t)frame->period_ns;
    }
    if (frame->telemetry) {
        return (uint32_t)(board && board->period_ns > 0 ? board->period_ns : tick_ns);
    }
    for (size_t i = 0; i < protocol->host.command.count; i++) {
        size_t command = protocol->host.command.frame[i];

        if (command == index || protocol->frame[command].reply[0] == (int)index) {
            return (uint32_t)tick_ns;
        }
    }
    return 0;
}

/* Visits a frame with its number; of a group with the slots that there are. */
static void walk_described_frame(struct walk *walk, size_t index, int board, unsigned number,
                                 unsigned repeats, int slot)
{
    const struct described_protocol *protocol = walk->config->bus[walk->bus].described;
    const struct described_frame *frame = &protocol->frame[index];
    const struct message message = {
        .name = frame->name,
        .id = described_id(frame, number),
        .id_mask = frame->mask,
        .fd = frame->flags & FRAME_FD,
        .extended = frame->flags & FRAME_EXTENDED,
        .remote = frame->remote,
        .bit_rate_switch = frame->flags & FRAME_BRS,
        .sender = frame->from_host ? MESSAGE_NO_BOARD : board,
        .receiver = frame->from_host ? board : MESSAGE_NO_BOARD,
        .from_host = frame->from_host,
        .length = frame->flags & FRAME_FD ? frame_fd_length(frame->length * repeats)
                                          : (uint8_t)(frame->length * repeats),
        .code = MESSAGE_NO_CODE,
        .cycle_ns = described_cycle_ns(walk, protocol, index,
                                       board < 0 ? NULL : &walk->config->board[board]),
        .fields = frame->layout,
        .id_fields = frame->id_layout,
        .repeats = (uint8_t)repeats,
        .slot = slot,
    };

    walk_visit(walk, &message);
}

static void walk_described_board(struct walk *walk, int index, unsigned first_slot)
{
    const struct described_protocol *protocol = walk->config->bus[walk->bus].described;
    const struct board_config *board = &walk->config->board[index];
    unsigned axes = board_config_axes(board);
    unsigned kind = board->kind == BOARD_MOTOR ? DESCRIBED_MOTOR
                    : board->kind == BOARD_FT  ? DESCRIBED_FT
                                               : DESCRIBED_INERTIAL;

    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];
        bool motor = kind == DESCRIBED_MOTOR;

        if (!(frame->of & kind) || (frame->from_host && frame->by != DESCRIBED_BY_ADDRESS &&
                                    frame->by != DESCRIBED_BY_SLOT)) {
            continue;
        }
        for (unsigned k = 0; frame->by == DESCRIBED_BY_SLOT && k < axes; k++) {
            walk_described_frame(walk, i, index, first_slot + k, 1, (int)(first_slot + k));
        }
        if (frame->by != DESCRIBED_BY_SLOT) {
            walk_described_frame(
                walk, i, index, frame->by == DESCRIBED_BY_ADDRESS ? board->address : 0, 1,
                motor && protocol->axes == 1 && frame->by == DESCRIBED_BY_ADDRESS ? (int)first_slot
                                                                                  : -1);
        }
    }
}

static void walk_described_broadcasts(struct walk *walk, unsigned slots)
{
    const struct described_protocol *protocol = walk->config->bus[walk->bus].described;

    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];

        if (frame->from_host && frame->by == DESCRIBED_BY_NONE) {
            walk_described_frame(walk, i, MESSAGE_NO_BOARD, 0, 1, -1);
        }
        for (unsigned slot = 0; frame->by == DESCRIBED_BY_GROUP && slot < slots;
             slot += frame->repeats) {
            walk_described_frame(walk, i, MESSAGE_NO_BOARD, slot / frame->repeats,
                                 slots - slot < frame->repeats ? slots - slot : frame->repeats,
                                 (int)slot);
        }
    }
}

void boards_messages(const struct boards_config *config, int bus,
                     bool (*visit)(void *context, const struct message *message), void *context)
{
    struct walk walk = {config, bus, visit, context, true};
    enum board_personality personality = boards_personality(config, bus);
    unsigned slots = 0, slot = 0;

    for (size_t i = 0; i < config->nboard; i++) {
        slots += config->board[i].bus == bus ? board_config_axes(&config->board[i]) : 0;
    }
    if (personality == BOARD_COMPACT) {
        walk_compact_broadcasts(&walk, slots);
    } else if (personality == BOARD_DESCRIBED) {
        walk_described_broadcasts(&walk, slots);
    } else if (personality == BOARD_CIA402) {
        walk_cia402_board(&walk, MESSAGE_NO_BOARD, 0);
    } else {
        walk_icub_broadcasts(&walk, personality == BOARD_FOC);
    }
    for (size_t i = 0; i < config->nboard && walk.going; i++) {
        if (config->board[i].bus != bus) {
            continue;
        }
        if (personality == BOARD_COMPACT) {
            walk_compact_board(&walk, (int)i, slot);
            slot += board_config_axes(&config->board[i]);
        } else if (personality == BOARD_DESCRIBED) {
            walk_described_board(&walk, (int)i, slot);
            slot += board_config_axes(&config->board[i]);
        } else if (personality == BOARD_CIA402) {
            walk_cia402_board(&walk, (int)i, slot);
            slot += board_config_axes(&config->board[i]);
        } else {
            walk_discovery_reply(&walk, (int)i);
            walk_icub_board(&walk, (int)i, personality == BOARD_FOC);
        }
    }
}
