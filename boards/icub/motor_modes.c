/* SPDX-License-Identifier: Apache-2.0 */
/* The control modes of a motor board: how an axis enters each, leniently or strictly. */
#include "boards/icub/motor_private.h"

#include <stdio.h>

void motor_axis_hold_position(struct motor_axis *axis)
{
    axis->desired = motor_axis_position(axis);
    axis->parameter[ICUB_P_DESIRED_POSITION] = axis->desired;
    trajectory_stop(&axis->trajectory, axis->desired);
}

void motor_axis_reset_references(struct board *board, struct motor_axis *axis)
{
    int64_t now = board->boards->now_ns;

    motor_axis_hold_position(axis);
    axis->desired_velocity = axis->velocity_rest = 0;
    pid_reset(&axis->position_pid);
    pid_reset(&axis->torque_pid);
    pid_reset(&axis->current_pid);
    pid_reset(&axis->impedance);
    axis->parameter[ICUB_P_DESIRED_VELOCITY] = 0;
    axis->parameter[ICUB_P_DESIRED_TORQUE] = 0;
    axis->parameter[ICUB_P_OPEN_LOOP] = 0;
    axis->torque_reference = axis->output = axis->pwm = 0;
    axis->voltage_ns = axis->torque_ns = axis->velocity_ns = now;
    axis->limit_reported = false;
}

void motor_axis_set_mode(struct board *board, struct motor_axis *axis, uint8_t mode)
{
    if (mode != axis->mode) {
        board_event(board, BOARD_EVENT_MODE, motor_axis_index(board, axis), axis->mode, mode);
        axis->mode = mode;
        motor_board_of(board)->status_due = true;
    }
    motor_axis_reset_references(board, axis);
}

/* Returns whether a mode drives the motor. */
static bool motor_is_control_mode(int64_t mode)
{
    switch (mode) {
    case ICUB_MODE_POSITION:
    case ICUB_MODE_VELOCITY:
    case ICUB_MODE_TORQUE:
    case ICUB_MODE_IMPEDANCE_POSITION:
    case ICUB_MODE_IMPEDANCE_VELOCITY:
    case ICUB_MODE_CURRENT:
    case ICUB_MODE_MIXED:
    case ICUB_MODE_DIRECT:
    case ICUB_MODE_OPEN_LOOP:
        return true;
    default:
        return false;
    }
}

/* Writes a text and a number to the host's log. */
static void motor_board_print_number(struct board *board, const char *text, unsigned number)
{
    char line[32];

    snprintf(line, sizeof line, "%s%u", text, number);
    motor_board_print(board, line);
}

/* Switches the mode of a strict axis; the present one again changes nothing, its references
 * neither. */
static void motor_axis_switch_strictly(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool known = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_HARDWARE_FAULT ||
                 (motor_is_control_mode(mode) && mode != ICUB_MODE_CURRENT);

    if (mode == axis->mode) {
        return;
    }
    motor_board_print_number(board,
                             "CMODE SET:", known ? (unsigned)mode : (unsigned)ICUB_MODE_UNKNOWN);
    if (!known) {
        motor_board_print(board, "UNKNOWN CONTROLMODE PID");
    }
    motor_axis_set_mode(board, axis, known ? (uint8_t)mode : ICUB_MODE_HARDWARE_FAULT);
}

bool motor_axis_is_owed_nothing(struct board *board, struct motor_axis *axis, bool calibrated)
{
    unsigned index = motor_axis_index(board, axis);
    enum board_owed owed;

    if (!board->config.strict) {
        return true;
    }
    if (!motor_board_of(board)->protocol_ack) {
        motor_board_print(board, "can protocol NOT ack");
        owed = BOARD_OWED_PROTOCOL;
    } else if (axis->pids != PID_HAS_ALL) {
        motor_board_print_number(board, "PID IS NOT SET ", index);
        owed = BOARD_OWED_PID;
    } else if (board->config.require_calibration && !calibrated) {
        motor_board_print_number(board, "calib failed ", index);
        owed = BOARD_OWED_CALIBRATION;
    } else {
        return true;
    }
    board_event(board, BOARD_EVENT_OWED, index, owed, 0);
    motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    return false;
}

/* Obeys SET_CONTROL_MODE as the firmware does, oddities included (motor_board.c). */
static void motor_axis_command_mode_strictly(struct board *board, struct motor_axis *axis,
                                             int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    if (axis->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode == ICUB_MODE_FORCE_IDLE) {
            motor_axis_switch_strictly(board, axis, ICUB_MODE_IDLE);
        }
    } else if (axis->mode == ICUB_MODE_IDLE) {
        if (!stop && motor_axis_is_owed_nothing(board, axis, axis->calibrated)) {
            motor_axis_switch_strictly(board, axis, mode);
            motor_board_print_number(board, "PWM ENA:", motor_axis_index(board, axis));
        }
    } else if (stop) {
        motor_board_print_number(board, "PWM DIS:", motor_axis_index(board, axis));
        motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
    } else {
        motor_axis_switch_strictly(board, axis, mode);
    }
}

bool motor_axis_command_mode(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    if (board->config.strict) {
        motor_axis_command_mode_strictly(board, axis, mode);
        return true;
    }
    if (!stop && (!motor_is_control_mode(mode) ||
                  (mode == ICUB_MODE_CURRENT && motor_axis_config(board, axis)->valve))) {
        return false;
    }
    /* From idle into a mode; out of a fault by FORCE_IDLE only; else from mode to mode */
    if (axis->mode == ICUB_MODE_IDLE) {
        if (!stop) {
            motor_axis_set_mode(board, axis, (uint8_t)mode);
        }
    } else if (axis->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode == ICUB_MODE_FORCE_IDLE) {
            motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
        }
    } else {
        motor_axis_set_mode(board, axis, stop ? ICUB_MODE_IDLE : (uint8_t)mode);
    }
    return true;
}

bool motor_axis_moves(const struct motor_axis *axis)
{
    return axis->mode == ICUB_MODE_POSITION || axis->mode == ICUB_MODE_IMPEDANCE_POSITION ||
           axis->mode == ICUB_MODE_MIXED;
}

bool motor_axis_has_velocity(const struct motor_axis *axis)
{
    return axis->mode == ICUB_MODE_VELOCITY || axis->mode == ICUB_MODE_IMPEDANCE_VELOCITY ||
           axis->mode == ICUB_MODE_MIXED;
}

bool motor_axis_is_impedance(const struct motor_axis *axis)
{
    if (axis->mode == ICUB_MODE_IMPEDANCE_POSITION || axis->mode == ICUB_MODE_IMPEDANCE_VELOCITY) {
        return true;
    }
    return axis->parameter[ICUB_P_INTERACTION] == ICUB_COMPLIANT &&
           (motor_axis_moves(axis) || motor_axis_has_velocity(axis) ||
            axis->mode == ICUB_MODE_DIRECT);
}
