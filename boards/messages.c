/* SPDX-License-Identifier: Apache-2.0 */
/* Visits the messages and the periodic frames of a bus with the functions of its protocol. */
#include "boards/messages.h"

#include "boards/board_private.h"

/* ---- messages ---- */

void message_visit(struct message_walk *walk, const struct message *message)
{
    walk->going = walk->going && walk->visit(walk->context, message);
}

unsigned boards_first_slot(const struct boards_config *config, int board)
{
    unsigned slot = 0;

    for (int i = 0; i < board; i++) {
        slot += config->board[i].bus == config->board[board].bus
                    ? board_config_axes(&config->board[i])
                    : 0;
    }
    return slot;
}

void boards_messages(const struct boards_config *config, int bus,
                     bool (*visit)(void *context, const struct message *message), void *context)
{
    const struct protocol *protocol = boards_protocol(config, bus);
    struct message_walk walk = {
        .config = config,
        .bus = boards_bus(config, bus),
        .visit = visit,
        .context = context,
        .going = true,
    };
    unsigned slot = 0;

    for (size_t i = 0; i < config->nboard; i++) {
        walk.slots += config->board[i].bus == bus ? board_config_axes(&config->board[i]) : 0;
    }
    /* Visit the host's messages to all boards, then each board with its first slot */
    protocol->visit_broadcasts(&walk);
    for (size_t i = 0; i < config->nboard && walk.going; i++) {
        if (config->board[i].bus == bus) {
            protocol->visit_board(&walk, (int)i, slot);
            slot += board_config_axes(&config->board[i]);
        }
    }
}

/* ---- fields ---- */

/* Returns the axis of a slot of a bus; NULL = none. */
static const struct board_axis_config *find_slot_axis(const struct boards_config *config, int bus,
                                                      unsigned slot)
{
    for (size_t i = 0; i < config->nboard; i++) {
        const struct board_config *board = &config->board[i];
        unsigned axes = board->bus == bus ? board_config_axes(board) : 0;

        if (slot < axes) {
            return &board->axis[slot];
        }
        slot -= axes;
    }
    return NULL;
}

void boards_describe_field(const struct boards_config *config, int bus,
                           const struct message_field *field, struct field_subject *subject)
{
    const struct protocol *protocol = boards_protocol(config, bus);
    const struct message *message = field->message;
    const struct field *row = field->field;

    *subject = (struct field_subject){
        .channel = -1,
        .scale = row->scale != 0.0 ? row->scale : 1.0,
        .offset = row->offset,
        .unit = row->unit ? row->unit : "",
    };
    if (message->slot >= 0) {
        unsigned slot = (unsigned)message->slot + (message->list ? (unsigned)field->repeat : 0);

        subject->axis = find_slot_axis(config, bus, slot);
    }
    if (protocol->describe_field) {
        protocol->describe_field(config, bus, field, subject);
    }
}

/* ---- load ---- */

void load_visit(const struct load_walk *walk, unsigned length, double period_s)
{
    const struct load_frame frame = {
        .flags = walk->bus->fd ? FRAME_FD | FRAME_BRS : 0,
        .length = walk->bus->fd ? frame_fd_length(length) : (uint8_t)length,
        .period_s = period_s,
        .from_host = walk->from_host,
    };

    walk->visit(walk->context, &frame);
}

double load_period_s(const struct load_walk *walk, int64_t period_ns)
{
    return period_ns > 0 ? fmax((double)period_ns * 1e-9, MS * 1e-9) : walk->tick_s;
}

unsigned load_axes(const struct board_config *board)
{
    unsigned count = 0;

    for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
        count += board->axis[k].joint >= 0;
    }
    return count;
}

unsigned load_bus_axes(const struct load_walk *walk)
{
    unsigned count = 0;

    for (size_t i = 0; i < walk->config->nboard; i++) {
        const struct board_config *board = &walk->config->board[i];

        count += board->bus == walk->index ? load_axes(board) : 0;
    }
    return count;
}

/* Visits a message as a periodic frame if it has a cycle. */
static bool load_visit_message(void *context, const struct message *message)
{
    const struct load_walk *walk = context;
    const struct load_frame frame = {
        .flags = (uint8_t)((message->extended ? FRAME_EXTENDED : 0) | (message->fd ? FRAME_FD : 0) |
                           (message->bit_rate_switch ? FRAME_BRS : 0)),
        .length = message->length,
        .period_s = (double)message->cycle_ns * 1e-9,
        .from_host = message->from_host,
    };

    if (message->cycle_ns > 0) {
        walk->visit(walk->context, &frame);
    }
    return true;
}

void boards_load(const struct boards_config *config, int bus, double command_period_s,
                 void (*visit)(void *context, const struct load_frame *frame), void *context)
{
    const struct protocol *protocol = boards_protocol(config, bus);
    struct load_walk walk = {
        .config = config,
        .bus = boards_bus(config, bus),
        .index = bus,
        .visit = visit,
        .context = context,
        .tick_s = fmax((double)config->tick_ns * 1e-9, MS * 1e-9),
        .command_period_s = command_period_s,
    };

    /* Without functions of the protocol: visit the messages that have a cycle */
    if (!protocol->visit_board_load) {
        boards_messages(config, bus, load_visit_message, &walk);
        return;
    }
    for (size_t i = 0; i < config->nboard; i++) {
        if (config->board[i].bus == bus) {
            protocol->visit_board_load(&walk, &config->board[i]);
        }
    }
    walk.from_host = true;
    protocol->visit_command_load(&walk);
}
