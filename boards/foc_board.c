/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A 2FOC board: one motor, one answer to each DESIRED_TARGETS. Its modes, gates and faults are
 * those of the firmware, its control laws those of boards/foc_control.h.
 */
#include "boards/board_private.h"
#include "boards/foc_control.h"
#include "boards/foc_table.h"
#include "boards/motor_control.h"

#include "canbus/frame.h"

#include <math.h>
#include <string.h>

enum {
    ANSWERS_MAX = 8, /* to DESIRED_TARGETS within a tick */
    TOLERANCE = 36,  /* of the encoder, 0.1 deg */
};

struct foc_board {
    uint8_t mode;
    uint32_t faults;
    uint8_t encoder; /* enum foc_encoder_state */
    bool compatible; /* the host speaks our protocol */
    bool motor_set, current_set;
    uint8_t flags; /* enum foc_motor_flag */
    int64_t resolution, index_offset, poles, tolerance;
    int64_t nominal_ma, peak_ma, overload_ma;
    int64_t temperature_limit; /* 0.1 degree C; 0 = none */
    struct foc_law current, speed;
    struct foc_position_law position_law;
    float motor_parameter[FOC_MOTOR_MAX_VELOCITY + 1]; /* kept for the host */

    int64_t target;   /* as last commanded for the present mode */
    int64_t speed_ma; /* reference of the current loop in SPEED_CURRENT */
    struct foc_limiter limiter;
    int64_t vq;
    int32_t start; /* position when the mode began */

    int64_t i2t; /* mA^2 ms / 1024 */
    int64_t target_ns;

    int32_t position, velocity; /* icubdeg, icubdeg/ms */
    int32_t position_before;    /* a millisecond ago */
    int32_t turn;               /* whole revolutions, to see the index go by */
    double current_a, supply_v, temperature_c;
    bool sensors_bad, started;

    unsigned answers;
    int64_t status_ms, sampled_ms;
};

struct foc_board *foc_board_create(struct arena *arena)
{
    return arena_alloc(arena, 1, sizeof(struct foc_board));
}

static bool runs(uint8_t mode)
{
    return mode != ICUB_MODE_IDLE && mode != ICUB_MODE_HARDWARE_FAULT &&
           mode != ICUB_MODE_NOT_CONFIGURED;
}

static void forget_references(struct foc_board *foc)
{
    foc->target = foc->speed_ma = 0;
    foc->vq = 0;
    foc->limiter = (struct foc_limiter){0};
    foc_law_reset(&foc->current);
    foc_law_reset(&foc->speed);
    foc_position_reset(&foc->position_law);
    foc->start = foc->position;
}

static void set_mode(struct board *board, uint8_t mode)
{
    struct foc_board *foc = board->foc;

    if (mode != foc->mode) {
        board_event(board, BOARD_EVENT_MODE, 0, foc->mode, mode);
        foc->mode = mode;
    }
    forget_references(foc);
    foc->target_ns = board->boards->time_ns;
}

static void fail(struct board *board, uint32_t faults)
{
    struct foc_board *foc = board->foc;
    uint32_t risen = faults & ~foc->faults;

    foc->faults |= faults;
    if (risen) {
        board_event(board, BOARD_EVENT_FAULT, 0, risen, 0);
    }
    if (foc->mode != ICUB_MODE_HARDWARE_FAULT && foc->mode != ICUB_MODE_NOT_CONFIGURED) {
        set_mode(board, ICUB_MODE_HARDWARE_FAULT);
    }
}

static void power_up(struct board *board)
{
    struct foc_board *foc = board->foc;
    const struct foc_board fresh = {
        .mode = ICUB_MODE_NOT_CONFIGURED,
        .speed = {.kp = 0x0c, .ki = 0x08, .shift = 0x0a}, /* the firmware's */
        .position = foc->position,
        .position_before = foc->position_before,
        .turn = foc->turn,
        .supply_v = foc->supply_v,
        .started = foc->started,
        .target_ns = board->boards->time_ns,
        .status_ms = INT64_MIN / 2,
        .sampled_ms = board->boards->time_ns / MS,
    };

    *foc = fresh;
}

/* ---- commands ---- */

static bool is_control_mode(int64_t mode)
{
    return mode == ICUB_MODE_CURRENT || mode == ICUB_MODE_SPEED_VOLTAGE ||
           mode == ICUB_MODE_SPEED_CURRENT || mode == ICUB_MODE_OPEN_LOOP ||
           mode == ICUB_MODE_POSITION;
}

static bool command_mode(struct board *board, int64_t mode)
{
    struct foc_board *foc = board->foc;
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    if (!stop && !is_control_mode(mode)) {
        return false;
    }
    if (foc->mode == ICUB_MODE_NOT_CONFIGURED) {
        return true;
    }
    if (foc->mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode == ICUB_MODE_FORCE_IDLE) {
            foc->faults = 0;
            foc->encoder = 0;
            set_mode(board, ICUB_MODE_IDLE);
        }
        return true;
    }
    set_mode(board, stop ? ICUB_MODE_IDLE : (uint8_t)mode);
    return true;
}

static float float_of(const uint8_t *data)
{
    uint32_t bits = get_u32_le(data);
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static bool command_law(struct foc_board *foc, const struct bus_frame *frame,
                        const int64_t *request)
{
    bool current = frame->data[0] == FOC_SET_CURRENT_PID;
    struct foc_law *law = current ? &foc->current : &foc->speed;

    if (frame->len == 6) {
        if (!foc_law_set_gain(law, frame->data[1] - 1u, (double)float_of(frame->data + 2))) {
            return false;
        }
    } else if (frame->len == 8) {
        foc_law_set(law, request[0], request[1], request[3]);
    } else {
        return false;
    }
    foc->current_set = foc->current_set || current;
    return true;
}

static bool command_pid(struct foc_board *foc, const struct bus_frame *frame,
                        const int64_t *request)
{
    float value = float_of(frame->data + 4);
    unsigned which = (unsigned)request[1];

    if (which < FOC_PID_KP || which > FOC_PID_STICTION_DOWN || !isfinite(value)) {
        return false;
    }
    switch (request[0]) {
    case FOC_LOOP_POSITION:
        foc->position_law.gain[which] = value;
        return true;
    case FOC_LOOP_CURRENT:
        /* the other parameters have no use in a PI law with fixed limits */
        foc->current_set = true;
        return which > FOC_PID_KI ||
               foc_law_set_gain(&foc->current, which - FOC_PID_KP, (double)value);
    case FOC_LOOP_VELOCITY:
        return which > FOC_PID_KI ||
               foc_law_set_gain(&foc->speed, which - FOC_PID_KP, (double)value);
    default:
        return false;
    }
}

static bool command_limit(struct foc_board *foc, const struct bus_frame *frame,
                          const int64_t *request)
{
    if (frame->len == 5) {
        foc->peak_ma = get_i16_le(frame->data + 1);
        foc->nominal_ma = foc->peak_ma / 2;
        foc->overload_ma = 20000;
    } else if (frame->len == 8) {
        foc->nominal_ma = request[0];
        foc->peak_ma = request[1];
        foc->overload_ma = request[2];
    } else {
        return false;
    }
    return true;
}

static void configure_motor(struct foc_board *foc, const struct bus_frame *frame,
                            const int64_t *request)
{
    foc->flags = (uint8_t)request[0];
    foc->resolution = request[1];
    foc->index_offset = request[2];
    foc->poles = request[3];
    foc->tolerance = frame->len == 8 ? request[4] : TOLERANCE;
    foc->motor_set = true;
    foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED;
    if (foc->flags & FOC_HAS_HALL) {
        foc->flags &= (uint8_t) ~(FOC_HAS_INDEX | FOC_HAS_TEMPERATURE);
    }
    if (foc->flags & FOC_HAS_QE && foc->flags & FOC_HAS_INDEX) {
        foc->encoder |= FOC_QE_NOT_CALIBRATED;
    }
}

static bool configure(struct foc_board *foc, const struct bus_frame *frame, const int64_t *request)
{
    switch (frame->data[0]) {
    case FOC_SET_CURRENT_PID:
    case FOC_SET_VELOCITY_PID:
        return command_law(foc, frame, request);
    case FOC_SET_PID:
        return command_pid(foc, frame, request);
    case FOC_SET_CURRENT_LIMIT:
        return command_limit(foc, frame, request);
    case FOC_SET_MOTOR_CONFIG:
        configure_motor(foc, frame, request);
        return true;
    case FOC_SET_TEMPERATURE_LIMIT:
        foc->temperature_limit = request[0];
        return true;
    case FOC_SET_MOTOR_PARAMETER:
        if (request[0] < FOC_MOTOR_BEMF || request[0] > FOC_MOTOR_MAX_VELOCITY) {
            return false;
        }
        foc->motor_parameter[request[0]] = float_of(frame->data + 2);
        return true;
    case ICUB_SET_I2T: /* the limits of the current set it here */
        return true;
    default:
        return false;
    }
}

static void take_target(struct foc_board *foc, int64_t target)
{
    switch (foc->mode) {
    case ICUB_MODE_OPEN_LOOP:
        foc->target = control_clamp(target, -FOC_PWM_MAX, FOC_PWM_MAX);
        break;
    case ICUB_MODE_CURRENT:
        foc->target = control_clamp(target, -foc->peak_ma, foc->peak_ma);
        break;
    case ICUB_MODE_IDLE:
        forget_references(foc);
        break;
    default:
        foc->target = target;
        break;
    }
}

static void tell_firmware(struct board *board, const int64_t *host, int64_t *reply)
{
    board->foc->compatible = host[0] == ICUB_PROTOCOL_MAJOR && host[1] == ICUB_PROTOCOL_MINOR;
    reply[0] = board->ops->type;
    reply[1] = board->ops->major;
    reply[2] = board->ops->minor;
    reply[3] = board->ops->build;
    reply[4] = ICUB_PROTOCOL_MAJOR;
    reply[5] = ICUB_PROTOCOL_MINOR;
    reply[6] = board->foc->compatible;
}

static bool get(struct board *board, unsigned code, const int64_t *request, int64_t *reply)
{
    struct foc_board *foc = board->foc;
    uint32_t bits;

    switch (code) {
    case FOC_GET_FIRMWARE_VERSION:
        tell_firmware(board, request, reply);
        return true;
    case ICUB_GET_CONTROL_MODE:
        reply[0] = foc->mode;
        return true;
    case ICUB_GET_BOARD_ID:
        reply[0] = board->address;
        return true;
    case FOC_GET_MOTOR_PARAMETER:
        if (request[0] < FOC_MOTOR_BEMF || request[0] > FOC_MOTOR_MAX_VELOCITY) {
            return false;
        }
        memcpy(&bits, &foc->motor_parameter[request[0]], sizeof bits);
        reply[0] = request[0];
        reply[1] = bits;
        return true;
    default:
        return false;
    }
}

static void become_idle_when_configured(struct board *board)
{
    struct foc_board *foc = board->foc;

    if (foc->mode == ICUB_MODE_NOT_CONFIGURED && foc->compatible && foc->motor_set &&
        foc->current_set && foc->peak_ma != 0) {
        set_mode(board, ICUB_MODE_IDLE);
        foc->answers += foc->answers < ANSWERS_MAX; /* tells it unasked, once */
    }
}

static bool command(struct board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer)
{
    struct foc_board *foc = board->foc;
    unsigned code = frame->data[0];
    bool obeyed;

    (void)answer;
    if (get(board, code, request, reply)) {
        become_idle_when_configured(board);
        return true;
    }
    if (code == ICUB_SET_BOARD_ID) {
        return !runs(foc->mode) && board_set_address(board, (uint8_t)request[0]);
    }
    if (!foc->compatible) {
        return false; /* a host that has not said its protocol is not trusted */
    }
    switch (code) {
    case FOC_SET_CONTROL_MODE:
        return command_mode(board, request[0]);
    case ICUB_SET_OPEN_LOOP:
        obeyed = foc->mode == ICUB_MODE_OPEN_LOOP;
        break;
    case ICUB_SET_DESIRED_VELOCITY:
        obeyed = foc->mode == ICUB_MODE_SPEED_VOLTAGE || foc->mode == ICUB_MODE_SPEED_CURRENT;
        break;
    default:
        obeyed = configure(foc, frame, request);
        become_idle_when_configured(board);
        return obeyed;
    }
    if (obeyed) {
        take_target(foc, request[0]);
    }
    return obeyed;
}

/* Any such frame feeds the watchdog; one too short for this board's target gets no answer. */
static bool targets(struct board *board, const struct bus_frame *frame)
{
    struct foc_board *foc = board->foc;

    foc->target_ns = board->boards->time_ns;
    if (frame->len < 2 * board->address) {
        return false;
    }
    take_target(foc, get_i16_le(frame->data + 2 * (board->address - 1)));
    if (foc->answers == ANSWERS_MAX) {
        board_lose(board);
    } else {
        foc->answers++;
    }
    return true;
}

/* ---- sensors ---- */

/* Encoder ticks a rotor revolution. */
static double ticks_per_rev(const struct board_axis_config *axis)
{
    return axis->motor_ticks_per_rad * 2.0 * M_PI / axis->gear;
}

static void sample(struct board *board, const struct plant_sensors *sensors)
{
    struct foc_board *foc = board->foc;
    const struct board_axis_config *axis = &board->config.axis[0];
    int64_t now_ms = board->boards->time_ns / MS, ms = now_ms - foc->sampled_ms;
    const struct motor_sense *sense;
    int32_t raw, position, turn;

    foc->supply_v =
        isfinite(sensors->supply_v) && sensors->supply_v > 0.0 ? sensors->supply_v : 0.0;
    if (axis->joint < 0) {
        return;
    }
    sense = &sensors->motor[axis->joint];
    foc->sensors_bad = !control_quantize(sense->qm * axis->motor_ticks_per_rad, &raw) ||
                       !isfinite(sense->current_a);
    if (foc->sensors_bad) {
        return;
    }
    foc->current_a = sense->current_a;
    foc->temperature_c = isfinite(sense->winding_c) ? sense->winding_c : 0.0;
    control_quantize(floor((double)raw * FOC_ICUBDEG_PER_REV / ticks_per_rev(axis)), &position);
    control_quantize(floor((double)raw / ticks_per_rev(axis)), &turn);
    if (!foc->started) {
        foc->position_before = foc->start = position;
        foc->started = true;
    } else if (turn != foc->turn) {
        foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED; /* the index went by */
    }
    if (ms > 0) {
        int64_t change = ((int64_t)position - foc->position_before) / ms;

        foc->velocity = (int32_t)control_clamp((foc->velocity + change) / 2, INT32_MIN, INT32_MAX);
        foc->position_before = position;
        foc->sampled_ms = now_ms;
    }
    foc->position = position;
    foc->turn = turn;
}

static int64_t milliamperes(const struct foc_board *foc)
{
    int32_t value = 0;

    control_quantize(foc->current_a * 1e3, &value);
    return value;
}

/* ---- faults ---- */

static void watch_i2t(struct board *board)
{
    struct foc_board *foc = board->foc;
    int64_t current = control_clamp(milliamperes(foc), INT16_MIN, INT16_MAX);
    int64_t nominal2 = foc->nominal_ma * foc->nominal_ma;
    int64_t limit = (foc->peak_ma * foc->peak_ma - nominal2) * 10;

    foc->i2t += (current * current - nominal2) / 1024;
    foc->i2t = foc->i2t > 0 ? foc->i2t : 0;
    if (foc->mode != ICUB_MODE_NOT_CONFIGURED && !(foc->flags & FOC_HAS_TEMPERATURE) &&
        foc->i2t > limit && foc->mode != ICUB_MODE_HARDWARE_FAULT) {
        board->boards->counters.trips++;
        fail(board, FOC_FAULT_I2T);
    }
}

static void watch(struct board *board)
{
    struct foc_board *foc = board->foc;
    uint32_t faults = 0;

    if (!runs(foc->mode)) {
        return;
    }
    if (board->boards->time_ns - foc->target_ns > (int64_t)FOC_TARGET_TIMEOUT_MS * MS) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, 0, foc->mode, 0);
        faults |= FOC_FAULT_SET_POINT_EXPIRED;
    }
    if (foc->overload_ma > 0 && fabs(foc->current_a) * 1e3 > (double)foc->overload_ma) {
        board->boards->counters.trips++;
        faults |= FOC_FAULT_OVER_CURRENT;
    }
    if (foc->supply_v < BOARD_UNDER_VOLTAGE_V) {
        faults |= FOC_FAULT_UNDER_VOLTAGE;
    }
    if (foc->sensors_bad) {
        foc->encoder |= FOC_QE_PHASE_BROKEN;
        faults |= FOC_FAULT_ENCODER;
    }
    if (foc->flags & FOC_HAS_TEMPERATURE && foc->temperature_limit > 0 &&
        foc->temperature_c * 10.0 > (double)foc->temperature_limit) {
        faults |= FOC_FAULT_OVER_HEATING;
    }
    if (faults) {
        fail(board, faults);
    }
}

/* ---- control laws, once a millisecond ---- */

static int64_t speed_current(struct foc_board *foc)
{
    int64_t error = foc->target - foc->velocity;

    foc->speed_ma += (error - foc->speed.error) * 16 + error + foc->speed.error;
    foc->speed_ma = control_clamp(foc->speed_ma, -foc->peak_ma, foc->peak_ma);
    foc->speed.error = error;
    return foc->speed_ma;
}

/* What the current limiter leaves of a voltage. */
static int64_t limited(struct foc_board *foc, int64_t vq)
{
    return foc_limit(&foc->limiter, &foc->current, vq, milliamperes(foc), foc->peak_ma);
}

static void step(struct foc_board *foc)
{
    int64_t vq;

    switch (foc->mode) {
    case ICUB_MODE_OPEN_LOOP:
        vq = limited(foc, foc->target / (1 << FOC_VQ_SHIFT));
        break;
    case ICUB_MODE_SPEED_VOLTAGE:
        vq = limited(foc, foc_law_step(&foc->speed, foc->target - foc->velocity));
        break;
    case ICUB_MODE_POSITION:
        vq = limited(foc,
                     foc_position_step(&foc->position_law,
                                       (double)foc->target - ((double)foc->position - foc->start)));
        break;
    case ICUB_MODE_SPEED_CURRENT:
        vq = foc_law_step(&foc->current, speed_current(foc) - milliamperes(foc));
        break;
    case ICUB_MODE_CURRENT:
        vq = foc_law_step(&foc->current, foc->target - milliamperes(foc));
        break;
    default:
        vq = 0;
        break;
    }
    foc->vq = control_clamp(vq, -FOC_VQ_MAX, FOC_VQ_MAX);
}

static void drive(const struct board *board, struct plant_command *command)
{
    const struct foc_board *foc = board->foc;
    int joint = board->config.axis[0].joint;

    if (joint >= 0) {
        command->motor[joint].bridge_on = runs(foc->mode);
        command->motor[joint].voltage_v =
            runs(foc->mode) ? (double)foc->vq * 1e-3 * foc->supply_v : 0.0;
    }
}

static void control(struct board *board, struct ms_span span, struct plant_command *command)
{
    watch(board);
    for (int64_t ms = span.from; ms < span.to; ms++) {
        watch_i2t(board);
        step(board->foc);
    }
    drive(board, command);
}

static void shut_down(struct board *board, struct plant_command *command)
{
    if (runs(board->foc->mode)) {
        set_mode(board, ICUB_MODE_IDLE);
    }
    drive(board, command);
}

static bool fault(const struct board *board)
{
    return board->foc->mode == ICUB_MODE_HARDWARE_FAULT;
}

/* ---- frames ---- */

static void send(struct board *board, struct frame_sink *sink, enum foc_type type,
                 const int64_t *values)
{
    uint8_t data[8];

    fields_encode(foc_frames[type].fields, values, data);
    board_send(board, sink, icub_id(ICUB_PERIODIC_MOTOR, board->address, type),
               foc_frames[type].length, data);
}

static void transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct foc_board *foc = board->foc;
    int64_t period_ms = board->config.status_period_ns / MS;
    int64_t additional_ms = foc_additional_status_ms(board->address);

    if (board->lost_in_status) {
        foc->faults |= FOC_FAULT_CAN_OVERRUN;
        board->lost_in_status = board->lost_in_overflow = false;
    }
    for (; foc->answers > 0; foc->answers--) {
        send(board, sink, FOC_FEEDBACK,
             (const int64_t[]){milliamperes(foc), foc->velocity, foc->position});
        if (span.to - foc->status_ms >= period_ms) {
            foc->status_ms = span.to;
            send(board, sink, FOC_STATUS,
                 (const int64_t[]){foc->mode, foc->encoder, foc->vq * (1 << FOC_VQ_SHIFT),
                                   foc->faults});
        }
    }
    if (span.to / additional_ms > span.from / additional_ms) {
        int32_t temperature = 0;

        control_quantize(foc->temperature_c * 10.0, &temperature);
        send(board, sink, FOC_ADDITIONAL_STATUS, (const int64_t[]){temperature});
    }
}

const struct board_ops foc_board_ops = {
    .type = FOC_BOARD_2FOC,
    .major = 3,
    .minor = 6,
    .build = 31,
    .periodic_max = 2 * ANSWERS_MAX + 1,
    .commands = foc_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .no_info = true,
    .command = command,
    .targets = targets,
    .power_up = power_up,
    .sample = sample,
    .control = control,
    .transmit = transmit,
    .shut_down = shut_down,
    .fault = fault,
};
