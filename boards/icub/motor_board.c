/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A motor board (BLL): two axes on one address. Obeys the commands of class 0, keeps the rules of
 * the control modes, watches faults and time-outs, closes its loops every millisecond, and sends
 * the frames of class 1 in their slots.
 *
 * Units are the protocol's: encoder ticks, PWM counts (+-1333 = +-100 % of the supply), mA, torque
 * in counts of the torque source (0x8000 = its full scale). Bridges are on in every running mode
 * but calibration, and off in idle and after a fault.
 *
 * The references become PWM once a millisecond:
 *
 *   voltage (open loop): the reference itself
 *   current: PID (SET_CURRENT_PID) on mA; the reference is SET_DESIRED_TORQUE, read as mA
 *   torque: PID (SET_TORQUE_PID) + offset on torque counts
 *   position: PID (SET_POSITION_PID) + offset + stiction while a move is under way, on ticks; the
 *     reference moves by the trajectory generator (POSITION_MOVE), in velocity mode by the velocity
 *     reference, in mixed mode by both; in direct mode it jumps
 *   impedance (its two modes, or any position-like mode when the interaction mode is compliant):
 *     torque reference = stiffness * error + damping * change of error + offset, then as torque
 *
 * Each PID is cut to its own limit, everything to the PWM limit and the full scale. Gains are zero
 * at power-up, so that a board holds nothing before the host has configured it.
 *
 * Calibration is that of the firmware whose version the board reports: type 3 (absolute encoder)
 * takes p3 as the encoder's zero. A p2 of 0 is invalid and makes a fault.
 *
 * A strict board does what the firmware does even where that is odd. An axis that is to leave idle,
 * for calibration too, goes into hardware fault instead, with a PRINT that says why, unless a host
 * has stated a compatible protocol (GET_FIRMWARE_VERSION) and set all seven parameters of the
 * position PID; with require_calibration also unless it has been calibrated. It has no current
 * mode; a mode that it does not have makes a fault. The present mode again leaves the references as
 * they are. PRINT reports every change of mode.
 *
 * A winding above the limit of SET_TEMPERATURE_LIMIT (0 = none) puts its axis into hardware fault;
 * the fault byte has no bit for it, byte 5 of STATUS has, for as long as it is too hot. A
 * thermometer without a number is reported there and stops nothing.
 *
 * STATUS bytes 4, 6 and 7 are the CAN controller's: states as they are, bus-off and overflow until
 * reported once, and of each error counter the change since the STATUS before, for hosts add these
 * up.
 *
 * Over-current is an I2t law, as the firmware's: the motor may be above its limit by as much as
 * integral (I^2 - limit^2) dt = limit^2 * 10 ms, then the axis trips. At twice the limit that takes
 * 4 ms, at 3.4 times a single sample; the inrush of a voltage step, over within a few milliseconds,
 * passes.
 */
#include "boards/icub/motor_private.h"

#include <math.h>
#include <string.h>

enum { POLICY_AT_START = 0x7f }; /* what a host usually asks for */

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

/* Fills the parameters of an axis at power-up: gains 0, limits of the rig. */
static void motor_axis_set_defaults(const struct board *board, struct motor_axis *axis)
{
    const struct board_axis_config *config = motor_axis_config(board, axis);
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
    if (config->joint < 0) {
        return;
    }
    /* Limits of the rig, rounded outward to ticks */
    control_quantize(floor(config->lower_rad * config->joint_ticks_per_rad), &limit);
    p[ICUB_P_MIN_POSITION] = limit;
    control_quantize(ceil(config->upper_rad * config->joint_ticks_per_rad), &limit);
    p[ICUB_P_MAX_POSITION] = limit;
    control_quantize(config->current_limit_a * 1e3, &limit);
    p[ICUB_P_CURRENT_LIMIT] = limit;
    control_quantize(config->temperature_limit_c / ICUB_TEMPERATURE_C, &limit);
    p[ICUB_P_TEMPERATURE_LIMIT] = control_clamp(limit, 0, INT16_MAX);
}

/* Resets board and axes (struct board_ops). */
static void motor_board_power_up(struct board *board)
{
    struct motor_board *motor = motor_board_of(board);

    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        motor_axis_set_defaults(board, axis);
        if (!motor->powered) {
            memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        }
        axis->mode = ICUB_MODE_IDLE;
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
    motor->started = false; /* speed estimation restarts */
}

/* Switches all axes off. */
static void motor_board_switch_off(struct board *board)
{
    for (int i = 0; i < MOTOR_AXES; i++) {
        if (motor_runs(motor_board_of(board)->axis[i].mode)) {
            motor_axis_set_mode(board, &motor_board_of(board)->axis[i], ICUB_MODE_IDLE);
        }
    }
}

/* Stops motors and telemetry on discovery, where the rig asks for that (struct icub_board_ops). */
static void motor_board_discovered(struct icub_board *icub)
{
    struct board *board = &icub->board;

    if (board->config.discovery_stops_motors) {
        motor_board_switch_off(board);
        motor_board_of(board)->policy = 0;
    }
}

/* ---- sensors ---- */

/* Takes the sensors of an axis; values without a number are a fault and change nothing. */
static void motor_axis_sample(struct motor_axis *axis, const struct board_axis_config *config,
                              const struct plant_sensors *sensors)
{
    const struct motor_sense *sense;
    int32_t joint, motor;

    if (config->joint < 0) {
        return;
    }
    sense = &sensors->motor[config->joint];
    axis->sensors_bad = !control_quantize(sense->q * config->joint_ticks_per_rad, &joint) ||
                        !control_quantize(sense->qm * config->motor_ticks_per_rad, &motor) ||
                        !isfinite(sense->current_a) || !isfinite(sense->torque_nm);
    if (!axis->sensors_bad) {
        axis->joint.raw = joint;
        axis->motor.raw = motor;
        axis->current_a = sense->current_a;
        axis->torque_nm = sense->torque_nm;
    }
    axis->thermometer_bad =
        !control_quantize(sense->winding_c / ICUB_TEMPERATURE_C, &axis->temperature);
}

/* Samples both axes (struct board_ops). Encoders are quantized; their speeds are estimated from
 * a sample a millisecond. */
static void motor_board_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct motor_board *motor = motor_board_of(board);
    int64_t now_ms = board->boards->now_ns / MS;

    motor->supply_v = board_supply_v(sensors);
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        motor_axis_sample(axis, &board->config.axis[i], sensors);

        /* The first sample after power-up: as if the axis had always been here */
        if (!motor->started) {
            estimator_reset(&axis->joint.speed, axis->joint.raw);
            estimator_reset(&axis->motor.speed, axis->motor.raw);
            motor_axis_hold_position(axis);
        }

        /* In a tick of several milliseconds the sample stands for all of them */
        for (int64_t ms = motor->sampled_ms; ms < now_ms; ms++) {
            estimator_push(&axis->joint.speed, axis->joint.raw);
            estimator_push(&axis->motor.speed, axis->motor.raw);
        }
    }
    motor->started = true;
    motor->sampled_ms = now_ms;
}

/* ---- the tick ---- */

/* Writes bridge and voltage of an axis into the plant's command. */
static void motor_axis_drive_bridge(const struct board *board, const struct motor_axis *axis,
                                    struct plant_command *command)
{
    int joint = motor_axis_config(board, axis)->joint;
    bool on = motor_runs(axis->mode) && axis->mode != ICUB_MODE_CALIBRATION;

    if (joint >= 0) {
        command->motor[joint].bridge_on = on;
        command->motor[joint].voltage_v =
            on ? (double)axis->pwm / ICUB_PWM_FULL_SCALE * motor_board_of(board)->supply_v : 0.0;
    }
}

/* Runs one tick: faults and time-outs, laws, bridges (struct board_ops). */
static void motor_board_control(struct board *board, struct ms_span span,
                                struct plant_command *command)
{
    motor_board_watch(board);
    for (int i = 0; i < MOTOR_AXES; i++) {
        struct motor_axis *axis = &motor_board_of(board)->axis[i];

        for (int64_t ms = span.from; ms < span.to; ms++) {
            motor_axis_step(board, axis);
        }
        motor_axis_drive_bridge(board, axis, command);
    }
}

/* Returns whether an axis is in hardware fault (struct board_ops). */
static bool motor_board_is_faulty(const struct board *board)
{
    for (int i = 0; i < MOTOR_AXES; i++) {
        if (motor_board_of(board)->axis[i].mode == ICUB_MODE_HARDWARE_FAULT) {
            return true;
        }
    }
    return false;
}

/* Returns the mode of an axis (struct board_ops). */
static uint8_t motor_board_mode(const struct board *board, unsigned axis)
{
    return motor_board_of(board)->axis[axis].mode;
}

/* Switches all axes off (struct board_ops). */
static void motor_board_shut_down(struct board *board, struct plant_command *command)
{
    motor_board_switch_off(board);
    for (int i = 0; i < MOTOR_AXES; i++) {
        motor_axis_drive_bridge(board, &motor_board_of(board)->axis[i], command);
    }
}

static const struct board_ops motor_board_ops = {
    .identity = {.type = ICUB_BOARD_BLL, .major = 2, .minor = 0x51, .build = 87},
    .periodic_max = 11,
    .power_up = motor_board_power_up,
    .sample = motor_board_sample,
    .control = motor_board_control,
    .transmit = motor_board_transmit,
    .shut_down = motor_board_shut_down,
    .fault = motor_board_is_faulty,
    .mode = motor_board_mode,
    .settings = &motor_settings,
};

static const struct icub_board_ops motor_icub_ops = {
    .commands = icub_motor_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .axis_bit = true,
    .loader_type = ICUB_BOARD_DSP,
    .command = motor_board_command,
    .discovered = motor_board_discovered,
};

struct board *motor_board_create(struct arena *arena)
{
    struct motor_board *motor = arena_alloc(arena, 1, sizeof *motor);

    if (!motor) {
        return NULL;
    }
    motor->icub.board.ops = &motor_board_ops;
    motor->icub.ops = &motor_icub_ops;
    return &motor->icub.board;
}
