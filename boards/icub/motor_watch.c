/* SPDX-License-Identifier: Apache-2.0 */
/* Watches faults of a motor board's hardware, its limits and its time-outs. */
#include "boards/icub/motor_private.h"

enum { OVERLOAD_MS = 10 }; /* budget of over-current, see motor_board.c */

/* Updates the I2t overload of an axis; returns whether it trips. */
static bool motor_axis_is_over_current(const struct board *board, struct motor_axis *axis)
{
    double limit = (double)axis->parameter[ICUB_P_CURRENT_LIMIT] * 1e-3;
    double tick_ms = (double)board->boards->tick_ns / MS;

    if (!motor_runs(axis->mode)) {
        axis->overload = 0.0;
        return false;
    }
    if (limit == 0.0) {
        return axis->current_a != 0.0;
    }
    if (axis->overload == 0.0 && axis->current_a * axis->current_a <= limit * limit) {
        return false; /* which is the rule */
    }
    axis->overload += (axis->current_a * axis->current_a / (limit * limit) - 1.0) * tick_ms;
    axis->overload = axis->overload > 0.0 ? axis->overload : 0.0;
    return axis->overload > OVERLOAD_MS;
}

/* Returns the faults of the supply, which all axes of a board have together. */
static uint8_t motor_board_supply_faults(const struct board *board)
{
    double supply_v = motor_board_of(board)->supply_v;

    return (board_is_under_voltage(board, supply_v) ? ICUB_FAULT_UNDER_VOLTAGE : 0) |
           (board_is_over_voltage(board, supply_v) ? ICUB_FAULT_OVER_VOLTAGE : 0);
}

/* Checks encoders and current, given the faults of the supply; a fault stops a running axis. */
static void motor_axis_watch_faults(struct board *board, struct motor_axis *axis, uint8_t supply)
{
    uint8_t faults = (uint8_t)(supply | (axis->sensors_bad ? ICUB_FAULT_ABSOLUTE_ENCODER : 0));
    uint8_t risen = faults & (uint8_t)~axis->faults;
    bool over_current = motor_axis_is_over_current(board, axis);

    axis->faults = faults;
    /* Over-current is reported once, the others as long as they last */
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
    if (motor_runs(axis->mode) && (faults || over_current)) {
        motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    }
}

/* Checks the winding's temperature; above its limit a running axis stops. */
static void motor_axis_watch_temperature(struct board *board, struct motor_axis *axis)
{
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
    if (hot && motor_runs(axis->mode)) {
        motor_axis_set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    }
}

/* Returns the state of the CAN controller, as STATUS byte 4 has it. */
uint8_t motor_board_can_status(const struct board *board)
{
    const struct board_can_state *can = &board->can;

    return (uint8_t)((can->bus_off ? ICUB_CAN_BUS_OFF : 0) |
                     (can->tec >= BOARD_CAN_PASSIVE ? ICUB_CAN_TX_ERROR : 0) |
                     (can->rec >= BOARD_CAN_PASSIVE ? ICUB_CAN_RX_ERROR : 0) |
                     (can->rec >= BOARD_CAN_WARNING ? ICUB_CAN_RX_WARNING : 0));
}

/* Notes new states of the CAN controller for the next STATUS. */
static void motor_board_watch_can(struct board *board)
{
    struct motor_board *motor = motor_board_of(board);
    uint8_t now = motor_board_can_status(board);

    if (now & (uint8_t)~motor->can_reported) {
        motor->status_due = true;
    }
    motor->can_reported &= now;
    motor->can |= now & (uint8_t)~motor->can_reported;
}

/* Sets a reference to 0 that was not refreshed, with an event. */
static void motor_axis_reference_timed_out(struct board *board, struct motor_axis *axis,
                                           enum icub_parameter reference)
{
    axis->parameter[reference] = 0;
    board->boards->counters.timeouts++;
    board_event(board, BOARD_EVENT_TIMEOUT, motor_axis_index(board, axis), axis->mode, 0);
}

/* Checks the command time-out of this simulator, a safety that the firmware (a strict board)
 * lacks. */
static void motor_axis_watch_references(struct board *board, struct motor_axis *axis)
{
    bool voltage = axis->mode == ICUB_MODE_OPEN_LOOP;
    bool torque = axis->mode == ICUB_MODE_TORQUE || axis->mode == ICUB_MODE_CURRENT;
    enum icub_parameter reference = voltage ? ICUB_P_OPEN_LOOP : ICUB_P_DESIRED_TORQUE;
    int64_t age = board->boards->now_ns - (voltage ? axis->voltage_ns : axis->torque_ns);

    if ((voltage || torque) && !board->config.strict && board->config.command_timeout_ns > 0 &&
        age > board->config.command_timeout_ns && axis->parameter[reference] != 0) {
        motor_axis_reference_timed_out(board, axis, reference);
        motor_board_print(board, "REFERENCE TIMEOUT");
    }
}

/* Checks the time-out of the velocity reference, as the firmware has it. */
static void motor_axis_watch_velocity(struct board *board, struct motor_axis *axis)
{
    int64_t age = board->boards->now_ns - axis->velocity_ns;

    if (motor_axis_has_velocity(axis) && axis->parameter[ICUB_P_DESIRED_VELOCITY] != 0 &&
        age > axis->parameter[ICUB_P_VELOCITY_TIMEOUT] * MS) {
        motor_axis_reference_timed_out(board, axis, ICUB_P_DESIRED_VELOCITY);
        motor_board_print(board, "VELOCITY TIMEOUT");
    }
}

/* Returns whether the torque source of an axis has been heard lately. */
static bool motor_axis_source_is_alive(const struct board *board, const struct motor_axis *axis)
{
    int64_t address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    const struct torque_source *source = &icub_bus_of(board->bus)->source[address];
    int64_t since = axis->source_ns;

    if (address == 0) {
        return motor_axis_config(board, axis)->torque_full_scale_nm > 0.0;
    }
    if (source->heard && source->time_ns > since) {
        since = source->time_ns;
    }
    return board->boards->now_ns - since <= (int64_t)ICUB_STRAIN_SAFE_MS * MS;
}

/* Switches an axis off whose torque loop has lost its source. */
static void motor_axis_watch_source(struct board *board, struct motor_axis *axis)
{
    if ((axis->mode == ICUB_MODE_TORQUE || motor_axis_is_impedance(axis)) &&
        !motor_axis_source_is_alive(board, axis)) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_SOURCE_LOST, motor_axis_index(board, axis),
                    (uint32_t)axis->parameter[ICUB_P_TORQUE_SOURCE], 0);
        motor_board_print(board, "STRAIN WATCHDOG");
        motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
    }
}

/* Refuses any voltage beyond a limit, even one that would lead back, as the firmware does. */
static void motor_axis_watch_limits(struct board *board, struct motor_axis *axis)
{
    int32_t position = motor_axis_position(axis);
    bool beyond = position < axis->parameter[ICUB_P_MIN_POSITION] ||
                  position > axis->parameter[ICUB_P_MAX_POSITION];

    if (!beyond) {
        axis->limit_reported = false;
    } else if (axis->mode == ICUB_MODE_OPEN_LOOP && axis->parameter[ICUB_P_OPEN_LOOP] != 0) {
        axis->parameter[ICUB_P_OPEN_LOOP] = 0;
        if (!axis->limit_reported) {
            axis->limit_reported = true;
            board_event(board, BOARD_EVENT_LIMIT, motor_axis_index(board, axis), (uint32_t)position,
                        0);
            motor_board_print(board, "OUT OF LIMITS");
        }
    }
}

/* Ends a calibration when its time is over: the offset makes the position that was named zero. */
static void motor_axis_watch_calibration(struct board *board, struct motor_axis *axis)
{
    if (axis->mode == ICUB_MODE_CALIBRATION && board->boards->now_ns >= axis->calibrated_ns) {
        axis->offset = -axis->calibration_zero;
        axis->calibrated = true;
        motor_axis_set_mode(board, axis, ICUB_MODE_IDLE);
    }
}

void motor_board_watch(struct board *board)
{
    const uint8_t supply = motor_board_supply_faults(board);

    motor_board_watch_can(board);
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor_board_of(board)->axis[i];

        motor_axis_watch_faults(board, axis, supply);
        motor_axis_watch_temperature(board, axis);
        motor_axis_watch_calibration(board, axis);
        motor_axis_watch_source(board, axis);
        motor_axis_watch_references(board, axis);
        motor_axis_watch_velocity(board, axis);
        motor_axis_watch_limits(board, axis);
    }
}
