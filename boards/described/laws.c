/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The laws of a described axis, a step a millisecond: from voltage at the bottom to impedance and
 * position at the top, each made of the one below it.
 *
 *   position   v* = position_per_s (p* - p) + velocity target
 *   velocity   torque* = velocity_nm_s_rad (v* - v) + integral + torque target
 *   impedance  torque* = kp (p* - p) + kd (v* - v) + torque target
 *   torque     current* = torque* / torque constant
 *   current    PI loop with the back-EMF (boards/motor_control.h), within the current limit
 *
 * A servo valve is a source of speed: velocity* times its constant is the voltage.
 */
#include "boards/described/private.h"

#include <math.h>

/* Returns a target of an axis. */
static double axis_target(const struct described_axis *axis, enum described_meaning meaning)
{
    return axis->target[meaning - DESCRIBED_SET_POINT];
}

/* Returns the voltage of the current loop, its target within the current limit. */
static double axis_current_law(const struct board *board, struct described_axis *axis,
                               double wanted_a)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];
    double limit =
        fmin(config->current_limit_a, described_axis_setting(axis, DESCRIBED_CURRENT_LIMIT));

    wanted_a = fmax(fmin(wanted_a, limit), -limit);
    axis->wanted_a = wanted_a;
    return current_loop_step(&axis->integral_v, axis->kp_v_a, axis->ki_v_as,
                             wanted_a - axis->current_a, described_node_of(board)->supply_v) +
           config->bemf_v_s_rad * axis->velocity_rad_s;
}

/* Returns the voltage of the current loop for a torque. */
static double axis_torque_law(const struct board *board, struct described_axis *axis,
                              double torque_nm)
{
    double constant = board->config.axis[described_axis_index(board, axis)].torque_nm_a;

    return axis_current_law(board, axis, constant > 0.0 ? torque_nm / constant : 0.0);
}

/* Returns the torque that the drive gives at its current limit. */
static double axis_torque_most(const struct board *board, const struct described_axis *axis)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];

    return config->torque_nm_a * config->current_limit_a;
}

/* Returns the voltage of the velocity loop; that of a valve is proportional to the speed. */
static double axis_velocity_law(const struct board *board, struct described_axis *axis,
                                double wanted_rad_s)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];
    double limit = described_axis_setting(axis, DESCRIBED_VELOCITY_LIMIT);
    double most = axis_torque_most(board, axis), error;

    wanted_rad_s = fmax(fmin(wanted_rad_s, limit), -limit);
    error = wanted_rad_s - axis->velocity_rad_s;

    if (config->valve) {
        return config->bemf_v_s_rad * wanted_rad_s;
    }
    axis->integral_nm += described_axis_setting(axis, DESCRIBED_INTEGRAL_GAIN) * error * 1e-3;
    axis->integral_nm = fmax(fmin(axis->integral_nm, most), -most);
    return axis_torque_law(board, axis,
                           described_axis_setting(axis, DESCRIBED_VELOCITY_GAIN) * error +
                               axis->integral_nm + axis_target(axis, DESCRIBED_TO_TORQUE));
}

/* Returns the distance from the motor to the wanted position, which is kept within the joint's
 * limits. */
static double axis_position_error(const struct board *board, const struct described_axis *axis)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];
    double wanted = axis_target(axis, DESCRIBED_TO_POSITION) + axis->zero_rad;

    return fmax(fmin(wanted, config->upper_rad), config->lower_rad) - axis->motor_rad;
}

/* Returns the voltage of a law. */
static double axis_law_voltage(const struct board *board, struct described_axis *axis,
                               enum described_law law)
{
    switch (law) {
    case DESCRIBED_VOLTAGE:
        return axis_target(axis, DESCRIBED_TO_VOLTAGE) +
               axis_target(axis, DESCRIBED_TO_DUTY) * described_node_of(board)->supply_v;
    case DESCRIBED_CURRENT:
        return axis_current_law(board, axis, axis_target(axis, DESCRIBED_TO_CURRENT));
    case DESCRIBED_TORQUE:
        return axis_torque_law(board, axis, axis_target(axis, DESCRIBED_TO_TORQUE));
    case DESCRIBED_VELOCITY:
        return axis_velocity_law(board, axis, axis_target(axis, DESCRIBED_TO_VELOCITY));
    case DESCRIBED_POSITION:
        return axis_velocity_law(board, axis,
                                 described_axis_setting(axis, DESCRIBED_POSITION_GAIN) *
                                         axis_position_error(board, axis) +
                                     axis_target(axis, DESCRIBED_TO_VELOCITY));
    case DESCRIBED_IMPEDANCE:
        return axis_torque_law(
            board, axis,
            axis_target(axis, DESCRIBED_TO_KP) * axis_position_error(board, axis) +
                axis_target(axis, DESCRIBED_TO_KD) *
                    (axis_target(axis, DESCRIBED_TO_VELOCITY) - axis->velocity_rad_s) +
                axis_target(axis, DESCRIBED_TO_TORQUE));
    default:
        return 0.0;
    }
}

void described_axis_step(const struct board *board, struct described_axis *axis)
{
    const struct described_node *node = described_node_of(board);
    double v;

    axis->wanted_a = 0.0;
    v = axis_law_voltage(board, axis, described_axis_law(node->protocol, axis));

    axis->voltage_v = fmax(fmin(v, node->supply_v), -node->supply_v);
}
