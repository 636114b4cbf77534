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
 * How references become PWM, once a millisecond:
 * - voltage (open loop): the reference itself;
 * - current: PID (SET_CURRENT_PID) on mA; the reference is SET_DESIRED_TORQUE, read as mA;
 * - torque: PID (SET_TORQUE_PID) + offset on torque counts;
 * - position: PID (SET_POSITION_PID) + offset + stiction while a move is under way, on ticks; the
 *   reference moves by the trajectory generator (POSITION_MOVE), in velocity mode by the velocity
 *   reference, in mixed mode by both, in direct mode it jumps;
 * - impedance (its two modes, or any position-like mode when the interaction mode is compliant):
 *   torque reference = stiffness * error + damping * change of error + offset, then as torque.
 * Each PID is cut to its own limit, everything to the PWM limit and the full scale. Gains are zero
 * at power-up, so that a board holds nothing before the host has configured it.
 *
 * Calibration is that of the firmware whose version the board tells: type 3 (absolute encoder)
 * takes p3 as the encoder's zero. A p2 of 0 is invalid and makes a fault.
 *
 * A strict board does what the firmware does also where that is odd. It drives its bridge only
 * after a host has told a fitting protocol (GET_FIRMWARE_VERSION) and all seven parameters of the
 * position PID before it left idle; without them STATUS tells the mode, but nothing moves. It has
 * no current mode. A mode that it does not have resets the references of a running axis and nothing
 * else; from idle it leads to position mode. PRINT tells of every change.
 *
 * Over-current is an I2t law, as the firmware's: the motor may be above its limit by as much as
 * integral (I^2 - limit^2) dt = limit^2 * 10 ms, then the axis trips. At twice the limit that takes
 * 4 ms, at 3.4 times a single sample; the inrush of a voltage step, over within a few milliseconds,
 * passes.
 */
#include "boards/board_private.h"
#include "boards/motor_control.h"

#include "canbus/frame.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    BOARD_AXES = 2,
    ALL_PIDS = 0x7f,       /* SET_P_GAIN ... SET_OUTPUT_LIMIT have all come */
    CALIBRATION_MS = 100,  /* how long CALIBRATE_ENCODER takes */
    OVERLOAD_MS = 10,      /* budget of over-current, see above */
    POLICY_AT_START = 0x7f /* what a host usually asks for */
};

struct encoder {
    int32_t raw;
    struct speed_estimator speed;
};

struct motor_axis {
    int64_t parameter[ICUB_P_COUNT];
    int64_t saved[ICUB_P_SAVED]; /* flash */
    uint8_t mode;
    uint8_t faults;      /* as long as their cause lasts */
    uint8_t faults_once; /* until STATUS has told them */
    uint8_t pids;        /* which parameters of the position PID have come; bits */
    bool pads;           /* the bridge's drivers are enabled */
    bool sensors_bad;    /* no number came from the plant */
    bool limit_told;     /* the refusal at a joint limit has been reported */
    struct encoder joint, motor;
    int32_t offset; /* position = raw + offset */
    double current_a, torque_nm;
    double overload; /* integral of (I / limit)^2 - 1, ms */

    int32_t desired;          /* position reference of this millisecond */
    int64_t desired_velocity; /* ramped velocity reference */
    int64_t velocity_rest;    /* what is less than a tick */
    struct trajectory trajectory;
    struct pid position_pid, torque_pid, current_pid, impedance;
    int64_t torque_reference, torque; /* counts */
    int64_t output, pwm;              /* of the law, and after the PWM limit */

    int64_t voltage_ns, torque_ns, velocity_ns; /* when the reference was last commanded */
    int64_t source_ns;                          /* when the torque source was chosen */
    int64_t calibrated_ns;                      /* end of the calibration */
    int32_t calibration_zero;
};

struct motor_board {
    struct motor_axis axis[BOARD_AXES];
    double supply_v;
    uint32_t policy;
    int64_t sampled_ms, status_ms;
    uint8_t text; /* number of the last PRINT */
    bool status_due, additional_due;
    bool protocol_ack;     /* the host speaks our protocol */
    bool powered, started; /* has had its first power-up; its first sample */
};

struct motor_board *motor_board_create(struct arena *arena)
{
    return arena_alloc(arena, 1, sizeof(struct motor_board));
}

static unsigned index_of(const struct board *board, const struct motor_axis *axis)
{
    return (unsigned)(axis - board->motor->axis);
}

static const struct board_axis_config *config_of(const struct board *board,
                                                 const struct motor_axis *axis)
{
    return &board->config.axis[index_of(board, axis)];
}

static int32_t position_of(const struct motor_axis *axis)
{
    return (int32_t)control_clamp((int64_t)axis->joint.raw + axis->offset, INT32_MIN, INT32_MAX);
}

static int64_t milliamperes(const struct motor_axis *axis)
{
    int32_t value = 0;

    control_quantize(axis->current_a * 1e3, &value);
    return value;
}

static bool runs(uint8_t mode)
{
    return mode != ICUB_MODE_IDLE && mode != ICUB_MODE_HARDWARE_FAULT;
}

/* A text for whoever watches the bus, in PRINT frames of six characters. */
static void print(struct board *board, const char *text)
{
    struct motor_board *motor = board->motor;
    size_t left = strlen(text);
    uint32_t id = icub_id(ICUB_PERIODIC_MOTOR, board->address, ICUB_PRINT);

    if (!(motor->policy >> (ICUB_PRINT - 1) & 1)) {
        return;
    }
    motor->text = (motor->text + 1) & 0xf;
    for (uint8_t part = 0; left > 0; part++) {
        uint8_t data[8] = {ICUB_PRINT, (uint8_t)(motor->text << 4 | part)};
        size_t size = left < 6 ? left : 6;

        memcpy(data + 2, text, size);
        text += size;
        left -= size;
        data[0] |= left ? 0 : 0x80;
        board_queue(board, id, (uint8_t)(2 + size), data);
    }
}

/* ---- modes ---- */

static void hold_position(struct motor_axis *axis)
{
    axis->desired = position_of(axis);
    axis->parameter[ICUB_P_DESIRED_POSITION] = axis->desired;
    trajectory_stop(&axis->trajectory, axis->desired);
}

/* The axis stays where it is, with nothing left of earlier commands. */
static void reset_references(struct board *board, struct motor_axis *axis)
{
    int64_t now = board->boards->time_ns;

    hold_position(axis);
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
    axis->limit_told = false;
}

static void set_mode(struct board *board, struct motor_axis *axis, uint8_t mode)
{
    if (mode != axis->mode) {
        board_event(board, BOARD_EVENT_MODE, index_of(board, axis), axis->mode, mode);
        axis->mode = mode;
        board->motor->status_due = true;
    }
    reset_references(board, axis);
}

static bool is_control_mode(int64_t mode)
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

/* The drivers of the bridge, as a strict board enables them. */
static bool enable_pads(struct board *board, struct motor_axis *axis)
{
    char text[32];

    if (!board->motor->protocol_ack) {
        print(board, "can protocol NOT ack");
        return false;
    }
    if (axis->pids != ALL_PIDS) {
        snprintf(text, sizeof text, "PID IS NOT SET %u", index_of(board, axis));
        print(board, text);
        return false;
    }
    snprintf(text, sizeof text, "PWM ENA:%u", index_of(board, axis));
    print(board, text);
    return true;
}

static void disable_pads(struct board *board, struct motor_axis *axis)
{
    char text[32];

    axis->pads = false;
    snprintf(text, sizeof text, "PWM DIS:%u", index_of(board, axis));
    print(board, text);
    set_mode(board, axis, ICUB_MODE_IDLE);
}

static bool command_mode_strictly(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;
    bool known = is_control_mode(mode) && mode != ICUB_MODE_CURRENT;
    char text[32];

    if (axis->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode != ICUB_MODE_FORCE_IDLE) {
            return true;
        }
        disable_pads(board, axis);
    } else if (axis->mode == ICUB_MODE_IDLE) {
        if (stop) {
            return true;
        }
        axis->pads = enable_pads(board, axis);
        set_mode(board, axis,
                 known        ? (uint8_t)mode
                 : axis->pads ? ICUB_MODE_POSITION
                              : ICUB_MODE_HARDWARE_FAULT);
    } else if (stop) {
        disable_pads(board, axis);
    } else {
        set_mode(board, axis, known ? (uint8_t)mode : axis->mode);
    }
    snprintf(text, sizeof text, "CTRLMODE SET:%u", (unsigned)mode);
    print(board, text);
    return true;
}

static bool command_mode(struct board *board, struct motor_axis *axis, int64_t mode)
{
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    if (board->config.strict) {
        return command_mode_strictly(board, axis, mode);
    }
    if (!stop && !is_control_mode(mode)) {
        return false;
    }
    axis->pads = true;
    if (axis->mode == ICUB_MODE_IDLE) {
        if (!stop) {
            set_mode(board, axis, (uint8_t)mode);
        }
    } else if (axis->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode == ICUB_MODE_FORCE_IDLE) {
            set_mode(board, axis, ICUB_MODE_IDLE);
        }
    } else {
        set_mode(board, axis, stop ? ICUB_MODE_IDLE : (uint8_t)mode);
    }
    return true;
}

static bool moves(const struct motor_axis *axis)
{
    return axis->mode == ICUB_MODE_POSITION || axis->mode == ICUB_MODE_IMPEDANCE_POSITION ||
           axis->mode == ICUB_MODE_MIXED;
}

static bool has_velocity(const struct motor_axis *axis)
{
    return axis->mode == ICUB_MODE_VELOCITY || axis->mode == ICUB_MODE_IMPEDANCE_VELOCITY ||
           axis->mode == ICUB_MODE_MIXED;
}

static bool is_impedance(const struct motor_axis *axis)
{
    if (axis->mode == ICUB_MODE_IMPEDANCE_POSITION || axis->mode == ICUB_MODE_IMPEDANCE_VELOCITY) {
        return true;
    }
    return axis->parameter[ICUB_P_INTERACTION] == ICUB_COMPLIANT &&
           (moves(axis) || has_velocity(axis) || axis->mode == ICUB_MODE_DIRECT);
}

/* ---- power-up ---- */

static void set_defaults(const struct board *board, struct motor_axis *axis)
{
    const struct board_axis_config *config = config_of(board, axis);
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
    control_quantize(floor(config->lower_rad * config->joint_ticks_per_rad), &limit);
    p[ICUB_P_MIN_POSITION] = limit;
    control_quantize(ceil(config->upper_rad * config->joint_ticks_per_rad), &limit);
    p[ICUB_P_MAX_POSITION] = limit;
    control_quantize(config->current_limit_a * 1e3, &limit);
    p[ICUB_P_CURRENT_LIMIT] = limit;
}

static void power_up(struct board *board)
{
    struct motor_board *motor = board->motor;

    for (int i = 0; i < BOARD_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        set_defaults(board, axis);
        if (!motor->powered) {
            memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        }
        axis->mode = ICUB_MODE_IDLE;
        axis->faults = axis->faults_once = 0;
        axis->pids = 0;
        axis->pads = false;
        axis->offset = 0;
        axis->source_ns = board->boards->time_ns;
        reset_references(board, axis);
    }
    motor->powered = true;
    motor->protocol_ack = false;
    motor->policy = board->config.transmit_at_start ? POLICY_AT_START : 0;
    motor->status_due = motor->additional_due = false;
    motor->status_ms = board->boards->time_ns / MS;
}

static void switch_off(struct board *board)
{
    for (int i = 0; i < BOARD_AXES; i++) {
        if (runs(board->motor->axis[i].mode)) {
            set_mode(board, &board->motor->axis[i], ICUB_MODE_IDLE);
        }
    }
}

static void discovered(struct board *board)
{
    if (board->config.discovery_stops_motors) {
        switch_off(board);
        board->motor->policy = 0;
    }
}

/* ---- commands ---- */

static int64_t in_limits(const struct motor_axis *axis, int64_t position)
{
    const int64_t *p = axis->parameter;

    return position < p[ICUB_P_MIN_POSITION]   ? p[ICUB_P_MIN_POSITION]
           : position > p[ICUB_P_MAX_POSITION] ? p[ICUB_P_MAX_POSITION]
                                               : position;
}

static void position_move(struct motor_axis *axis, int64_t target, int64_t speed)
{
    if (!moves(axis)) {
        return;
    }
    target = in_limits(axis, target);
    axis->parameter[ICUB_P_DESIRED_POSITION] = target;
    axis->trajectory.position = axis->desired;
    trajectory_start(&axis->trajectory, (int32_t)target, speed);
}

static void velocity_move(struct board *board, struct motor_axis *axis, const int64_t *request)
{
    if (has_velocity(axis)) {
        axis->parameter[ICUB_P_DESIRED_VELOCITY] = request[0];
        axis->parameter[ICUB_P_DESIRED_ACCELERATION] = request[1];
        axis->velocity_ns = board->boards->time_ns;
    }
}

static void stop_trajectory(struct motor_axis *axis)
{
    if (moves(axis) || has_velocity(axis)) {
        axis->parameter[ICUB_P_DESIRED_VELOCITY] = 0;
        axis->desired_velocity = axis->velocity_rest = 0;
        hold_position(axis);
    }
}

/* The present position shall read value; references keep their distance to it. */
static void set_encoder(struct motor_axis *axis, int64_t value)
{
    int64_t change = value - position_of(axis);

    axis->offset = (int32_t)control_clamp(axis->offset + change, INT32_MIN, INT32_MAX);
    axis->desired = (int32_t)control_clamp(axis->desired + change, INT32_MIN, INT32_MAX);
    axis->parameter[ICUB_P_DESIRED_POSITION] = axis->desired;
    trajectory_stop(&axis->trajectory, axis->desired);
}

static bool calibrate(struct board *board, struct motor_axis *axis, const int64_t *request)
{
    if (request[0] != ICUB_CALIBRATE_ABSOLUTE) {
        return false;
    }
    if (request[2] == 0) {
        print(board, "invalid calib p2");
        set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    } else if (axis->mode != ICUB_MODE_HARDWARE_FAULT) {
        set_mode(board, axis, ICUB_MODE_CALIBRATION);
        axis->calibration_zero = (int32_t)request[3];
        axis->calibrated_ns = board->boards->time_ns + (int64_t)CALIBRATION_MS * MS;
    }
    return true;
}

static void tell_firmware(const struct board *board, const int64_t *host, int64_t *reply)
{
    reply[0] = board->ops->type;
    reply[1] = board->ops->major;
    reply[2] = board->ops->minor;
    reply[3] = board->ops->build;
    reply[4] = ICUB_PROTOCOL_MAJOR;
    reply[5] = ICUB_PROTOCOL_MINOR;
    reply[6] = board->motor->protocol_ack =
        host[0] == ICUB_PROTOCOL_MAJOR && host[1] <= ICUB_PROTOCOL_MINOR;
}

/* The parameters of the position PID that a command brings: P, D, I, integral limit, offset, scale,
 * output limit. */
static uint8_t pid_bits(unsigned code)
{
    switch (code) {
    case ICUB_SET_P_GAIN:
        return 1 << 0;
    case ICUB_SET_D_GAIN:
        return 1 << 1;
    case ICUB_SET_I_GAIN:
        return 1 << 2;
    case ICUB_SET_I_LIMIT:
        return 1 << 3;
    case ICUB_SET_OFFSET:
        return 1 << 4;
    case ICUB_SET_SCALE:
        return 1 << 5;
    case ICUB_SET_OUTPUT_LIMIT:
        return 1 << 6;
    case ICUB_SET_POSITION_PID:
        return 1 << 0 | 1 << 1 | 1 << 2 | 1 << 5;
    case ICUB_SET_POSITION_PID_LIMITS:
        return 1 << 3 | 1 << 4 | 1 << 6;
    default:
        return 0;
    }
}

/* What a parameter's new value means beyond being kept. */
static void parameter_set(struct board *board, struct motor_axis *axis, unsigned code)
{
    int64_t now = board->boards->time_ns;

    axis->pids |= pid_bits(code);
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
        board->motor->additional_due = true;
        break;
    default:
        break;
    }
}

/* Commands that ask for the state of an axis. */
static bool tell(const struct board *board, const struct motor_axis *axis, unsigned code,
                 int64_t *reply)
{
    const int64_t *p = axis->parameter;

    switch (code) {
    case ICUB_GET_CONTROL_MODE:
        reply[0] = axis->mode;
        return true;
    case ICUB_MOTION_DONE:
        reply[0] = !axis->trajectory.running && axis->mode != ICUB_MODE_CALIBRATION;
        return true;
    case ICUB_GET_ENCODER_POSITION:
        reply[0] = position_of(axis);
        reply[1] = estimator_speed(&axis->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]);
        return true;
    case ICUB_GET_ENCODER_VELOCITY:
        reply[0] = estimator_speed(&axis->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]);
        return true;
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

/* Commands that make an axis do something. */
static bool act(struct board *board, struct motor_axis *axis, unsigned code, const int64_t *request)
{
    switch (code) {
    case ICUB_CALIBRATE_ENCODER:
        return calibrate(board, axis, request);
    case ICUB_SET_CONTROL_MODE:
        return command_mode(board, axis, request[0]);
    case ICUB_WRITE_FLASH:
        memcpy(axis->saved, axis->parameter, sizeof axis->saved);
        return true;
    case ICUB_READ_FLASH:
        memcpy(axis->parameter, axis->saved, sizeof axis->saved);
        return true;
    case ICUB_POSITION_MOVE:
        position_move(axis, request[0], request[1]);
        return true;
    case ICUB_VELOCITY_MOVE:
        velocity_move(board, axis, request);
        return true;
    case ICUB_SET_ENCODER_POSITION:
        set_encoder(axis, request[0]);
        return true;
    case ICUB_SET_DESIRED_TORQUE:
        axis->parameter[ICUB_P_DESIRED_TORQUE] = control_clamp(request[0], INT16_MIN, INT16_MAX);
        axis->torque_ns = board->boards->time_ns;
        return true;
    case ICUB_STOP_TRAJECTORY:
        stop_trajectory(axis);
        return true;
    case ICUB_SET_COMMAND_POSITION:
        if (axis->mode == ICUB_MODE_DIRECT) {
            axis->desired = (int32_t)in_limits(axis, request[0]);
        }
        return true;
    case ICUB_TOGGLE_VERBOSE: /* of the serial port, which is not here */
        return true;
    default:
        return false;
    }
}

static bool obey_board(struct board *board, const struct bus_frame *frame, unsigned code,
                       const int64_t *request, int64_t *reply, bool *answer)
{
    switch (code) {
    case ICUB_GET_INFO:
        board_queue_info(board, icub_id(ICUB_POLLING_MOTOR, board->address, frame->id >> 4));
        *answer = false;
        return true;
    case ICUB_SET_INFO:
        board_set_info(board, request);
        return true;
    case ICUB_SET_BOARD_ID:
        return board_set_address(board, (uint8_t)request[0]);
    case ICUB_SET_BROADCAST_POLICY:
        board->motor->policy = (uint32_t)request[0];
        return true;
    case ICUB_GET_FIRMWARE_VERSION:
        tell_firmware(board, request, reply);
        return true;
    default:
        return false;
    }
}

static bool command(struct board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer)
{
    unsigned code = frame->data[0] & ~(unsigned)ICUB_AXIS_BIT;
    struct motor_axis *axis = &board->motor->axis[frame->data[0] & ICUB_AXIS_BIT ? 1 : 0];
    const struct icub_command *row = &icub_motor_commands[code];
    int64_t *parameter = &axis->parameter[row->parameter];

    switch (row->kind) {
    case ICUB_SET:
        memcpy(parameter, request, fields_count(row->request) * sizeof *parameter);
        parameter_set(board, axis, code);
        return true;
    case ICUB_GET:
        memcpy(reply, parameter, fields_count(row->reply) * sizeof *parameter);
        return true;
    case ICUB_DO:
    case ICUB_NO_COMMAND:
        break;
    }
    return obey_board(board, frame, code, request, reply, answer) ||
           tell(board, axis, code, reply) || act(board, axis, code, request);
}

/* ---- sensors ---- */

static void sample_axis(struct motor_axis *axis, const struct board_axis_config *config,
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
}

static void sample(struct board *board, const struct plant_sensors *sensors)
{
    struct motor_board *motor = board->motor;
    int64_t now_ms = board->boards->time_ns / MS;

    motor->supply_v =
        isfinite(sensors->supply_v) && sensors->supply_v > 0.0 ? sensors->supply_v : 0.0;
    for (int i = 0; i < BOARD_AXES; i++) {
        struct motor_axis *axis = &motor->axis[i];

        sample_axis(axis, &board->config.axis[i], sensors);
        if (!motor->started) {
            estimator_reset(&axis->joint.speed, axis->joint.raw);
            estimator_reset(&axis->motor.speed, axis->motor.raw);
            hold_position(axis);
        }
        for (int64_t ms = motor->sampled_ms; ms < now_ms; ms++) {
            estimator_push(&axis->joint.speed, axis->joint.raw);
            estimator_push(&axis->motor.speed, axis->motor.raw);
        }
    }
    motor->started = true;
    motor->sampled_ms = now_ms;
}

/* ---- faults and time-outs ---- */

static bool is_over_current(const struct board *board, struct motor_axis *axis)
{
    double limit = (double)axis->parameter[ICUB_P_CURRENT_LIMIT] * 1e-3;
    double tick_ms = (double)board->boards->tick_ns / MS;

    if (!runs(axis->mode)) {
        axis->overload = 0.0;
        return false;
    }
    if (limit == 0.0) {
        return axis->current_a != 0.0;
    }
    axis->overload += (axis->current_a * axis->current_a / (limit * limit) - 1.0) * tick_ms;
    axis->overload = fmax(axis->overload, 0.0);
    return axis->overload > OVERLOAD_MS;
}

static void watch_faults(struct board *board, struct motor_axis *axis)
{
    uint8_t faults =
        (uint8_t)((board->motor->supply_v < BOARD_UNDER_VOLTAGE_V ? ICUB_FAULT_UNDER_VOLTAGE : 0) |
                  (axis->sensors_bad ? ICUB_FAULT_ABSOLUTE_ENCODER : 0));
    uint8_t risen = faults & (uint8_t)~axis->faults;
    bool over_current = is_over_current(board, axis);

    axis->faults = faults;
    if (over_current) {
        axis->faults_once |= ICUB_FAULT_OVER_CURRENT;
        risen |= ICUB_FAULT_OVER_CURRENT;
        board->boards->counters.trips++;
        print(board, "OVERCURRENT");
    }
    if (risen) {
        board_event(board, BOARD_EVENT_FAULT, index_of(board, axis), risen, 0);
        board->motor->status_due = true;
    }
    if (runs(axis->mode) && (faults || over_current)) {
        set_mode(board, axis, ICUB_MODE_HARDWARE_FAULT);
    }
}

static void went_stale(struct board *board, struct motor_axis *axis, enum icub_parameter reference)
{
    axis->parameter[reference] = 0;
    board->boards->counters.timeouts++;
    board_event(board, BOARD_EVENT_TIMEOUT, index_of(board, axis), axis->mode, 0);
}

/* Our safety time-out, which no strict board has. */
static void watch_references(struct board *board, struct motor_axis *axis)
{
    bool voltage = axis->mode == ICUB_MODE_OPEN_LOOP;
    bool torque = axis->mode == ICUB_MODE_TORQUE || axis->mode == ICUB_MODE_CURRENT;
    enum icub_parameter reference = voltage ? ICUB_P_OPEN_LOOP : ICUB_P_DESIRED_TORQUE;
    int64_t age = board->boards->time_ns - (voltage ? axis->voltage_ns : axis->torque_ns);

    if ((voltage || torque) && !board->config.strict && board->config.command_timeout_ns > 0 &&
        age > board->config.command_timeout_ns && axis->parameter[reference] != 0) {
        went_stale(board, axis, reference);
        print(board, "REFERENCE TIMEOUT");
    }
}

static void watch_velocity(struct board *board, struct motor_axis *axis)
{
    int64_t age = board->boards->time_ns - axis->velocity_ns;

    if (has_velocity(axis) && axis->parameter[ICUB_P_DESIRED_VELOCITY] != 0 &&
        age > axis->parameter[ICUB_P_VELOCITY_TIMEOUT] * MS) {
        went_stale(board, axis, ICUB_P_DESIRED_VELOCITY);
        print(board, "VELOCITY TIMEOUT");
    }
}

static bool source_is_safe(const struct board *board, const struct motor_axis *axis)
{
    int64_t address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    const struct torque_source *source = &board->bus->source[address];
    int64_t since = axis->source_ns;

    if (address == 0) {
        return config_of(board, axis)->torque_full_scale_nm > 0.0;
    }
    if (source->heard && source->time_ns > since) {
        since = source->time_ns;
    }
    return board->boards->time_ns - since <= (int64_t)ICUB_STRAIN_SAFE_MS * MS;
}

static void watch_source(struct board *board, struct motor_axis *axis)
{
    if ((axis->mode == ICUB_MODE_TORQUE || is_impedance(axis)) && !source_is_safe(board, axis)) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_SOURCE_LOST, index_of(board, axis),
                    (uint32_t)axis->parameter[ICUB_P_TORQUE_SOURCE], 0);
        print(board, "STRAIN WATCHDOG");
        set_mode(board, axis, ICUB_MODE_IDLE);
    }
}

/* Beyond a limit the firmware refuses any voltage, also that which would lead back. */
static void watch_limits(struct board *board, struct motor_axis *axis)
{
    int32_t position = position_of(axis);
    bool beyond = position < axis->parameter[ICUB_P_MIN_POSITION] ||
                  position > axis->parameter[ICUB_P_MAX_POSITION];

    if (!beyond) {
        axis->limit_told = false;
    } else if (axis->mode == ICUB_MODE_OPEN_LOOP && axis->parameter[ICUB_P_OPEN_LOOP] != 0) {
        axis->parameter[ICUB_P_OPEN_LOOP] = 0;
        if (!axis->limit_told) {
            axis->limit_told = true;
            board_event(board, BOARD_EVENT_LIMIT, index_of(board, axis), (uint32_t)position, 0);
            print(board, "OUT OF LIMITS");
        }
    }
}

static void watch_calibration(struct board *board, struct motor_axis *axis)
{
    if (axis->mode == ICUB_MODE_CALIBRATION && board->boards->time_ns >= axis->calibrated_ns) {
        axis->offset = -axis->calibration_zero;
        set_mode(board, axis, ICUB_MODE_IDLE);
    }
}

/* ---- control laws ---- */

static int64_t cut(int64_t value, int64_t limit)
{
    int64_t most = control_clamp(limit, 0, ICUB_PWM_FULL_SCALE);

    return control_clamp(value, -most, most);
}

/* Ticks that the velocity reference is worth in this millisecond. */
static int64_t velocity_step(struct motor_axis *axis)
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

/* Moves the position reference on; it never moves (further) out of the limits. */
static void advance(struct motor_axis *axis)
{
    int64_t *p = axis->parameter;
    int64_t step = moves(axis) ? trajectory_step(&axis->trajectory) : 0;
    int64_t desired;

    if (has_velocity(axis)) {
        step += velocity_step(axis);
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

static int64_t position_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_POSITION_KP], p[ICUB_P_POSITION_KI],
                                    p[ICUB_P_POSITION_KD], p[ICUB_P_POSITION_SHIFT],
                                    p[ICUB_P_POSITION_INTEGRAL_LIMIT]};
    int64_t pwm = pid_step(&axis->position_pid, &gains, (int64_t)axis->desired - position_of(axis));

    pwm += p[ICUB_P_POSITION_OFFSET];
    if (axis->trajectory.running && axis->trajectory.target != axis->trajectory.start) {
        pwm += axis->trajectory.target > axis->trajectory.start ? p[ICUB_P_POSITION_STICTION_UP]
                                                                : p[ICUB_P_POSITION_STICTION_DOWN];
    }
    return cut(pwm, p[ICUB_P_POSITION_LIMIT]);
}

static int64_t torque_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_TORQUE_KP], p[ICUB_P_TORQUE_KI], p[ICUB_P_TORQUE_KD],
                                    p[ICUB_P_TORQUE_SHIFT], p[ICUB_P_TORQUE_INTEGRAL_LIMIT]};
    int64_t pwm = pid_step(&axis->torque_pid, &gains, axis->torque_reference - axis->torque);

    return cut(pwm + p[ICUB_P_TORQUE_OFFSET], p[ICUB_P_TORQUE_LIMIT]);
}

static int64_t current_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {p[ICUB_P_CURRENT_KP], p[ICUB_P_CURRENT_KI],
                                    p[ICUB_P_CURRENT_KD], p[ICUB_P_CURRENT_SHIFT], INT16_MAX};

    return pid_step(&axis->current_pid, &gains, p[ICUB_P_DESIRED_TORQUE] - milliamperes(axis));
}

static int64_t impedance_law(struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;
    const struct pid_gains gains = {.kp = p[ICUB_P_STIFFNESS], .kd = p[ICUB_P_DAMPING]};

    axis->torque_reference =
        pid_step(&axis->impedance, &gains, (int64_t)axis->desired - position_of(axis)) +
        p[ICUB_P_IMPEDANCE_OFFSET];
    return torque_law(axis);
}

static int64_t measured_torque(const struct board *board, const struct motor_axis *axis)
{
    const struct board_axis_config *config = config_of(board, axis);
    int64_t address = axis->parameter[ICUB_P_TORQUE_SOURCE];
    int32_t counts = 0;

    if (address != 0) {
        return board->bus->source[address].value[axis->parameter[ICUB_P_TORQUE_CHANNEL]];
    }
    if (config->torque_full_scale_nm > 0.0) {
        control_quantize(axis->torque_nm / config->torque_full_scale_nm * ICUB_STRAIN_ZERO,
                         &counts);
    }
    return control_clamp(counts, INT16_MIN, INT16_MAX);
}

/* One millisecond of the board's loop. */
static void step(const struct board *board, struct motor_axis *axis)
{
    const int64_t *p = axis->parameter;

    axis->torque = measured_torque(board, axis);
    switch (axis->mode) {
    case ICUB_MODE_OPEN_LOOP:
        axis->output = p[ICUB_P_OPEN_LOOP];
        break;
    case ICUB_MODE_CURRENT:
        axis->output = current_law(axis);
        break;
    case ICUB_MODE_TORQUE:
        axis->torque_reference = p[ICUB_P_DESIRED_TORQUE];
        axis->output = torque_law(axis);
        break;
    case ICUB_MODE_IDLE:
    case ICUB_MODE_HARDWARE_FAULT:
    case ICUB_MODE_CALIBRATION:
        axis->output = 0;
        break;
    default:
        advance(axis);
        axis->output = is_impedance(axis) ? impedance_law(axis) : position_law(axis);
        break;
    }
    axis->output = cut(axis->output, ICUB_PWM_FULL_SCALE);
    axis->pwm = cut(axis->output, p[ICUB_P_PWM_LIMIT]);
}

static void drive(const struct board *board, const struct motor_axis *axis,
                  struct plant_command *command)
{
    int joint = config_of(board, axis)->joint;
    bool on = runs(axis->mode) && axis->mode != ICUB_MODE_CALIBRATION && axis->pads;

    if (joint >= 0) {
        command->motor[joint].bridge_on = on;
        command->motor[joint].voltage_v =
            on ? (double)axis->pwm / ICUB_PWM_FULL_SCALE * board->motor->supply_v : 0.0;
    }
}

static void control(struct board *board, struct ms_span span, struct plant_command *command)
{
    for (int i = 0; i < BOARD_AXES; i++) {
        struct motor_axis *axis = &board->motor->axis[i];

        watch_faults(board, axis);
        watch_calibration(board, axis);
        watch_source(board, axis);
        watch_references(board, axis);
        watch_velocity(board, axis);
        watch_limits(board, axis);
        for (int64_t ms = span.from; ms < span.to; ms++) {
            step(board, axis);
        }
        drive(board, axis, command);
    }
}

static bool fault(const struct board *board)
{
    for (int i = 0; i < BOARD_AXES; i++) {
        if (board->motor->axis[i].mode == ICUB_MODE_HARDWARE_FAULT) {
            return true;
        }
    }
    return false;
}

static void shut_down(struct board *board, struct plant_command *command)
{
    switch_off(board);
    for (int i = 0; i < BOARD_AXES; i++) {
        drive(board, &board->motor->axis[i], command);
    }
}

/* ---- periodic frames ---- */

static bool wanted(const struct motor_board *motor, enum icub_motor_type type)
{
    return motor->policy >> (type - 1) & 1;
}

static void send(struct board *board, struct frame_sink *sink, enum icub_motor_type type,
                 const int64_t *values)
{
    const struct icub_frame_type *row = &icub_motor_frames[type];
    uint8_t data[8];

    fields_encode(row->fields, values, data);
    board_send(board, sink, icub_id(ICUB_PERIODIC_MOTOR, board->address, type), row->length, data);
}

static void send_wanted(struct board *board, struct frame_sink *sink, enum icub_motor_type type,
                        int64_t v0, int64_t v1, int64_t v2, int64_t v3)
{
    if (wanted(board->motor, type)) {
        send(board, sink, type, (const int64_t[]){v0, v1, v2, v3});
    }
}

static void send_status(struct board *board, struct frame_sink *sink, int64_t now_ms)
{
    struct motor_board *motor = board->motor;
    struct motor_axis *a = &motor->axis[0], *b = &motor->axis[1];
    bool periodic = now_ms - motor->status_ms >= ICUB_STATUS_PERIOD_MS;
    uint8_t lasting = (a->faults | b->faults) &
                      (ICUB_FAULT_UNDER_VOLTAGE | ICUB_FAULT_OVER_VOLTAGE | ICUB_FAULT_EXTERNAL);
    bool now = motor->status_due || periodic || lasting || board->lost_in_status;

    if (!wanted(motor, ICUB_STATUS)) {
        return;
    }
    if (now) {
        send(board, sink, ICUB_STATUS,
             (const int64_t[]){a->faults | a->faults_once, a->mode, b->faults | b->faults_once,
                               b->mode, board->lost_in_status ? ICUB_CAN_TX_OVERFLOW : 0, 0, 0, 0});
        a->faults_once = b->faults_once = 0;
        motor->status_due = board->lost_in_status = false;
        motor->status_ms = periodic ? now_ms : motor->status_ms;
    }
    if (now || motor->additional_due) {
        send(board, sink, ICUB_ADDITIONAL_STATUS,
             (const int64_t[]){a->parameter[ICUB_P_INTERACTION] | b->parameter[ICUB_P_INTERACTION]
                                                                      << 4});
        motor->additional_due = false;
    }
}

static void send_speeds(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &board->motor->axis[0], *b = &board->motor->axis[1];
    const int64_t *p = a->parameter, *q = b->parameter;

    send_wanted(board, sink, ICUB_VELOCITY,
                estimator_speed(&a->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]),
                estimator_speed(&b->joint.speed, q[ICUB_P_JOINT_SPEED_SHIFT]),
                estimator_acceleration(&a->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT] +
                                                            p[ICUB_P_JOINT_ACCELERATION_SHIFT]),
                estimator_acceleration(&b->joint.speed, q[ICUB_P_JOINT_SPEED_SHIFT] +
                                                            q[ICUB_P_JOINT_ACCELERATION_SHIFT]));
}

static void send_motor_speeds(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &board->motor->axis[0], *b = &board->motor->axis[1];
    const int64_t *p = a->parameter, *q = b->parameter;

    send_wanted(board, sink, ICUB_MOTOR_SPEED,
                estimator_speed(&a->motor.speed, p[ICUB_P_MOTOR_SPEED_SHIFT]),
                estimator_speed(&b->motor.speed, q[ICUB_P_MOTOR_SPEED_SHIFT]),
                estimator_acceleration(&a->motor.speed, p[ICUB_P_MOTOR_SPEED_SHIFT] +
                                                            p[ICUB_P_MOTOR_ACCELERATION_SHIFT]),
                estimator_acceleration(&b->motor.speed, q[ICUB_P_MOTOR_SPEED_SHIFT] +
                                                            q[ICUB_P_MOTOR_ACCELERATION_SHIFT]));
}

static void send_slot_3(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &board->motor->axis[0], *b = &board->motor->axis[1];

    send_wanted(board, sink, ICUB_CURRENT, milliamperes(a), milliamperes(b), 0, 0);
    if (board->lost_in_overflow && wanted(board->motor, ICUB_OVERFLOW)) {
        board->lost_in_overflow = false;
        send(board, sink, ICUB_OVERFLOW, NULL);
    }
    send_speeds(board, sink);
    send_wanted(board, sink, ICUB_PID_ERROR, a->position_pid.error, b->position_pid.error,
                a->torque_pid.error, b->torque_pid.error);
    send_wanted(board, sink, ICUB_DEBUG, a->torque, b->torque, a->torque_reference,
                b->torque_reference);
    send_wanted(board, sink, ICUB_MOTOR_POSITION, a->motor.raw, b->motor.raw, 0, 0);
    send_motor_speeds(board, sink);
}

static void transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    const struct motor_axis *a = &board->motor->axis[0], *b = &board->motor->axis[1];
    unsigned slots = 0;

    for (int64_t ms = span.from; ms < span.to && ms < span.from + ICUB_SLOTS; ms++) {
        slots |= 1u << ms % ICUB_SLOTS;
    }
    if (slots & 1u << 0) {
        send_wanted(board, sink, ICUB_POSITION, position_of(a), position_of(b), 0, 0);
    }
    if (slots & 1u << 1) {
        send_wanted(board, sink, ICUB_PID_VALUE, a->output, b->output, a->pwm, b->pwm);
    }
    if (slots & 1u << 2) {
        send_status(board, sink, span.to);
    }
    if (slots & 1u << 3) {
        send_slot_3(board, sink);
    }
}

const struct board_ops motor_board_ops = {
    .type = ICUB_BOARD_BLL,
    .major = 2,
    .minor = 0x51,
    .build = 60,
    .periodic_max = 11,
    .commands = icub_motor_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .axis_bit = true,
    .command = command,
    .power_up = power_up,
    .discovered = discovered,
    .sample = sample,
    .control = control,
    .transmit = transmit,
    .shut_down = shut_down,
    .fault = fault,
};
