/* SPDX-License-Identifier: Apache-2.0 */
/* The control modes of a motor board: how an axis comes into each, gently or strictly. */
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

/* Enables the drivers of the bridge as a strict board does; false: it does not. */
static bool motor_axis_enable_pads(struct board *board, struct motor_axis *axis)
{
    char text[32];

    if (!motor_board_of(board)->protocol_ack) {
        motor_board_print(board, "can protocol NOT ack");
        return false;
    }
    if (axis->pids != PID_HAS_ALL) {
        snprintf(text, sizeof text, "PID IS NOT SET %u", motor_axis_index(board, axis));
        motor_board_print(board, text);
        return false;
    }
    snprintf(text, sizeof text, "PWM ENA:%u", motor_axis_index(board, axis));
    motor_board_print(board, text);
    return true;
}

static void motor_axis_disable_pads(struct board *board, struct motor_axis *axis)
{
    char text[32];

    axis->pads = false;
    snprintf(text, sizeof text, "PWM DIS:%u", motor_axis_index(board, axis));
    motor_board_print(board, text);
    motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
}

/* SET_CONTROL_MODE as the firmware obeys it, oddities included (motor_board.c). */
static bool motor_axis_command_mode_strictly(struct board *board, struct motor_axis *axis,
                                             int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;
    bool known = motor_is_control_mode(mode) && mode != ICUB_MODE_CURRENT;
    char text[32];

    if (axis->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode != ICUB_MODE_FORCE_IDLE) {
            return true;
        }
        motor_axis_disable_pads(board, axis);
    } else if (axis->mode == ICUB_MODE_IDLE) {
        if (stop) {
            return true;
        }
        axis->pads = motor_axis_enable_pads(board, axis);
        motor_axis_set_mode(board, axis,
                            known        ? (uint8_t)mode
                            : axis->pads ? ICUB_MODE_POSITION
                                         : ICUB_MODE_HARDWARE_FAULT);
    } else if (stop) {
        motor_axis_disable_pads(board, axis);
    } else {
        motor_axis_set_mode(board, axis, known ? (uint8_t)mode : axis->mode);
    }
    snprintf(text, sizeof text, "CTRLMODE SET:%u", (unsigned)mode);
    motor_board_print(board, text);
    return true;
}

bool motor_axis_command_mode(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    if (board->config.strict) {
        return motor_axis_command_mode_strictly(board, axis, mode);
    }
    if (!stop && !motor_is_control_mode(mode)) {
        return false;
    }
    axis->pads = true;
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
