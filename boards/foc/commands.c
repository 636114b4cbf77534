/* SPDX-License-Identifier: Apache-2.0 */
/* Obeys each command of class 0 and DESIRED_TARGETS on a 2FOC board. */
#include "boards/foc/private.h"
#include "boards/motor_control.h"

#include "canbus/frame.h"

#include <math.h>
#include <string.h>

enum { TOLERANCE = 36 }; /* tolerance of the encoder, 0.1 deg */

/* Returns whether a mode drives the motor. */
static bool foc_is_control_mode(int64_t mode)
{
    return mode == ICUB_MODE_CURRENT || mode == ICUB_MODE_SPEED_VOLTAGE ||
           mode == ICUB_MODE_SPEED_CURRENT || mode == ICUB_MODE_OPEN_LOOP ||
           mode == ICUB_MODE_POSITION;
}

/* Obeys SET_CONTROL_MODE. Returns false when there is no such mode. */
static bool foc_board_command_mode(struct board *board, int64_t mode)
{
    struct foc_board *foc = foc_board_of(board);
    bool stop = mode == ICUB_MODE_IDLE || mode == ICUB_MODE_FORCE_IDLE;

    bool current = mode == ICUB_MODE_CURRENT || mode == ICUB_MODE_SPEED_CURRENT;

    if (!stop && (!foc_is_control_mode(mode) || (current && board->config.axis[0].valve))) {
        return false;
    }
    /* Not configured: ignored; in fault: only FORCE_IDLE, which clears it */
    if (foc->mode == ICUB_MODE_NOT_CONFIGURED) {
        return true;
    }
    if (foc->mode == ICUB_MODE_HARDWARE_FAULT) {
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

/* Obeys SET_CURRENT_PID or SET_VELOCITY_PID: one gain as a float, or all as integers. */
static bool foc_board_command_law(struct foc_board *foc, const struct bus_frame *frame,
                                  const int64_t *request)
{
    bool current = frame->data[0] == FOC_SET_CURRENT_PID;
    struct foc_law *law = current ? &foc->current : &foc->speed;

    if (frame->len == 6) {
        if (!foc_law_set_gain(law, frame->data[1] - 1u, (double)foc_get_float(frame->data + 2))) {
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

/* Obeys SET_PID: one parameter of a loop as a float. */
static bool foc_board_command_pid(struct foc_board *foc, const struct bus_frame *frame,
                                  const int64_t *request)
{
    float value = foc_get_float(frame->data + 4);
    unsigned which = (unsigned)request[1];

    if (which < FOC_PID_KP || which > FOC_PID_STICTION_DOWN || !isfinite(value)) {
        return false;
    }
    switch (request[0]) {
    case FOC_LOOP_POSITION:
        foc->position_law.gain[which] = value;
        return true;
    case FOC_LOOP_CURRENT:
        /* The other parameters have no use in a PI law with fixed limits */
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

/* Obeys SET_CURRENT_LIMIT: nominal, peak and overload, or the peak alone. */
static bool foc_board_command_limit(struct foc_board *foc, const struct bus_frame *frame,
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

/* Obeys SET_MOTOR_CONFIG: which sensors the motor has, resolution, poles. */
static void foc_board_configure_motor(struct foc_board *foc, const struct bus_frame *frame,
                                      const int64_t *request)
{
    foc->flags = (uint8_t)request[0];
    foc->resolution = request[1];
    foc->index_offset = request[2];
    foc->poles = request[3];
    foc->tolerance = frame->len == 8 ? request[4] : TOLERANCE;
    foc->motor_set = true;
    foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED;
    /* With Hall sensors there is no index; with an index the encoder waits for its pulse */
    if (foc->flags & FOC_HAS_HALL) {
        foc->flags &= (uint8_t) ~(FOC_HAS_INDEX | FOC_HAS_TEMPERATURE);
    }
    if (foc->flags & FOC_HAS_QE && foc->flags & FOC_HAS_INDEX) {
        foc->encoder |= FOC_QE_NOT_CALIBRATED;
    }
}

/* Obeys a command that configures. Returns false when it is refused. */
static bool foc_board_configure(struct foc_board *foc, const struct bus_frame *frame,
                                const int64_t *request)
{
    switch (frame->data[0]) {
    case FOC_SET_CURRENT_PID:
    case FOC_SET_VELOCITY_PID:
        return foc_board_command_law(foc, frame, request);
    case FOC_SET_PID:
        return foc_board_command_pid(foc, frame, request);
    case FOC_SET_CURRENT_LIMIT:
        return foc_board_command_limit(foc, frame, request);
    case FOC_SET_MOTOR_CONFIG:
        foc_board_configure_motor(foc, frame, request);
        return true;
    case FOC_SET_TEMPERATURE_LIMIT:
        foc->temperature_limit = request[0];
        return true;
    case FOC_SET_MOTOR_PARAMETER:
        if (request[0] < FOC_MOTOR_BEMF || request[0] > FOC_MOTOR_MAX_VELOCITY) {
            return false;
        }
        foc->motor_parameter[request[0]] = foc_get_float(frame->data + 2);
        return true;
    case ICUB_SET_I2T: /* the limits of the current set it here */
        return true;
    default:
        return false;
    }
}

/* Takes a target in the units of the mode, within its limits. */
static void foc_board_set_target(struct foc_board *foc, int64_t target)
{
    switch (foc->mode) {
    case ICUB_MODE_OPEN_LOOP:
        foc->target = control_clamp(target, -FOC_PWM_MAX, FOC_PWM_MAX);
        break;
    case ICUB_MODE_CURRENT:
        foc->target = control_clamp(target, -foc->peak_ma, foc->peak_ma);
        break;
    case ICUB_MODE_IDLE:
        foc_board_forget_references(foc);
        break;
    default:
        foc->target = target;
        break;
    }
}

/* Answers a command that asks; returns false when it is not one of them. */
static bool foc_board_answer(struct board *board, unsigned code, const int64_t *request,
                             int64_t *reply)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t bits;

    switch (code) {
    case FOC_GET_FIRMWARE_VERSION:
        foc->compatible = request[0] == ICUB_PROTOCOL_MAJOR && request[1] == ICUB_PROTOCOL_MINOR;
        icub_board_report_firmware(board, ICUB_PROTOCOL_MAJOR, ICUB_PROTOCOL_MINOR, foc->compatible,
                                   reply);
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

/* Enters idle when all that configures has come. */
static void foc_board_idle_when_configured(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);

    if (foc->mode == ICUB_MODE_NOT_CONFIGURED && foc->compatible && foc->motor_set &&
        foc->current_set && foc->peak_ma != 0) {
        foc_board_set_mode(board, ICUB_MODE_IDLE);
        foc->answers += foc->answers < FOC_ANSWERS_MAX; /* reports it unasked, once */
    }
}

bool foc_board_command(struct icub_board *icub, const struct bus_frame *frame,
                       const int64_t *request, int64_t *reply, bool *answer)
{
    struct board *board = &icub->board;
    struct foc_board *foc = foc_board_of(board);
    unsigned code = frame->data[0];
    bool obeyed;

    /* What is answered in any mode */
    (void)answer;
    if (foc_board_answer(board, code, request, reply)) {
        foc_board_idle_when_configured(board);
        return true;
    }

    /* What changes the board or its axis */
    if (code == ICUB_SET_BOARD_ID) {
        return !foc_runs(foc->mode) && board_set_address(board, (uint8_t)request[0]);
    }
    if (!foc->compatible) {
        return false; /* a host must state its protocol first */
    }

    switch (code) {
    case FOC_SET_CONTROL_MODE:
        return foc_board_command_mode(board, request[0]);
    case ICUB_SET_OPEN_LOOP: /* targets as DESIRED_TARGETS brings them, in their mode only */
        obeyed = foc->mode == ICUB_MODE_OPEN_LOOP;
        break;
    case ICUB_SET_DESIRED_VELOCITY:
        obeyed = foc->mode == ICUB_MODE_SPEED_VOLTAGE || foc->mode == ICUB_MODE_SPEED_CURRENT;
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

/* Obeys DESIRED_TARGETS. Any such frame feeds the watchdog; one too short for this board's
 * target gets no answer. */
bool foc_board_targets(struct icub_board *icub, const struct bus_frame *frame)
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
    }
    return true;
}
