/* SPDX-License-Identifier: Apache-2.0 */
/* The control laws of a 2FOC board; boards/foc/private.h describes them. */
#include "boards/foc/private.h"

#include <float.h>

/* Sets the integer gains of a law, in the scale of the bus. The law uses half of ki. */
static void foc_law_set(struct foc_law *law, int64_t kp, int64_t ki, int64_t shift)
{
    law->kp = kp;
    law->ki = ki / 2;
    law->shift = shift;
}

/* Sets one gain of a loop from a float. Returns false for a gain that the loop cannot have. kp and
 * ki of a law share the largest shift at which they fit into 15 bits. */
static bool foc_set_gain(struct foc_board *foc, unsigned loop, unsigned which, double value)
{
    double *gain = foc->gain[loop];
    int64_t *shown = foc->setting + FOC_P_CURRENT_PID + loop * FOC_PID_FIELDS;
    bool of_law = loop != FOC_LOOP_POSITION && which <= FOC_PID_KI;
    int exponent = 0;

    if (!isfinite(value) || (of_law && fabs(value) >= 32768.0)) {
        return false;
    }
    gain[which] = of_law ? value : (double)(float)value;
    if (which <= FOC_PID_KD) {
        shown[which - FOC_PID_KP] =
            (int64_t)fmax(fmin(ldexp(value, (int)shown[FOC_PID_FIELDS - 1]), INT16_MAX), INT16_MIN);
    }
    if (of_law) {
        while (fmax(gain[FOC_PID_KP], gain[FOC_PID_KI]) >= ldexp(1.0, exponent)) {
            exponent++;
        }
        foc_law_set(&foc->law[loop], (int64_t)ldexp(gain[FOC_PID_KP], 15 - exponent),
                    (int64_t)ldexp(gain[FOC_PID_KI], 15 - exponent), 15 - exponent);
    }
    return true;
}

/* Sets the gains of a loop from kp, ki, kd and the shift that they have in common. */
static void foc_set_gains(struct foc_board *foc, unsigned loop, const int64_t *pid)
{
    for (unsigned i = 0; i < FOC_PID_FIELDS - 1; i++) {
        foc->gain[loop][FOC_PID_KP + i] = ldexp((double)pid[i], -(int)pid[FOC_PID_FIELDS - 1]);
    }
    memcpy(foc->setting + FOC_P_CURRENT_PID + loop * FOC_PID_FIELDS, pid,
           FOC_PID_FIELDS * sizeof *pid);
    if (loop != FOC_LOOP_POSITION) {
        foc_law_set(&foc->law[loop], pid[0], pid[1], pid[FOC_PID_FIELDS - 1]);
    }
}

/* Advances a law by one step and adds its change to the voltage v. Limits v to +-most, in Vq.
 * *before: error of the last step, replaced by `error`. Returns v in Vq. */
static int64_t foc_law_add(const struct foc_law *law, int64_t *v, int64_t *before, int64_t error,
                           int64_t most)
{
    error = control_clamp(error, INT16_MIN, INT16_MAX);
    *v += (error - *before) * law->kp + (error + *before) * law->ki;
    *v = control_clamp(*v, -(most << law->shift), most << law->shift);
    *before = error;
    return *v >> law->shift;
}

/* Limits the current: returns vq, plus the voltage that keeps the current at its peak. */
static int64_t foc_limiter_step(struct foc_board *foc, int64_t vq, int64_t current_ma)
{
    struct foc_limiter *limiter = &foc->limiter;
    int64_t change;

    if (current_ma > foc->setting[FOC_P_PEAK]) {
        limiter->side = 1;
    } else if (current_ma < -foc->setting[FOC_P_PEAK]) {
        limiter->side = -1;
    }
    if (!limiter->side) {
        return vq;
    }
    change =
        foc_law_add(&foc->law[FOC_LOOP_CURRENT], &limiter->v, &limiter->error,
                    limiter->side * foc->setting[FOC_P_PEAK] - current_ma, (int64_t)2 * FOC_VQ_MAX);
    if (limiter->side * limiter->v >= 0) {
        *limiter = (struct foc_limiter){0};
        return vq;
    }
    return vq + change;
}

/* Advances the position law by one millisecond. Returns Vq. */
static int64_t foc_position_step(struct foc_position_law *law, const double *gain, double error)
{
    double limit = gain[FOC_PID_OUTPUT_LIMIT] > 0.0 ? gain[FOC_PID_OUTPUT_LIMIT] : FOC_PWM_MAX;
    double most = gain[FOC_PID_INTEGRAL_LIMIT] > 0.0 ? gain[FOC_PID_INTEGRAL_LIMIT] : limit;
    double out;
    int32_t vq = 0;

    law->integral = fmax(fmin(law->integral + gain[FOC_PID_KI] * error, most), -most);
    out = gain[FOC_PID_KP] * error + law->integral + gain[FOC_PID_KD] * (error - law->error);
    law->error = error;
    control_quantize(fmax(fmin(out, limit), -limit) / (1 << FOC_VQ_SHIFT), &vq);
    return vq;
}

/* The settings of a 2FOC board: gains of its laws as floats, current limits. */

enum { LIMIT_MAX_MA = 32767 };

#define LAW_MAX 32767.0 /* limit of foc_set_gain */

static const struct {
    const char *name;
    unsigned loop;  /* FOC_LOOPS: a limit of the current */
    unsigned which; /* enum foc_pid_parameter of a loop, or enum foc_parameter */
} rows[] = {
    {"current_kp", FOC_LOOP_CURRENT, FOC_PID_KP},
    {"current_ki", FOC_LOOP_CURRENT, FOC_PID_KI},
    {"speed_kp", FOC_LOOP_VELOCITY, FOC_PID_KP},
    {"speed_ki", FOC_LOOP_VELOCITY, FOC_PID_KI},
    {"position_kp", FOC_LOOP_POSITION, FOC_PID_KP},
    {"position_ki", FOC_LOOP_POSITION, FOC_PID_KI},
    {"position_kd", FOC_LOOP_POSITION, FOC_PID_KD},
    {"position_integral_limit", FOC_LOOP_POSITION, FOC_PID_INTEGRAL_LIMIT},
    {"position_limit", FOC_LOOP_POSITION, FOC_PID_OUTPUT_LIMIT},
    {"current_limit", FOC_LOOPS, FOC_P_NOMINAL},
    {"current_peak", FOC_LOOPS, FOC_P_PEAK},
};

/* Describes a setting: name, unit, range, value (struct board_settings). */
static void foc_setting_describe(const struct board *board, unsigned axis, size_t index,
                                 struct board_setting *setting)
{
    const struct foc_board *foc = foc_board_of(board);
    unsigned loop = rows[index].loop, which = rows[index].which;
    bool is_limit = loop == FOC_LOOPS;
    double most = is_limit ? LIMIT_MAX_MA : loop == FOC_LOOP_POSITION ? (double)FLT_MAX : LAW_MAX;

    (void)axis;
    *setting = (struct board_setting){
        .name = rows[index].name,
        .unit = is_limit ? "mA" : "",
        .min = is_limit ? 0.0 : -most,
        .max = most,
        .whole = is_limit,
        .value = is_limit ? (double)foc->setting[which] : foc->gain[loop][which],
    };
}

/* Writes a setting (struct board_settings). */
static bool foc_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    struct foc_board *foc = foc_board_of(board);

    (void)axis;
    if (rows[index].loop < FOC_LOOPS) {
        return foc_set_gain(foc, rows[index].loop, rows[index].which, value);
    }
    foc->setting[rows[index].which] = (int64_t)value;
    return true;
}

static const struct board_settings foc_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = foc_setting_describe,
    .set = foc_setting_set,
};

/* Commands of class 0 and DESIRED_TARGETS on a 2FOC board. */

enum { TOLERANCE = 36 }; /* tolerance of the encoder, 0.1 deg */

/* Resets the references of the laws. */
static void foc_board_forget_references(struct foc_board *foc)
{
    foc->target = foc->speed_ma = 0;
    foc->vq = 0;
    foc->limiter = (struct foc_limiter){0};
    for (unsigned loop = 0; loop < FOC_LOOP_POSITION; loop++) {
        foc->law[loop].v = foc->law[loop].error = 0;
    }
    foc->position_law = (struct foc_position_law){0};
    foc->start = foc->position;
}

/* Resets the references and sets the mode, even if unchanged. */
static void foc_board_set_mode(struct board *board, uint8_t mode)
{
    struct foc_board *foc = foc_board_of(board);

    if (mode != foc->axis.mode) {
        board_event(board, BOARD_EVENT_MODE, 0, foc->axis.mode, mode);
        foc->axis.mode = mode;
        foc->axis.on = foc_runs(mode);
        foc->axis.faulty = mode == ICUB_MODE_HARDWARE_FAULT;
    }
    foc_board_forget_references(foc);
    foc->target_ns = board->boards->now_ns;
}

/* Obeys SET_CONTROL_MODE. Returns false for an unknown mode. */
static bool foc_board_command_mode(struct board *board, int64_t mode)
{
    struct foc_board *foc = foc_board_of(board);
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;
    bool current = mode == ICUB_MODE_CURRENT || mode == ICUB_MODE_SPEED_CURRENT;
    bool voltage = mode == ICUB_MODE_SPEED_VOLTAGE || mode == ICUB_MODE_OPEN_LOOP ||
                   mode == ICUB_MODE_POSITION;

    if (!stop && !voltage && !(current && !board->config.axis[0].valve)) {
        return false;
    }
    /* A board that is not configured ignores the command. In a fault, only FORCE_IDLE has an
     * effect: it clears the fault */
    if (foc->axis.mode == ICUB_MODE_NOT_CONFIGURED) {
        return true;
    }
    if (foc->axis.mode == ICUB_MODE_HARDWARE_FAULT) {
        if (mode == ICUB_MODE_FORCE_IDLE) {
            foc->faults = 0;
            foc->encoder = 0;
            foc_board_set_mode(board, ICUB_MODE_IDLE);
        }
        return true;
    }
    foc_board_set_mode(board, stop ? ICUB_MODE_IDLE : (uint8_t)mode);
    return true;
}

/* Returns a little-endian float32. */
static float foc_get_float(const uint8_t *data)
{
    uint32_t bits = get_u32_le(data);
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Obeys SET_CURRENT_PID, SET_VELOCITY_PID or SET_POSITION_PID: sets one gain from a float, or all
 * gains from integers. Returns false if it refuses the command. */
static bool foc_board_command_law(struct foc_board *foc, unsigned loop,
                                  const struct bus_frame *frame, const int64_t *request)
{
    unsigned which = frame->data[1] + FOC_PID_KP - 1u;

    if (frame->len == 8) {
        foc_set_gains(foc, loop, request);
    } else if (frame->len != 6 || which < FOC_PID_KP || which > FOC_PID_KI ||
               !foc_set_gain(foc, loop, which, (double)foc_get_float(frame->data + 2))) {
        return false;
    }
    foc->current_set = foc->current_set || loop == FOC_LOOP_CURRENT;
    return true;
}

/* Obeys SET_PID: sets one parameter of a loop from a float. Most parameters of the laws of current
 * and velocity have no effect. Returns false if it refuses the command. */
static bool foc_board_command_pid(struct foc_board *foc, const struct bus_frame *frame,
                                  const int64_t *request)
{
    unsigned loop = (unsigned)request[0], which = (unsigned)request[1];

    if (loop >= FOC_LOOPS || which < FOC_PID_KP || which > FOC_PID_STICTION_DOWN ||
        !foc_set_gain(foc, loop, which, (double)foc_get_float(frame->data + 4))) {
        return false;
    }
    foc->current_set = foc->current_set || loop == FOC_LOOP_CURRENT;
    return true;
}

/* Obeys a configuration command. Returns false if it refuses the command. */
static bool foc_board_configure(struct foc_board *foc, const struct bus_frame *frame,
                                const int64_t *request)
{
    const struct icub_command *row = &foc_commands[frame->data[0]];
    int64_t *setting = foc->setting;

    if (row->kind == ICUB_SET) {
        memcpy(setting + row->parameter, request, fields_count(row->request) * sizeof *request);
        return true;
    }
    switch (frame->data[0]) {
    case FOC_SET_CURRENT_PID:
    case FOC_SET_VELOCITY_PID:
    case ICUB_SET_POSITION_PID:
        return foc_board_command_law(foc, row->parameter / FOC_PID_FIELDS, frame, request);
    case FOC_SET_PID:
        return foc_board_command_pid(foc, frame, request);
    case FOC_SET_CURRENT_LIMIT: /* 8 bytes: nominal, peak and overload; 5 bytes: peak only */
        if (frame->len != 5 && frame->len != 8) {
            return false;
        }
        setting[FOC_P_PEAK] = frame->len == 5 ? get_i16_le(frame->data + 1) : request[1];
        setting[FOC_P_NOMINAL] = frame->len == 5 ? setting[FOC_P_PEAK] / 2 : request[0];
        setting[FOC_P_OVERLOAD] = frame->len == 5 ? 20000 : request[2];
        return true;
    case FOC_SET_MOTOR_CONFIG: /* sensors, encoder resolution and poles of the motor */
        foc->flags = (uint8_t)request[0];
        setting[FOC_P_FLAGS] = request[0] & FOC_MOTOR_FLAGS;
        setting[FOC_P_RESOLUTION] = request[1];
        setting[FOC_P_INDEX_OFFSET] = request[2];
        setting[FOC_P_POLES] = request[3] & ~INT64_C(1); /* the firmware keeps pairs of poles */
        setting[FOC_P_TOLERANCE] = frame->len == 8 ? request[4] : TOLERANCE;
        foc->motor_set = true;
        foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED;
        /* With Hall sensors there is no index. With an index, the encoder is calibrated at the
         * index pulse */
        if (foc->flags & FOC_HAS_HALL) {
            foc->flags &= (uint8_t) ~(FOC_HAS_INDEX | FOC_HAS_TEMPERATURE);
        }
        if (foc->flags & FOC_HAS_QE && foc->flags & FOC_HAS_INDEX) {
            foc->encoder |= FOC_QE_NOT_CALIBRATED;
        }
        return true;
    case FOC_SET_MOTOR_PARAMETER:
        if (request[0] < FOC_MOTOR_BEMF || request[0] > FOC_MOTOR_MAX_VELOCITY) {
            return false;
        }
        foc->motor_parameter[request[0]] = foc_get_float(frame->data + 2);
        return true;
    case ICUB_SET_I2T: /* no effect: the current limits define the I2t law */
        return true;
    default:
        return false;
    }
}

/* Sets the set point in the unit of the mode, limited to the mode's range. */
static void foc_board_set_target(struct foc_board *foc, int64_t target)
{
    switch (foc->axis.mode) {
    case ICUB_MODE_OPEN_LOOP:
        foc->target = control_clamp(target, -FOC_PWM_MAX, FOC_PWM_MAX);
        break;
    case ICUB_MODE_CURRENT:
        foc->target = control_clamp(target, -foc->setting[FOC_P_PEAK], foc->setting[FOC_P_PEAK]);
        break;
    case ICUB_MODE_IDLE:
        foc_board_forget_references(foc);
        break;
    default:
        foc->target = target;
        break;
    }
}

/* Answers a query. Returns false for any other command. */
static bool foc_board_answer(struct board *board, unsigned code, const int64_t *request,
                             int64_t *reply)
{
    struct foc_board *foc = foc_board_of(board);
    const struct icub_command *row = &foc_commands[code];
    float gain;
    uint32_t bits;

    if (row->kind == ICUB_GET) {
        memcpy(reply, foc->setting + row->parameter, fields_count(row->reply) * sizeof *reply);
        return true;
    }
    switch (code) {
    case FOC_GET_FIRMWARE_VERSION:
        foc->compatible = request[0] == ICUB_PROTOCOL_MAJOR && request[1] == ICUB_PROTOCOL_MINOR;
        icub_board_report_firmware(board, ICUB_PROTOCOL_MAJOR, ICUB_PROTOCOL_MINOR, foc->compatible,
                                   reply);
        return true;
    case ICUB_GET_CONTROL_MODE:
        reply[0] = foc->axis.mode;
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
    case FOC_GET_PID: /* the firmware reports only the gains */
        reply[0] = reply[1] = FOC_PID_NONE;
        if (request[0] < FOC_LOOPS && request[1] >= FOC_PID_KP && request[1] <= FOC_PID_KD) {
            gain = (float)foc->gain[request[0]][request[1]];
            memcpy(&bits, &gain, sizeof bits);
            reply[0] = request[0];
            reply[1] = request[1];
            reply[2] = bits;
        }
        return true;
    default:
        return false;
    }
}

/* Enters idle if the configuration is complete. */
static void foc_board_idle_when_configured(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);

    if (foc->axis.mode == ICUB_MODE_NOT_CONFIGURED && foc->compatible && foc->motor_set &&
        foc->current_set && foc->setting[FOC_P_PEAK] != 0) {
        foc_board_set_mode(board, ICUB_MODE_IDLE);
        /* report the change once, without a request */
        foc->answers += foc->answers < FOC_ANSWERS_MAX;
    }
}

/* Obeys a command (struct icub_board_ops). */
static bool foc_board_command(struct icub_board *icub, const struct bus_frame *frame,
                              const int64_t *request, int64_t *reply, bool *answer)
{
    struct board *board = &icub->board;
    struct foc_board *foc = foc_board_of(board);
    unsigned code = frame->data[0];
    bool obeyed;

    /* Answer queries in any mode */
    (void)answer;
    if (foc_board_answer(board, code, request, reply)) {
        foc_board_idle_when_configured(board);
        return true;
    }

    /* Obey commands that change the board or its axis */
    if (code == ICUB_SET_BOARD_ID) {
        return !foc_runs(foc->axis.mode) && board_set_address(board, (uint8_t)request[0]);
    }
    if (!foc->compatible) {
        return false; /* the host must first state a compatible protocol */
    }

    switch (code) {
    case FOC_SET_CONTROL_MODE:
        return foc_board_command_mode(board, request[0]);
    /* Set the set point as DESIRED_TARGETS does, if the mode uses it */
    case ICUB_SET_OPEN_LOOP:
        obeyed = foc->axis.mode == ICUB_MODE_OPEN_LOOP;
        break;
    case ICUB_SET_DESIRED_VELOCITY:
        obeyed =
            foc->axis.mode == ICUB_MODE_SPEED_VOLTAGE || foc->axis.mode == ICUB_MODE_SPEED_CURRENT;
        break;
    default:
        obeyed = foc_board_configure(foc, frame, request);
        board->boards->settings_changes++;
        foc_board_idle_when_configured(board);
        return obeyed;
    }
    if (obeyed) {
        foc_board_set_target(foc, request[0]);
    }
    return obeyed;
}

/* Obeys DESIRED_TARGETS. Every frame resets the watchdog. A frame without a target for this board
 * gets no answer. Returns false for such a frame. */
static bool foc_board_targets(struct icub_board *icub, const struct bus_frame *frame)
{
    struct board *board = &icub->board;
    struct foc_board *foc = foc_board_of(board);

    foc->target_ns = board->boards->now_ns;
    if (frame->len < 2 * board->address) {
        return false;
    }
    foc_board_set_target(foc, get_i16_le(frame->data + 2 * (board->address - 1)));
    if (foc->answers == FOC_ANSWERS_MAX) {
        board_lose(board);
    } else {
        foc->answers++;
        board_queue_transmit(board);
    }
    return true;
}

/*
 * A 2FOC board: one motor. It sends one answer to each DESIRED_TARGETS. Modes, checks and faults
 * follow the firmware. boards/foc/private.h describes the control laws.
 */

/* Latches faults, reports new faults as an event, and enters hardware fault. */
static void foc_board_raise_faults(struct board *board, uint32_t faults)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t risen = faults & ~foc->faults;

    foc->faults |= faults;
    if (risen) {
        board_event(board, BOARD_EVENT_FAULT, 0, risen, 0);
    }
    if (foc->axis.mode != ICUB_MODE_HARDWARE_FAULT && foc->axis.mode != ICUB_MODE_NOT_CONFIGURED) {
        foc_board_set_mode(board, ICUB_MODE_HARDWARE_FAULT);
    }
}

/* Resets the board to the defaults of the firmware, in mode not configured (struct board_ops). */
static void foc_board_power_up(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);
    int32_t temperature_limit = 0;
    const struct foc_board fresh = {
        .icub = foc->icub,
        .axis.mode = ICUB_MODE_NOT_CONFIGURED,
        /* The limits are stand-ins of the firmware */
        .setting = {[FOC_P_CURRENT_LIMITS] = 0, 31, 21, 0, 12, 11, 0, 2, 1},
        .target_ns = board->boards->now_ns,
        .status_ms = INT64_MIN / 2,
        .additional_ms = INT64_MIN / 2,
    };

    control_quantize(board->config.axis[0].temperature_limit_c / ICUB_TEMPERATURE_C,
                     &temperature_limit);
    *foc = fresh;
    foc_set_gains(foc, FOC_LOOP_VELOCITY, (const int64_t[]){12, 16, 0, 10}); /* of the firmware */
    foc->setting[FOC_P_TEMPERATURE_LIMIT] = control_clamp(temperature_limit, 0, INT16_MAX);
}

/* ---- sensors ---- */

/* Samples the sensors (struct board_ops). Converts the rotor encoder to icubdeg. The speed is a
 * running mean with one step per tick. Without a finite reading, a value stays as it is. */
static void foc_board_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct foc_board *foc = foc_board_of(board);
    const struct axis *axis = &foc->axis;
    const struct board_axis_config *config = axis->config;
    double ticks_per_rev = config->motor_ticks_per_rad * 2.0 * M_PI / config->gear;
    int32_t position = 0, turn = 0;

    (void)sensors;
    if (config->joint < 0 || axis->bad_motor) {
        return;
    }
    control_quantize(axis->winding_c / ICUB_TEMPERATURE_C, &foc->temperature);
    control_quantize(floor((double)axis->motor_ticks * FOC_ICUBDEG_PER_REV / ticks_per_rev),
                     &position);
    control_quantize(floor((double)axis->motor_ticks / ticks_per_rev), &turn);

    /* An index pulse, once a revolution, calibrates the encoder */
    if (!foc->started) {
        foc->position_before = foc->start = position;
        foc->started = true;
    } else if (turn != foc->turn) {
        foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED;
    }
    if (axis->passed_ms > 0) {
        int64_t change = ((int64_t)position - foc->position_before) / axis->passed_ms;

        foc->velocity = (int32_t)control_clamp((foc->velocity + change) / 2, INT32_MIN, INT32_MAX);
        foc->position_before = position;
    }
    foc->position = position;
    foc->turn = turn;
}

/* Returns the measured current, mA. */
static int64_t foc_board_current_ma(const struct foc_board *foc)
{
    int32_t value = 0;

    control_quantize(foc->axis.current_a * 1e3, &value);
    return value;
}

/* ---- faults ---- */

/* Checks the age of the set point, current, supply, encoder and winding of a running motor. Raises
 * faults. */
static void foc_board_watch_faults(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t faults = 0,
             now = axis_find_faults(board, &foc->axis, (double)foc->setting[FOC_P_PEAK] * 1e-3);

    if (!foc_runs(foc->axis.mode)) {
        return;
    }

    /* The set point expires without DESIRED_TARGETS */
    if (board->boards->now_ns - foc->target_ns > (int64_t)FOC_TARGET_TIMEOUT_MS * MS) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, 0, foc->axis.mode, 0);
        faults |= FOC_FAULT_SET_POINT_EXPIRED;
    }

    /* Hardware faults: current, supply, encoder, winding */
    if (foc->setting[FOC_P_OVERLOAD] > 0 &&
        fabs(foc->axis.current_a) * 1e3 > (double)foc->setting[FOC_P_OVERLOAD]) {
        board->boards->counters.trips++;
        faults |= FOC_FAULT_OVER_CURRENT;
    }
    faults |= now & AXIS_UNDER_VOLTAGE ? FOC_FAULT_UNDER_VOLTAGE : 0;
    faults |= now & AXIS_OVER_VOLTAGE ? FOC_FAULT_OVER_VOLTAGE : 0;
    if (foc->axis.bad_motor) {
        foc->encoder |= FOC_QE_PHASE_BROKEN;
        faults |= FOC_FAULT_ENCODER;
    }
    if (foc->flags & FOC_HAS_TEMPERATURE && foc->setting[FOC_P_TEMPERATURE_LIMIT] > 0 &&
        foc->temperature > foc->setting[FOC_P_TEMPERATURE_LIMIT]) {
        board->boards->counters.trips++;
        faults |= FOC_FAULT_OVER_HEATING;
    }
    if (faults) {
        foc_board_raise_faults(board, faults);
    }
}

/* ---- control laws, once a millisecond ---- */

/* Hands a current to the drive's own controller, whose bandwidth is kp / L. Returns Vq as
 * measured. */
static int64_t foc_follow_current(struct foc_board *foc, int64_t target_ma)
{
    struct axis *axis = &foc->axis;
    const double kp_v_a =
        ldexp((double)foc->law[FOC_LOOP_CURRENT].kp, -(int)foc->law[FOC_LOOP_CURRENT].shift) *
        axis->supply_v;
    int32_t vq = 0;

    axis_follow_current(axis, (double)target_ma * 1e-3, (double)foc->setting[FOC_P_PEAK] * 1e-3,
                        kp_v_a);
    control_quantize(axis->supply_v > 0.0 ? axis->voltage_v / axis->supply_v * 1e3 : 0.0, &vq);
    return vq;
}

/* Computes the voltage of this millisecond with the law of the mode. */
static void foc_board_step_laws(struct foc_board *foc)
{
    int64_t vq, current_ma = foc_board_current_ma(foc), error = foc->target - foc->velocity;
    struct foc_law *speed = &foc->law[FOC_LOOP_VELOCITY];

    foc->axis.law.on = false;
    switch (foc->axis.mode) {
    case ICUB_MODE_OPEN_LOOP:
        vq = foc_limiter_step(foc, foc->target / (1 << FOC_VQ_SHIFT), current_ma);
        break;
    case ICUB_MODE_SPEED_VOLTAGE:
        vq = foc_limiter_step(foc, foc_law_add(speed, &speed->v, &speed->error, error, FOC_VQ_MAX),
                              current_ma);
        break;
    case ICUB_MODE_POSITION:
        vq = foc_limiter_step(
            foc,
            foc_position_step(&foc->position_law, foc->gain[FOC_LOOP_POSITION],
                              (double)foc->target - ((double)foc->position - foc->start)),
            current_ma);
        break;
    case ICUB_MODE_SPEED_CURRENT: /* a PI law computes the current reference */
        foc->speed_ma += (error - speed->error) * 16 + error + speed->error;
        foc->speed_ma =
            control_clamp(foc->speed_ma, -foc->setting[FOC_P_PEAK], foc->setting[FOC_P_PEAK]);
        speed->error = error;
        vq = foc_follow_current(foc, foc->speed_ma);
        break;
    case ICUB_MODE_CURRENT:
        vq = foc_follow_current(foc, foc->target);
        break;
    default:
        vq = 0;
        break;
    }
    foc->vq = control_clamp(vq, -FOC_VQ_MAX, FOC_VQ_MAX);
}

/* Runs one tick: faults, laws, bridge (struct board_ops). */
static void foc_board_control(struct board *board, struct ms_span span)
{
    struct foc_board *foc = foc_board_of(board);

    foc_board_watch_faults(board);
    for (int64_t ms = span.from; ms < span.to; ms++) {
        /* Advance the firmware's I2t law by one millisecond. At the peak current an axis trips
         * after 10.24 s. */
        int64_t current = control_clamp(foc_board_current_ma(foc), INT16_MIN, INT16_MAX);
        int64_t nominal2 = foc->setting[FOC_P_NOMINAL] * foc->setting[FOC_P_NOMINAL];
        int64_t limit = (foc->setting[FOC_P_PEAK] * foc->setting[FOC_P_PEAK] - nominal2) * 10;

        foc->i2t += (current * current - nominal2) / 1024;
        foc->i2t = foc->i2t > 0 ? foc->i2t : 0;
        if (foc->axis.mode != ICUB_MODE_NOT_CONFIGURED && !(foc->flags & FOC_HAS_TEMPERATURE) &&
            foc->i2t > limit && foc->axis.mode != ICUB_MODE_HARDWARE_FAULT) {
            board->boards->counters.trips++;
            foc_board_raise_faults(board, FOC_FAULT_I2T);
        }

        foc_board_step_laws(foc);
    }
    if (!foc->axis.law.on) {
        foc->axis.voltage_v = (double)foc->vq * 1e-3 * foc->axis.supply_v;
    }
}

/* Switches the motor off (struct board_ops). */
static void foc_board_shut_down(struct board *board)
{
    if (foc_runs(foc_board_of(board)->axis.mode)) {
        foc_board_set_mode(board, ICUB_MODE_IDLE);
    }
}

/* ---- frames ---- */

/* Builds a periodic frame from its row and sends it. */
static void foc_board_send_frame(struct board *board, struct frame_sink *sink, enum foc_type type,
                                 const int64_t *values)
{
    uint8_t data[8];

    fields_encode(foc_frames[type].fields, values, data);
    board_send(board, sink, icub_id(ICUB_PERIODIC_MOTOR, board->address, type),
               foc_frames[type].length, data);
}

/* For each DESIRED_TARGETS, sends FOC, and also STATUS and ADDITIONAL_STATUS if they are due
 * (struct board_ops). Sends nothing else: the loader program of these boards would take a frame of
 * type C as an acknowledgment. */
static void foc_board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct foc_board *foc = foc_board_of(board);
    bool rx_warns = board->can.rec >= BOARD_CAN_WARNING,
         tx_warns = board->can.tec >= BOARD_CAN_WARNING;
    bool rx_passive = board->can.rec >= BOARD_CAN_PASSIVE,
         tx_passive = board->can.tec >= BOARD_CAN_PASSIVE;
    uint32_t can =
        (rx_warns ? FOC_FAULT_CAN_RX_WARNING : 0u) | (tx_warns ? FOC_FAULT_CAN_TX_WARNING : 0u) |
        (rx_passive ? FOC_FAULT_CAN_RX_PASSIVE : 0u) | (tx_passive ? FOC_FAULT_CAN_TX_PASSIVE : 0u);
    int64_t period_ms = board->config.status_period_ns / MS;
    int64_t additional_ms = foc_additional_status_ms(board->address);

    /* Report lost frames and errors of the CAN controller. They do not stop the motor. The bits for
     * past errors remain until the faults are cleared */
    if (board->lost_in_status) {
        foc->faults |= FOC_FAULT_CAN_OVERRUN;
        board->lost_in_status = board->lost_in_overflow = false;
    }
    foc->faults |= (rx_warns || tx_warns ? FOC_FAULT_CAN_WAS_WARNING : 0u) |
                   (rx_passive ? FOC_FAULT_CAN_RX_WAS_PASSIVE : 0u) |
                   (tx_passive ? FOC_FAULT_CAN_TX_WAS_PASSIVE : 0u);
    /* STATUS has the rig's period. ADDITIONAL_STATUS is sent only with a thermometer */
    for (; foc->answers > 0; foc->answers--) {
        foc_board_send_frame(
            board, sink, FOC_FEEDBACK,
            (const int64_t[]){foc_board_current_ma(foc), foc->velocity, foc->position});
        if (span.to - foc->status_ms >= period_ms) {
            foc->status_ms = span.to;
            foc_board_send_frame(board, sink, FOC_STATUS,
                                 (const int64_t[]){foc->axis.mode, foc->encoder,
                                                   foc->vq * (1 << FOC_VQ_SHIFT),
                                                   foc->faults | can});
        }
        if (foc->flags & FOC_HAS_TEMPERATURE && span.to - foc->additional_ms >= additional_ms) {
            foc->additional_ms = span.to;
            foc_board_send_frame(board, sink, FOC_ADDITIONAL_STATUS,
                                 (const int64_t[]){foc->temperature});
        }
    }
}

const struct icub_board_ops foc_icub_ops = {
    .base =
        {
            .size = sizeof(struct foc_board),
            .identity = {.type = FOC_BOARD_2FOC, .major = 3, .minor = 6, .build = 31},
            .periodic_max = 2 * FOC_ANSWERS_MAX + 1,
            .turns_field = true,
            .power_up = foc_board_power_up,
            .sample = foc_board_sample,
            .control = foc_board_control,
            .transmit = foc_board_transmit,
            .shut_down = foc_board_shut_down,
            .axes = offsetof(struct foc_board, axis),
            .axis_size = sizeof(struct axis),
            .settings = &foc_settings,
        },
    .commands = foc_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .no_info = true,
    .loader_type = FOC_BOARD_2FOC,
    .command = foc_board_command,
    .targets = foc_board_targets,
};
