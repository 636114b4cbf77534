/* SPDX-License-Identifier: Apache-2.0 */
/* Protocol foc of the 2FOC boards as a module (struct protocol): the differences from icub. */
#include "boards/foc/private.h"
#include "boards/icub/messages.h"
#include "boards/protocol_list.h"
#include "manual/protocol_foc.h"

/* ---- messages ---- */

/* Returns the cycle of a class 1 frame. */
static uint32_t foc_cycle_ns(const struct board_config *board, unsigned type)
{
    return type == FOC_ADDITIONAL_STATUS ? foc_additional_status_ms(board->address) * (uint32_t)MS
           : type == FOC_STATUS && board->status_period_ns > MS ? (uint32_t)board->status_period_ns
                                                                : (uint32_t)MS;
}

/* Visits DISCOVER and DESIRED_TARGETS. DESIRED_TARGETS has targets for four addresses. */
static void foc_visit_broadcasts(struct message_walk *walk)
{
    const struct message targets = {
        .name = foc_frames[FOC_DESIRED_TARGETS].name,
        .id = FOC_DESIRED_TARGETS_ID,
        .base = FOC_DESIRED_TARGETS_ID,
        .sender = MESSAGE_NO_BOARD,
        .receiver = MESSAGE_NO_BOARD,
        .from_host = true,
        .length = FOC_TARGETS_LENGTH,
        .code = MESSAGE_NO_CODE,
        .section = ICUB_SECTION_TELEMETRY,
        .cycle_ns = MS,
        .fields = foc_frames[FOC_DESIRED_TARGETS].fields,
        .repeats = 1,
        .slot = -1,
    };

    icub_visit_discovery(walk);
    message_visit(walk, &targets);
}

/* Visits the messages of a board (struct protocol). */
static void foc_visit_board(struct message_walk *walk, int board, unsigned first_slot)
{
    static const struct icub_dialect dialect = {
        .frames = foc_frames,
        .commands = foc_commands,
        .host_frame = FOC_DESIRED_TARGETS,
        .spread_frame = FOC_ADDITIONAL_STATUS,
        .cycle_ns = foc_cycle_ns,
    };

    (void)first_slot;
    icub_visit_messages(walk, board, &dialect);
}

/* Describes a field: its axis or channel, and its unit (struct protocol). */
static void foc_describe_field(const struct boards_config *config, int bus,
                               const struct message_field *field, struct field_subject *subject)
{
    const struct board_config *board = icub_message_board(config, field->message);
    double rotor;

    /* A field of DESIRED_TARGETS belongs to the axis at an address. Any other field belongs to the
     * board's own axis */
    for (size_t i = 0; i < config->nboard && !board; i++) {
        const struct board_config *at = &config->board[i];

        if (at->bus == bus && at->kind == BOARD_MOTOR && at->address == field->index + 1) {
            subject->axis = &at->axis[0];
        }
    }
    if (board && board->kind == BOARD_MOTOR && field->message->id >> 8 != ICUB_MANAGEMENT) {
        subject->axis = &board->axis[0];
    }
    icub_describe_channel(config, field, subject);

    /* Express rotor angles as joint angles */
    if (!subject->axis || !(subject->axis->gear > 0.0)) {
        return;
    }
    rotor = 2.0 * M_PI / FOC_ICUBDEG_PER_REV / subject->axis->gear;
    if (!strcmp(subject->unit, "icubdeg")) {
        subject->scale = rotor;
        subject->unit = "rad";
    } else if (!strcmp(subject->unit, "icubdeg/ms")) {
        subject->scale = 1e3 * rotor;
        subject->unit = "rad/s";
    }
}

/* ---- load ---- */

/* Visits the periodic frames of a board (struct protocol). */
static void foc_visit_board_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, 0); /* period of DESIRED_TARGETS */

    if (board->kind != BOARD_MOTOR) {
        icub_visit_sensor_load(walk, board);
        return;
    }
    load_visit(walk, FOC_FEEDBACK_LENGTH, period_s);
    load_visit(walk, FOC_STATUS_LENGTH, fmax(period_s, (double)board->status_period_ns * 1e-9));
    load_visit(walk, FOC_ADDITIONAL_STATUS_LENGTH, foc_additional_status_ms(board->address) * 1e-3);
}

/* Visits DESIRED_TARGETS, which the host sends once a tick (struct protocol). */
static void foc_visit_command_load(struct load_walk *walk)
{
    if (load_bus_axes(walk) > 0) {
        load_visit(walk, FOC_TARGETS_LENGTH, load_period_s(walk, 0));
    }
}

/* clang-format off */
static const char *const foc_fault_names[] = {
    "protocol", "Hall sequence", "absolute encoder checksum", "Hall value", "over-current",
    "over-voltage", "under-voltage", "external", "bit 8", "over-heating", "CAN reception warning",
    "CAN sending warning", "CAN passive", "CAN passive", "set-point expired", "CAN overrun", "PWM",
    "encoder calculation", "SPI timing", "encoder", "EMUROM CRC", "EMUROM", "I2t",
    "ADC calibration", "lower limit", "upper limit", "silicon", "CAN length", NULL};
/* clang-format on */

const struct protocol protocol_foc = {
    .name = "foc",
    .summary = "iCub 2FOC motor boards, one axis an address, 1 kHz",
    .motor_address_max = FOC_AXES_MAX, /* only these addresses have a target */
    .axes_max = 1,
    ICUB_MEMBERS(&foc_icub_ops.base),
    .visit_broadcasts = foc_visit_broadcasts,
    .visit_board = foc_visit_board,
    .describe_field = foc_describe_field,
    .visit_board_load = foc_visit_board_load,
    .visit_command_load = foc_visit_command_load,
    .fault_names = foc_fault_names,
    .timeout_text = "a fault",
    .help = MANUAL_PROTOCOL_FOC,
    .bench = {.bus_axes = 2,
              .board_axes = 1,
              .ft_address = 0x0d,
              .torque_address = 0x0c,
              .ft_period_s = "0.005",
              .torque_period_s = "0.01",
              .command_period_s = "0.001",
              .motors = "  rotor_poles: 8\n  status_period_s: 0.01\n"},
};
