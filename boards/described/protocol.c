/* SPDX-License-Identifier: Apache-2.0 */
/* Described protocols as a module (struct protocol), and their messages. The row of a message is
 * its struct described_frame. */
#include "boards/described/private.h"

#include "boards/protocol_list.h"
#include "manual/protocol_compact.h"

#include <inttypes.h>
#include <stdarg.h>

/* ---- messages ---- */

/* Returns the period of a frame: its own period or the telemetry period. Set points of the host,
 * and their answers, are sent once per tick. */
static uint32_t frame_cycle_ns(const struct message_walk *walk, size_t index,
                               const struct board_config *board)
{
    const struct described_protocol *protocol = walk->bus->described;
    const struct described_frame *frame = &protocol->frame[index];
    int64_t tick_ns = walk->config->tick_ns > MS ? walk->config->tick_ns : MS;

    if (frame->period_ns > 0 && (!frame->optional || (board && board->transmit_at_start))) {
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

/* Returns the name of the first frame that answers a frame. */
static const char *frame_answer(const struct described_protocol *protocol,
                                const struct described_frame *frame,
                                const struct board_config *board)
{
    const unsigned kind = board ? described_kind_index(described_kind(board->kind)) : 0;

    for (unsigned i = 0; frame->from_host && i < 3; i++) {
        int reply = frame->reply[(kind + i) % 3];

        if (reply >= 0) {
            return protocol->frame[reply].name;
        }
    }
    return NULL;
}

/* Visits a frame with an identifier number. repeats: number of repetitions, for a group its slots
 * in use. */
static void visit_frame(struct message_walk *walk, size_t index, int board, unsigned number,
                        unsigned repeats, int slot)
{
    static const enum message_number counts[] = {[DESCRIBED_BY_NONE] = MESSAGE_OF_ADDRESS,
                                                 [DESCRIBED_BY_ADDRESS] = MESSAGE_OF_ADDRESS,
                                                 [DESCRIBED_BY_SLOT] = MESSAGE_OF_SLOT,
                                                 [DESCRIBED_BY_GROUP] = MESSAGE_OF_GROUP};
    const struct described_protocol *protocol = walk->bus->described;
    const struct described_frame *frame = &protocol->frame[index];
    const struct board_config *config = board < 0 ? NULL : &walk->config->board[board];
    /* Number and repetitions depend on the bus */
    const struct message message = {
        .name = frame->name,
        .id = described_id(frame, number),
        .id_mask = frame->mask,
        .base = frame->base,
        .step = frame->by == DESCRIBED_BY_NONE ? 0 : frame->step,
        .number = number,
        .counts = counts[frame->by],
        .fd = frame->flags & FRAME_FD,
        .extended = frame->flags & FRAME_EXTENDED,
        .remote = frame->remote,
        .bit_rate_switch = frame->flags & FRAME_BRS,
        .sender = frame->from_host ? MESSAGE_NO_BOARD : board,
        .receiver = frame->from_host ? board : MESSAGE_NO_BOARD,
        .from_host = frame->from_host,
        /* longest length that a board accepts; 0 without fields */
        .length = frame->flags & FRAME_FD || repeats > 1 ? described_length(frame, repeats)
                  : frame->length > 0                    ? frame->longest
                                                         : 0,
        .shortest = frame->length > 0 && frame->shortest < frame->longest ? frame->shortest : 0,
        .code = MESSAGE_NO_CODE,
        .answer = frame_answer(protocol, frame, config),
        .section = frame->from_host ? MESSAGE_FROM_HOST : MESSAGE_FROM_BOARDS,
        .cycle_ns = frame_cycle_ns(walk, index, config),
        .constant = frame->nconstant == frame->nfield,
        .row = frame,
        .fields =
            frame->model_layout ? frame->model_layout[config ? config->model : 0] : frame->layout,
        .id_fields = frame->model_id_layout ? frame->model_id_layout[config ? config->model : 0]
                                            : frame->id_layout,
        .repeats = (uint8_t)repeats,
        .slot = slot,
        .list = frame->repeats > 1,
    };

    message_visit(walk, &message);
}

/* Visits the messages of a board (struct protocol). */
static void described_visit_board(struct message_walk *walk, int index, unsigned first_slot)
{
    const struct described_protocol *protocol = walk->bus->described;
    const struct board_config *board = &walk->config->board[index];
    unsigned axes = board_config_axes(board);
    unsigned kind = described_kind(board->kind);

    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];
        /* described_visit_broadcasts visits the frames from the host to all boards */
        bool by_address = frame->by == DESCRIBED_BY_ADDRESS;
        bool of_one_axis = kind == DESCRIBED_MOTOR && protocol->axes == 1 && by_address;

        if (!(frame->of & kind) ||
            (frame->from_host && !by_address && frame->by != DESCRIBED_BY_SLOT)) {
            continue;
        }
        /* A frame by slot exists once per axis */
        for (unsigned k = 0; frame->by == DESCRIBED_BY_SLOT && k < axes; k++) {
            visit_frame(walk, i, index, first_slot + k, 1, (int)(first_slot + k));
        }
        if (frame->by != DESCRIBED_BY_SLOT) {
            bool list = frame->repeats > 1;

            visit_frame(walk, i, index, by_address ? board->address : 0, list ? axes : 1,
                        of_one_axis || list ? (int)first_slot : -1);
        }
    }
}

/* Visits the messages of the host to all boards (struct protocol). */
static void described_visit_broadcasts(struct message_walk *walk)
{
    const struct described_protocol *protocol = walk->bus->described;

    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];

        if (frame->from_host && frame->by == DESCRIBED_BY_NONE) {
            visit_frame(walk, i, MESSAGE_NO_BOARD, 0, 1, -1);
        }
        for (unsigned slot = 0; frame->by == DESCRIBED_BY_GROUP && slot < walk->slots;
             slot += frame->repeats) {
            unsigned left = walk->slots - slot;

            visit_frame(walk, i, MESSAGE_NO_BOARD, slot / frame->repeats,
                        left < frame->repeats ? left : frame->repeats, (int)slot);
        }
    }
}

/* ---- comments ---- */

static void add_text(char *text, size_t size, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Appends formatted text. */
static void add_text(char *text, size_t size, const char *format, ...)
{
    size_t used = strlen(text);
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text + used, size - used, format, arguments);
    va_end(arguments);
}

/* Writes the facts that DBC signals cannot express: identifier fields, counter and checksum (struct
 * protocol). */
static void described_comment_message(const struct message *message, char *text, size_t size)
{
    const struct described_frame *row = message->row;
    unsigned bit = 0;
    size_t i = row->ndata;

    text[0] = '\0';
    /* Fields of the identifier */
    for (const struct field *f = message->id_fields; f && f->type != FIELD_END; f++) {
        unsigned bits = f->type & FIELD_BITS_MASK;

        if (!(f->type & FIELD_PADDING) && row->field[i++].meaning != DESCRIBED_CONSTANT) {
            add_text(text, size, "%s%u|%u@1%c %s (%.9g,%.9g)%s%s",
                     *text ? ", " : "in the identifier ", bit, bits,
                     f->type & FIELD_SIGNED ? '-' : '+', f->name, f->scale, f->offset,
                     f->unit ? " " : "", f->unit ? f->unit : "");
        }
        bit += bits;
    }
    /* The counter and the checksum */
    if (row->counter >= 0) {
        add_text(text, size, "%s%s counts the frames", *text ? "; " : "",
                 described_layout(row, (size_t)row->counter)->name);
    }
    if (row->checksum) {
        add_text(text, size, "%sbyte %u is the %s of the others", *text ? "; " : "",
                 row->checksum_byte, described_checksum_name(row->checksum));
    }
}

/* Writes a note on a counter or checksum field (struct protocol). */
static void described_note_field(const struct message *message, size_t field, char *text,
                                 size_t size)
{
    const struct described_frame *row = message->row;

    text[0] = '\0';
    if ((int)field == row->counter) {
        snprintf(text, size, "counts the frames");
    } else if (row->field[field].meaning == DESCRIBED_CHECKSUM) {
        snprintf(text, size, "%s of the other bytes", described_checksum_name(row->checksum));
    }
}

/* ---- the module ---- */

/* Returns whether a frame of the protocol uses an identifier (struct protocol). */
static bool described_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text,
                                size_t size)
{
    unsigned number;

    for (size_t i = 0; bus && i < bus->described->nframe; i++) {
        const struct described_frame *frame = &bus->described->frame[i];

        if (described_number(frame, id, false, &number)) {
            snprintf(text, size, "frame %s of protocol %s, expected another", frame->name,
                     bus->described->name);
            return true;
        }
    }
    return false;
}

/* Writes the name of a state. Adds the name of the selected law if the state uses it. */
static void write_state(const struct described_protocol *protocol, uint32_t mode, char *text,
                        size_t size)
{
    const struct described_state *state = &protocol->state[mode & 0xff];
    bool selected = state->law == DESCRIBED_SELECTED;

    snprintf(text, size, "%s%s%s%s", state->name, selected ? " (" : "",
             selected ? protocol->law[mode >> 8].name : "", selected ? ")" : "");
}

/* Describes an event in the names of the protocol file: a change of state or a malformed frame
 * (struct protocol). */
static bool described_describe_event(const struct boards_bus_config *bus,
                                     const struct board_event *event, char *text, size_t size)
{
    const struct described_protocol *protocol = bus->described;
    const struct described_frame *row = &protocol->frame[event->row];
    char from[80], to[80];
    int used;

    if (event->kind == BOARD_EVENT_MODE) {
        write_state(protocol, event->a, from, sizeof from);
        write_state(protocol, event->b, to, sizeof to);
        snprintf(text, size, "axis %u from %s to %s", event->axis, from, to);
        return true;
    }
    if (event->kind != BOARD_EVENT_MALFORMED || !event->why) {
        return false;
    }
    used = snprintf(text, size, "frame %s (id 0x%03" PRIx32 "): ", row->name, event->a);
    text += used;
    size -= (size_t)used;
    switch ((enum described_wrong)event->why) {
    case DESCRIBED_WRONG_LENGTH:
        snprintf(text, size, "length is %" PRIu32 ", expected %" PRIu32, event->b, event->c);
        break;
    case DESCRIBED_WRONG_FORMAT:
        snprintf(text, size, "format is %s, expected %s",
                 row->flags & FRAME_FD ? "classic CAN" : "CAN FD",
                 row->flags & FRAME_FD ? "CAN FD" : "classic CAN");
        break;
    case DESCRIBED_WRONG_CHECKSUM:
        snprintf(text, size, "checksum is 0x%02" PRIx32 ", expected 0x%02" PRIx32, event->b,
                 event->c);
        break;
    case DESCRIBED_WRONG_COUNTER:
        snprintf(text, size, "counter %s is %" PRIu32 " again, expected %" PRIu32,
                 described_layout(row, (size_t)row->counter)->name, event->b, event->c);
        break;
    case DESCRIBED_WRONG_VALUE:
        snprintf(text, size, "%s is %" PRIu32 ", expected a value that protocol %s lists",
                 described_layout(row, event->c)->name, event->b, protocol->name);
        break;
    case DESCRIBED_WRONG_LAW:
        snprintf(text, size, "its law controls a current, expected one that a servo valve has");
        break;
    case DESCRIBED_WRONG_MODE:
        snprintf(text, size, "the selected law is %s, expected %s", protocol->law[event->b].name,
                 protocol->law[event->c].name);
        break;
    }
    return true;
}

/* Returns the name of the law in force. The protocol file has no names for laws in force. */
static const char *described_law_name(uint32_t law)
{
    const char *name = described_law_word(law);

    return name ? name : "unknown";
}

/* Members common to all described protocols. */
#define DESCRIBED                                                                                  \
    .motor_address_max = DESCRIBED_ADDRESS_MAX, .address_max = DESCRIBED_ADDRESS_MAX,              \
    .axes_max = DESCRIBED_AXES, .slots_max = DESCRIBED_SLOTS, .canfd = true,                       \
    .bus = &described_bus_ops,                                                                     \
    .board = {[BOARD_MOTOR] = &described_motor_ops,                                                \
              [BOARD_FT] = &described_ft_ops,                                                      \
              [BOARD_INERTIAL] = &described_inertial_ops},                                         \
    .visit_broadcasts = described_visit_broadcasts, .visit_board = described_visit_board,          \
    .comment_message = described_comment_message, .note_field = described_note_field,              \
    .claims_id = described_claims_id, .mode_name = described_law_name,                             \
    .describe_event = described_describe_event, .modes_are_states = true,                          \
    .fault_names = described_fault_names, .timeout_text = "as its protocol has it",                \
    .limit_text = "ticks, voltage set to 0"

const struct protocol protocol_described = {
    .name = "described",
    .summary = "a protocol of your own, as a YAML file says: own-boards.md",
    .needs_file = true,
    DESCRIBED,
};

const struct protocol protocol_compact = {
    .name = "compact",
    .summary = "our own, classic CAN or CAN FD, one axis a slot, 1 kHz",
    .text = PROTOCOL_TEXT_COMPACT,
    .text_fd = PROTOCOL_TEXT_COMPACT_FD,
    .external = true,
    .external_torque = true,
    DESCRIBED,
    .bench = {.bus_axes = 3,
              .board_axes = 1,
              .ft_address = 30,
              .ft_period_s = "0.005",
              .command_period_s = "0.001"},
    .bench_fd = {.bus_axes = 12,
                 .board_axes = 4,
                 .ft_address = 30,
                 .ft_period_s = "0.001",
                 .command_period_s = "0.001"},
};
