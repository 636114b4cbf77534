/* SPDX-License-Identifier: Apache-2.0 */
/* The settings of an iCub motor board: parameters that commands of class 0 set, with their
 * ranges. */
#include "boards/icub/motor_private.h"

/* A setting: the command that sets it, and its field in the command. */
static const struct {
    const char *name;
    uint8_t code;
    uint8_t field;
} rows[] = {
    {"position_kp", ICUB_SET_P_GAIN, 0},
    {"position_ki", ICUB_SET_I_GAIN, 0},
    {"position_kd", ICUB_SET_D_GAIN, 0},
    {"position_shift", ICUB_SET_SCALE, 0},
    {"position_offset", ICUB_SET_OFFSET, 0},
    {"position_limit", ICUB_SET_OUTPUT_LIMIT, 0},
    {"position_integral_limit", ICUB_SET_I_LIMIT, 0},
    {"torque_kp", ICUB_SET_TORQUE_PID, 0},
    {"torque_ki", ICUB_SET_TORQUE_PID, 1},
    {"torque_kd", ICUB_SET_TORQUE_PID, 2},
    {"torque_shift", ICUB_SET_TORQUE_PID, 3},
    {"torque_offset", ICUB_SET_TORQUE_PID_LIMITS, 0},
    {"torque_limit", ICUB_SET_TORQUE_PID_LIMITS, 1},
    {"torque_integral_limit", ICUB_SET_TORQUE_PID_LIMITS, 2},
    {"current_kp", ICUB_SET_CURRENT_PID, 0},
    {"current_ki", ICUB_SET_CURRENT_PID, 1},
    {"current_kd", ICUB_SET_CURRENT_PID, 2},
    {"current_shift", ICUB_SET_CURRENT_PID, 3},
    {"stiffness", ICUB_SET_IMPEDANCE, 0},
    {"damping", ICUB_SET_IMPEDANCE, 1},
    {"pwm_limit", ICUB_SET_PWM_LIMIT, 0},
    {"current_limit", ICUB_SET_CURRENT_LIMIT, 0},
    {"max_velocity", ICUB_SET_MAX_VELOCITY, 0},
};

/* Returns the axis parameter that a setting stores. */
static int64_t *motor_setting_parameter(const struct board *board, unsigned axis, size_t index)
{
    enum icub_parameter parameter = icub_motor_commands[rows[index].code].parameter;

    return &motor_board_of(board)->axis[axis].parameter[parameter + rows[index].field];
}

/* Describes a setting: name, unit, range (struct board_settings). */
static void motor_setting_describe(const struct board *board, unsigned axis, size_t index,
                                   struct board_setting *setting)
{
    const struct field *field = &icub_motor_commands[rows[index].code].request[rows[index].field];
    bool bounded = field->min != 0 || field->max != 0;

    *setting = (struct board_setting){
        .name = rows[index].name,
        .unit = field->unit ? field->unit : "",
        .min = (double)(bounded ? field->min : field_lowest(field)),
        .max = (double)(bounded ? field->max : field_highest(field)),
        .whole = true,
        .value = (double)*motor_setting_parameter(board, axis, index),
    };
}

/* Writes a setting (struct board_settings). */
static bool motor_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    *motor_setting_parameter(board, axis, index) = (int64_t)value;
    if (rows[index].code == ICUB_SET_I_GAIN) {
        /* SET_I_GAIN also resets the integral */
        motor_board_of(board)->axis[axis].position_pid.integral = 0;
    }
    return true;
}

static const struct board_settings motor_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = motor_setting_describe,
    .set = motor_setting_set,
};

/* Sends the periodic frames of a motor board in their slots. */

/* Builds a frame from its row and sends it. */
static void motor_board_send_frame(struct board *board, struct frame_sink *sink,
                                   enum icub_motor_type type, const int64_t *values)
{
    const struct icub_frame_type *row = &icub_motor_frames[type];
    uint8_t data[8];

    fields_encode(row->fields, values, data);
    board_send(board, sink, icub_id(ICUB_PERIODIC_MOTOR, board->address, type), row->length, data);
}

/* Sends a frame of up to four values if the broadcast policy selects its type. */
static void motor_board_send_if_wanted(struct board *board, struct frame_sink *sink,
                                       enum icub_motor_type type, int64_t v0, int64_t v1,
                                       int64_t v2, int64_t v3)
{
    if (motor_board_of(board)->policy >> (type - 1) & 1) {
        motor_board_send_frame(board, sink, type, (const int64_t[]){v0, v1, v2, v3});
    }
}

/* Returns the change of an error counter since the last STATUS, limited to a signed byte. The rest
 * of the change is in the next STATUS. */
static int64_t can_counter_change(unsigned counter, int *reported)
{
    int64_t change = control_clamp((int64_t)counter - *reported, INT8_MIN, INT8_MAX);

    *reported += (int)change;
    return change & 0xff;
}

/* Sends STATUS and ADDITIONAL_STATUS when due: periodically, on changes, and while a fault
 * lasts. */
static void motor_board_transmit_status(struct board *board, struct frame_sink *sink,
                                        int64_t now_ms)
{
    struct motor_board *motor = motor_board_of(board);
    struct motor_axis *a = &motor->axis[0], *b = &motor->axis[1];
    bool periodic = now_ms - motor->status_ms >= ICUB_STATUS_PERIOD_MS;
    uint8_t lasting = (a->faults | b->faults) &
                      (ICUB_FAULT_UNDER_VOLTAGE | ICUB_FAULT_OVER_VOLTAGE | ICUB_FAULT_EXTERNAL);
    bool now = motor->status_due || periodic || lasting || board->lost_in_status;

    if (!(motor->policy >> (ICUB_STATUS - 1) & 1) || board->can.bus_off) {
        return; /* the frame would be lost in bus-off */
    }
    if (now) {
        motor_board_send_frame(
            board, sink, ICUB_STATUS,
            (const int64_t[]){
                a->faults | a->faults_once, a->base.mode, b->faults | b->faults_once, b->base.mode,
                motor->can | motor_board_can_status(board) |
                    (board->lost_in_status ? ICUB_CAN_TX_OVERFLOW : 0),
                a->heat | b->heat << 1, can_counter_change(board->can.tec, &motor->reported_tec),
                can_counter_change(board->can.rec, &motor->reported_rec)});
        /* Clear what STATUS reports only once */
        a->faults_once = b->faults_once = 0;
        motor->can = 0;
        motor->can_reported = motor_board_can_status(board);
        motor->status_due = board->lost_in_status = false;
        motor->status_ms = periodic ? now_ms : motor->status_ms;
    }
    if (now || motor->additional_due) {
        motor_board_send_frame(board, sink, ICUB_ADDITIONAL_STATUS,
                               (const int64_t[]){a->parameter[ICUB_P_INTERACTION] |
                                                 b->parameter[ICUB_P_INTERACTION] << 4});
        motor->additional_due = false;
    }
}

/* Sends the speeds and accelerations of the joints or of the motors. */
static void motor_board_send_speeds(struct board *board, struct frame_sink *sink, bool of_motors)
{
    int speed_shift = of_motors ? ICUB_P_MOTOR_SPEED_SHIFT : ICUB_P_JOINT_SPEED_SHIFT;
    int64_t speed[MOTOR_AXES], acceleration[MOTOR_AXES];

    for (int i = 0; i < MOTOR_AXES; i++) {
        const struct motor_axis *axis = &motor_board_of(board)->axis[i];
        const struct speed_estimator *of = of_motors ? &axis->motor : &axis->joint;
        /* shift[0]: of the speed, shift[1]: of the acceleration */
        const int64_t *shift = &axis->parameter[speed_shift];

        speed[i] = estimator_speed(of, shift[0]);
        acceleration[i] = estimator_acceleration(of, shift[0] + shift[1]);
    }
    motor_board_send_if_wanted(board, sink, of_motors ? ICUB_MOTOR_SPEED : ICUB_VELOCITY, speed[0],
                               speed[1], acceleration[0], acceleration[1]);
}

/* Sends the frames of slot 3 that the broadcast policy selects. */
static void motor_board_transmit_slot_3(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];

    motor_board_send_if_wanted(board, sink, ICUB_CURRENT, motor_axis_current_ma(a),
                               motor_axis_current_ma(b), 0, 0);
    if (board->lost_in_overflow && motor_board_of(board)->policy >> (ICUB_OVERFLOW - 1) & 1) {
        board->lost_in_overflow = false;
        motor_board_send_frame(board, sink, ICUB_OVERFLOW, NULL);
    }
    motor_board_send_speeds(board, sink, false);
    motor_board_send_if_wanted(board, sink, ICUB_PID_ERROR, a->position_pid.error,
                               b->position_pid.error, a->torque_pid.error, b->torque_pid.error);
    motor_board_send_if_wanted(board, sink, ICUB_DEBUG, a->torque, b->torque, a->torque_reference,
                               b->torque_reference);
    motor_board_send_if_wanted(board, sink, ICUB_MOTOR_POSITION, a->base.motor_ticks,
                               b->base.motor_ticks, 0, 0);
    motor_board_send_speeds(board, sink, true);
}

/* Sends the periodic frames of the slots in a span (struct board_ops). */
static void motor_board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];
    unsigned slots = 0;

    /* Find the slots in this tick: several, one or none */
    for (int64_t ms = span.from; ms < span.to && ms < span.from + ICUB_SLOTS; ms++) {
        slots |= 1u << ms % ICUB_SLOTS;
    }

    if (slots & 1u << 0) {
        motor_board_send_if_wanted(board, sink, ICUB_POSITION, motor_axis_position(a),
                                   motor_axis_position(b), 0, 0);
    }
    if (slots & 1u << 1) {
        motor_board_send_if_wanted(board, sink, ICUB_PID_VALUE, a->output, b->output, a->pwm,
                                   b->pwm);
    }
    if (slots & 1u << 2) {
        motor_board_transmit_status(board, sink, span.to);
    }
    if (slots & 1u << 3) {
        motor_board_transmit_slot_3(board, sink);
    }
}

/* Obeys each command of class 0 on a motor board. */

enum { CALIBRATION_MS = 100 }; /* duration of CALIBRATE_ENCODER */

/* Returns a position within the limits, ticks. */
static int64_t motor_axis_clamp_position(const struct motor_axis *axis, int64_t position)
{
    const int64_t *p = axis->parameter;

    return position < p[ICUB_P_MIN_POSITION]   ? p[ICUB_P_MIN_POSITION]
           : position > p[ICUB_P_MAX_POSITION] ? p[ICUB_P_MAX_POSITION]
                                               : position;
}

/* Answers a query about the state of an axis. Returns false for any other command. */
static bool motor_axis_answer(const struct board *board, const struct motor_axis *axis,
                              unsigned code, int64_t *reply)
{
    const int64_t *p = axis->parameter;

    switch (code) {
    /* Mode and motion */
    case ICUB_GET_CONTROL_MODE:
        reply[0] = axis->base.mode;
        return true;
    case ICUB_MOTION_DONE:
        reply[0] = !axis->trajectory.running && axis->base.mode != ICUB_MODE_CALIBRATION;
        return true;
    case ICUB_GET_ENCODER_POSITION:
        reply[0] = motor_axis_position(axis);
        reply[1] = estimator_speed(&axis->joint, p[ICUB_P_JOINT_SPEED_SHIFT]);
        return true;
    case ICUB_GET_ENCODER_VELOCITY:
        reply[0] = estimator_speed(&axis->joint, p[ICUB_P_JOINT_SPEED_SHIFT]);
        return true;

    /* The control law */
    case ICUB_GET_PID_ERROR:
        reply[0] = axis->position_pid.error;
        return true;
    case ICUB_GET_PID_OUTPUT:
        reply[0] = axis->output;
        return true;
    case ICUB_GET_POSITION_REFERENCE:
        reply[0] = axis->desired;
        return true;
    case ICUB_GET_VELOCITY_REFERENCE:
        reply[0] = axis->desired_velocity;
        return true;

    /* The board */
    case ICUB_GET_ERROR_STATUS:
        reply[0] = axis->faults | axis->faults_once;
        return true;
    case ICUB_GET_BOARD_ID:
        reply[0] = board->address;
        return true;
    default:
        return false;
    }
}

/* Obeys a command to an axis. Returns false for any other command, or if it refuses the command. */
static bool motor_axis_act(struct board *board, struct motor_axis *axis, unsigned code,
                           const int64_t *request)
{
    int64_t change;

    switch (code) {
    /* Mode and calibration */
    case ICUB_CALIBRATE_ENCODER:
        /* Refuse any type but the absolute encoder */
        if (request[0] != ICUB_CALIBRATE_ABSOLUTE) {
            return false;
        }
        if (request[2] == 0) {
            motor_board_print(board, "invalid calib p2");
            motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
        } else if (axis->base.mode != ICUB_MODE_HARDWARE_FAULT &&
                   motor_axis_is_owed_nothing(board, axis, true)) {
            motor_axis_set_mode(board, axis, ICUB_MODE_CALIBRATION);
            axis->calibration_zero = (int32_t)request[3];
            axis->calibrated_ns = board->boards->now_ns + (int64_t)CALIBRATION_MS * MS;
        }
        return true;

    case ICUB_SET_CONTROL_MODE:
        return motor_axis_command_mode(board, axis, request[0]);

    /* Contents of the flash */
    case ICUB_WRITE_FLASH:
        memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        return true;
    case ICUB_READ_FLASH:
        memcpy(axis->parameter, axis->saved, sizeof axis->saved);
        board->boards->settings_changes++;
        return true;

    /* References */
    case ICUB_POSITION_MOVE: /* only in modes with a trajectory generator */
        if (motor_axis_moves(axis)) {
            int64_t target = motor_axis_clamp_position(axis, request[0]);

            axis->parameter[ICUB_P_DESIRED_POSITION] = target;
            axis->trajectory.position = axis->desired;
            trajectory_start(&axis->trajectory, (int32_t)target, request[1]);
        }
        return true;
    case ICUB_VELOCITY_MOVE:
        if (motor_axis_has_velocity(axis)) {
            axis->parameter[ICUB_P_DESIRED_VELOCITY] = request[0];
            axis->parameter[ICUB_P_DESIRED_ACCELERATION] = request[1];
            axis->velocity_ns = board->boards->now_ns;
        }
        return true;
    case ICUB_SET_ENCODER_POSITION: /* references move with the position */
        change = request[0] - motor_axis_position(axis);
        axis->offset = (int32_t)control_clamp(axis->offset + change, INT32_MIN, INT32_MAX);
        axis->desired = (int32_t)control_clamp(axis->desired + change, INT32_MIN, INT32_MAX);
        axis->parameter[ICUB_P_DESIRED_POSITION] = axis->desired;
        trajectory_stop(&axis->trajectory, axis->desired);
        return true;
    case ICUB_SET_DESIRED_TORQUE:
        axis->parameter[ICUB_P_DESIRED_TORQUE] = control_clamp(request[0], INT16_MIN, INT16_MAX);
        axis->torque_ns = board->boards->now_ns;
        return true;
    case ICUB_STOP_TRAJECTORY:
        if (motor_axis_moves(axis) || motor_axis_has_velocity(axis)) {
            axis->parameter[ICUB_P_DESIRED_VELOCITY] = 0;
            axis->desired_velocity = axis->velocity_rest = 0;
            motor_axis_hold_position(axis);
        }
        return true;
    case ICUB_SET_COMMAND_POSITION:
        if (axis->base.mode == ICUB_MODE_DIRECT) {
            axis->desired = (int32_t)motor_axis_clamp_position(axis, request[0]);
        }
        return true;
    case ICUB_TOGGLE_VERBOSE: /* accepted without effect: there is no serial port */
        return true;
    default:
        return false;
    }
}

/* Obeys a command to the whole board. Ignores the axis bit. Returns false for any other command. */
static bool motor_board_obey(struct motor_board *motor, const struct bus_frame *frame,
                             unsigned code, const int64_t *request, int64_t *reply, bool *answer)
{
    struct icub_board *icub = &motor->icub;
    struct board *board = &icub->board;

    switch (code) {
    case ICUB_GET_INFO:
        icub_board_queue_info(icub, icub_id(ICUB_POLLING_MOTOR, board->address, frame->id >> 4));
        *answer = false;
        return true;
    case ICUB_SET_INFO:
        icub_board_set_info(icub, request);
        return true;
    case ICUB_SET_BOARD_ID:
        return board_set_address(board, (uint8_t)request[0]);
    case ICUB_SET_BROADCAST_POLICY:
        motor->policy = (uint32_t)request[0];
        return true;
    case ICUB_GET_FIRMWARE_VERSION:
        motor->protocol_ack =
            request[0] == ICUB_PROTOCOL_MAJOR && request[1] <= ICUB_PROTOCOL_MINOR;
        icub_board_report_firmware(board, ICUB_PROTOCOL_MAJOR, ICUB_PROTOCOL_MINOR,
                                   motor->protocol_ack, reply);
        return true;
    default:
        return false;
    }
}

/* Obeys a command (struct icub_board_ops). */
static bool motor_board_command(struct icub_board *icub, const struct bus_frame *frame,
                                const int64_t *request, int64_t *reply, bool *answer)
{
    struct board *board = &icub->board;
    struct motor_board *motor = motor_board_of(board);
    unsigned code = frame->data[0] & ~(unsigned)ICUB_AXIS_BIT;
    struct motor_axis *axis = &motor->axis[frame->data[0] & ICUB_AXIS_BIT ? 1 : 0];
    const struct icub_command *row = &icub_motor_commands[code];
    int64_t *parameter = &axis->parameter[row->parameter];

    switch (row->kind) {
    case ICUB_SET:
        memcpy(parameter, request, fields_count(row->request) * sizeof *parameter);
        board->boards->settings_changes += row->parameter < ICUB_P_SAVED;
        if (row->parameter <= ICUB_P_POSITION_INTEGRAL_LIMIT) {
            unsigned bits = (1u << fields_count(row->request)) - 1;

            axis->pids |= (uint8_t)(bits << row->parameter & PID_HAS_ALL);
        }
        if (code == ICUB_SET_OPEN_LOOP) {
            axis->voltage_ns = board->boards->now_ns;
        } else if (code == ICUB_SET_I_GAIN) {
            axis->position_pid.integral = 0;
        } else if (code == ICUB_SET_TORQUE_SOURCE) {
            axis->source_ns = board->boards->now_ns;
        } else if (code == ICUB_SET_INTERACTION_MODE) {
            motor->additional_due = true;
        }
        return true;
    case ICUB_GET:
        memcpy(reply, parameter, fields_count(row->reply) * sizeof *parameter);
        return true;
    case ICUB_DO:
    case ICUB_NO_COMMAND:
        break;
    }
    return motor_board_obey(motor, frame, code, request, reply, answer) ||
           motor_axis_answer(board, axis, code, reply) ||
           motor_axis_act(board, axis, code, request);
}

/*
 * A motor board (BLL): two axes on one address. It obeys the commands of class 0 and the rules of
 * the control modes. It checks faults and time-outs, runs its control laws every millisecond, and
 * sends the frames of class 1 in their slots.
 *
 * Units are the protocol's: encoder ticks, PWM counts (+-1333 = +-100 % of the supply), mA, torque
 * in counts of the torque source (0x8000 = its full scale). Bridges are on in every running mode
 * except calibration. They are off in idle and after a fault.
 *
 * Once a millisecond, the law of the mode computes the PWM from the reference:
 *
 *   voltage (open loop): PWM = reference
 *   current: PID (SET_CURRENT_PID) on mA; the reference is SET_DESIRED_TORQUE, in mA
 *   torque: PID (SET_TORQUE_PID) + offset on torque counts
 *   position: PID (SET_POSITION_PID) + offset on ticks, + stiction during a move. The trajectory
 *     generator (POSITION_MOVE) moves the reference. In velocity mode the velocity reference moves
 *     it, in mixed mode both do. In direct mode the reference jumps
 *   impedance (two modes, and all position modes with interaction mode compliant): torque reference
 *     = stiffness * error + damping * change of error + offset, then the torque law
 *
 * Each PID is limited to its own limit. The PWM is limited to the PWM limit and the full scale.
 * Gains are zero at power-up, so an axis exerts no force until the host has configured it.
 *
 * Calibration follows the firmware whose version the board reports. Type 3 (absolute encoder) uses
 * the parameter p3 as the zero of the encoder. The value 0 of p2 is invalid and causes a fault.
 *
 * A strict board follows the firmware exactly, even where the firmware is odd. An axis leaves idle,
 * also for calibration, only if a host has stated a compatible protocol (GET_FIRMWARE_VERSION) and
 * set all seven parameters of the position PID. With require_calibration, every mode except
 * calibration also requires a calibrated axis. Otherwise the axis enters hardware fault, and a
 * PRINT gives the reason. A strict board has no current mode; an unknown mode causes a fault.
 * Commanding the present mode keeps the references. PRINT reports every change of mode.
 *
 * A winding above the limit of SET_TEMPERATURE_LIMIT (0 = none) puts its axis into hardware fault.
 * Byte 5 of STATUS reports it while the winding is too hot; the fault byte has no bit for it. A
 * thermometer without a valid reading is reported in the same byte and stops no axis.
 *
 * STATUS bytes 4, 6 and 7 report the CAN controller. Byte 4 has the present states; it reports
 * bus-off and overflow once. Bytes 6 and 7 have the change of each error counter since the last
 * STATUS, because hosts add the changes.
 *
 * Over-current follows the firmware's I2t law. The axis trips when the integral of (I^2 - limit^2)
 * over time exceeds limit^2 * 10 ms. At twice the limit this takes 4 ms. At 3.4 times the limit one
 * sample is enough. The inrush current of a voltage step lasts a few milliseconds and does not trip
 * the axis.
 */

enum { POLICY_AT_START = 0x7f }; /* selects the frames that hosts usually request */

void motor_board_print(struct board *board, const char *text)
{
    struct motor_board *motor = motor_board_of(board);
    size_t left = strlen(text);
    uint32_t id = icub_id(ICUB_PERIODIC_MOTOR, board->address, ICUB_PRINT);

    if (!(motor->policy >> (ICUB_PRINT - 1) & 1)) {
        return;
    }
    for (uint8_t part = 0; left > 0; part++) {
        uint8_t data[8] = {ICUB_PRINT, (uint8_t)(motor->text << 4 | part)};
        size_t size = left < 6 ? left : 6;

        memcpy(data + 2, text, size);
        text += size;
        left -= size;
        data[0] |= left ? 0 : 0x80;
        board_queue(board, id, (uint8_t)(2 + size), data);
    }
    motor->text = (motor->text + 1) % ICUB_PRINT_TEXTS;
}

/* ---- power-up ---- */

/* Resets board and axes (struct board_ops). */
static void motor_board_power_up(struct board *board)
{
    struct motor_board *motor = motor_board_of(board);

    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        /* Fill the parameters of an axis at power-up. Gains are 0; the rig gives the limits. */
        const struct board_axis_config *config = &board->config.axis[i];
        int64_t *p = axis->parameter;
        int32_t limit = 0;

        memset(p, 0, sizeof axis->parameter);
        p[ICUB_P_POSITION_LIMIT] = p[ICUB_P_TORQUE_LIMIT] = ICUB_PWM_FULL_SCALE;
        p[ICUB_P_POSITION_INTEGRAL_LIMIT] = p[ICUB_P_TORQUE_INTEGRAL_LIMIT] = INT16_MAX;
        p[ICUB_P_PWM_LIMIT] = ICUB_PWM_FULL_SCALE;
        p[ICUB_P_MAX_VELOCITY] = INT16_MAX;
        p[ICUB_P_VELOCITY_SHIFT] = 4;
        p[ICUB_P_VELOCITY_TIMEOUT] = 2000;
        p[ICUB_P_JOINT_SPEED_SHIFT] = p[ICUB_P_JOINT_ACCELERATION_SHIFT] = 5;
        p[ICUB_P_MOTOR_SPEED_SHIFT] = p[ICUB_P_MOTOR_ACCELERATION_SHIFT] = 5;
        if (config->joint >= 0) {
            /* Round the limits of the rig outward to ticks */
            control_quantize(floor(config->lower_rad * config->joint_ticks_per_rad), &limit);
            p[ICUB_P_MIN_POSITION] = limit;
            control_quantize(ceil(config->upper_rad * config->joint_ticks_per_rad), &limit);
            p[ICUB_P_MAX_POSITION] = limit;
            control_quantize(config->current_limit_a * 1e3, &limit);
            p[ICUB_P_CURRENT_LIMIT] = limit;
            control_quantize(config->temperature_limit_c / ICUB_TEMPERATURE_C, &limit);
            p[ICUB_P_TEMPERATURE_LIMIT] = control_clamp(limit, 0, INT16_MAX);
        }

        if (!motor->powered) {
            memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        }
        axis->base.mode = ICUB_MODE_IDLE;
        axis->faults = axis->faults_once = axis->heat = 0;
        axis->pids = 0;
        axis->calibrated = false;
        axis->offset = 0;
        axis->source_ns = board->boards->now_ns;
        motor_axis_reset_references(board, axis);
    }
    motor->powered = true;
    motor->text = 0;
    motor->protocol_ack = false;
    motor->policy = board->config.transmit_at_start ? POLICY_AT_START : 0;
    motor->status_due = motor->additional_due = false;
    motor->status_ms = board->boards->now_ns / MS;
    motor->can = motor->can_reported = 0;
    motor->reported_tec = motor->reported_rec = 0;
}

/* ---- sensors ---- */

/* Samples both axes (struct board_ops). Pushes one sample per millisecond into the speed
 * estimators. */
static void motor_board_sample(struct board *board, const struct plant_sensors *sensors)
{
    (void)sensors;
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor_board_of(board)->axis[i];
        double temperature = axis->base.winding_c / ICUB_TEMPERATURE_C;

        axis->thermometer_bad = !control_quantize(temperature, &axis->temperature);
        /* Start the speed estimators and the position reference at the first sample after
         * power-up */
        if (axis->base.first) {
            estimator_reset(&axis->joint, axis->base.link_ticks);
            estimator_reset(&axis->motor, axis->base.motor_ticks);
            motor_axis_hold_position(axis);
        }
        /* A tick of several milliseconds has one sample: use it for each millisecond */
        for (int64_t ms = 0; ms < axis->base.passed_ms; ms++) {
            estimator_push(&axis->joint, axis->base.link_ticks);
            estimator_push(&axis->motor, axis->base.motor_ticks);
        }
    }
}

/* ---- the tick ---- */

/* Runs one tick: faults and time-outs, laws, bridges (struct board_ops). */
static void motor_board_control(struct board *board, struct ms_span span)
{
    motor_board_watch(board);
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor_board_of(board)->axis[i];

        for (int64_t ms = span.from; ms < span.to; ms++) {
            motor_axis_step(board, axis);
        }
        if (!axis->base.law.on) {
            axis->base.voltage_v = (double)axis->pwm / ICUB_PWM_FULL_SCALE * axis->base.supply_v;
        }
    }
}

/* Switches all axes off (struct board_ops). */
static void motor_board_shut_down(struct board *board)
{
    for (int i = 0; i < MOTOR_AXES; i++) {
        if (motor_runs(motor_board_of(board)->axis[i].base.mode)) {
            motor_axis_set_mode(board, &motor_board_of(board)->axis[i], ICUB_MODE_IDLE);
        }
    }
}

/* Stops motors and telemetry on discovery if the rig sets discovery_stops_motors (struct
 * icub_board_ops). */
static void motor_board_discovered(struct icub_board *icub)
{
    struct board *board = &icub->board;

    if (board->config.discovery_stops_motors) {
        motor_board_shut_down(board);
        motor_board_of(board)->policy = 0;
    }
}

const struct icub_board_ops motor_icub_ops = {
    .base =
        {
            .size = sizeof(struct motor_board),
            .identity = {.type = ICUB_BOARD_BLL, .major = 2, .minor = 0x51, .build = 87},
            .periodic_max = 11,
            .power_up = motor_board_power_up,
            .sample = motor_board_sample,
            .control = motor_board_control,
            .transmit = motor_board_transmit,
            .shut_down = motor_board_shut_down,
            .axes = offsetof(struct motor_board, axis),
            .axis_size = sizeof(struct motor_axis),
            .settings = &motor_settings,
        },
    .commands = icub_motor_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .axis_bit = true,
    .loader_type = ICUB_BOARD_DSP,
    .command = motor_board_command,
    .discovered = motor_board_discovered,
};
