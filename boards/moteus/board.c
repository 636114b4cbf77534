/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of the control position. Without limits, the control position jumps to the commanded
 * position. With limits on speed and acceleration, it arrives there with the commanded velocity.
 * The commanded position itself moves with the commanded velocity.
 */
#include "boards/moteus/private.h"

#define STEP_S 1e-3

/* Clamps a value to +-limit. A limit of NaN does not apply. */
static double path_clamp(double value, double limit)
{
    return fmax(fmin(value, limit), -limit);
}

/* Advances the control position by one millisecond. A limit of NaN does not apply. */
static void moteus_path_step(struct moteus_path *path, double target_velocity,
                             double velocity_limit, double acceleration_limit)
{
    double change = acceleration_limit * STEP_S, wanted = target_velocity, before = path->velocity;

    /* Without limits, the control position follows the command directly */
    if (isnan(velocity_limit) && isnan(acceleration_limit)) {
        path->position = isnan(path->target) ? path->position : path->target;
        path->target = NAN;
        path->velocity = target_velocity;
        path->position += target_velocity * STEP_S;
        path->done = true;
        return;
    }

    /* Wanted speed: the commanded speed, plus a speed towards the target. The added speed is the
     * largest from which the axis can still brake to the commanded speed at the target. The
     * distance then equals the way in this step plus the stopping distance v^2 / 2a */
    if (!isnan(path->target)) {
        double distance = path->target - path->position, half = change / 2.0;
        double speed = (before - target_velocity) * (distance < 0.0 ? -1.0 : 1.0);
        double square = half * half + 2.0 * (acceleration_limit * fabs(distance) - half * speed);

        wanted += isnan(acceleration_limit)
                      ? distance / STEP_S
                      : copysign(fmax(sqrt(fmax(square, 0.0)) - half, 0.0), distance);
        path->target += target_velocity * STEP_S;
    }
    wanted = path_clamp(wanted, velocity_limit);
    path->velocity = isnan(change) ? wanted : before + path_clamp(wanted - before, change);
    path->position += (isnan(change) ? path->velocity : (before + path->velocity) / 2.0) * STEP_S;

    /* The path is done at the commanded speed and, if a position is commanded, at this position */
    change = isnan(change) ? 0.0 : change;
    path->done = fabs(path->velocity - target_velocity) <= change + 1e-9;
    if (!isnan(path->target)) {
        path->done = path->done && fabs(path->target - path->position) <= change * STEP_S + 1e-9;
        if (path->done) {
            path->position = path->target;
            path->velocity = path_clamp(target_velocity, velocity_limit);
            path->target = NAN;
        }
    }
}

/*
 * A moteus controller: one motor, which runs only on command. Modes, faults and the watchdog follow
 * firmware 1.1.0. Path and limits advance once a millisecond instead of 30 times. Current and
 * position loops are laws of the drive's own controller (boards/axis.h). The gains of the position
 * loop stand for the owner's configuration: damping equal to the motor's back-EMF, and 40/s from
 * position error to speed.
 */

#define TURN (2.0 * M_PI)

/* duration of the 256 PWM periods in which the drive measures the current offsets */
enum { ENABLING_MS = 9 };

/* Defaults of the firmware: servo.default_timeout_s, servo.timeout_max_torque_Nm,
 * servo.default_accel_limit, servo.max_velocity, lowest supply voltage. */
static const double TIMEOUT_S = 0.1, TIMEOUT_TORQUE_NM = 5.0, ACCELERATION_LIMIT = 50.0,
                    VELOCITY_MAX = 500.0, SUPPLY_MIN_V = 4.0, POSITION_PER_S = 40.0;

/* ---- modes ---- */

/* Enters a mode, resets its loops and restarts the path. */
static void moteus_set_mode(struct board *board, enum moteus_mode mode)
{
    struct moteus_board *moteus = moteus_board_of(board);
    enum moteus_mode before = moteus_mode(moteus);

    if (mode != before) {
        board_event(board, BOARD_EVENT_MODE, 0, before, mode);
        moteus->value[MOTEUS_R_MODE] = moteus->axis.mode = (uint8_t)mode;
        moteus->axis.on = mode >= MOTEUS_PWM;
        moteus->axis.faulty = mode == MOTEUS_FAULT;
        moteus->axis.voltage_v = 0.0;
        moteus->axis.law.on = false;
        if (mode != MOTEUS_TIMEOUT) {
            moteus->path.position = NAN;
            moteus->path.done = false;
        }
    }
}

/* Enters the fault mode. The first fault remains until the board is stopped. */
static void moteus_raise_fault(struct board *board, enum moteus_fault fault)
{
    struct moteus_board *moteus = moteus_board_of(board);

    if (moteus_mode(moteus) != MOTEUS_FAULT) {
        moteus_set_mode(board, MOTEUS_FAULT);
        moteus->value[MOTEUS_R_FAULT] = fault;
        board_event(board, BOARD_EVENT_FAULT, 0, UINT32_C(1) << (fault - MOTEUS_FAULT_FIRST), 0);
    }
}

/* Enters the commanded mode, or the next mode on the way to it. Only a stop command leaves a fault
 * or a time-out. */
static void moteus_approach_mode(struct board *board)
{
    struct moteus_board *moteus = moteus_board_of(board);
    enum moteus_mode mode = moteus_mode(moteus), wanted = (enum moteus_mode)moteus->wanted_mode;
    double rad = moteus->motor * TURN;
    bool bounded = (wanted == MOTEUS_POSITION || wanted == MOTEUS_STAY_WITHIN) &&
                   moteus->command[MOTEUS_R_IGNORE_BOUNDS] == 0.0;

    if (mode == wanted || mode == MOTEUS_FAULT || mode == MOTEUS_TIMEOUT) {
        return;
    }
    if (mode == MOTEUS_STOPPED) {
        moteus->enabling_ms = ENABLING_MS;
        moteus_set_mode(board, MOTEUS_CALIBRATING);
    } else if (mode == MOTEUS_CALIBRATING && --moteus->enabling_ms > 0) {
        return;
    } else if (bounded &&
               (rad < board->config.axis[0].lower_rad || rad > board->config.axis[0].upper_rad)) {
        moteus_raise_fault(board, MOTEUS_OUTSIDE_LIMIT);
    } else {
        moteus_set_mode(board, wanted);
    }
}

/* Activates the command of a frame: its mode, limits, time-out and target. */
static void moteus_board_command(struct board *board)
{
    struct moteus_board *moteus = moteus_board_of(board);
    enum moteus_mode mode = (enum moteus_mode)moteus->commanded_mode;
    double acceleration = moteus->value[MOTEUS_R_ACCELERATION_LIMIT];
    double velocity = moteus->value[MOTEUS_R_VELOCITY_LIMIT];
    double timeout_s = moteus->value[MOTEUS_R_TIMEOUT];

    if (mode >= MOTEUS_FAULT && mode <= MOTEUS_CALIBRATION_COMPLETE) {
        return; /* only the board itself can enter these modes */
    }
    memcpy(moteus->command, moteus->value, sizeof moteus->command);
    moteus->wanted_mode = mode;

    /* Fill in the values that the command omits. An acceleration limit needs a speed limit */
    moteus->timeout_s = timeout_s == 0.0 ? TIMEOUT_S : timeout_s;
    moteus->acceleration_limit = isnan(acceleration)  ? ACCELERATION_LIMIT
                                 : acceleration < 0.0 ? (double)NAN
                                                      : acceleration;
    moteus->velocity_limit = velocity < 0.0 ? (double)NAN : velocity;
    if (!isnan(moteus->velocity_limit) || !isnan(moteus->acceleration_limit)) {
        moteus->velocity_limit = fmin(moteus->velocity_limit, VELOCITY_MAX);
    }
    moteus->path.target = moteus->command[MOTEUS_R_POSITION_COMMAND];
    if (mode == MOTEUS_STOPPED) {
        moteus->value[MOTEUS_R_FAULT] = MOTEUS_NO_FAULT;
        moteus_set_mode(board, MOTEUS_STOPPED);
    } else if (mode == MOTEUS_POSITION && isfinite(moteus->command[MOTEUS_R_STOP_POSITION]) &&
               (isfinite(moteus->velocity_limit) || isfinite(moteus->acceleration_limit))) {
        moteus_raise_fault(board, MOTEUS_STOP_POSITION);
    }
}

/* ---- power-up ---- */

/* Resets the board (struct board_ops). */
static void moteus_power_up(struct board *board)
{
    const struct board_axis_config *axis = &board->config.axis[0];
    const struct moteus_board fresh = {.board = *board,
                                       .torque_nm_a = axis->torque_nm_a > 0.0 ? axis->torque_nm_a
                                                                              : axis->bemf_v_s_rad,
                                       .timeout_s = NAN,
                                       .before = NAN,
                                       .link_before = NAN,
                                       .path = {.position = NAN, .target = NAN}};
    struct moteus_board *moteus = moteus_board_of(board);

    *moteus = fresh;
    for (size_t i = 0; i < moteus_row_count; i++) {
        moteus->value[moteus_rows[i].number] = moteus_rows[i].initial;
    }
    moteus->value[MOTEUS_R_FIRMWARE] = MOTEUS_FIRMWARE;
    moteus->value[MOTEUS_R_MAP_VERSION] = MOTEUS_MAP_VERSION;
    moteus->value[MOTEUS_R_UUID_MASK_CAPABLE] = 1.0;
    moteus->value[MOTEUS_R_HOME_STATE] = 2.0;        /* homed at the output */
    moteus->value[MOTEUS_R_ENCODER_VALIDITY] = 0x0f; /* encoder sources 0 and 1 are valid */
    for (unsigned i = 0; i < 4; i++) {
        uint64_t hash = hash_bytes(HASH_START + i, board->config.name, strlen(board->config.name));

        moteus->value[MOTEUS_R_UUID + i] = (uint32_t)hash;
        if (i < 3) {
            moteus->value[MOTEUS_R_SERIAL + i] = (uint32_t)(hash >> 32);
        }
    }
    if (axis->winding_ohm > 0.0) {
        moteus->kd = moteus->torque_nm_a * axis->bemf_v_s_rad / axis->winding_ohm * TURN;
        moteus->kp = POSITION_PER_S * moteus->kd;
    }
}

/* ---- sensors ---- */

/* Returns the fraction of an angle within one turn, 0 to 1. */
static double moteus_fraction(double turns)
{
    return turns - floor(turns);
}

/* Stores the measured values in the board's registers (struct board_ops). */
static void moteus_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct moteus_board *moteus = moteus_board_of(board);
    struct axis *axis = &moteus->axis;
    double *value = moteus->value, link;

    (void)sensors;
    axis_find_angles(axis);
    value[MOTEUS_R_MILLISECONDS] = (double)(uint32_t)(board->boards->now_ns / MS);
    if (axis->config->joint < 0 || axis->bad_motor || axis->bad_link) {
        return;
    }
    moteus->motor = axis->motor_rad / TURN;
    moteus->before = isnan(moteus->before) ? moteus->motor : moteus->before;
    axis_update_rate(&moteus->velocity, &moteus->before, moteus->motor, axis->passed_ms);
    value[MOTEUS_R_POSITION] = moteus->motor - moteus->zero;
    value[MOTEUS_R_VELOCITY] = value[MOTEUS_R_ENCODER_0_VELOCITY] = moteus->velocity;
    value[MOTEUS_R_TORQUE] = axis->current_a * moteus->torque_nm_a;
    value[MOTEUS_R_TORQUE_ERROR] = value[MOTEUS_R_TORQUE] - value[MOTEUS_R_CONTROL_TORQUE];
    value[MOTEUS_R_Q_CURRENT] = axis->current_a;
    link = axis->link_rad / TURN;
    moteus->link_before = isnan(moteus->link_before) ? link : moteus->link_before;
    axis_update_rate(&value[MOTEUS_R_ENCODER_1_VELOCITY], &moteus->link_before, link,
                     axis->passed_ms);
    value[MOTEUS_R_ABS_POSITION] = value[MOTEUS_R_ENCODER_1_POSITION] = moteus_fraction(link);
    value[MOTEUS_R_ENCODER_0_POSITION] = moteus_fraction(moteus->motor * axis->config->gear);
    value[MOTEUS_R_POWER] = axis->current_a * axis->voltage_v;
    value[MOTEUS_R_VOLTAGE] = axis->supply_v;
    value[MOTEUS_R_TEMPERATURE] = value[MOTEUS_R_MOTOR_TEMPERATURE] = axis->winding_c;
}

/* ---- faults ---- */

/* ---- control laws, once a millisecond ---- */

/* Clamps a value to +-limit. A limit of NaN does not apply. If the limit is active, stores `code`
 * in the FAULT register. */
static double moteus_limit(struct moteus_board *moteus, double value, double limit,
                           enum moteus_fault code)
{
    double limited = fmax(fmin(value, fabs(limit)), -fabs(limit));

    if (limited != value) {
        moteus->value[MOTEUS_R_FAULT] = code;
    }
    return limited;
}

/* Hands a current to the current controller. */
static void moteus_current_law(struct moteus_board *moteus, double wanted_a)
{
    const double limit_a = moteus->axis.config->current_limit_a;

    wanted_a =
        moteus_limit(moteus, isnan(wanted_a) ? 0.0 : wanted_a, limit_a, MOTEUS_LIMIT_CURRENT);
    axis_follow_law(&moteus->axis,
                    &(struct current_law){.current_a = wanted_a, .limit_a = limit_a});
}

/* Hands the position loop to the controller. Stores the parts of its torque in registers. */
static void moteus_torque_law(struct moteus_board *moteus, double position_error,
                              double velocity_error, const double *scale, double max_nm)
{
    double p = moteus->kp * scale[0] * position_error, d = moteus->kd * scale[1] * velocity_error;
    double torque = moteus_limit(moteus, p + d + scale[2], max_nm, MOTEUS_LIMIT_TORQUE);
    double *value = moteus->value;

    value[MOTEUS_R_POSITION_ERROR] = -position_error;
    value[MOTEUS_R_VELOCITY_ERROR] = -velocity_error;
    value[MOTEUS_R_TORQUE_P] = p;
    value[MOTEUS_R_TORQUE_D] = d;
    value[MOTEUS_R_TORQUE_FEEDFORWARD] = scale[2];
    value[MOTEUS_R_TORQUE_TOTAL] = value[MOTEUS_R_CONTROL_TORQUE] = torque;
    if (moteus->torque_nm_a == 0.0) {
        moteus_current_law(moteus, 0.0);
        return;
    }

    /* Convert gains from N m per turn to A per rad. The controller updates both errors in a tick */
    const double a_nm = 1.0 / moteus->torque_nm_a, limit_a = moteus->axis.config->current_limit_a;

    moteus_limit(moteus, torque * a_nm, limit_a, MOTEUS_LIMIT_CURRENT);
    axis_follow_law(
        &moteus->axis,
        &(struct current_law){.current_a = scale[2] * a_nm,
                              .limit_a = fmin(limit_a, fabs(max_nm) * a_nm),
                              .stiffness_a_rad = moteus->kp * scale[0] * a_nm / TURN,
                              .position_rad = moteus->axis.motor_rad + position_error * TURN,
                              .damping_a_s_rad = moteus->kd * scale[1] * a_nm / TURN,
                              .speed_rad_s = (moteus->velocity + velocity_error) * TURN});
}

/* Returns the value, or 0 if it is NaN. */
static double number_or_0(double value)
{
    return isnan(value) ? 0.0 : value;
}

/* Runs the position loop, which follows the path within the position limits. */
static void moteus_position_law(struct moteus_board *moteus)
{
    const struct board_axis_config *axis = moteus->axis.config;
    const double *command = moteus->command;
    const double scale[] = {number_or_0(command[MOTEUS_R_KP_SCALE]),
                            number_or_0(command[MOTEUS_R_KD_SCALE]),
                            number_or_0(command[MOTEUS_R_FEEDFORWARD_TORQUE])};
    double position = moteus->motor - moteus->zero;
    double lower = axis->lower_rad / TURN - moteus->zero;
    double upper = axis->upper_rad / TURN - moteus->zero;
    struct moteus_path *path = &moteus->path;

    if (isnan(path->position)) {
        path->position = position;
        path->velocity = moteus->velocity;
    }
    moteus_path_step(path, number_or_0(command[MOTEUS_R_VELOCITY_COMMAND]), moteus->velocity_limit,
                     moteus->acceleration_limit);
    /* Keep the control position at the stop position if it would move away. NaN = no stop */
    if ((path->position - command[MOTEUS_R_STOP_POSITION]) *
            number_or_0(command[MOTEUS_R_VELOCITY_COMMAND]) >
        0.0) {
        path->position = command[MOTEUS_R_STOP_POSITION];
        path->velocity = 0.0;
    }
    if (command[MOTEUS_R_IGNORE_BOUNDS] == 0.0 &&
        !(path->position >= lower && path->position <= upper)) {
        path->position = fmax(fmin(path->position, upper), lower);
        path->velocity = 0.0;
        moteus->value[MOTEUS_R_FAULT] = MOTEUS_LIMIT_POSITION;
    }
    moteus->value[MOTEUS_R_TRAJECTORY_COMPLETE] = path->done;
    moteus->value[MOTEUS_R_CONTROL_POSITION] = path->position;
    moteus->value[MOTEUS_R_CONTROL_VELOCITY] = path->velocity;
    moteus_torque_law(moteus, path->position - position, path->velocity - moteus->velocity, scale,
                      command[MOTEUS_R_MAX_TORQUE]);
}

/* Runs the law of the present mode. */
static void moteus_law(struct moteus_board *moteus)
{
    const double *command = moteus->command;
    double position = moteus->motor - moteus->zero;
    double lower = command[MOTEUS_R_STAY_LOWER], upper = command[MOTEUS_R_STAY_UPPER];
    double error = position < lower ? lower - position : position > upper ? upper - position : 0.0;
    double kd = number_or_0(command[MOTEUS_R_KD_SCALE]);

    switch (moteus_mode(moteus)) {
    case MOTEUS_VOLTAGE_DQ:
        axis_apply_voltage(&moteus->axis, number_or_0(command[MOTEUS_R_Q_VOLTAGE_COMMAND]));
        break;
    case MOTEUS_CURRENT:
        moteus_current_law(moteus, command[MOTEUS_R_Q_CURRENT_COMMAND]);
        break;
    case MOTEUS_POSITION:
        moteus_position_law(moteus);
        break;
    case MOTEUS_TIMEOUT:
    case MOTEUS_ZERO_VELOCITY:
        moteus_torque_law(moteus, 0.0, -moteus->velocity, (const double[]){0.0, kd, 0.0},
                          TIMEOUT_TORQUE_NM);
        break;
    /* outside the bounds, the position loop returns the motor to the nearer bound */
    case MOTEUS_STAY_WITHIN:
        moteus_torque_law(moteus, error, -moteus->velocity,
                          (const double[]){number_or_0(command[MOTEUS_R_KP_SCALE]),
                                           error == 0.0 ? 0.0 : kd,
                                           number_or_0(command[MOTEUS_R_FEEDFORWARD_TORQUE])},
                          command[MOTEUS_R_MAX_TORQUE]);
        break;
    default: /* brake: the motor is shorted; all other modes: the bridge is open */
        axis_apply_voltage(&moteus->axis, 0.0);
        break;
    }
}

/* Runs one tick (struct board_ops). Each millisecond runs the watchdog, the mode and the control
 * law. */
static void moteus_control(struct board *board, struct ms_span span)
{
    struct moteus_board *moteus = moteus_board_of(board);

    for (int64_t ms = span.from; ms < span.to; ms++) {
        moteus->timeout_s =
            fmax(moteus->timeout_s - STEP_S, isnan(moteus->timeout_s) ? (double)NAN : 0.0);
        moteus_approach_mode(board);

        /* Check supply, encoder, temperature and the age of the command */
        double hottest_c = board->config.axis[0].temperature_limit_c;
        enum moteus_mode mode = moteus_mode(moteus);
        uint32_t now =
            axis_find_faults(board, &moteus->axis, board->config.axis[0].current_limit_a);

        if (mode != MOTEUS_STOPPED && mode != MOTEUS_FAULT) {
            if (now & AXIS_OVER_VOLTAGE) {
                moteus_raise_fault(board, MOTEUS_OVER_VOLTAGE);
            } else if (moteus->axis.supply_v < SUPPLY_MIN_V) {
                moteus_raise_fault(board, MOTEUS_UNDER_VOLTAGE);
            } else if (moteus->axis.bad_motor || moteus->axis.bad_link) {
                moteus_raise_fault(board, MOTEUS_ENCODER);
            } else if (hottest_c > 0.0 && moteus->value[MOTEUS_R_MOTOR_TEMPERATURE] > hottest_c) {
                board->boards->counters.trips++;
                moteus_raise_fault(board, MOTEUS_OVER_TEMPERATURE);
            } else if ((mode == MOTEUS_POSITION || mode == MOTEUS_STAY_WITHIN) &&
                       moteus->timeout_s <= 0.0) {
                board->boards->counters.timeouts++;
                board_event(board, BOARD_EVENT_TIMEOUT, 0, mode, 0);
                moteus_set_mode(board, MOTEUS_TIMEOUT);
            }
        }

        if (moteus_mode(moteus) != MOTEUS_FAULT) {
            moteus->value[MOTEUS_R_FAULT] = MOTEUS_NO_FAULT;
        }
        moteus_law(moteus);
    }
}

/* Stops the motor (struct board_ops). */
static void moteus_shut_down(struct board *board)
{
    struct moteus_board *moteus = moteus_board_of(board);

    moteus->wanted_mode = MOTEUS_STOPPED;
    if (moteus_mode(moteus) != MOTEUS_FAULT) {
        moteus_set_mode(board, MOTEUS_STOPPED);
    }
}

/* Sends nothing (struct board_ops), because every frame of a moteus is a reply. */
static void moteus_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    (void)span;
    (void)sink;
    board->lost_in_status = board->lost_in_overflow = false;
}

const struct board_ops moteus_ops = {
    .size = sizeof(struct moteus_board),
    .identity = {.type = 2, .major = 1, .minor = 1},
    .turns_field = true,
    .power_up = moteus_power_up,
    .sample = moteus_sample,
    .control = moteus_control,
    .transmit = moteus_transmit,
    .shut_down = moteus_shut_down,
    .axes = offsetof(struct moteus_board, axis),
    .axis_size = sizeof(struct axis),
};

/*
 * Executes the subframes of a frame in order: writes and reads of registers. An unreadable subframe
 * ends the frame. Writes before it stay in effect.
 */

/* The frame that is being executed, and the reply to it. */
struct moteus_exchange {
    struct board *board;
    const struct bus_frame *frame;
    unsigned at; /* index of the next byte of the frame */
    /* commands: the mode was written; discard: the UUID mask selects another controller */
    bool commands, discard;
    enum board_verdict verdict;
    bool replies; /* the request asks for a reply */
    uint8_t reply[MOTEUS_DATA_MAX];
    unsigned used;
};

/* Reads a varuint. Returns false if the frame ends before the varuint does. */
static bool moteus_read_varuint(struct moteus_exchange *x, uint32_t *value)
{
    *value = 0;
    for (unsigned shift = 0; shift < 35 && x->at < x->frame->len; shift += 7) {
        uint8_t byte = x->frame->data[x->at++];

        *value |= (uint32_t)(byte & 0x7f) << shift;
        if (!(byte & 0x80)) {
            return true;
        }
    }
    return false;
}

/* Appends a varuint to the reply. Returns false if there is no room. */
static bool moteus_write_varuint(struct moteus_exchange *x, uint32_t value)
{
    for (; x->used < MOTEUS_DATA_MAX; value >>= 7) {
        x->reply[x->used++] = (uint8_t)((value & 0x7f) | (value > 0x7f ? 0x80 : 0));
        if (value <= 0x7f) {
            return true;
        }
    }
    return false;
}

/* Stores the verdict on a part of the frame that is not obeyed. The first such verdict remains. */
static void moteus_reject(struct moteus_exchange *x, enum board_verdict verdict)
{
    x->verdict = x->verdict == BOARD_OBEYED ? verdict : x->verdict;
}

/* Appends an error to the reply. */
static void moteus_write_error(struct moteus_exchange *x, enum moteus_subframe subframe,
                               uint32_t number, enum moteus_reason reason)
{
    unsigned used = x->used;

    moteus_reject(x, reason == MOTEUS_UNKNOWN_REGISTER ? BOARD_UNKNOWN : BOARD_MALFORMED);
    if (!moteus_write_varuint(x, subframe) || !moteus_write_varuint(x, number) ||
        !moteus_write_varuint(x, reason)) {
        x->used = used;
    }
}

/* Returns the value that a register keeps of a written one. NaN is a full duty, as in the firmware,
 * and no pin. */
static double moteus_kept(enum moteus_quantity quantity, double value)
{
    if (quantity == MOTEUS_Q_DUTY) {
        return fmax(fmin(value, 1.0), 0.0);
    }
    if (quantity == MOTEUS_Q_PINS) {
        return isnan(value) ? 0.0 : (int64_t)fmax(fmin(value, INT32_MAX), INT32_MIN) & 0x1f;
    }
    return value;
}

/* Writes a register and returns the result. An error does not end the frame. */
static enum moteus_reason moteus_write_register(struct moteus_exchange *x, uint32_t number,
                                                enum moteus_type type, const uint8_t *data)
{
    struct moteus_board *moteus = moteus_board_of(x->board);
    const struct moteus_row *row = moteus_find_row(number);
    double value, gear = x->board->config.axis[0].gear;

    if (!row) {
        return MOTEUS_UNKNOWN_REGISTER;
    }
    if (row->access == MOTEUS_R) {
        return MOTEUS_READ_ONLY;
    }
    value = moteus_get(row->quantity, type, data);
    if (number == MOTEUS_R_MODE) {
        /* Refuse modes that need single phases or an inductance: none are simulated */
        value = trunc(value);
        if (!(value >= 0.0 && value < MOTEUS_MODES) ||
            (value >= MOTEUS_PWM && value <= MOTEUS_VOLTAGE_FOC) ||
            value == MOTEUS_MEASURE_INDUCTANCE) {
            return MOTEUS_UNKNOWN_REGISTER;
        }
        /* Begin a command with default values. Store its mode in commanded_mode, because the mode
         * register shows the present mode */
        for (size_t i = 0; i < moteus_row_count; i++) {
            if (moteus_rows[i].commanded && moteus_rows[i].number != MOTEUS_R_MODE) {
                moteus->value[moteus_rows[i].number] = moteus_rows[i].initial;
            }
        }
        moteus->value[MOTEUS_R_TORQUE_FEEDFORWARD] = 0.0;
        moteus->commanded_mode = value;
        x->commands = true;
    } else if (number >= MOTEUS_R_UUID_MASK && number < MOTEUS_R_UUID_MASK_CAPABLE) {
        x->discard =
            value !=
            (double)(int32_t)(uint32_t)moteus->value[MOTEUS_R_UUID + number - MOTEUS_R_UUID_MASK];
    } else if (row->access == MOTEUS_W) {
        if (number == MOTEUS_R_OUTPUT_EXACT && isfinite(value)) {
            moteus->zero = moteus->motor - value;
        } else if (number == MOTEUS_R_OUTPUT_NEAREST && isfinite(value)) {
            /* Change the zero by whole rotor turns */
            moteus->zero -= round((value - (moteus->motor - moteus->zero)) * gear) / gear;
        }
        /* restart the path at the present position, as RECAPTURE does */
        moteus->path.position = NAN;
    } else {
        moteus->value[row->same_as ? row->same_as : number] = moteus_kept(row->quantity, value);
    }
    return MOTEUS_OK;
}

/* Executes a write. Returns false if the frame ends before the values do, or if the rest is for
 * another controller. */
static bool moteus_serve_write(struct moteus_exchange *x, enum moteus_type type, uint32_t count,
                               uint32_t first)
{
    unsigned bytes = moteus_bytes(type);

    for (uint32_t i = 0; i < count && !x->discard; i++) {
        enum moteus_reason reason;

        if (x->at + bytes > x->frame->len) {
            return false;
        }
        reason = moteus_write_register(x, first + i, type, x->frame->data + x->at);
        if (reason != MOTEUS_OK) {
            moteus_write_error(x, MOTEUS_WRITE_ERROR, first + i, reason);
        }
        x->at += bytes;
    }
    return !x->discard;
}

/* Executes a read. Returns false on an error, which ends the frame. */
static bool moteus_serve_read(struct moteus_exchange *x, uint8_t subframe, uint32_t count,
                              uint32_t first)
{
    enum moteus_type type = (enum moteus_type)(subframe & 0xc);
    const struct moteus_board *moteus = moteus_board_of(x->board);
    unsigned used = x->used;
    bool room = moteus_write_varuint(x, MOTEUS_REPLY | (subframe & 0xf)) &&
                (subframe & 3 || moteus_write_varuint(x, count)) && moteus_write_varuint(x, first);

    for (uint32_t i = 0; room && i < count; i++) {
        const struct moteus_row *row = moteus_find_row(first + i);

        room = x->used + moteus_bytes(type) <= MOTEUS_DATA_MAX;
        if (room && (!row || row->access == MOTEUS_W ||
                     !moteus_put(row->quantity, type,
                                 moteus->value[row->same_as ? row->same_as : first + i],
                                 x->reply + x->used))) {
            x->used = used;
            moteus_write_error(x, MOTEUS_READ_ERROR, first + i, MOTEUS_UNKNOWN_REGISTER);
            return false;
        }
        x->used += room ? moteus_bytes(type) : 0;
    }
    x->used = room ? x->used : used;
    return room;
}

/* Executes the next subframe. Returns false if the rest of the frame is unreadable. */
static bool moteus_serve_subframe(struct moteus_exchange *x)
{
    uint32_t subframe, count, first = 0;

    if (!moteus_read_varuint(x, &subframe) ||
        (subframe >= MOTEUS_REPLY && subframe != MOTEUS_NOP)) {
        moteus_reject(x, BOARD_UNKNOWN);
        return false;
    }
    if (subframe == MOTEUS_NOP) {
        return true;
    }
    count = subframe & 3;
    if ((count || moteus_read_varuint(x, &count)) && moteus_read_varuint(x, &first)) {
        if (subframe < MOTEUS_READ) {
            if (moteus_serve_write(x, (enum moteus_type)(subframe & 0xc), count, first)) {
                return true;
            }
        } else if (!x->replies || moteus_serve_read(x, (uint8_t)subframe, count, first)) {
            return true;
        }
    }
    if (!x->discard) {
        moteus_reject(x, BOARD_MALFORMED);
    }
    return false;
}

/* A bus of moteus controllers: finds the receivers of a frame. */

/* Passes a frame to one controller or to all controllers (struct board_bus_ops). */
static void moteus_bus_receive(struct boards *boards, struct board_bus *bus,
                               const struct bus_frame *frame)
{
    unsigned destination = frame->id & 0xff;
    bool all = destination == MOTEUS_BROADCAST;
    enum board_verdict verdict = BOARD_OBEYED;
    struct board *listener = NULL;

    /* Identifier bits above the two addresses must be 0 */
    for (unsigned address = 1; address < BOARD_ADDRESSES && frame->id <= 0xffff; address++) {
        struct board *board = bus->by_address[address];

        if (board && (all || address == destination) && !board_is_deaf(board)) {
            listener = board;
            board_hear(board);

            /* Execute the frame and queue the reply */
            struct moteus_exchange x = {.board = board,
                                        .frame = frame,
                                        .verdict = BOARD_OBEYED,
                                        .replies = frame->id & MOTEUS_WANTS_REPLY};

            while (x.at < frame->len && moteus_serve_subframe(&x)) {
            }
            if (x.commands && !x.discard) {
                moteus_board_command(board);
            }
            /* Reply in the format of the request. A reply that is too long for it is CAN FD */
            if (x.replies && !x.discard) {
                uint32_t id = moteus_id(board->address, frame->id >> 8 & 0x7f);
                uint8_t length = frame_fd_length(x.used);
                unsigned flags = (frame->flags & (FRAME_FD | FRAME_BRS)) |
                                 (length > 8 ? FRAME_FD : 0) | (id > 0x7ff ? FRAME_EXTENDED : 0);

                memset(x.reply + x.used, MOTEUS_NOP, length - x.used);
                board_queue_as(board, id, (uint8_t)flags, length, x.reply);
            }
            verdict = x.verdict;
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

const struct board_bus_ops moteus_bus_ops = {
    .size = sizeof(struct board_bus),
    .extended = true,
    .receive = moteus_bus_receive,
};
