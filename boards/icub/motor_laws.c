/* SPDX-License-Identifier: Apache-2.0 */
/* The control laws of a motor board, from references to PWM (boards/icub/motor_board.c says
 * which). */
#include "boards/icub/motor_private.h"

/* Returns a PWM value within a limit and the full scale. */
static int64_t pwm_clamp(int64_t value, int64_t limit)
{
    int64_t most = control_clamp(limit, 0, ICUB_PWM_FULL_SCALE);

    return control_clamp(value, -most, most);
}

/* Returns by how many ticks the velocity reference moves in this millisecond. */
static int64_t motor_axis_velocity_step(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    int64_t most = p[ICUB_P_MAX_VELOCITY] > 0 ? p[ICUB_P_MAX_VELOCITY] : 0;
    int64_t acceleration = p[ICUB_P_DESIRED_ACCELERATION];
    int64_t target = control_clamp(p[ICUB_P_DESIRED_VELOCITY], -most, most);
    int64_t change = target - axis->desired_velocity;
    int64_t step;

    if (acceleration > 0) {
        change = control_clamp(change, -acceleration, acceleration);
    }
    axis->desired_velocity += change;
    axis->velocity_rest += axis->desired_velocity;
    step = control_shift_right(axis->velocity_rest, p[ICUB_P_VELOCITY_SHIFT]);
    axis->velocity_rest -= step * (INT64_C(1) << p[ICUB_P_VELOCITY_SHIFT]);
    return step;
}

/* Advances the position reference; it never moves (further) out of the limits. */
static void motor_axis_advance_reference(struct motor_axis *axis)
{
    int64_t *p = axis->parameter;
    int64_t step = motor_axis_moves(axis) ? trajectory_step(&axis->trajectory) : 0;
    int64_t desired;

    if (motor_axis_has_velocity(axis)) {
        step += motor_axis_velocity_step(axis);
    }
    desired = axis->desired + step;
    if (step > 0 && desired > p[ICUB_P_MAX_POSITION]) {
        desired = axis->desired > p[ICUB_P_MAX_POSITION] ? axis->desired : p[ICUB_P_MAX_POSITION];
        p[ICUB_P_DESIRED_VELOCITY] = 0;
    } else if (step < 0 && desired < p[ICUB_P_MIN_POSITION]) {
        desired = axis->desired < p[ICUB_P_MIN_POSITION] ? axis->desired : p[ICUB_P_MIN_POSITION];
        p[ICUB_P_DESIRED_VELOCITY] = 0;
    }
    axis->desired = (int32_t)control_clamp(desired, INT32_MIN, INT32_MAX);
}

/* Returns the PWM of the position PID with offset and, during a move, stiction. */
static int64_t motor_axis_position_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_POSITION_KP], p[ICUB_P_POSITION_KI],
                                    p[ICUB_P_POSITION_KD], p[ICUB_P_POSITION_SHIFT],
                                    p[ICUB_P_POSITION_INTEGRAL_LIMIT]};
    int64_t pwm =
        pid_step(&axis->position_pid, &gains, (int64_t)axis->desired - motor_axis_position(axis));

    pwm += p[ICUB_P_POSITION_OFFSET];
    if (axis->trajectory.running && axis->trajectory.target != axis->trajectory.start) {
        pwm += axis->trajectory.target > axis->trajectory.start ? p[ICUB_P_POSITION_STICTION_UP]
                                                                : p[ICUB_P_POSITION_STICTION_DOWN];
    }
    return pwm_clamp(pwm, p[ICUB_P_POSITION_LIMIT]);
}

/* Returns the PWM of the torque PID with offset. */
static int64_t motor_axis_torque_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_TORQUE_KP], p[ICUB_P_TORQUE_KI], p[ICUB_P_TORQUE_KD],
                                    p[ICUB_P_TORQUE_SHIFT], p[ICUB_P_TORQUE_INTEGRAL_LIMIT]};
    int64_t pwm = pid_step(&axis->torque_pid, &gains, axis->torque_reference - axis->torque);

    return pwm_clamp(pwm + p[ICUB_P_TORQUE_OFFSET], p[ICUB_P_TORQUE_LIMIT]);
}

/* Returns the PWM of the current PID. */
static int64_t motor_axis_current_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_CURRENT_KP], p[ICUB_P_CURRENT_KI],
                                    p[ICUB_P_CURRENT_KD], p[ICUB_P_CURRENT_SHIFT], INT16_MAX};

    return pid_step(&axis->current_pid, &gains,
                    p[ICUB_P_DESIRED_TORQUE] - motor_axis_current_ma(axis));
}

/* Returns the PWM of the impedance: a torque reference by stiffness and damping, then the torque
 * law. */
static int64_t motor_axis_impedance_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {.kp = p[ICUB_P_STIFFNESS], .kd = p[ICUB_P_DAMPING]};

    axis->torque_reference =
        pid_step(&axis->impedance, &gains, (int64_t)axis->desired - motor_axis_position(axis)) +
        p[ICUB_P_IMPEDANCE_OFFSET];
    return motor_axis_torque_law(axis);
}

/* Returns the torque, in counts, of the axis's source: a STRAIN board on the bus or its own
 * sensor. */
static int64_t motor_axis_measured_torque(const struct board *board, const struct motor_axis *axis)
{
    const struct board_axis_config *config = motor_axis_config(board, axis);
    int64_t address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    int32_t counts = 0;

    if (address != 0) {
        return icub_bus_of(board->bus)
            ->source[address]
            .value[axis->parameter[ICUB_P_TORQUE_CHANNEL]];
    }
    if (config->torque_full_scale_nm > 0.0) {
        control_quantize(axis->torque_nm / config->torque_full_scale_nm * ICUB_STRAIN_ZERO,
                         &counts);
    }
    return control_clamp(counts, INT16_MIN, INT16_MAX);
}

/* Runs one millisecond: torque feedback, then the law of the mode, then the limits of the PWM. */
void motor_axis_step(const struct board *board, struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;

    axis->torque = motor_axis_measured_torque(board, axis);

    /* The law of the mode */
    switch (axis->mode) {
    case ICUB_MODE_OPEN_LOOP:
        axis->output = p[ICUB_P_OPEN_LOOP];
        break;
    case ICUB_MODE_CURRENT:
        axis->output = motor_axis_current_law(axis);
        break;
    case ICUB_MODE_TORQUE:
        axis->torque_reference = p[ICUB_P_DESIRED_TORQUE];
        axis->output = motor_axis_torque_law(axis);
        break;
    case ICUB_MODE_IDLE:
    case ICUB_MODE_HARDWARE_FAULT:
    case ICUB_MODE_CALIBRATION:
        axis->output = 0;
        break;
    default: /* the position-like modes */
        motor_axis_advance_reference(axis);
        axis->output = motor_axis_is_impedance(axis) ? motor_axis_impedance_law(axis)
                                                     : motor_axis_position_law(axis);
        break;
    }

    /* What the bridge can do, then what the host allows */
    axis->output = pwm_clamp(axis->output, ICUB_PWM_FULL_SCALE);
    axis->pwm = pwm_clamp(axis->output, p[ICUB_P_PWM_LIMIT]);
}
