/* SPDX-License-Identifier: Apache-2.0 */
/* The control laws of a motor board, from references to PWM; boards/icub/motor_board.c lists
 * them. */
#include "boards/icub/motor_private.h"

/* Clamps a PWM value to a limit and to the full scale. */
static int64_t pwm_clamp(int64_t value, int64_t limit)
{
    int64_t most = control_clamp(limit, 0, ICUB_PWM_FULL_SCALE);

    return control_clamp(value, -most, most);
}

/* Returns the change of the position reference by the velocity reference in this millisecond,
 * ticks. */
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

/* Advances the position reference, but not beyond a limit. A reference that is already beyond may
 * only move back. */
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

/* Returns the PWM of the position law: PID plus offset, plus stiction during a move. */
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

/* Returns the PWM of the torque law: PID plus offset. */
static int64_t motor_axis_torque_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_TORQUE_KP], p[ICUB_P_TORQUE_KI], p[ICUB_P_TORQUE_KD],
                                    p[ICUB_P_TORQUE_SHIFT], p[ICUB_P_TORQUE_INTEGRAL_LIMIT]};
    int64_t pwm = pid_step(&axis->torque_pid, &gains, axis->torque_reference - axis->torque);

    return pwm_clamp(pwm + p[ICUB_P_TORQUE_OFFSET], p[ICUB_P_TORQUE_LIMIT]);
}

/* Returns the measured torque in counts, from a STRAIN board on the bus or from the axis's own
 * sensor. */
static int64_t motor_axis_measured_torque(const struct board *board, const struct motor_axis *axis)
{
    const struct board_axis_config *config = axis->base.config;
    int64_t address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    int32_t counts = 0;

    if (address != 0) {
        return icub_bus_of(board->bus)
            ->source[address]
            .value[axis->parameter[ICUB_P_TORQUE_CHANNEL]];
    }
    if (config->torque_full_scale_nm > 0.0) {
        control_quantize(axis->base.torque_nm / config->torque_full_scale_nm * ICUB_STRAIN_ZERO,
                         &counts);
    }
    return control_clamp(counts, INT16_MIN, INT16_MAX);
}

/* Returns the PWM of the present bridge voltage. */
static int64_t motor_axis_measured_pwm(const struct motor_axis *axis)
{
    const struct axis *base = &axis->base;
    int32_t pwm = 0;

    if (base->supply_v > 0.0) {
        control_quantize(base->voltage_v / base->supply_v * ICUB_PWM_FULL_SCALE, &pwm);
    }
    return pwm_clamp(pwm, ICUB_PWM_FULL_SCALE);
}

static bool motor_axis_is_impedance(const struct motor_axis *axis)
{
    if (axis->base.mode == ICUB_MODE_IMPEDANCE_POSITION ||
        axis->base.mode == ICUB_MODE_IMPEDANCE_VELOCITY) {
        return true;
    }
    return axis->parameter[ICUB_P_INTERACTION] == ICUB_COMPLIANT &&
           (motor_axis_moves(axis) || motor_axis_has_velocity(axis) ||
            axis->base.mode == ICUB_MODE_DIRECT);
}

/* Runs one millisecond: measures the torque, runs the law of the mode, limits the PWM. */
void motor_axis_step(const struct board *board, struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    struct pid_gains gains;

    axis->torque = motor_axis_measured_torque(board, axis);
    axis->base.law.on = false;

    /* The law of the mode */
    switch (axis->base.mode) {
    case ICUB_MODE_OPEN_LOOP:
        axis->output = p[ICUB_P_OPEN_LOOP];
        break;
    case ICUB_MODE_CURRENT:
        axis_follow_law(&axis->base,
                        &(struct current_law){.current_a = (double)p[ICUB_P_DESIRED_TORQUE] * 1e-3,
                                              .limit_a = (double)INFINITY});
        axis->output = axis->pwm = motor_axis_measured_pwm(axis);
        return;
    case ICUB_MODE_TORQUE:
        axis->torque_reference = p[ICUB_P_DESIRED_TORQUE];
        axis->output = motor_axis_torque_law(axis);
        break;
    case ICUB_MODE_IDLE:
    case ICUB_MODE_HARDWARE_FAULT:
    case ICUB_MODE_CALIBRATION:
        axis->output = 0;
        break;
    default: /* all position modes */
        motor_axis_advance_reference(axis);
        if (!motor_axis_is_impedance(axis)) {
            axis->output = motor_axis_position_law(axis);
            break;
        }
        /* The impedance law computes the reference of the torque law */
        gains = (struct pid_gains){.kp = p[ICUB_P_STIFFNESS], .kd = p[ICUB_P_DAMPING]};
        axis->torque_reference =
            pid_step(&axis->impedance, &gains, (int64_t)axis->desired - motor_axis_position(axis)) +
            p[ICUB_P_IMPEDANCE_OFFSET];
        axis->output = motor_axis_torque_law(axis);
        break;
    }

    /* Limit the law's output to the full scale, and the PWM to the host's limit */
    axis->output = pwm_clamp(axis->output, ICUB_PWM_FULL_SCALE);
    axis->pwm = pwm_clamp(axis->output, p[ICUB_P_PWM_LIMIT]);
}

/* Control modes of a motor board: how a lenient and a strict board change them. */

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
    if (mode != axis->base.mode) {
        board_event(board, BOARD_EVENT_MODE, motor_axis_index(board, axis), axis->base.mode, mode);
        axis->base.mode = mode;
        axis->base.on = motor_runs(mode) && mode != ICUB_MODE_CALIBRATION;
        axis->base.faulty = mode == ICUB_MODE_HARDWARE_FAULT;
        motor_board_of(board)->status_due = true;
    }
    motor_axis_reset_references(board, axis);
}

/* Returns whether a mode drives the motor. */
static bool motor_is_control_mode(int64_t mode)
{
    return mode == ICUB_MODE_POSITION || mode == ICUB_MODE_VELOCITY || mode == ICUB_MODE_TORQUE ||
           mode == ICUB_MODE_IMPEDANCE_POSITION || mode == ICUB_MODE_IMPEDANCE_VELOCITY ||
           mode == ICUB_MODE_CURRENT || mode == ICUB_MODE_MIXED || mode == ICUB_MODE_DIRECT ||
           mode == ICUB_MODE_OPEN_LOOP;
}

/* Writes a text and a number to the host's log. */
static void motor_board_print_number(struct board *board, const char *text, unsigned number)
{
    char line[32];

    snprintf(line, sizeof line, "%s%u", text, number);
    motor_board_print(board, line);
}

/* Switches the mode of a strict axis. Commanding the present mode changes nothing and keeps the
 * references. */
static void motor_axis_switch_strictly(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool known = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_HARDWARE_FAULT ||
                 (motor_is_control_mode(mode) && mode != ICUB_MODE_CURRENT);

    if (mode == axis->base.mode) {
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

bool motor_axis_command_mode(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    /* A strict board obeys SET_CONTROL_MODE exactly as the firmware does */
    if (board->config.strict) {
        if (axis->base.mode == ICUB_MODE_HARDWARE_FAULT) {
            if (mode == ICUB_MODE_FORCE_IDLE) {
                motor_axis_switch_strictly(board, axis, ICUB_MODE_IDLE);
            }
        } else if (axis->base.mode == ICUB_MODE_IDLE) {
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
        return true;
    }
    if (!stop &&
        (!motor_is_control_mode(mode) || (mode == ICUB_MODE_CURRENT && axis->base.config->valve))) {
        return false;
    }
    /* From idle an axis can enter any mode. Only FORCE_IDLE leaves a fault. All other modes can
     * change directly */
    if (axis->base.mode == ICUB_MODE_IDLE) {
        if (!stop) {
            motor_axis_set_mode(board, axis, (uint8_t)mode);
        }
    } else if (axis->base.mode == ICUB_MODE_HARDWARE_FAULT) {
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
    return axis->base.mode == ICUB_MODE_POSITION ||
           axis->base.mode == ICUB_MODE_IMPEDANCE_POSITION || axis->base.mode == ICUB_MODE_MIXED;
}

bool motor_axis_has_velocity(const struct motor_axis *axis)
{
    return axis->base.mode == ICUB_MODE_VELOCITY ||
           axis->base.mode == ICUB_MODE_IMPEDANCE_VELOCITY || axis->base.mode == ICUB_MODE_MIXED;
}

/* Checks faults, limits and time-outs of a motor board. */

/* Returns the state of the CAN controller in the format of STATUS byte 4. */
uint8_t motor_board_can_status(const struct board *board)
{
    const struct board_can_state *can = &board->can;

    return (uint8_t)((can->bus_off ? ICUB_CAN_BUS_OFF : 0) |
                     (can->tec >= BOARD_CAN_PASSIVE ? ICUB_CAN_TX_ERROR : 0) |
                     (can->rec >= BOARD_CAN_PASSIVE ? ICUB_CAN_RX_ERROR : 0) |
                     (can->rec >= BOARD_CAN_WARNING ? ICUB_CAN_RX_WARNING : 0));
}

/* Sets a reference to 0 when it expires. A velocity reference has a time-out in the firmware.
 * Voltage and torque references have the command time-out. It is a
 * safety feature of this simulator, and strict boards do not have it. */
static void motor_axis_watch_references(struct board *board, struct motor_axis *axis)
{
    int64_t timeout_ns = board->config.strict ? 0 : board->config.command_timeout_ns, since_ns;
    int64_t *p = axis->parameter, *reference;
    bool velocity = false;

    if (timeout_ns > 0 && axis->base.mode == ICUB_MODE_OPEN_LOOP) {
        reference = &p[ICUB_P_OPEN_LOOP];
        since_ns = axis->voltage_ns;
    } else if (timeout_ns > 0 &&
               (axis->base.mode == ICUB_MODE_TORQUE || axis->base.mode == ICUB_MODE_CURRENT)) {
        reference = &p[ICUB_P_DESIRED_TORQUE];
        since_ns = axis->torque_ns;
    } else if (motor_axis_has_velocity(axis)) {
        velocity = true;
        reference = &p[ICUB_P_DESIRED_VELOCITY];
        since_ns = axis->velocity_ns;
        timeout_ns = p[ICUB_P_VELOCITY_TIMEOUT] * MS;
    } else {
        return;
    }
    if (*reference != 0 && board->boards->now_ns - since_ns > timeout_ns) {
        *reference = 0;
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, motor_axis_index(board, axis), axis->base.mode, 0);
        motor_board_print(board, velocity ? "VELOCITY TIMEOUT" : "REFERENCE TIMEOUT");
    }
}

/* Switches an axis off if its torque loop has lost the torque source. The source is lost if the
 * axis has no sensor, or if the STRAIN board has sent no frame for ICUB_STRAIN_SAFE_MS. */
static void motor_axis_watch_source(struct board *board, struct motor_axis *axis)
{
    int64_t address, since = axis->source_ns;
    const struct torque_source *source;

    if (axis->base.mode != ICUB_MODE_TORQUE && !motor_axis_is_impedance(axis)) {
        return;
    }
    address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    source = &icub_bus_of(board->bus)->source[address];
    since = source->time_ns > since ? source->time_ns : since;
    if (address == 0 ? !(axis->base.config->torque_full_scale_nm > 0.0)
                     : board->boards->now_ns - since > (int64_t)ICUB_STRAIN_SAFE_MS * MS) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_SOURCE_LOST, motor_axis_index(board, axis),
                    (uint32_t)address, 0);
        motor_board_print(board, "STRAIN WATCHDOG");
        motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
    }
}

/* Beyond a limit, sets any voltage reference to 0, even one that leads back. The firmware does the
 * same. */
static void motor_axis_watch_limits(struct board *board, struct motor_axis *axis)
{
    int32_t position = motor_axis_position(axis);
    bool beyond = position < axis->parameter[ICUB_P_MIN_POSITION] ||
                  position > axis->parameter[ICUB_P_MAX_POSITION];

    if (!beyond) {
        axis->limit_reported = false;
    } else if (axis->base.mode == ICUB_MODE_OPEN_LOOP && axis->parameter[ICUB_P_OPEN_LOOP] != 0) {
        axis->parameter[ICUB_P_OPEN_LOOP] = 0;
        if (!axis->limit_reported) {
            axis->limit_reported = true;
            board_event(board, BOARD_EVENT_LIMIT, motor_axis_index(board, axis), (uint32_t)position,
                        0);
            motor_board_print(board, "OUT OF LIMITS");
        }
    }
}

void motor_board_watch(struct board *board)
{
    struct motor_board *motor = motor_board_of(board);
    uint8_t can = motor_board_can_status(board);

    /* A new state of the CAN controller requests a STATUS frame */
    motor->status_due = motor->status_due || can & (uint8_t)~motor->can_reported;
    motor->can_reported &= can;
    motor->can |= can & (uint8_t)~motor->can_reported;
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        /* Check supply, encoders, torque sensor and current. A fault stops a running axis. */
        double limit_a = (double)axis->parameter[ICUB_P_CURRENT_LIMIT] * 1e-3;
        uint32_t now = axis_find_faults(board, &axis->base, limit_a);
        bool over_current = now & AXIS_OVER_CURRENT;
        uint8_t faults =
            (uint8_t)((now & AXIS_UNDER_VOLTAGE ? ICUB_FAULT_UNDER_VOLTAGE : 0) |
                      (now & AXIS_OVER_VOLTAGE ? ICUB_FAULT_OVER_VOLTAGE : 0) |
                      (now & (AXIS_MOTOR_ENCODER | AXIS_LINK_ENCODER | AXIS_TORQUE_SENSOR)
                           ? ICUB_FAULT_ABSOLUTE_ENCODER
                           : 0));
        uint8_t risen = faults & (uint8_t)~axis->faults;

        axis->faults = faults;
        /* Report over-current once and other faults while they last */
        if (over_current) {
            axis->faults_once |= ICUB_FAULT_OVER_CURRENT;
            risen |= ICUB_FAULT_OVER_CURRENT;
            board->boards->counters.trips++;
            motor_board_print(board, "OVERCURRENT");
        }
        if (risen) {
            board_event(board, BOARD_EVENT_FAULT, motor_axis_index(board, axis), risen, 0);
            motor_board_of(board)->status_due = true;
        }
        if (motor_runs(axis->base.mode) && (faults || over_current)) {
            motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
        }

        /* Check the winding temperature. A running axis stops above its limit. */
        int64_t limit = axis->parameter[ICUB_P_TEMPERATURE_LIMIT];
        bool hot = !axis->thermometer_bad && limit > 0 && axis->temperature > limit;
        uint8_t before = axis->heat;

        axis->heat = (uint8_t)((hot ? ICUB_BOARD_OVER_TEMPERATURE_0 : 0) |
                               (axis->thermometer_bad ? ICUB_BOARD_TEMPERATURE_ERROR_0 : 0));
        if (axis->heat != before) {
            motor_board_of(board)->status_due = true;
        }
        if (hot && !(before & ICUB_BOARD_OVER_TEMPERATURE_0)) {
            board->boards->counters.trips++;
            board_event(board, BOARD_EVENT_OVER_HEATED, motor_axis_index(board, axis),
                        (uint32_t)axis->temperature, 0);
            motor_board_print(board, "OVERHEATING");
        }
        if (hot && motor_runs(axis->base.mode)) {
            motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
        }
        /* At the end of a calibration, set the offset so that the calibrated position reads 0 */
        if (axis->base.mode == ICUB_MODE_CALIBRATION &&
            board->boards->now_ns >= axis->calibrated_ns) {
            axis->offset = -axis->calibration_zero;
            axis->calibrated = true;
            motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
        }
        motor_axis_watch_source(board, axis);
        motor_axis_watch_references(board, axis);
        motor_axis_watch_limits(board, axis);
    }
}
