/* SPDX-License-Identifier: Apache-2.0 */
/* Functions of every node of a compact bus: its identity, its telemetry period, its own
 * parameters. */
#include "boards/compact/private.h"

#include <string.h>

enum { RESTART_MS = 100 }; /* shortest restart */

bool compact_node_power_up(struct compact_node *node)
{
    const struct board_config *config = &node->board.config;
    int64_t now_ns = node->board.boards->now_ns;
    bool first = !node->powered;

    if (first) {
        int64_t period_ms = config->period_ns > 0 ? config->period_ns / MS : 1;

        node->saved.telemetry_ms = config->transmit_at_start ? period_ms : 0;
        node->saved.timeout_ms = config->command_timeout_ns / MS;
        node->powered = node->is_saved = true;
    }
    node->settings = node->saved;
    node->is_saved = true;
    node->started_ns = now_ns;
    node->next_ns = now_ns + node->settings.telemetry_ms * MS;
    return first;
}

bool compact_node_due(struct compact_node *node)
{
    int64_t period_ns = node->settings.telemetry_ms * MS;
    int64_t late = node->board.boards->now_ns - node->next_ns;

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

void compact_node_send(struct compact_node *node, struct frame_sink *sink,
                       enum compact_function function, unsigned number, const int64_t *values)
{
    const struct compact_message *row = compact_message(function);
    uint8_t data[8] = {0};

    fields_encode(row->fields, values, data);
    board_send(&node->board, sink, compact_id(function, number), row->length, data);
}

unsigned compact_first_slot(const struct board *board)
{
    const struct compact_bus *bus = compact_bus_of(board->bus);
    unsigned slot = 0;

    while (slot < bus->slots && &bus->slot[slot].motor->node.board != board) {
        slot++;
    }
    return slot < bus->slots ? slot : COMPACT_SLOTS;
}

/* Returns the first slot of a board, 0 when it has no axes. */
static unsigned compact_first_slot_or_0(const struct board *board)
{
    return board_config_axes(&board->config) ? compact_first_slot(board) : 0;
}

void compact_node_identify(struct compact_node *node)
{
    struct board *board = &node->board;
    const struct board_identity *identity = &board->ops->identity;
    const int64_t values[] = {identity->type,
                              board_config_axes(&board->config),
                              compact_first_slot_or_0(board),
                              COMPACT_PROTOCOL_VERSION,
                              identity->major,
                              identity->minor,
                              identity->build};
    uint8_t data[8] = {0};

    fields_encode(compact_message(COMPACT_IDENTITY)->fields, values, data);
    board_queue(board, compact_id(COMPACT_IDENTITY, board->address), COMPACT_IDENTITY_LENGTH, data);
}

/* Writes a setting; returns false when the value is below 0 or above most. */
static bool compact_set_within(int64_t *setting, int64_t value, int64_t most)
{
    if (value < 0 || value > most) {
        return false;
    }
    *setting = value;
    return true;
}

/* Writes a parameter of the board; a refused *value becomes the one in force. */
static enum compact_result compact_node_write(struct compact_node *node, unsigned parameter,
                                              int64_t *value)
{
    struct board *board = &node->board;
    int64_t boot_ns = board->config.boot_ns;

    switch (parameter) {
    /* Settings, which SAVE keeps */
    case COMPACT_P_TELEMETRY_PERIOD:
        if (!compact_set_within(&node->settings.telemetry_ms, *value, 255)) {
            *value = node->settings.telemetry_ms;
            return COMPACT_OUT_OF_RANGE;
        }
        node->next_ns = board->boards->now_ns + *value * MS;
        node->is_saved = false;
        return COMPACT_OK;
    case COMPACT_P_COMMAND_TIMEOUT:
        if (!compact_set_within(&node->settings.timeout_ms, *value, 60000)) {
            *value = node->settings.timeout_ms;
            return COMPACT_OUT_OF_RANGE;
        }
        node->is_saved = false;
        return COMPACT_OK;

    /* Orders */
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

/* Returns a serial number that is the same as long as the rig does not change: of bus, kind and
 * configured address. */
static int64_t compact_serial_number(const struct board *board)
{
    return INT64_C(0x51000000) | (int64_t)(board->config.bus & 0xff) << 16 |
           (int64_t)board->config.kind << 8 | board->config.address;
}

enum compact_result compact_node_access_parameter(struct compact_node *node, unsigned parameter,
                                                  bool write, int64_t *value)
{
    const struct board *board = &node->board;
    const struct board_identity *identity = &board->ops->identity;
    enum compact_result result = write ? compact_node_write(node, parameter, value) : COMPACT_OK;

    /* A refused write is answered with the value in force, also of what is read only */
    if (write && result != COMPACT_READ_ONLY) {
        return result;
    }

    switch (parameter) {
    /* What the board is */
    case COMPACT_P_KIND:
        *value = identity->type;
        return result;
    case COMPACT_P_FIRMWARE:
        *value = (int64_t)identity->major << 24 | identity->minor << 16 | identity->build;
        return result;
    case COMPACT_P_SERIAL:
        *value = compact_serial_number(board);
        return result;
    case COMPACT_P_FIRST_SLOT:
        *value = compact_first_slot_or_0(board);
        return result;
    case COMPACT_P_UPTIME:
        *value = (board->boards->now_ns - node->started_ns) / MS;
        return result;

    /* What can be set */
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
