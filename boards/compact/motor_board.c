/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A motor board of the compact protocol: up to four axes, each with a voltage and a current mode.
 *
 * The current loop has a step a millisecond (boards/axis.h), with the back-EMF. That has
 * to be fed forward, for a motor with J R / (Kt Kw) of a few milliseconds, as COMAN's, speeds up as
 * fast as the loop itself. Over-current is I2t.
 */
#include "boards/compact/private.h"
#include "boards/axis.h"

#include <math.h>
#include <string.h>

enum {
    /* These faults open the bridge */
    FATAL = COMPACT_FAULT_UNDER_VOLTAGE | COMPACT_FAULT_OVER_VOLTAGE | COMPACT_FAULT_OVER_CURRENT |
            COMPACT_FAULT_MOTOR_ENCODER | COMPACT_FAULT_LINK_ENCODER | COMPACT_FAULT_TORQUE_SENSOR |
            COMPACT_FAULT_TEMPERATURE,
};

/* ---- modes ---- */

/* Resets set-point, integral and overload of an axis. */
static void compact_axis_forget_command(const struct board *board, struct compact_axis *axis)
{
    axis->set_point = 0;
    axis->command_ns = board->boards->now_ns;
    axis->integral_v = axis->voltage_v = 0.0;
    axis->overload_ms = 0.0;
}

/* Enters a mode, with an event and fresh references, when it is another one. */
static void compact_axis_set_mode(struct board *board, struct compact_axis *axis,
                                  enum compact_mode mode)
{
    if (mode != axis->mode) {
        board_event(board, BOARD_EVENT_MODE, compact_axis_index(board, axis), axis->mode, mode);
        axis->mode = mode;
        compact_axis_forget_command(board, axis);
    }
}

bool compact_axis_command_mode(struct board *board, unsigned index, enum compact_mode mode)
{
    struct compact_axis *axis = &compact_motor_of(board)->axis[index];

    if (mode == COMPACT_CURRENT && board->config.axis[index].valve) {
        return false;
    }
    if (mode == COMPACT_OFF) {
        axis->latched = 0;
        compact_axis_set_mode(board, axis, COMPACT_OFF);
    } else if (axis->mode != COMPACT_FAULT) {
        compact_axis_set_mode(board, axis, mode);
    }
    return true;
}

void compact_axis_command(struct board *board, unsigned index, int16_t set_point)
{
    struct compact_axis *axis = &compact_motor_of(board)->axis[index];

    axis->commands = (axis->commands + 1) & 0xf;
    axis->command_ns = board->boards->now_ns;
    axis->set_point = compact_axis_runs(axis) ? set_point : 0;
}

/* ---- power-up ---- */

/* Fills the settings as the factory has tuned them for the rig's motor, in the protocol's units. */
static void compact_axis_set_factory(struct compact_axis_settings *settings,
                                     const struct board_axis_config *config)
{
    double kp, ki;

    settings->current_limit_ma = compact_counts(config->current_limit_a, 1e-3);
    settings->min_position = compact_counts(config->lower_rad, COMPACT_POSITION_RAD);
    settings->max_position = compact_counts(config->upper_rad, COMPACT_POSITION_RAD);
    settings->temperature_limit_c = compact_temperature_limit(config);
    if (config->winding_ohm > 0.0) {
        current_loop_tune(config->winding_ohm, config->winding_h, &kp, &ki);
        settings->current_kp = compact_counts(kp, 1e-3);
        settings->current_ki = compact_counts(ki, 1e-3);
        settings->back_emf = compact_counts(config->bemf_v_s_rad, 1e-3);
    }
}

/* Restores the saved settings, those of the factory at first, and resets the axes (struct
 * board_ops). */
static void compact_motor_power_up(struct board *board)
{
    struct compact_motor *motor = compact_motor_of(board);
    bool first = compact_node_power_up(&motor->node);

    /* The first power-up finds how many axes there are */
    while (first && motor->axes < BOARD_AXES_MAX && board->config.axis[motor->axes].joint >= 0) {
        compact_axis_set_factory(&motor->axis[motor->axes].saved, &board->config.axis[motor->axes]);
        motor->axes++;
    }
    /* Any power-up starts in OFF without faults */
    motor->first_slot = compact_first_slot(board);
    for (unsigned i = 0; i < motor->axes; i++) {
        struct compact_axis *axis = &motor->axis[i];

        axis->settings = axis->saved;
        axis->mode = axis->reported_mode = COMPACT_OFF;
        axis->latched = axis->faults = axis->reported_faults = 0;
        axis->commands = axis->sequence = 0;
        axis->velocity_rad_s = 0.0;
        compact_axis_forget_command(board, axis);
    }
    motor->started = false;
    if (!first) {
        compact_node_identify(&motor->node);
    }
}

/* ---- sensors ---- */

/* Takes the sensors of an axis; a value without a number keeps the one before and is a fault. */
static void compact_axis_sample(struct compact_axis *axis, const struct board_axis_config *config,
                                const struct motor_sense *sense, int64_t ms)
{
    int32_t motor, link;

    axis->bad_motor = !control_quantize(sense->qm * config->motor_ticks_per_rad, &motor) ||
                      !isfinite(sense->current_a);
    axis->bad_link = !control_quantize(sense->q * config->joint_ticks_per_rad, &link);
    axis->bad_torque = !isfinite(sense->torque_nm);
    if (!axis->bad_motor) {
        axis->motor_rad = motor / config->motor_ticks_per_rad;
        axis->motor = (int32_t)compact_counts(axis->motor_rad, COMPACT_POSITION_RAD);
        axis->current_a = sense->current_a;
    }
    if (!axis->bad_link) {
        axis->link =
            (int32_t)compact_counts(link / config->joint_ticks_per_rad, COMPACT_POSITION_RAD);
    }
    if (!axis->bad_torque) {
        axis->torque_nm = sense->torque_nm;
    }
    control_quantize(sense->winding_c, &axis->temperature_c);
    if (ms > 0) {
        double change = (axis->motor_rad - axis->before_rad) / ((double)ms * 1e-3);

        axis->velocity_rad_s = (axis->velocity_rad_s + change) / 2.0;
        axis->before_rad = axis->motor_rad;
    }
}

/* Samples all axes. Encoders are quantized to their ticks, then reported in 1e-5 rad; the
 * rotor's speed is a running mean. */
static void compact_motor_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct compact_motor *motor = compact_motor_of(board);
    int64_t now_ms = board->boards->now_ns / MS;

    motor->supply_v = board_supply_v(sensors);
    for (unsigned i = 0; i < motor->axes; i++) {
        const struct board_axis_config *config = &board->config.axis[i];

        compact_axis_sample(&motor->axis[i], config, &sensors->motor[config->joint],
                            motor->started ? now_ms - motor->sampled_ms : 0);
        if (!motor->started) {
            motor->axis[i].before_rad = motor->axis[i].motor_rad;
        }
    }
    motor->started = true;
    motor->sampled_ms = now_ms;
}

/* ---- faults ---- */

/* Updates the I2t overload of an axis; returns whether it trips. */
static bool compact_axis_is_over_current(const struct board *board, struct compact_axis *axis)
{
    double limit = (double)axis->settings.current_limit_ma * 1e-3;
    double tick_ms = (double)board->boards->tick_ns / MS;

    if (!compact_axis_runs(axis)) {
        axis->overload_ms = 0.0;
        return false;
    }
    return overload_step(&axis->overload_ms, axis->current_a, limit, tick_ms);
}

/* Returns whether the set-point of a running axis is older than the time-out. */
static bool compact_axis_is_stale(const struct board *board, const struct compact_axis *axis)
{
    int64_t timeout_ms = compact_motor_of(board)->node.settings.timeout_ms;

    return compact_axis_runs(axis) && timeout_ms > 0 &&
           board->boards->now_ns - axis->command_ns > timeout_ms * MS;
}

/* Returns whether the link is beyond a position limit. */
static bool compact_axis_is_beyond_limit(const struct compact_axis *axis)
{
    return axis->link < axis->settings.min_position || axis->link > axis->settings.max_position;
}

/* Returns the faults that are present now, as bits. */
static unsigned compact_axis_present_faults(const struct board *board, struct compact_axis *axis)
{
    const struct compact_motor *motor = compact_motor_of(board);
    unsigned faults = 0;

    faults |= board_is_under_voltage(board, motor->supply_v) ? COMPACT_FAULT_UNDER_VOLTAGE : 0;
    faults |= board_is_over_voltage(board, motor->supply_v) ? COMPACT_FAULT_OVER_VOLTAGE : 0;
    faults |= compact_axis_is_over_current(board, axis) ? COMPACT_FAULT_OVER_CURRENT : 0;
    faults |= axis->bad_motor ? COMPACT_FAULT_MOTOR_ENCODER : 0;
    faults |= axis->bad_link ? COMPACT_FAULT_LINK_ENCODER : 0;
    faults |= axis->bad_torque ? COMPACT_FAULT_TORQUE_SENSOR : 0;
    faults |=
        axis->temperature_c > axis->settings.temperature_limit_c ? COMPACT_FAULT_TEMPERATURE : 0;
    faults |= compact_axis_is_stale(board, axis) ? COMPACT_FAULT_STALE : 0;
    faults |= compact_axis_is_beyond_limit(axis) ? COMPACT_FAULT_LIMIT : 0;
    faults |= board->lost_in_status ? COMPACT_FAULT_OVERFLOW : 0;
    return faults;
}

/* Updates the faults of an axis: events for new ones; fatal ones open the bridge and stay. */
static void compact_axis_watch_faults(struct board *board, struct compact_axis *axis)
{
    unsigned faults = compact_axis_present_faults(board, axis);
    unsigned risen = faults & ~(unsigned)axis->faults;
    struct boards_counters *counters = &board->boards->counters;

    /* Warnings: the mode stays */
    if (risen & COMPACT_FAULT_STALE) {
        axis->set_point = 0;
        counters->timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, compact_axis_index(board, axis), axis->mode, 0);
    }
    if (risen & COMPACT_FAULT_LIMIT && compact_axis_runs(axis)) {
        board_event(board, BOARD_EVENT_LIMIT, compact_axis_index(board, axis), (uint32_t)axis->link,
                    0);
    }
    if (risen & FATAL) {
        board_event(board, BOARD_EVENT_FAULT, compact_axis_index(board, axis), risen & FATAL, 0);
    }
    counters->trips += (faults & COMPACT_FAULT_OVER_CURRENT) != 0;
    counters->trips += (risen & COMPACT_FAULT_TEMPERATURE) != 0;
    /* A fatal fault is latched until the host switches the axis off */
    if (faults & FATAL && compact_axis_runs(axis)) {
        axis->latched |= (uint16_t)(faults & FATAL);
        compact_axis_set_mode(board, axis, COMPACT_FAULT);
    }
    axis->faults = (uint16_t)(faults | axis->latched);
}

/* ---- control ---- */

/* Returns the voltage of a set-point in voltage mode. */
static double compact_axis_voltage_law(const struct compact_axis *axis)
{
    return (double)axis->set_point * COMPACT_VOLTAGE_V;
}

/* Returns the voltage of the current loop (PI) plus the back-EMF, V. */
static double compact_axis_current_law(struct compact_axis *axis, double supply_v)
{
    const struct compact_axis_settings *p = &axis->settings;
    int64_t wanted = control_clamp(axis->set_point, -p->current_limit_ma, p->current_limit_ma);
    double error = (double)wanted * COMPACT_SET_CURRENT_A - axis->current_a;

    return current_loop_step(&axis->integral_v, (double)p->current_kp * 1e-3,
                             (double)p->current_ki * 1e-3, error, supply_v) +
           (double)p->back_emf * 1e-3 * axis->velocity_rad_s;
}

/* Sets set-points to 0 that lead further beyond a position limit. */
static void compact_axis_heed_limits(struct compact_axis *axis)
{
    bool further = (axis->link > axis->settings.max_position && axis->set_point > 0) ||
                   (axis->link < axis->settings.min_position && axis->set_point < 0);

    if (further) {
        axis->set_point = 0;
    }
}

/* Computes the voltage of an axis for this millisecond, within the supply. */
static void compact_axis_step(struct compact_axis *axis, double supply_v)
{
    double v = axis->mode == COMPACT_VOLTAGE   ? compact_axis_voltage_law(axis)
               : axis->mode == COMPACT_CURRENT ? compact_axis_current_law(axis, supply_v)
                                               : 0.0;

    axis->voltage_v = fmax(fmin(v, supply_v), -supply_v);
}

/* Writes bridges and voltages of all axes into the plant's command. */
static void compact_motor_drive_bridges(const struct board *board, struct plant_command *command)
{
    for (unsigned i = 0; i < compact_motor_of(board)->axes; i++) {
        const struct compact_axis *axis = &compact_motor_of(board)->axis[i];
        struct motor_command *motor = &command->motor[board->config.axis[i].joint];

        motor->bridge_on = compact_axis_runs(axis);
        motor->voltage_v = compact_axis_runs(axis) ? axis->voltage_v : 0.0;
    }
}

/* Runs one tick: faults, limits, laws, bridges (struct board_ops). */
static void compact_motor_control(struct board *board, struct ms_span span,
                                  struct plant_command *command)
{
    struct compact_motor *motor = compact_motor_of(board);

    for (unsigned i = 0; i < motor->axes; i++) {
        compact_axis_watch_faults(board, &motor->axis[i]);
        compact_axis_heed_limits(&motor->axis[i]);
        for (int64_t ms = span.from; ms < span.to; ms++) {
            compact_axis_step(&motor->axis[i], motor->supply_v);
        }
    }
    compact_motor_drive_bridges(board, command);
}

/* Switches all axes off (struct board_ops). */
static void compact_motor_shut_down(struct board *board, struct plant_command *command)
{
    for (unsigned i = 0; i < compact_motor_of(board)->axes; i++) {
        if (compact_axis_runs(&compact_motor_of(board)->axis[i])) {
            compact_axis_set_mode(board, &compact_motor_of(board)->axis[i], COMPACT_OFF);
        }
    }
    compact_motor_drive_bridges(board, command);
}

/* Returns whether an axis is in FAULT (struct board_ops). */
static bool compact_motor_is_faulty(const struct board *board)
{
    for (unsigned i = 0; i < compact_motor_of(board)->axes; i++) {
        if (compact_motor_of(board)->axis[i].mode == COMPACT_FAULT) {
            return true;
        }
    }
    return false;
}

/* Returns the mode of an axis (struct board_ops). */
static uint8_t compact_motor_mode(const struct board *board, unsigned axis)
{
    return (uint8_t)compact_motor_of(board)->axis[axis].mode;
}

/* ---- frames ---- */

/* Sends TELEMETRY of each axis. */
static void compact_motor_send_telemetry(struct board *board, struct frame_sink *sink)
{
    struct compact_motor *motor = compact_motor_of(board);

    for (unsigned i = 0; i < motor->axes; i++) {
        struct compact_axis *axis = &motor->axis[i];

        compact_node_send(&motor->node, sink, COMPACT_TELEMETRY, motor->first_slot + i,
                          (const int64_t[]){axis->motor, (int64_t)axis->motor - axis->link,
                                            compact_counts(axis->current_a, COMPACT_CURRENT_A),
                                            compact_counts(axis->torque_nm, COMPACT_TORQUE_NM),
                                            axis->sequence & 3});
        axis->sequence++;
    }
}

/* Sends TELEMETRY_FD, all axes in one frame. */
static void compact_motor_send_telemetry_fd(struct board *board, struct frame_sink *sink)
{
    struct compact_motor *motor = compact_motor_of(board);
    const struct compact_message *row = compact_message(COMPACT_TELEMETRY_FD);
    uint8_t data[64];

    for (unsigned i = 0; i < motor->axes; i++) {
        struct compact_axis *axis = &motor->axis[i];
        const int64_t values[] = {axis->motor,
                                  axis->link,
                                  compact_counts(axis->velocity_rad_s, COMPACT_VELOCITY_RAD_S),
                                  compact_counts(axis->current_a, COMPACT_SET_CURRENT_A),
                                  compact_counts(axis->torque_nm, COMPACT_TORQUE_FD_NM),
                                  axis->mode,
                                  (axis->faults & FATAL) != 0,
                                  axis->sequence & 0xf};

        fields_encode(row->fields, values, data + COMPACT_TELEMETRY_FD_LENGTH * i);
        axis->sequence++;
    }
    board_send(board, sink, compact_id(COMPACT_TELEMETRY_FD, board->address),
               (uint8_t)(COMPACT_TELEMETRY_FD_LENGTH * motor->axes), data);
}

/* Sends STATE of an axis. */
static void compact_axis_send_state(struct board *board, struct compact_axis *axis,
                                    struct frame_sink *sink)
{
    struct compact_motor *motor = compact_motor_of(board);

    axis->reported_mode = axis->mode;
    axis->reported_faults = axis->faults;
    compact_node_send(
        &motor->node, sink, COMPACT_STATE, motor->first_slot + compact_axis_index(board, axis),
        (const int64_t[]){axis->mode, axis->commands, axis->faults,
                          compact_counts(motor->supply_v, COMPACT_SUPPLY_V), axis->temperature_c,
                          compact_counts(axis->voltage_v, COMPACT_VOLTAGE_V)});
}

/* Sends telemetry when it is due, and STATE periodically and on changes (struct board_ops). */
static void compact_motor_transmit(struct board *board, struct ms_span span,
                                   struct frame_sink *sink)
{
    struct compact_motor *motor = compact_motor_of(board);
    bool overflow_reported = board->lost_in_status;

    if (compact_node_due(&motor->node) && motor->axes > 0) {
        if (board->bus->config.fd) {
            compact_motor_send_telemetry_fd(board, sink);
        } else {
            compact_motor_send_telemetry(board, sink);
        }
    }
    for (unsigned i = 0; i < motor->axes; i++) {
        struct compact_axis *axis = &motor->axis[i];

        if (compact_state_due(span, motor->first_slot + i) || axis->mode != axis->reported_mode ||
            axis->faults != axis->reported_faults) {
            compact_axis_send_state(board, axis, sink);
        }
        overflow_reported = overflow_reported && axis->reported_faults & COMPACT_FAULT_OVERFLOW;
    }
    /* Lost frames are forgotten when every axis has reported them */
    if (overflow_reported) {
        board->lost_in_status = board->lost_in_overflow = false;
    }
}

static const struct board_ops compact_motor_ops = {
    .identity = {.type = COMPACT_KIND_MOTOR, .major = 1, .minor = 0, .build = 12},
    .periodic_max = 2 * BOARD_AXES_MAX,
    .power_up = compact_motor_power_up,
    .sample = compact_motor_sample,
    .control = compact_motor_control,
    .transmit = compact_motor_transmit,
    .shut_down = compact_motor_shut_down,
    .fault = compact_motor_is_faulty,
    .mode = compact_motor_mode,
    .settings = &compact_settings,
};

static const struct compact_node_ops compact_motor_node_ops = {
    .parameter = compact_motor_access_parameter,
};

struct board *compact_motor_create(struct arena *arena)
{
    struct compact_motor *motor = arena_alloc(arena, 1, sizeof *motor);

    if (!motor) {
        return NULL;
    }
    motor->node.board.ops = &compact_motor_ops;
    motor->node.ops = &compact_motor_node_ops;
    return &motor->node.board;
}
