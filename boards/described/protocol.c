/* SPDX-License-Identifier: Apache-2.0 */
/* Protocols that a file describes, described, as a module. */
#include "boards/described/protocol.h"

#include "boards/board_private.h"
#include "boards/described/board.h"
#include "boards/described/messages.h"
#include "boards/protocol_list.h"
#include "manual/protocol_compact.h"

/* Creates a board by its kind (struct protocol). */
static struct board *described_make_board(const struct board_config *config, struct arena *arena)
{
    return config->kind == BOARD_MOTOR      ? described_motor_create(arena)
           : config->kind == BOARD_INERTIAL ? described_inertial_create(arena)
                                            : described_ft_create(arena);
}

/* Checks address and number of axes of a board (struct protocol). */
static enum error_code described_check_board(const struct boards_bus_config *bus,
                                             const struct board_config *board, struct error *error)
{
    const char *name = board->name ? board->name : "(no name)";

    if (board->address > bus->described->address_max) {
        return error_set(error, ERROR_INPUT,
                         "board %s: the address is beyond those of its protocol", name);
    }
    if (board_config_axes(board) > bus->described->axes) {
        return error_set(error, ERROR_INPUT,
                         "board %s: it has more axes than boards of its protocol", name);
    }
    return ERROR_NONE;
}

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

/* Returns the name of the law in force: the states have names of the file. */
static const char *described_law_name(uint32_t law)
{
    static const char *const names[] = {
        [DESCRIBED_OFF] = "off",
        [DESCRIBED_VOLTAGE] = "voltage",
        [DESCRIBED_CURRENT] = "current",
        [DESCRIBED_TORQUE] = "torque",
        [DESCRIBED_VELOCITY] = "velocity",
        [DESCRIBED_POSITION] = "position",
        [DESCRIBED_IMPEDANCE] = "impedance",
        [DESCRIBED_FAULT] = "fault",
    };

    return law <= DESCRIBED_FAULT ? names[law] : "unknown";
}

/* What all described protocols have. */
#define DESCRIBED                                                                                  \
    .motor_address_max = DESCRIBED_ADDRESS_MAX, .address_max = DESCRIBED_ADDRESS_MAX,              \
    .axes_max = DESCRIBED_AXES, .slots_max = DESCRIBED_SLOTS, .canfd = true,                       \
    .make_bus = described_bus_create, .make_board = described_make_board,                          \
    .check_board = described_check_board, .visit_broadcasts = described_visit_broadcasts,          \
    .visit_board = described_visit_board, .comment_message = described_comment_message,            \
    .note_field = described_note_field, .claims_id = described_claims_id,                          \
    .mode_name = described_law_name, .fault_names = described_fault_names,                         \
    .timeout_text = "as its protocol has it", .limit_text = "ticks, voltage set to 0"

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
