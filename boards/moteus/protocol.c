/* SPDX-License-Identifier: Apache-2.0 */
/* The register protocol of moteus controllers as a module (struct protocol). */
#include "boards/moteus/protocol.h"

#include "boards/moteus/private.h"
#include "boards/protocol_list.h"
#include "manual/protocol_moteus.h"

/* ---- messages ---- */

/* Visits nothing, because no message is for all boards (struct protocol). */
static void moteus_visit_broadcasts(struct message_walk *walk)
{
    (void)walk;
}

/* Visits the command to a board and the reply (struct protocol). */
static void moteus_visit_board(struct message_walk *walk, int index, unsigned first_slot)
{
    unsigned address = walk->config->board[index].address;
    struct message message = {
        .name = "COMMAND",
        .id = MOTEUS_WANTS_REPLY | moteus_id(0, address),
        .base = MOTEUS_WANTS_REPLY,
        .step = 1,
        .number = address,
        .extended = true,
        .fd = true,
        .bit_rate_switch = true,
        .sender = MESSAGE_NO_BOARD,
        .receiver = index,
        .from_host = true,
        .length = MOTEUS_COMMAND_LENGTH,
        .code = MESSAGE_NO_CODE,
        .answer = "REPLY",
        .section = MESSAGE_FROM_HOST,
        .cycle_ns = (uint32_t)(walk->config->tick_ns > MS ? walk->config->tick_ns : MS),
        .fields = moteus_command_fields,
        .repeats = 1,
        .slot = (int)first_slot,
    };

    message_visit(walk, &message);
    message.name = "REPLY";
    message.id = moteus_id(address, 0);
    message.base = 0;
    message.step = moteus_id(1, 0);
    message.extended = message.id > 0x7ff;
    message.sender = index;
    message.receiver = MESSAGE_NO_BOARD;
    message.from_host = false;
    message.length = MOTEUS_REPLY_LENGTH;
    message.answer = NULL;
    message.section = MESSAGE_FROM_BOARDS;
    message.fields = moteus_reply_fields;
    message_visit(walk, &message);
}

/* Returns whether an identifier belongs to a frame from the host to a controller, or from a
 * controller to the host (struct protocol). */
static bool moteus_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text,
                             size_t size)
{
    snprintf(text, size, "moteus boards, expected one whose low byte is from 0x20 to 0x7e");
    return bus && ((id & 0xff) <= MOTEUS_ADDRESS_MAX || (id & 0xff) == MOTEUS_BROADCAST);
}

/* ---- words ---- */

/* Returns the name of a mode (struct protocol). */
static const char *moteus_mode_name(uint32_t mode)
{
    static const char *const names[MOTEUS_MODES] = {
        "stopped",  "fault",   "enabling",      "calibrating", "calibration complete",
        "PWM",      "voltage", "voltage FOC",   "voltage DQ",  "current",
        "position", "timeout", "zero velocity", "stay within", "measure inductance",
        "brake"};

    return mode < MOTEUS_MODES ? names[mode] : "unknown";
}

/* Names of the codes from MOTEUS_FAULT_FIRST on. */
/* clang-format off */
static const char *const moteus_fault_names[] = {
    "calibration", "motor driver", "over-voltage", "encoder", "motor not configured",
    "PWM cycle overrun", "over-temperature", "outside limit", "under-voltage",
    "configuration changed", "theta invalid", "position invalid", "driver enable",
    "stop position with limits", NULL};
/* clang-format on */

/* Prints the registers (struct protocol). */
static void moteus_print_registers(FILE *out)
{
    fputs("\n## Registers\n\n| number | name | unit | access |\n|---|---|---|---|\n", out);
    for (size_t i = 0; i < moteus_row_count; i++) {
        const struct moteus_row *row = &moteus_rows[i];
        const char *unit = moteus_unit(row->quantity);

        fprintf(out, "| 0x%03x | `%s` | %s | %s |\n", row->number, row->name, unit ? unit : "",
                row->access == MOTEUS_R    ? "read"
                : row->access == MOTEUS_RW ? "read, write"
                                           : "write");
    }
}

const struct protocol protocol_moteus = {
    .name = "moteus",
    .summary = "moteus controllers (mjbots) over CAN FD, one axis an address, 1 kHz",
    .motor_address_max = MOTEUS_ADDRESS_MAX,
    .address_max = MOTEUS_ADDRESS_MAX,
    .axes_max = 1,
    .canfd = true,
    .canfd_only = true,
    .motors_only = true,
    /* assumed; at most 0.4 ms with both frames and the host: 2.5 kHz with one controller and a
     * pi3hat, by its makers (blog.mjbots.com, "Capturing full rate debug data from moteus") */
    .reply = {.delay_ns = 100000},
    .bus = &moteus_bus_ops,
    .board = {[BOARD_MOTOR] = &moteus_ops},
    .no_valves = true,
    .visit_broadcasts = moteus_visit_broadcasts,
    .visit_board = moteus_visit_board,
    .claims_id = moteus_claims_id,
    .mode_name = moteus_mode_name,
    .fault_names = moteus_fault_names,
    .timeout_text = "mode timeout",
    .limit_text = "turns",
    .help = MANUAL_PROTOCOL_MOTEUS,
    .print_appendix = moteus_print_registers,
};
