/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A 2FOC board: one motor, one answer to each DESIRED_TARGETS. Its modes, gates and faults are
 * those of the firmware, its control laws those of boards/foc/control.h.
 */
#include "boards/foc/private.h"
#include "boards/motor_control.h"

#include "canbus/frame.h"

#include <math.h>
#include <string.h>

void foc_board_forget_references(struct foc_board *foc)
{
    foc->target = foc->speed_ma = 0;
    foc->vq = 0;
    foc->limiter = (struct foc_limiter){0};
    foc_law_reset(&foc->current);
    foc_law_reset(&foc->speed);
    foc_position_reset(&foc->position_law);
    foc->start = foc->position;
}

void foc_board_set_mode(struct board *board, uint8_t mode)
{
    struct foc_board *foc = foc_board_of(board);

    if (mode != foc->mode) {
        board_event(board, BOARD_EVENT_MODE, 0, foc->mode, mode);
        foc->mode = mode;
    }
    foc_board_forget_references(foc);
    foc->target_ns = board->boards->now_ns;
}

/* Latches faults, with an event for new ones, and enters hardware fault. */
static void foc_board_raise_faults(struct board *board, uint32_t faults)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t risen = faults & ~foc->faults;

    foc->faults |= faults;
    if (risen) {
        board_event(board, BOARD_EVENT_FAULT, 0, risen, 0);
    }
    if (foc->mode != ICUB_MODE_HARDWARE_FAULT && foc->mode != ICUB_MODE_NOT_CONFIGURED) {
        foc_board_set_mode(board, ICUB_MODE_HARDWARE_FAULT);
    }
}

/* Resets the board to the firmware's defaults, not configured (struct board_ops). */
static void foc_board_power_up(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);
    int32_t temperature_limit = 0;
    const struct foc_board fresh = {
        .icub = foc->icub,
        .mode = ICUB_MODE_NOT_CONFIGURED,
        .speed = {.kp = 0x0c, .ki = 0x08, .shift = 0x0a}, /* the firmware's */
        .supply_v = foc->supply_v,
        .target_ns = board->boards->now_ns,
        .status_ms = INT64_MIN / 2,
        .sampled_ms = board->boards->now_ns / MS,
    };

    control_quantize(board->config.axis[0].temperature_limit_c / ICUB_TEMPERATURE_C,
                     &temperature_limit);
    *foc = fresh;
    foc->temperature_limit = control_clamp(temperature_limit, 0, INT16_MAX);
}

/* ---- sensors ---- */

/* Returns the encoder ticks of a rotor revolution. */
static double foc_ticks_per_rev(const struct board_axis_config *axis)
{
    return axis->motor_ticks_per_rad * 2.0 * M_PI / axis->gear;
}

/* Takes the sensors. The rotor encoder is quantized and becomes icubdeg; its speed is a running
 * mean over milliseconds. */
static void foc_board_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct foc_board *foc = foc_board_of(board);
    const struct board_axis_config *axis = &board->config.axis[0];
    int64_t now_ms = board->boards->now_ns / MS, ms = now_ms - foc->sampled_ms;
    const struct motor_sense *sense;
    int32_t raw, position = 0, turn = 0;

    foc->supply_v = board_supply_v(sensors);
    if (axis->joint < 0) {
        return;
    }

    /* Without a number the values before stay */
    sense = &sensors->motor[axis->joint];
    foc->sensors_bad = !control_quantize(sense->qm * axis->motor_ticks_per_rad, &raw) ||
                       !isfinite(sense->current_a);
    if (foc->sensors_bad) {
        return;
    }
    foc->current_a = sense->current_a;
    control_quantize(sense->winding_c / ICUB_TEMPERATURE_C, &foc->temperature);
    control_quantize(floor((double)raw * FOC_ICUBDEG_PER_REV / foc_ticks_per_rev(axis)), &position);
    control_quantize(floor((double)raw / foc_ticks_per_rev(axis)), &turn);

    /* The encoder is calibrated when its index has gone by, once a revolution */
    if (!foc->started) {
        foc->position_before = foc->start = position;
        foc->started = true;
    } else if (turn != foc->turn) {
        foc->encoder &= (uint8_t)~FOC_QE_NOT_CALIBRATED;
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

/* Returns the measured current, mA. */
static int64_t foc_board_current_ma(const struct foc_board *foc)
{
    int32_t value = 0;

    control_quantize(foc->current_a * 1e3, &value);
    return value;
}

/* ---- faults ---- */

/* Steps the I2t law of the firmware, once a millisecond: at the peak current an axis trips after
 * 10.24 s. */
static void foc_board_watch_i2t(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);
    int64_t current = control_clamp(foc_board_current_ma(foc), INT16_MIN, INT16_MAX);
    int64_t nominal2 = foc->nominal_ma * foc->nominal_ma;
    int64_t limit = (foc->peak_ma * foc->peak_ma - nominal2) * 10;

    foc->i2t += (current * current - nominal2) / 1024;
    foc->i2t = foc->i2t > 0 ? foc->i2t : 0;
    if (foc->mode != ICUB_MODE_NOT_CONFIGURED && !(foc->flags & FOC_HAS_TEMPERATURE) &&
        foc->i2t > limit && foc->mode != ICUB_MODE_HARDWARE_FAULT) {
        board->boards->counters.trips++;
        foc_board_raise_faults(board, FOC_FAULT_I2T);
    }
}

/* Checks set-point, current, supply, encoder and winding of a running motor and raises faults. */
static void foc_board_watch_faults(struct board *board)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t faults = 0;

    if (!foc_runs(foc->mode)) {
        return;
    }

    /* The host: DESIRED_TARGETS must come */
    if (board->boards->now_ns - foc->target_ns > (int64_t)FOC_TARGET_TIMEOUT_MS * MS) {
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, 0, foc->mode, 0);
        faults |= FOC_FAULT_SET_POINT_EXPIRED;
    }

    /* The hardware: current, supply, encoder, winding */
    if (foc->overload_ma > 0 && fabs(foc->current_a) * 1e3 > (double)foc->overload_ma) {
        board->boards->counters.trips++;
        faults |= FOC_FAULT_OVER_CURRENT;
    }
    if (board_is_under_voltage(board, foc->supply_v)) {
        faults |= FOC_FAULT_UNDER_VOLTAGE;
    }
    if (board_is_over_voltage(board, foc->supply_v)) {
        faults |= FOC_FAULT_OVER_VOLTAGE;
    }
    if (foc->sensors_bad) {
        foc->encoder |= FOC_QE_PHASE_BROKEN;
        faults |= FOC_FAULT_ENCODER;
    }
    if (foc->flags & FOC_HAS_TEMPERATURE && foc->temperature_limit > 0 &&
        foc->temperature > foc->temperature_limit) {
        board->boards->counters.trips++;
        faults |= FOC_FAULT_OVER_HEATING;
    }
    if (faults) {
        foc_board_raise_faults(board, faults);
    }
}

/* ---- control laws, once a millisecond ---- */

/* Returns the current reference of the speed loop, mA (incremental PI). */
static int64_t foc_board_speed_law(struct foc_board *foc)
{
    int64_t error = foc->target - foc->velocity;

    foc->speed_ma += (error - foc->speed.error) * 16 + error + foc->speed.error;
    foc->speed_ma = control_clamp(foc->speed_ma, -foc->peak_ma, foc->peak_ma);
    foc->speed.error = error;
    return foc->speed_ma;
}

/* Returns what the current limiter leaves of a voltage. */
static int64_t foc_board_limit_current(struct foc_board *foc, int64_t vq)
{
    return foc_limiter_step(&foc->limiter, &foc->current, vq, foc_board_current_ma(foc),
                            foc->peak_ma);
}

/* Computes the voltage of this millisecond by the law of the mode. */
static void foc_board_step_laws(struct foc_board *foc)
{
    int64_t vq;

    switch (foc->mode) {
    case ICUB_MODE_OPEN_LOOP:
        vq = foc_board_limit_current(foc, foc->target / (1 << FOC_VQ_SHIFT));
        break;
    case ICUB_MODE_SPEED_VOLTAGE:
        vq = foc_board_limit_current(foc, foc_law_step(&foc->speed, foc->target - foc->velocity));
        break;
    case ICUB_MODE_POSITION:
        vq = foc_board_limit_current(
            foc, foc_position_step(&foc->position_law,
                                   (double)foc->target - ((double)foc->position - foc->start)));
        break;
    case ICUB_MODE_SPEED_CURRENT:
        vq = foc_law_step(&foc->current, foc_board_speed_law(foc) - foc_board_current_ma(foc));
        break;
    case ICUB_MODE_CURRENT:
        vq = foc_law_step(&foc->current, foc->target - foc_board_current_ma(foc));
        break;
    default:
        vq = 0;
        break;
    }
    foc->vq = control_clamp(vq, -FOC_VQ_MAX, FOC_VQ_MAX);
}

/* Writes bridge and voltage into the plant's command. */
static void foc_board_drive_bridge(const struct board *board, struct plant_command *command)
{
    const struct foc_board *foc = foc_board_of(board);
    int joint = board->config.axis[0].joint;

    if (joint >= 0) {
        command->motor[joint].bridge_on = foc_runs(foc->mode);
        command->motor[joint].voltage_v =
            foc_runs(foc->mode) ? (double)foc->vq * 1e-3 * foc->supply_v : 0.0;
    }
}

/* Runs one tick: faults, laws, bridge (struct board_ops). */
static void foc_board_control(struct board *board, struct ms_span span,
                              struct plant_command *command)
{
    foc_board_watch_faults(board);
    for (int64_t ms = span.from; ms < span.to; ms++) {
        foc_board_watch_i2t(board);
        foc_board_step_laws(foc_board_of(board));
    }
    foc_board_drive_bridge(board, command);
}

/* Switches the motor off (struct board_ops). */
static void foc_board_shut_down(struct board *board, struct plant_command *command)
{
    if (foc_runs(foc_board_of(board)->mode)) {
        foc_board_set_mode(board, ICUB_MODE_IDLE);
    }
    foc_board_drive_bridge(board, command);
}

/* Returns whether the board is in hardware fault (struct board_ops). */
static bool foc_board_is_faulty(const struct board *board)
{
    return foc_board_of(board)->mode == ICUB_MODE_HARDWARE_FAULT;
}

/* Returns the mode (struct board_ops). */
static uint8_t foc_board_mode(const struct board *board, unsigned axis)
{
    (void)axis; /* there is one */
    return foc_board_of(board)->mode;
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

/* Returns the fault bits for the state of the CAN controller; none of them stops the motor. */
static uint32_t foc_board_can_faults(const struct board *board)
{
    const struct board_can_state *can = &board->can;

    return (can->rec >= BOARD_CAN_WARNING ? FOC_FAULT_CAN_RX_WARNING : 0) |
           (can->tec >= BOARD_CAN_WARNING ? FOC_FAULT_CAN_TX_WARNING : 0) |
           (can->rec >= BOARD_CAN_PASSIVE ? FOC_FAULT_CAN_RX_PASSIVE : 0) |
           (can->tec >= BOARD_CAN_PASSIVE ? FOC_FAULT_CAN_TX_PASSIVE : 0);
}

/* Latches those bits that stay until the faults are cleared. */
static void foc_board_latch_can_faults(struct foc_board *foc, uint32_t now)
{
    foc->faults |=
        (now & (FOC_FAULT_CAN_RX_WARNING | FOC_FAULT_CAN_TX_WARNING) ? FOC_FAULT_CAN_WAS_WARNING
                                                                     : 0) |
        (now & FOC_FAULT_CAN_RX_PASSIVE ? FOC_FAULT_CAN_RX_WAS_PASSIVE : 0) |
        (now & FOC_FAULT_CAN_TX_PASSIVE ? FOC_FAULT_CAN_TX_WAS_PASSIVE : 0);
}

/* Sends FOC and STATUS for each DESIRED_TARGETS, and ADDITIONAL_STATUS (struct board_ops). */
static void foc_board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct foc_board *foc = foc_board_of(board);
    uint32_t can = foc_board_can_faults(board);
    int64_t period_ms = board->config.status_period_ns / MS;
    int64_t additional_ms = foc_additional_status_ms(board->address);

    /* Frames that were lost, and errors of the CAN controller */
    if (board->lost_in_status) {
        foc->faults |= FOC_FAULT_CAN_OVERRUN;
        board->lost_in_status = board->lost_in_overflow = false;
    }
    foc_board_latch_can_faults(foc, can);
    /* An answer to each DESIRED_TARGETS, STATUS no more often than the rig says */
    for (; foc->answers > 0; foc->answers--) {
        foc_board_send_frame(
            board, sink, FOC_FEEDBACK,
            (const int64_t[]){foc_board_current_ma(foc), foc->velocity, foc->position});
        if (span.to - foc->status_ms >= period_ms) {
            foc->status_ms = span.to;
            foc_board_send_frame(board, sink, FOC_STATUS,
                                 (const int64_t[]){foc->mode, foc->encoder,
                                                   foc->vq * (1 << FOC_VQ_SHIFT),
                                                   foc->faults | can});
        }
    }
    if (span.to / additional_ms > span.from / additional_ms) {
        foc_board_send_frame(board, sink, FOC_ADDITIONAL_STATUS,
                             (const int64_t[]){foc->temperature});
    }
}

static const struct board_ops foc_board_ops = {
    .identity = {.type = FOC_BOARD_2FOC, .major = 3, .minor = 6, .build = 31},
    .periodic_max = 2 * FOC_ANSWERS_MAX + 1,
    .turns_field = true,
    .power_up = foc_board_power_up,
    .sample = foc_board_sample,
    .control = foc_board_control,
    .transmit = foc_board_transmit,
    .shut_down = foc_board_shut_down,
    .fault = foc_board_is_faulty,
    .mode = foc_board_mode,
    .settings = &foc_settings,
};

static const struct icub_board_ops foc_icub_ops = {
    .commands = foc_commands,
    .command_count = ICUB_MOTOR_COMMANDS,
    .command_class = ICUB_POLLING_MOTOR,
    .no_info = true,
    .loader_type = FOC_BOARD_2FOC,
    .command = foc_board_command,
    .targets = foc_board_targets,
};

struct board *foc_board_create(struct arena *arena)
{
    struct foc_board *foc = arena_alloc(arena, 1, sizeof *foc);

    if (!foc) {
        return NULL;
    }
    foc->icub.board.ops = &foc_board_ops;
    foc->icub.ops = &foc_icub_ops;
    return &foc->icub.board;
}
