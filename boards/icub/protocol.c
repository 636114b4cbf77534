/* SPDX-License-Identifier: Apache-2.0 */
/* The protocol of the BLL boards, icub, as a module. */
#include "boards/icub/board.h"
#include "boards/icub/messages.h"
#include "boards/protocol_list.h"
#include "manual/protocol_icub.h"

#include <string.h>

/* ---- boards ---- */

/* Allocates the image of what is downloaded; returns false without memory. */
static bool icub_keep_firmware(struct board *board, struct arena *arena)
{
    uint16_t **image = &icub_board_of(board)->loader.image;

    *image = arena_alloc(arena, (size_t)ICUB_MEMORIES * ICUB_MEMORY_WORDS, sizeof **image);
    return *image;
}

/* Creates a board of the configured kind (struct protocol). */
static struct board *icub_make_board(const struct board_config *config, struct arena *arena)
{
    struct board *board;

    if (config->kind != BOARD_MOTOR) {
        return icub_make_sensor(config, arena);
    }
    board = motor_board_create(arena);
    return board && config->keep_firmware && !icub_keep_firmware(board, arena) ? NULL : board;
}

/* ---- messages ---- */

/* Returns the cycle of a class 1 frame, 0 where it has none. */
static uint32_t icub_cycle_ns(const struct board_config *board, unsigned type)
{
    (void)board;
    return type == ICUB_STATUS || type == ICUB_ADDITIONAL_STATUS || type == ICUB_OVERFLOW ||
                   type == ICUB_PRINT
               ? 0
               : (uint32_t)(ICUB_SLOTS * MS);
}

/* Visits the messages of a board (struct protocol). */
static void icub_visit_board(struct message_walk *walk, int board, unsigned first_slot)
{
    static const struct icub_dialect dialect = {
        .frames = icub_motor_frames,
        .commands = icub_motor_commands,
        .axis_bit = true,
        .host_frame = -1,
        .spread_frame = -1,
        .cycle_ns = icub_cycle_ns,
    };

    (void)first_slot;
    icub_visit_messages(walk, board, &dialect);
}

/* Returns the axis of a motor board that a field is about; NULL when there is none. In telemetry
 * it is the digit that ends the field's name; characters of a text are c and a digit. */
static const struct board_axis_config *icub_field_axis(const struct board_config *board,
                                                       const struct message_field *field)
{
    size_t size = strlen(field->field->name);
    char last = field->field->name[size - 1];

    if (!board || board->kind != BOARD_MOTOR || field->message->id >> 8 == ICUB_MANAGEMENT) {
        return NULL;
    }
    if (field->code != MESSAGE_NO_CODE) {
        return &board->axis[field->code >= MESSAGE_AXIS_BIT];
    }
    return size > 2 && (last == '0' || last == '1') ? &board->axis[last - '0'] : NULL;
}

/* Describes a field: the axis or channel that it is about, and its unit (struct protocol). */
static void icub_describe_field(const struct boards_config *config, int bus,
                                const struct message_field *field, struct field_subject *subject)
{
    const struct message *message = field->message;
    bool of_rotor =
        message->id >> 8 == ICUB_PERIODIC_MOTOR && (message->id & 0xf) == ICUB_MOTOR_POSITION;
    double ticks = 0.0;

    (void)bus;
    subject->axis = icub_field_axis(icub_message_board(config, message), field);
    icub_describe_channel(config, field, subject);
    if (subject->axis && subject->axis->joint >= 0) {
        ticks = of_rotor ? subject->axis->motor_ticks_per_rad : subject->axis->joint_ticks_per_rad;
    }

    /* Quantities that are scaled by the axis that the field belongs to */
    if (!strcmp(subject->unit, "pwm")) {
        subject->scale = 100.0 / ICUB_PWM_FULL_SCALE;
        subject->offset = 0.0;
        subject->unit = "%";
    } else if (!strcmp(subject->unit, "tick") && ticks > 0.0) {
        subject->scale = 1.0 / ticks;
        subject->offset = 0.0;
        subject->unit = "rad";
    }
}

/* ---- load ---- */

/* Visits the frames that a board sends again and again: POSITION, PID_VAL, CURRENT and VELOCITY,
 * one in each slot; STATUS. */
static void icub_visit_board_load(struct load_walk *walk, const struct board_config *board)
{
    if (board->kind != BOARD_MOTOR) {
        icub_visit_sensor_load(walk, board);
        return;
    }
    for (int i = 0; i < 4; i++) {
        load_visit(walk, 8, ICUB_SLOTS * 1e-3);
    }
    load_visit(walk, 8, ICUB_STATUS_PERIOD_MS * 1e-3);
}

/* Visits the host's frames: a voltage for each axis. */
static void icub_visit_command_load(struct load_walk *walk)
{
    for (unsigned i = load_bus_axes(walk); i > 0; i--) {
        load_visit(walk, 3, walk->command_period_s);
    }
}

static const char *const icub_fault_names[] = {
    "under-voltage", "over-voltage",     "external",        "over-current",
    "Hall sensor",   "absolute encoder", "optical encoder", NULL};

const struct protocol protocol_icub = {
    .name = "icub",
    .summary = "iCub BLL motor boards, two axes an address, and STRAIN boards",
    .motor_address_max = ICUB_ADDRESS_MAX,
    .address_max = ICUB_ADDRESS_MAX,
    .axes_max = 2,
    .spare_axes = true,
    .torque_boards = true,
    .padded = true,
    .external = true,
    .make_bus = icub_bus_create,
    .make_board = icub_make_board,
    .firmware = icub_firmware,
    .visit_broadcasts = icub_visit_discovery,
    .visit_board = icub_visit_board,
    .describe_field = icub_describe_field,
    .claims_id = icub_claims_id,
    .visit_board_load = icub_visit_board_load,
    .visit_command_load = icub_visit_command_load,
    .mode_name = icub_mode_name,
    .fault_names = icub_fault_names,
    .timeout_text = "reference set to 0",
    .limit_text = "ticks, voltage set to 0",
    .help = MANUAL_PROTOCOL_ICUB,
    .sections = icub_sections,
    .bench = {.bus_axes = 6,
              .board_axes = 2,
              .ft_address = 0x0d,
              .torque_address = 0x0c,
              .ft_period_s = "0.005",
              .torque_period_s = "0.005",
              .command_period_s = "0.002"},
};
