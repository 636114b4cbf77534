/* SPDX-License-Identifier: Apache-2.0 */
/* Obeys each command of class 0 on a motor board. */
#include "boards/icub/motor_private.h"

#include "canbus/frame.h"

#include <string.h>

enum { CALIBRATION_MS = 100 }; /* duration of CALIBRATE_ENCODER */

/* Returns a position within the limits, ticks. */
static int64_t motor_axis_clamp_position(const struct motor_axis *axis, int64_t position)
{
    const int64_t *p = axis->parameter;

    return position < p[ICUB_P_MIN_POSITION]   ? p[ICUB_P_MIN_POSITION]
           : position > p[ICUB_P_MAX_POSITION] ? p[ICUB_P_MAX_POSITION]
                                               : position;
}

/* Starts a trajectory to a target, in modes that have a generator. */
static void motor_axis_start_move(struct motor_axis *axis, int64_t target, int64_t speed)
{
    if (!motor_axis_moves(axis)) {
        return;
    }
    target = motor_axis_clamp_position(axis, target);
    axis->parameter[ICUB_P_DESIRED_POSITION] = target;
    axis->trajectory.position = axis->desired;
    trajectory_start(&axis->trajectory, (int32_t)target, speed);
}

/* Takes a velocity reference, in modes that have one. */
static void motor_axis_start_velocity(struct board *board, struct motor_axis *axis,
                                      const int64_t *request)
{
    if (motor_axis_has_velocity(axis)) {
        axis->parameter[ICUB_P_DESIRED_VELOCITY] = request[0];
        axis->parameter[ICUB_P_DESIRED_ACCELERATION] = request[1];
        axis->velocity_ns = board->boards->now_ns;
    }
}

/* Stops the motion where the axis is. */
static void motor_axis_stop_move(struct motor_axis *axis)
{
    if (motor_axis_moves(axis) || motor_axis_has_velocity(axis)) {
        axis->parameter[ICUB_P_DESIRED_VELOCITY] = 0;
        axis->desired_velocity = axis->velocity_rest = 0;
        motor_axis_hold_position(axis);
    }
}

/* Makes the present position read value; references keep their distance to it. */
static void motor_axis_set_encoder(struct motor_axis *axis, int64_t value)
{
    int64_t change = value - motor_axis_position(axis);

    axis->offset = (int32_t)control_clamp(axis->offset + change, INT32_MIN, INT32_MAX);
    axis->desired = (int32_t)control_clamp(axis->desired + change, INT32_MIN, INT32_MAX);
    axis->parameter[ICUB_P_DESIRED_POSITION] = axis->desired;
    trajectory_stop(&axis->trajectory, axis->desired);
}

/* Obeys CALIBRATE_ENCODER. Returns false when the type is another than absolute. */
static bool motor_axis_calibrate(struct board *board, struct motor_axis *axis,
                                 const int64_t *request)
{
    if (request[0] != ICUB_CALIBRATE_ABSOLUTE) {
        return false;
    }
    if (request[2] == 0) {
        motor_board_print(board, "invalid calib p2");
        motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    } else if (axis->mode != ICUB_MODE_HARDWARE_FAULT &&
               motor_axis_is_owed_nothing(board, axis, true)) {
        motor_axis_set_mode(board, axis, ICUB_MODE_CALIBRATION);
        axis->calibration_zero = (int32_t)request[3];
        axis->calibrated_ns = board->boards->now_ns + (int64_t)CALIBRATION_MS * MS;
    }
    return true;
}

/* Returns the parameters of the position PID that a command sets, as bits of motor_axis's pids. */
static uint8_t motor_axis_pid_bits(unsigned code)
{
    switch (code) {
    case ICUB_SET_P_GAIN:
        return PID_HAS_P;
    case ICUB_SET_D_GAIN:
        return PID_HAS_D;
    case ICUB_SET_I_GAIN:
        return PID_HAS_I;
    case ICUB_SET_I_LIMIT:
        return PID_HAS_INTEGRAL_LIMIT;
    case ICUB_SET_OFFSET:
        return PID_HAS_OFFSET;
    case ICUB_SET_SCALE:
        return PID_HAS_SCALE;
    case ICUB_SET_OUTPUT_LIMIT:
        return PID_HAS_LIMIT;
    case ICUB_SET_POSITION_PID:
        return PID_HAS_P | PID_HAS_D | PID_HAS_I | PID_HAS_SCALE;
    case ICUB_SET_POSITION_PID_LIMITS:
        return PID_HAS_INTEGRAL_LIMIT | PID_HAS_OFFSET | PID_HAS_LIMIT;
    default:
        return 0;
    }
}

/* Does what follows from a parameter's new value, beyond storing it. */
static void motor_axis_parameter_changed(struct board *board, struct motor_axis *axis,
                                         unsigned code)
{
    int64_t now = board->boards->now_ns;

    axis->pids |= motor_axis_pid_bits(code);
    switch (code) {
    case ICUB_SET_OPEN_LOOP:
        axis->voltage_ns = now;
        break;
    case ICUB_SET_I_GAIN:
        axis->position_pid.integral = 0;
        break;
    case ICUB_SET_TORQUE_SOURCE:
        axis->source_ns = now;
        break;
    case ICUB_SET_INTERACTION_MODE:
        motor_board_of(board)->additional_due = true;
        break;
    default:
        break;
    }
}

/* Answers commands that ask for the state of an axis; returns false when it is not one of them. */
static bool motor_axis_answer(const struct board *board, const struct motor_axis *axis,
                              unsigned code, int64_t *reply)
{
    const int64_t *p = axis->parameter;

    switch (code) {
    /* Mode and motion */
    case ICUB_GET_CONTROL_MODE:
        reply[0] = axis->mode;
        return true;
    case ICUB_MOTION_DONE:
        reply[0] = !axis->trajectory.running && axis->mode != ICUB_MODE_CALIBRATION;
        return true;
    case ICUB_GET_ENCODER_POSITION:
        reply[0] = motor_axis_position(axis);
        reply[1] = estimator_speed(&axis->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]);
        return true;
    case ICUB_GET_ENCODER_VELOCITY:
        reply[0] = estimator_speed(&axis->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]);
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

/* Obeys commands that make an axis do something; returns false when it is not one of them, or
 * refused. */
static bool motor_axis_act(struct board *board, struct motor_axis *axis, unsigned code,
                           const int64_t *request)
{
    switch (code) {
    /* Mode and calibration */
    case ICUB_CALIBRATE_ENCODER:
        return motor_axis_calibrate(board, axis, request);
    case ICUB_SET_CONTROL_MODE:
        return motor_axis_command_mode(board, axis, request[0]);

    /* What survives a power cycle */
    case ICUB_WRITE_FLASH:
        memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        return true;
    case ICUB_READ_FLASH:
        memcpy(axis->parameter, axis->saved, sizeof axis->saved);
        board->boards->settings_changes++;
        return true;

    /* References */
    case ICUB_POSITION_MOVE:
        motor_axis_start_move(axis, request[0], request[1]);
        return true;
    case ICUB_VELOCITY_MOVE:
        motor_axis_start_velocity(board, axis, request);
        return true;
    case ICUB_SET_ENCODER_POSITION:
        motor_axis_set_encoder(axis, request[0]);
        return true;
    case ICUB_SET_DESIRED_TORQUE:
        axis->parameter[ICUB_P_DESIRED_TORQUE] = control_clamp(request[0], INT16_MIN, INT16_MAX);
        axis->torque_ns = board->boards->now_ns;
        return true;
    case ICUB_STOP_TRAJECTORY:
        motor_axis_stop_move(axis);
        return true;
    case ICUB_SET_COMMAND_POSITION:
        if (axis->mode == ICUB_MODE_DIRECT) {
            axis->desired = (int32_t)motor_axis_clamp_position(axis, request[0]);
        }
        return true;
    case ICUB_TOGGLE_VERBOSE: /* of the serial port, which is not here */
        return true;
    default:
        return false;
    }
}

/* Obeys commands that are for the board, whatever their axis bit. */
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

bool motor_board_command(struct icub_board *icub, const struct bus_frame *frame,
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
        motor_axis_parameter_changed(board, axis, code);
        board->boards->settings_changes += row->parameter < ICUB_P_SAVED;
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
