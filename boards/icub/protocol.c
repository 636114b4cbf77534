/* SPDX-License-Identifier: Apache-2.0 */
/* The messages of iCub buses; boards/icub/messages.h describes the functions. */
#include "boards/icub/board.h"
#include "boards/icub/messages.h"

#include "boards/protocol_list.h"
#include "manual/protocol_icub.h"

#include <string.h>

enum {
    SECTION_MOTOR_COMMANDS = ICUB_SECTION_TELEMETRY + 1,
    SECTION_STRAIN_TELEMETRY,
    SECTION_STRAIN_COMMANDS,
    SECTION_INERTIAL_TELEMETRY,
    SECTION_INERTIAL_COMMANDS,
    SECTION_MANAGEMENT,
};

const char *const icub_sections[] = {
    [ICUB_SECTION_TELEMETRY] = "Targets and telemetry of motor boards",
    [SECTION_MOTOR_COMMANDS] = "Commands of motor boards",
    [SECTION_STRAIN_TELEMETRY] = "Telemetry of STRAIN boards",
    [SECTION_STRAIN_COMMANDS] = "Commands of STRAIN boards",
    [SECTION_INERTIAL_TELEMETRY] = "Telemetry of inertial boards",
    [SECTION_INERTIAL_COMMANDS] = "Commands of inertial boards",
    [SECTION_MANAGEMENT] = "Management of all boards",
    NULL,
};

/* ---- commands ---- */

/* Visits a command if `request` is true, and always its answer. */
static void visit_command(struct message_walk *walk, int index, enum icub_class cls, unsigned code,
                          const struct icub_command *row, bool axis_bit, bool request)
{
    const struct board_config *board = &walk->config->board[index];
    struct message message = {
        .name = row->name,
        .id = icub_id(cls, ICUB_HOST, board->address),
        .base = icub_id(cls, ICUB_HOST, 0),
        .step = 1,
        .number = board->address,
        .sender = MESSAGE_NO_BOARD,
        .receiver = index,
        .from_host = true,
        .length = row->request_max,
        .shortest = row->request_min,
        .code = (int)code,
        .axis_bit = axis_bit,
        .family = cls == ICUB_MANAGEMENT ? "MANAGEMENT" : "COMMAND",
        .section = cls == ICUB_MANAGEMENT          ? SECTION_MANAGEMENT
                   : board->kind == BOARD_MOTOR    ? SECTION_MOTOR_COMMANDS
                   : board->kind == BOARD_INERTIAL ? SECTION_INERTIAL_COMMANDS
                                                   : SECTION_STRAIN_COMMANDS,
        .fields = row->request,
        .first_byte = 1,
        .repeats = 1,
        .slot = -1,
    };

    /* Visit the request; its answer has sender and receiver exchanged */
    if (request) {
        message_visit(walk, &message);
    }
    if (row->reply_length) {
        message.id = icub_id(cls, board->address, ICUB_HOST);
        message.base = icub_id(cls, 0, ICUB_HOST);
        message.step = icub_id(cls, 1, ICUB_HOST) - message.base;
        message.sender = index;
        message.receiver = MESSAGE_NO_BOARD;
        message.from_host = false;
        message.length = row->reply_length;
        message.shortest = 0;
        message.family = cls == ICUB_MANAGEMENT ? "MANAGEMENT_REPLY" : "REPLY";
        message.fields = row->reply;
        message_visit(walk, &message);
    }
}

/* ---- discovery: a question to everyone, an answer of each ---- */

void icub_visit_discovery(struct message_walk *walk)
{
    const struct icub_command *row = icub_management_command(ICUB_DISCOVER);
    const uint32_t id = icub_id(ICUB_MANAGEMENT, ICUB_HOST, ICUB_EVERYONE);
    const struct message discover = {
        .name = row->name,
        .id = id,
        .base = id,
        .sender = MESSAGE_NO_BOARD,
        .receiver = MESSAGE_NO_BOARD,
        .from_host = true,
        .length = row->request_max,
        .code = ICUB_DISCOVER,
        .family = "MANAGEMENT",
        .section = SECTION_MANAGEMENT,
        .first_byte = 1,
        .repeats = 1,
        .slot = -1,
    };

    message_visit(walk, &discover);
}

/* ---- periodic frames ---- */

/* Visits the periodic frames of a board. */
static void visit_frames(struct message_walk *walk, int index, const struct icub_dialect *dialect)
{
    const struct board_config *board = &walk->config->board[index];
    bool motor = board->kind == BOARD_MOTOR, inertial = board->kind == BOARD_INERTIAL;
    enum icub_class cls = motor      ? ICUB_PERIODIC_MOTOR
                          : inertial ? ICUB_PERIODIC_INERTIAL
                                     : ICUB_PERIODIC_ANALOG;
    const struct icub_frame_type *rows = motor      ? dialect->frames
                                         : inertial ? icub_inertial_frames
                                                    : icub_analog_frames;

    /* Visit one frame for each type in the board's table */
    for (unsigned type = 0; type < 16; type++) {
        bool periodic = inertial || type == ICUB_FORCE || type == ICUB_TORQUE;
        int64_t period_ns = !periodic ? 0 : board->period_ns > 0 ? board->period_ns : MS;
        struct message message = {
            .name = rows[type].name,
            .id = icub_id(cls, board->address, type),
            .base = icub_id(cls, 0, type),
            .step = icub_id(cls, 1, type) - icub_id(cls, 0, type),
            .number = board->address,
            .sender = index,
            .receiver = MESSAGE_NO_BOARD,
            .length = rows[type].length,
            .code = MESSAGE_NO_CODE,
            .section = motor      ? ICUB_SECTION_TELEMETRY
                       : inertial ? SECTION_INERTIAL_TELEMETRY
                                  : SECTION_STRAIN_TELEMETRY,
            .cycle_varies = motor && (int)type == dialect->spread_frame,
            .cycle_ns = motor ? dialect->cycle_ns(board, type) : (uint32_t)period_ns,
            .fields = rows[type].fields,
            .repeats = 1,
            .slot = -1,
        };

        if (message.name && !(motor && (int)type == dialect->host_frame)) {
            message_visit(walk, &message);
        }
    }
}

void icub_visit_messages(struct message_walk *walk, int board, const struct icub_dialect *dialect)
{
    enum board_kind kind = walk->config->board[board].kind;
    bool motor = kind == BOARD_MOTOR;
    const struct icub_command *rows = motor                    ? dialect->commands
                                      : kind == BOARD_INERTIAL ? icub_inertial_commands
                                                               : icub_strain_commands;

    visit_command(walk, board, ICUB_MANAGEMENT, ICUB_DISCOVER,
                  icub_management_command(ICUB_DISCOVER), false, false);
    visit_frames(walk, board, dialect);
    for (unsigned code = 0; code < (motor ? ICUB_MOTOR_COMMANDS : ICUB_STRAIN_COMMANDS); code++) {
        if (rows[code].kind) {
            visit_command(walk, board, motor ? ICUB_POLLING_MOTOR : ICUB_POLLING_ANALOG, code,
                          &rows[code], motor && dialect->axis_bit, true);
        }
    }
    for (unsigned code = 0; code < ICUB_DISCOVER; code++) {
        const struct icub_command *row = icub_management_command((uint8_t)code);

        if (row) {
            visit_command(walk, board, ICUB_MANAGEMENT, code, row, false, true);
        }
    }
}

/* ---- fields ---- */

const struct board_config *icub_message_board(const struct boards_config *config,
                                              const struct message *message)
{
    int board = message->from_host ? message->receiver : message->sender;

    return board == MESSAGE_NO_BOARD ? NULL : &config->board[board];
}

void icub_describe_channel(const struct boards_config *config, const struct message_field *field,
                           struct field_subject *subject)
{
    const struct board_config *board = icub_message_board(config, field->message);
    unsigned type = field->message->id & 0xf;

    if (!board || board->kind == BOARD_MOTOR || field->message->id >> 8 != ICUB_PERIODIC_ANALOG ||
        (type != ICUB_FORCE && type != ICUB_TORQUE)) {
        return;
    }

    /* Only calibrated frames have a unit: offset binary over the full scale */
    subject->channel = field->index + (type == ICUB_TORQUE ? 3 : 0);
    if (board->full_scale[subject->channel] > 0.0) {
        subject->scale = board->full_scale[subject->channel] / ICUB_STRAIN_ZERO;
        subject->offset = -board->full_scale[subject->channel];
        subject->unit = board->kind == BOARD_FT && subject->channel < 3 ? "N" : "Nm";
    }
}

/* ---- load ---- */

/* Visits two frames of a STRAIN board, forces and torques, or three frames of an inertial board:
 * acceleration, rate and quaternion, as hosts select them. */
void icub_visit_sensor_load(struct load_walk *walk, const struct board_config *board)
{
    bool inertial = board->kind == BOARD_INERTIAL;

    for (int i = 0; i < (inertial ? 3 : 2); i++) {
        load_visit(walk, inertial ? ICUB_INERTIAL_LENGTH : ICUB_STRAIN_LENGTH,
                   load_period_s(walk, board->period_ns));
    }
}

/* ---- identifiers, words, boards ---- */

bool icub_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text, size_t size)
{
    unsigned cls = id >> 8;

    (void)bus;
    snprintf(text, size, "the boards, expected one from 0x400 to 0x6ff");
    return cls == ICUB_POLLING_MOTOR || cls == ICUB_PERIODIC_MOTOR || cls == ICUB_POLLING_ANALOG ||
           cls == ICUB_PERIODIC_ANALOG || cls == ICUB_MANAGEMENT;
}

const char *icub_mode_name(uint32_t mode)
{
    static const struct {
        uint32_t mode;
        const char *name;
    } names[] = {
        {ICUB_MODE_IDLE, "idle"},
        {ICUB_MODE_POSITION, "position"},
        {ICUB_MODE_VELOCITY, "velocity"},
        {ICUB_MODE_TORQUE, "torque"},
        {ICUB_MODE_IMPEDANCE_POSITION, "impedance position"},
        {ICUB_MODE_IMPEDANCE_VELOCITY, "impedance velocity"},
        {ICUB_MODE_CURRENT, "current"},
        {ICUB_MODE_MIXED, "mixed"},
        {ICUB_MODE_DIRECT, "direct position"},
        {ICUB_MODE_SPEED_VOLTAGE, "speed (voltage)"},
        {ICUB_MODE_SPEED_CURRENT, "speed (current)"},
        {ICUB_MODE_NOT_CONFIGURED, "not configured"},
        {ICUB_MODE_OPEN_LOOP, "voltage"},
        {ICUB_MODE_CALIBRATION, "calibration"},
        {ICUB_MODE_HARDWARE_FAULT, "hardware fault"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(names); i++) {
        if (names[i].mode == mode) {
            return names[i].name;
        }
    }
    return "unknown";
}

bool icub_firmware(const struct board *board, struct board_firmware *firmware)
{
    const struct icub_loader *loader = &icub_board_of(board)->loader;

    *firmware = (struct board_firmware){loader->lines, loader->bytes, loader->crc, loader->image,
                                        (size_t)ICUB_MEMORIES * ICUB_MEMORY_WORDS};
    return loader->lines > 0;
}

/* The protocol icub of the BLL boards as a module (struct protocol). */

/* ---- messages ---- */

/* Returns the cycle of a class 1 frame; 0 = none. */
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

/* Describes a field: its axis or channel, and its unit (struct protocol). */
static void icub_describe_field(const struct boards_config *config, int bus,
                                const struct message_field *field, struct field_subject *subject)
{
    const struct message *message = field->message;
    const struct board_config *board = icub_message_board(config, message);
    size_t size = strlen(field->field->name);
    char last = field->field->name[size - 1];
    bool of_rotor =
        message->id >> 8 == ICUB_PERIODIC_MOTOR && (message->id & 0xf) == ICUB_MOTOR_POSITION;
    double ticks = 0.0;

    (void)bus;
    /* In telemetry, the last digit of a field's name is the axis. Names of characters in a text are
     * c and a digit */
    if (board && board->kind == BOARD_MOTOR && message->id >> 8 != ICUB_MANAGEMENT) {
        if (field->code != MESSAGE_NO_CODE) {
            subject->axis = &board->axis[field->code >= MESSAGE_AXIS_BIT];
        } else if (size > 2 && (last == '0' || last == '1')) {
            subject->axis = &board->axis[last - '0'];
        }
    }
    icub_describe_channel(config, field, subject);
    if (subject->axis && subject->axis->joint >= 0) {
        ticks = of_rotor ? subject->axis->motor_ticks_per_rad : subject->axis->joint_ticks_per_rad;
    }

    /* Express PWM counts in percent */
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

/* Visits the periodic frames of a board: STATUS, and one of POSITION, PID_VALUE, CURRENT and
 * VELOCITY per slot. */
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

/* Visits the host's frames: one open-loop command per axis. */
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
    .axes_max = 2,
    .spare_axes = true,
    ICUB_MEMBERS(&motor_icub_ops.base),
    .visit_broadcasts = icub_visit_discovery,
    .visit_board = icub_visit_board,
    .describe_field = icub_describe_field,
    .visit_board_load = icub_visit_board_load,
    .visit_command_load = icub_visit_command_load,
    .fault_names = icub_fault_names,
    .timeout_text = "reference set to 0",
    .help = MANUAL_PROTOCOL_ICUB,
    .bench = {.bus_axes = 6,
              .board_axes = 2,
              .ft_address = 0x0d,
              .torque_address = 0x0c,
              .ft_period_s = "0.005",
              .torque_period_s = "0.005",
              .command_period_s = "0.002"},
};
