/* SPDX-License-Identifier: Apache-2.0 */
/* Buses that speak the compact protocol: dispatch of frames, and what all of their boards have. */
#include "boards/compact/private.h"

#include "canbus/frame.h"

#include <string.h>

enum { RESTART_MS = 100 }; /* at least */

/* ---- what all boards have ---- */

bool compact_node_power_up(struct board *board, struct compact_node *node)
{
    const struct board_config *config = &board->config;
    bool first = !node->powered;

    if (first) {
        int64_t period_ms = config->period_ns > 0 ? config->period_ns / MS : 1;

        node->saved.telemetry_ms = config->transmit_at_start ? period_ms : 0;
        node->saved.timeout_ms = config->command_timeout_ns / MS;
        node->powered = node->is_saved = true;
    }
    node->settings = node->saved;
    node->is_saved = true;
    node->started_ns = board->boards->time_ns;
    node->next_ns = board->boards->time_ns + node->settings.telemetry_ms * MS;
    return first;
}

bool compact_node_due(const struct board *board, struct compact_node *node)
{
    int64_t period_ns = node->settings.telemetry_ms * MS;
    int64_t late = board->boards->time_ns - node->next_ns;

    if (period_ns == 0 || late < 0) {
        return false;
    }
    node->next_ns += (late / period_ns + 1) * period_ns;
    return true;
}

bool compact_state_due(struct ms_span span, unsigned phase)
{
    const int64_t period = COMPACT_STATE_PERIOD_MS;

    return (span.to + period - 1 - phase) / period > (span.from + period - 1 - phase) / period;
}

void compact_board_send(struct board *board, struct frame_sink *sink,
                        enum compact_function function, unsigned number, const int64_t *values)
{
    const struct compact_message *row = compact_message(function);
    uint8_t data[8] = {0};

    fields_encode(row->fields, values, data);
    board_send(board, sink, compact_id(function, number), row->length, data);
}

unsigned compact_first_slot(const struct board *board)
{
    unsigned slot = 0;

    while (slot < COMPACT_SLOTS && board->bus->slot[slot].board != board) {
        slot++;
    }
    return slot;
}

static unsigned compact_axis_count(const struct board *board)
{
    unsigned count = 0;

    while (board->config.kind == BOARD_MOTOR && count < BOARD_AXES_MAX &&
           board->config.axis[count].joint >= 0) {
        count++;
    }
    return count;
}

static unsigned compact_first_slot_or_0(const struct board *board)
{
    return compact_axis_count(board) ? compact_first_slot(board) : 0;
}

void compact_board_identify(struct board *board)
{
    const int64_t values[] = {
        board->ops->type,         compact_axis_count(board), compact_first_slot_or_0(board),
        COMPACT_PROTOCOL_VERSION, board->ops->major,         board->ops->minor,
        board->ops->build};
    uint8_t data[8] = {0};

    fields_encode(compact_message(COMPACT_IDENTITY)->fields, values, data);
    board_queue(board, compact_id(COMPACT_IDENTITY, board->address), COMPACT_IDENTITY_LENGTH, data);
}

static bool compact_set_within(int64_t *setting, int64_t value, int64_t most)
{
    if (value < 0 || value > most) {
        return false;
    }
    *setting = value;
    return true;
}

static enum compact_result compact_node_write(struct board *board, struct compact_node *node,
                                              unsigned parameter, int64_t *value)
{
    int64_t boot_ns = board->config.boot_ns;

    switch (parameter) {
    case COMPACT_P_TELEMETRY_PERIOD:
        if (!compact_set_within(&node->settings.telemetry_ms, *value, 255)) {
            *value = node->settings.telemetry_ms;
            return COMPACT_OUT_OF_RANGE;
        }
        node->next_ns = board->boards->time_ns + *value * MS;
        node->is_saved = false;
        return COMPACT_OK;
    case COMPACT_P_COMMAND_TIMEOUT:
        if (!compact_set_within(&node->settings.timeout_ms, *value, 60000)) {
            *value = node->settings.timeout_ms;
            return COMPACT_OUT_OF_RANGE;
        }
        node->is_saved = false;
        return COMPACT_OK;
    case COMPACT_P_RESTART:
        if (*value != 1) {
            *value = 0;
            return COMPACT_OUT_OF_RANGE;
        }
        board_enter_bootloader(board,
                               boot_ns > RESTART_MS * MS ? boot_ns : (int64_t)RESTART_MS * MS);
        return COMPACT_OK;
    case COMPACT_P_SAVE:
        if (*value != 1) {
            *value = node->is_saved;
            return COMPACT_OUT_OF_RANGE;
        }
        node->saved = node->settings;
        node->is_saved = true;
        return COMPACT_OK;
    case COMPACT_P_KIND:
    case COMPACT_P_FIRMWARE:
    case COMPACT_P_SERIAL:
    case COMPACT_P_FIRST_SLOT:
    case COMPACT_P_UPTIME:
        return COMPACT_READ_ONLY;
    default:
        return COMPACT_UNKNOWN_PARAMETER;
    }
}

/* Of a board as long as the rig stays: bus, kind and the address that it left the factory with. */
static int64_t compact_serial_number(const struct board *board)
{
    return INT64_C(0x51000000) | (int64_t)(board->config.bus & 0xff) << 16 |
           (int64_t)board->config.kind << 8 | board->config.address;
}

enum compact_result compact_node_access_parameter(struct board *board, struct compact_node *node,
                                                  unsigned parameter, bool write, int64_t *value)
{
    enum compact_result result =
        write ? compact_node_write(board, node, parameter, value) : COMPACT_OK;

    if (write && result != COMPACT_READ_ONLY) {
        return result;
    }
    switch (parameter) {
    case COMPACT_P_KIND:
        *value = board->ops->type;
        return result;
    case COMPACT_P_FIRMWARE:
        *value = (int64_t)board->ops->major << 24 | board->ops->minor << 16 | board->ops->build;
        return result;
    case COMPACT_P_SERIAL:
        *value = compact_serial_number(board);
        return result;
    case COMPACT_P_FIRST_SLOT:
        *value = compact_first_slot_or_0(board);
        return result;
    case COMPACT_P_UPTIME:
        *value = (board->boards->time_ns - node->started_ns) / MS;
        return result;
    case COMPACT_P_TELEMETRY_PERIOD:
        *value = node->settings.telemetry_ms;
        return result;
    case COMPACT_P_COMMAND_TIMEOUT:
        *value = node->settings.timeout_ms;
        return result;
    case COMPACT_P_RESTART:
        *value = 0;
        return result;
    case COMPACT_P_SAVE:
        *value = node->is_saved;
        return result;
    default:
        return COMPACT_UNKNOWN_PARAMETER;
    }
}

/* ---- reception ---- */

static void compact_bus_receive_mode(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    struct board *listener = NULL;
    enum board_verdict verdict = BOARD_OBEYED;
    int64_t values[FIELDS_MAX];

    fields_decode(compact_message(COMPACT_MODE)->fields, frame->data, frame->len, values);
    if (frame->len != COMPACT_MODE_LENGTH ||
        (values[0] != COMPACT_OFF && values[0] != COMPACT_VOLTAGE &&
         values[0] != COMPACT_CURRENT)) {
        verdict = BOARD_MALFORMED;
    }
    for (unsigned slot = 0; slot < bus->slots; slot++) {
        struct board *board = bus->slot[slot].board;

        if (board_is_deaf(board) || !(values[1] >> slot & 1)) {
            continue;
        }
        listener = board;
        if (verdict == BOARD_OBEYED) {
            compact_axis_command_mode(board, bus->slot[slot].axis, (enum compact_mode)values[0]);
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

static void compact_bus_receive_command(struct boards *boards, struct board_bus *bus,
                                        const struct bus_frame *frame)
{
    unsigned first = (frame->id & 0x1f) * COMPACT_GROUP;
    struct board *listener = NULL;
    bool whole = frame->len > 0 && frame->len % 2 == 0;

    for (unsigned i = 0; i < (frame->len + 1u) / 2 && first + i < bus->slots; i++) {
        const struct board_slot *slot = &bus->slot[first + i];

        if (board_is_deaf(slot->board)) {
            continue;
        }
        listener = slot->board;
        if (whole) {
            compact_axis_command(slot->board, slot->axis, get_i16_le(frame->data + 2 * i));
        }
    }
    if (frame->len == 0 && first < bus->slots) {
        listener = bus->slot[first].board;
    }
    boards_count_frame(boards, listener, whole ? BOARD_OBEYED : BOARD_MALFORMED, frame);
}

static void compact_bus_receive_discover(struct boards *boards, struct board_bus *bus,
                                         const struct bus_frame *frame)
{
    struct board *listener = NULL;

    for (unsigned node = 1; node < BOARD_ADDRESSES; node++) {
        struct board *board = bus->by_address[node];

        if (board && !board_is_deaf(board)) {
            listener = board;
            if (frame->len == 0) {
                compact_board_identify(board);
            }
        }
    }
    boards_count_frame(boards, listener, frame->len ? BOARD_MALFORMED : BOARD_OBEYED, frame);
}

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
        result = board->ops->parameter(board, (unsigned)values[0], (unsigned)values[2], write,
                                       &values[3]);
    }
    values[4] = result;
    fields_encode(compact_message(COMPACT_REPLY)->fields, values, data);
    board_queue(board, compact_id(COMPACT_REPLY, board->address), COMPACT_REPLY_LENGTH, data);
    if (result != COMPACT_OK) {
        verdict = result == COMPACT_UNKNOWN_PARAMETER ? BOARD_UNKNOWN : BOARD_MALFORMED;
    }
    boards_count_frame(boards, board, verdict, frame);
}

void compact_bus_receive(struct boards *boards, struct board_bus *bus,
                         const struct bus_frame *frame)
{
    bool first = (frame->id & 0x1f) == 0;

    switch (frame->id >> 5) {
    case COMPACT_MODE:
        if (first) {
            compact_bus_receive_mode(boards, bus, frame);
            return;
        }
        break;
    case COMPACT_COMMAND:
        compact_bus_receive_command(boards, bus, frame);
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
