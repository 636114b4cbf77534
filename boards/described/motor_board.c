/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A motor board of a described protocol: up to four axes with the states of the file, faults that
 * open the bridge, and a time-out of commands. A fatal fault leads to the state with law fault
 * until a state with law off is commanded. Beyond a position limit only set-points of the open laws
 * (voltage, current, torque) that lead back are obeyed; the others keep their target within.
 */
#include "boards/described/private.h"

#include <math.h>
#include <string.h>

#define TEMPERATURE_MAX_C 125.0 /* limit where the rig gives none */

/* ---- states ---- */

enum described_law described_axis_law(const struct described_protocol *protocol,
                                      const struct described_axis *axis)
{
    return described_state_law(protocol, axis->state, axis->law);
}

/* Returns the law in force of an axis. */
static enum described_law axis_law(const struct board *board, const struct described_axis *axis)
{
    return described_axis_law(described_node_of(board)->protocol, axis);
}

/* Returns whether the bridge of an axis is on. */
static bool described_axis_runs(const struct board *board, const struct described_axis *axis)
{
    return described_law_drives(axis_law(board, axis));
}

void described_axis_forget(const struct board *board, struct described_axis *axis)
{
    memset(axis->target, 0, sizeof axis->target);
    axis->command_ns = board->boards->now_ns;
    axis->integral_v = axis->integral_nm = axis->voltage_v = 0.0;
    axis->overload_ms = 0.0;

    /* The target of position is the present position, not 0 */
    axis->target[DESCRIBED_TO_POSITION - DESCRIBED_SET_POINT] = axis->motor_rad - axis->zero_rad;
}

/* Enters a state; another one forgets set-points and loops. */
static void described_axis_set_state(struct board *board, struct described_axis *axis, int state)
{
    enum described_law before = axis_law(board, axis);

    if (state != axis->state) {
        axis->state = state;
        board_event(board, BOARD_EVENT_MODE, described_axis_index(board, axis), before,
                    axis_law(board, axis));
        described_axis_forget(board, axis);
    }
}

/* Enters a state that a host commands: off clears a fault where no frame exists for that;
 * nothing else leads out of it. */
static void described_axis_command_state(struct board *board, struct described_axis *axis,
                                         int state)
{
    const struct described_protocol *protocol = described_node_of(board)->protocol;

    if (protocol->state[state].law == DESCRIBED_OFF) {
        axis->latched = protocol->clears ? axis->latched : 0;
        described_axis_set_state(board, axis, state);
    } else if (axis->latched == 0) {
        described_axis_set_state(board, axis, state);
    }
}

/* Selects the law of the states whose law a host selects. */
static void described_axis_select_law(struct board *board, struct described_axis *axis, int law)
{
    enum described_law before = axis_law(board, axis);

    if (law != axis->law) {
        axis->law = law;
        if (axis_law(board, axis) != before) {
            board_event(board, BOARD_EVENT_MODE, described_axis_index(board, axis), before,
                        axis_law(board, axis));
            described_axis_forget(board, axis);
        }
    }
}

/* ---- commands ---- */

/* Sets a target from a field of a frame. */
static void described_axis_set_target(struct board *board, struct described_axis *axis,
                                      const struct described_frame *frame, size_t field,
                                      int64_t count)
{
    const struct described_protocol *protocol = described_node_of(board)->protocol;
    const struct described_state *state = &protocol->state[axis->state];
    enum described_meaning meaning = frame->field[field].meaning;
    double value = described_value(described_layout(frame, field), &frame->field[field], count);

    /* A set-point is of the law in force */
    if (meaning == DESCRIBED_SET_POINT) {
        static const enum described_meaning of_law[] = {
            [DESCRIBED_VOLTAGE] = DESCRIBED_TO_VOLTAGE,
            [DESCRIBED_CURRENT] = DESCRIBED_TO_CURRENT,
            [DESCRIBED_TORQUE] = DESCRIBED_TO_TORQUE,
            [DESCRIBED_VELOCITY] = DESCRIBED_TO_VELOCITY,
            [DESCRIBED_POSITION] = DESCRIBED_TO_POSITION,
            [DESCRIBED_IMPEDANCE] = DESCRIBED_TO_POSITION,
        };

        state = state->law == DESCRIBED_SELECTED ? &protocol->law[axis->law] : state;
        meaning = of_law[state->law];
        value = (double)count * state->set_point_scale;
    }
    axis->target[meaning - DESCRIBED_SET_POINT] = value;
}

/* Returns whether the axis has the state or law that a frame commands. */
static bool described_axis_has_law(const struct board *board, unsigned index,
                                   const struct described_frame *frame, const int64_t *values)
{
    const struct described_protocol *protocol = described_node_of(board)->protocol;
    int law = described_motor_of(board)->axis[index].law, state = frame->enter;
    bool suits = true;

    /* A motor has all laws, a valve none that controls a current */
    if (!board->config.axis[index].valve) {
        return true;
    }
    for (size_t i = 0; i < frame->nfield; i++) {
        if (frame->field[i].meaning == DESCRIBED_LAW) {
            law = described_find_state(protocol->law, protocol->nlaw, values[i], true);
            suits = described_law_suits_valve(protocol->law[law].law);
        } else if (frame->field[i].meaning == DESCRIBED_STATE) {
            state = described_find_state(protocol->state, protocol->nstate, values[i], true);
        }
    }
    if (state >= 0) {
        suits = suits && described_law_suits_valve(described_state_law(protocol, state, law));
    }
    return suits;
}

/* Latches the fault of an emergency stop, whether the axis runs or not. */
static void described_axis_stop(struct board *board, struct described_axis *axis)
{
    const uint32_t stopped = UINT32_C(1) << DESCRIBED_STOPPED;

    if (!(axis->latched & stopped)) {
        board_event(board, BOARD_EVENT_FAULT, described_axis_index(board, axis), stopped, 0);
    }
    axis->latched |= stopped;
    axis->faults |= stopped;
    described_axis_set_state(board, axis, described_node_of(board)->protocol->fault_state);
}

/* Forgets the faults that are over, and leaves their state. */
static void described_axis_clear_faults(struct board *board, struct described_axis *axis)
{
    axis->faults &= ~axis->latched;
    axis->latched = 0;
    if (axis_law(board, axis) == DESCRIBED_FAULT) {
        described_axis_set_state(board, axis, described_node_of(board)->protocol->off_state);
    }
}

/* Sets a setting, which is not negative; a value that is no number changes nothing. */
static void described_axis_set(struct described_axis *axis, const struct field *layout,
                               const struct described_field *field, int64_t count)
{
    const int64_t infinity = INT64_C(0x7f800000); /* the exponent of a float that is no number */

    if (!(layout->type & FIELD_FLOAT) || (count & infinity) != infinity) {
        axis->setting[field->meaning - DESCRIBED_SETTING] =
            fmax(described_value(layout, field, count), 0.0);
    }
}

/* Sets settings, parameters and the reading of the position; the axis keeps its state. */
static void described_axis_configure(struct board *board, struct described_axis *axis,
                                     const struct described_frame *frame, const int64_t *values)
{
    int parameter = described_find_field(frame, DESCRIBED_PARAMETER);
    int written = described_find_field(frame, DESCRIBED_PARAMETER_VALUE);

    /* Fields of their own */
    for (size_t i = 0; i < frame->nfield; i++) {
        const struct described_field *field = &frame->field[i];

        if (described_is_setting(field->meaning)) {
            described_axis_set(axis, described_layout(frame, i), field, values[i]);
        } else if (field->meaning == DESCRIBED_PRESENT_POSITION) {
            axis->zero_rad =
                axis->motor_rad - described_value(described_layout(frame, i), field, values[i]);
            described_axis_forget(board, axis);
        }
    }

    /* A parameter that is named by its number */
    if (parameter >= 0 && written >= 0) {
        const struct described_parameter *of =
            described_find_parameter(described_node_of(board)->protocol, values[parameter]);

        described_axis_set(axis, &of->layout, &of->field, values[written]);
    }
}

bool described_axis_obey(struct board *board, unsigned index, const struct described_frame *frame,
                         const int64_t *values)
{
    const struct described_protocol *protocol = described_node_of(board)->protocol;
    struct described_axis *axis = &described_motor_of(board)->axis[index];

    if (!described_axis_has_law(board, index, frame, values)) {
        return false;
    }

    /* Faults, the law and the state first: they forget the targets of before */
    if (frame->clear) {
        described_axis_clear_faults(board, axis);
    }
    for (size_t i = 0; i < frame->nfield; i++) {
        if (frame->field[i].meaning == DESCRIBED_LAW) {
            described_axis_select_law(
                board, axis, described_find_state(protocol->law, protocol->nlaw, values[i], true));
        }
    }
    for (size_t i = 0; i < frame->nfield; i++) {
        if (frame->field[i].meaning == DESCRIBED_STATE) {
            described_axis_command_state(
                board, axis,
                described_find_state(protocol->state, protocol->nstate, values[i], true));
        }
    }
    if (frame->enter >= 0) {
        described_axis_command_state(board, axis, frame->enter);
    }
    if (frame->stop) {
        described_axis_stop(board, axis);
    }
    described_axis_configure(board, axis, frame, values);
    if (frame->zero) {
        axis->zero_rad = axis->motor_rad;
        described_axis_forget(board, axis);
    }
    if (!frame->commands) {
        return true;
    }
    axis->commands++;
    axis->command_ns = board->boards->now_ns;
    for (size_t i = 0; i < frame->nfield && described_axis_runs(board, axis); i++) {
        if (frame->field[i].meaning >= DESCRIBED_SET_POINT &&
            frame->field[i].meaning <= DESCRIBED_TO_KD &&
            (frame->of_one || frame->field[i].axis == index)) {
            described_axis_set_target(board, axis, frame, i, values[i]);
        }
    }
    return true;
}

/* ---- power-up ---- */

/* Resets the settings to those of the file; limits stay those of the rig. */
static void described_axis_reset_settings(const struct described_protocol *protocol,
                                          struct described_axis *axis)
{
    const double setting[] = {
        [DESCRIBED_VELOCITY_LIMIT - DESCRIBED_SETTING] = HUGE_VAL,
        [DESCRIBED_CURRENT_LIMIT - DESCRIBED_SETTING] = HUGE_VAL,
        [DESCRIBED_POSITION_GAIN - DESCRIBED_SETTING] = protocol->position_per_s,
        [DESCRIBED_VELOCITY_GAIN - DESCRIBED_SETTING] = protocol->velocity_nm_s_rad,
        [DESCRIBED_INTEGRAL_GAIN - DESCRIBED_SETTING] = protocol->velocity_nm_rad,
    };

    memcpy(axis->setting, setting, sizeof axis->setting);
    axis->wanted_a = 0.0;
}

/* Powers up a motor board (struct board_ops). */
static void described_motor_power_up(struct board *board)
{
    struct described_motor *motor = described_motor_of(board);
    bool first = described_node_power_up(&motor->node);

    for (unsigned i = 0; i < motor->node.axes; i++) {
        const struct board_axis_config *config = &board->config.axis[i];
        struct described_axis *axis = &motor->axis[i];

        if (config->winding_ohm > 0.0) {
            current_loop_tune(config->winding_ohm, config->winding_h, &axis->kp_v_a,
                              &axis->ki_v_as);
        }
        axis->state = motor->node.protocol->off_state;
        axis->law = 0;
        axis->latched = axis->faults = 0;
        axis->commands = 0;
        axis->velocity_rad_s = axis->zero_rad = 0.0;
        described_axis_reset_settings(motor->node.protocol, axis);
        described_axis_forget(board, axis);
    }
    motor->started = false;
    if (!first) {
        described_node_announce(&motor->node);
    }
}

/* ---- sensors ---- */

/* Reads the sensors of an axis. ms: time since the last sample. */
static void described_axis_sample(struct described_axis *axis,
                                  const struct board_axis_config *config,
                                  const struct motor_sense *sense, int64_t ms)
{
    int32_t motor, link;

    /* Encoders are quantized to their ticks; what has no reading is held */
    axis->bad_motor = !control_quantize(sense->qm * config->motor_ticks_per_rad, &motor) ||
                      !isfinite(sense->current_a);
    axis->bad_link = !control_quantize(sense->q * config->joint_ticks_per_rad, &link);
    axis->bad_torque = !isfinite(sense->torque_nm);
    if (!axis->bad_motor) {
        axis->motor_rad = motor / config->motor_ticks_per_rad;
        axis->current_a = sense->current_a;
    }
    if (!axis->bad_link) {
        axis->link_rad = link / config->joint_ticks_per_rad;
    }
    if (!axis->bad_torque) {
        axis->torque_nm = sense->torque_nm;
    }
    control_quantize(sense->winding_c, &axis->temperature_c);
    axis->pressure_bar[0] = sense->pressure_pa[0] * 1e-5;
    axis->pressure_bar[1] = sense->pressure_pa[1] * 1e-5;
    axis->valve_opening = sense->valve_opening;

    /* The rotor's speed is a running mean */
    if (ms > 0) {
        double change = (axis->motor_rad - axis->before_rad) / ((double)ms * 1e-3);

        axis->velocity_rad_s = (axis->velocity_rad_s + change) / 2.0;
        axis->before_rad = axis->motor_rad;
    }
}

/* Reads the sensors of all axes (struct board_ops). */
static void described_motor_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_motor *motor = described_motor_of(board);
    int64_t now_ms = board->boards->now_ns / MS;

    motor->node.supply_v = board_supply_v(sensors);
    motor->node.oil_pa = board_oil_pa(sensors);
    for (unsigned i = 0; i < motor->node.axes; i++) {
        const struct board_axis_config *config = &board->config.axis[i];

        described_axis_sample(&motor->axis[i], config, &sensors->motor[config->joint],
                              motor->started ? now_ms - motor->sampled_ms : 0);
        if (!motor->started) {
            motor->axis[i].before_rad = motor->axis[i].motor_rad;
        }
    }
    motor->started = true;
    motor->sampled_ms = now_ms;
}

/* ---- faults ---- */

/* Returns whether the I2t law sees an overload of an axis that runs. */
static bool described_axis_is_over_current(const struct board *board, struct described_axis *axis)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];

    if (!described_axis_runs(board, axis)) {
        axis->overload_ms = 0.0;
        return false;
    }
    return overload_step(&axis->overload_ms, axis->current_a, config->current_limit_a,
                         (double)board->boards->tick_ns / MS);
}

/* Returns whether commands of an axis have not come for the time-out. */
static bool described_axis_is_stale(const struct board *board, const struct described_axis *axis)
{
    int64_t own_ns = described_node_of(board)->protocol->command_timeout_ns;
    int64_t timeout_ns = own_ns != 0 ? own_ns : board->config.command_timeout_ns;

    return described_axis_runs(board, axis) && timeout_ns > 0 &&
           board->boards->now_ns - axis->command_ns > timeout_ns;
}

/* Returns the bit of a fault if it is present. */
static uint32_t fault_if(bool present, enum described_fault fault)
{
    return present ? UINT32_C(1) << fault : 0;
}

/* Returns the faults that an axis has now. */
static uint32_t described_axis_present_faults(const struct board *board,
                                              struct described_axis *axis)
{
    const unsigned index = described_axis_index(board, axis);
    const struct board_axis_config *config = &board->config.axis[index];
    double supply_v = described_node_of(board)->supply_v;
    double oil_pa = described_node_of(board)->oil_pa;
    double hottest_c =
        config->temperature_limit_c > 0.0 ? config->temperature_limit_c : TEMPERATURE_MAX_C;

    return fault_if(board_is_under_voltage(board, supply_v), DESCRIBED_UNDER_VOLTAGE) |
           fault_if(board_is_over_voltage(board, supply_v), DESCRIBED_OVER_VOLTAGE) |
           fault_if(described_axis_is_over_current(board, axis), DESCRIBED_OVER_CURRENT) |
           fault_if(axis->bad_motor, DESCRIBED_MOTOR_ENCODER) |
           fault_if(axis->bad_link, DESCRIBED_LINK_ENCODER) |
           fault_if(axis->bad_torque, DESCRIBED_TORQUE_SENSOR) |
           fault_if(axis->temperature_c > hottest_c, DESCRIBED_OVER_TEMPERATURE) |
           fault_if(board_is_under_pressure(board, index, oil_pa), DESCRIBED_UNDER_PRESSURE) |
           fault_if(board_is_over_pressure(board, index, oil_pa), DESCRIBED_OVER_PRESSURE) |
           fault_if(described_axis_is_stale(board, axis), DESCRIBED_STALE) |
           fault_if(axis->link_rad < config->lower_rad || axis->link_rad > config->upper_rad,
                    DESCRIBED_LIMIT) |
           fault_if(board->lost_in_status, DESCRIBED_OVERFLOW);
}

/* Reacts to a time-out of commands: enters the protocol's state, or forgets the set-points. */
static void described_axis_expire(struct board *board, struct described_axis *axis)
{
    int state = described_node_of(board)->protocol->timeout_state;
    int64_t command_ns = axis->command_ns;

    board->boards->counters.timeouts++;
    board_event(board, BOARD_EVENT_TIMEOUT, described_axis_index(board, axis),
                axis_law(board, axis), 0);
    if (state >= 0) {
        axis->latched |= UINT32_C(1) << DESCRIBED_STALE;
        described_axis_set_state(board, axis, state);
    } else {
        double voltage_v = axis->voltage_v, overload_ms = axis->overload_ms;

        described_axis_forget(board, axis);
        axis->command_ns = command_ns;
        axis->voltage_v = voltage_v;
        axis->overload_ms = overload_ms;
    }
}

/* Finds the faults of an axis and reacts to new ones: events, counters, the fault state. */
static void described_axis_watch_faults(struct board *board, struct described_axis *axis)
{
    const struct described_protocol *protocol = described_node_of(board)->protocol;
    uint32_t faults = described_axis_present_faults(board, axis);
    uint32_t risen = faults & ~axis->faults, fatal = faults & DESCRIBED_FATAL;
    unsigned index = described_axis_index(board, axis);
    struct boards_counters *counters = &board->boards->counters;

    if (risen >> DESCRIBED_STALE & 1) {
        described_axis_expire(board, axis);
    }
    if (risen >> DESCRIBED_LIMIT & 1 && described_axis_runs(board, axis)) {
        int32_t ticks = 0;

        control_quantize(axis->link_rad * board->config.axis[index].joint_ticks_per_rad, &ticks);
        board_event(board, BOARD_EVENT_LIMIT, index, (uint32_t)ticks, 0);
    }
    if (risen & DESCRIBED_FATAL) {
        board_event(board, BOARD_EVENT_FAULT, index, risen & DESCRIBED_FATAL, 0);
    }
    counters->trips += faults >> DESCRIBED_OVER_CURRENT & 1;
    counters->trips += risen >> DESCRIBED_OVER_TEMPERATURE & 1;
    if (fatal && described_axis_runs(board, axis)) {
        axis->latched |= fatal;
        described_axis_set_state(board, axis, protocol->fault_state);
    }
    axis->faults = faults | axis->latched;
}

/* ---- control ---- */

/* Stops set-points of open laws that lead further beyond a limit. */
static void described_axis_heed_limits(const struct board *board, struct described_axis *axis)
{
    static const enum described_meaning open[] = {DESCRIBED_TO_VOLTAGE, DESCRIBED_TO_DUTY,
                                                  DESCRIBED_TO_CURRENT, DESCRIBED_TO_TORQUE};
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];
    bool above = axis->link_rad > config->upper_rad, below = axis->link_rad < config->lower_rad;

    if (axis_law(board, axis) > DESCRIBED_TORQUE) {
        return;
    }
    for (size_t i = 0; i < sizeof open / sizeof *open; i++) {
        double *target = &axis->target[open[i] - DESCRIBED_SET_POINT];

        if ((above && *target > 0.0) || (below && *target < 0.0)) {
            *target = 0.0;
        }
    }
}

/* Writes voltages and switches of the bridges into the command of the plant. */
static void described_motor_drive_bridges(const struct board *board, struct plant_command *command)
{
    for (unsigned i = 0; i < described_node_of(board)->axes; i++) {
        const struct described_axis *axis = &described_motor_of(board)->axis[i];
        struct motor_command *motor = &command->motor[board->config.axis[i].joint];

        motor->bridge_on = described_axis_runs(board, axis);
        motor->voltage_v = motor->bridge_on ? axis->voltage_v : 0.0;
    }
}

/* Runs a tick of a motor board: faults, limits and laws (struct board_ops). */
static void described_motor_control(struct board *board, struct ms_span span,
                                    struct plant_command *command)
{
    struct described_motor *motor = described_motor_of(board);

    for (unsigned i = 0; i < motor->node.axes; i++) {
        described_axis_watch_faults(board, &motor->axis[i]);
        described_axis_heed_limits(board, &motor->axis[i]);
        for (int64_t ms = span.from; ms < span.to; ms++) {
            described_axis_step(board, &motor->axis[i]);
        }
    }
    described_motor_drive_bridges(board, command);
}

/* Opens the bridges of a motor board (struct board_ops). */
static void described_motor_shut_down(struct board *board, struct plant_command *command)
{
    for (unsigned i = 0; i < described_node_of(board)->axes; i++) {
        struct described_axis *axis = &described_motor_of(board)->axis[i];

        if (described_axis_runs(board, axis)) {
            described_axis_set_state(board, axis, described_node_of(board)->protocol->off_state);
        }
    }
    described_motor_drive_bridges(board, command);
}

/* Returns whether some axis has latched a fault (struct board_ops). */
static bool described_motor_is_faulty(const struct board *board)
{
    for (unsigned i = 0; i < described_node_of(board)->axes; i++) {
        if (described_motor_of(board)->axis[i].latched) {
            return true;
        }
    }
    return false;
}

/* Returns the law in force of an axis, or that of faults (struct board_ops). */
static uint8_t described_motor_mode(const struct board *board, unsigned axis)
{
    const struct described_axis *of = &described_motor_of(board)->axis[axis];

    return (uint8_t)(of->latched ? DESCRIBED_FAULT : axis_law(board, of));
}

/* ---- what its frames tell ---- */

/* Computes targets, powers and settings of an axis; false: the meaning is another. */
static bool described_axis_power(const struct board *board, const struct described_axis *axis,
                                 enum described_meaning meaning, double *value)
{
    const struct board_axis_config *config = &board->config.axis[described_axis_index(board, axis)];
    double supply_v = described_node_of(board)->supply_v;
    double bridge_v = described_axis_runs(board, axis) ? axis->voltage_v : 0.0;

    switch (meaning) {
    /* Aims */
    case DESCRIBED_AXIS_VOLTAGE:
        *value = axis->voltage_v;
        return true;
    case DESCRIBED_CURRENT_TARGET:
        *value = axis->wanted_a;
        return true;
    case DESCRIBED_TORQUE_TARGET:
        *value = axis->wanted_a * config->torque_nm_a;
        return true;

    /* Powers */
    case DESCRIBED_ELECTRICAL_POWER:
        *value = bridge_v * axis->current_a;
        return true;
    case DESCRIBED_MECHANICAL_POWER:
        *value = axis->current_a * config->torque_nm_a * axis->velocity_rad_s;
        return true;
    case DESCRIBED_SUPPLY_CURRENT:
        *value = supply_v > 0.0 ? bridge_v * axis->current_a / supply_v : 0.0;
        return true;

    /* Settings */
    case DESCRIBED_CURRENT_LIMIT:
        *value =
            fmin(config->current_limit_a, described_axis_setting(axis, DESCRIBED_CURRENT_LIMIT));
        return true;
    default:
        *value = described_is_setting(meaning) ? described_axis_setting(axis, meaning) : 0.0;
        return described_is_setting(meaning);
    }
}

/* Computes what a field of an axis carries (struct described_node_ops). */
static bool described_motor_source(const struct described_node *node, unsigned index,
                                   const struct described_field *field, double *value,
                                   int64_t *count)
{
    const struct board *board = &node->board;
    const struct described_axis *axis = &described_motor_of(board)->axis[index];
    int32_t motor = 0, link = 0;

    if (described_axis_power(board, axis, field->meaning, value)) {
        return false;
    }
    switch (field->meaning) {
    /* Sensors */
    case DESCRIBED_MOTOR_POSITION:
        *value = axis->motor_rad - axis->zero_rad;
        return false;
    case DESCRIBED_LINK_POSITION:
        *value = axis->link_rad - axis->zero_rad;
        return false;
    case DESCRIBED_DEFLECTION:
        /* of counts, so that a host's difference is the link's count exactly */
        control_quantize(axis->motor_rad / field->scale, &motor);
        control_quantize(axis->link_rad / field->scale, &link);
        *count = (int64_t)motor - link;
        return true;
    case DESCRIBED_MOTOR_VELOCITY:
        *value = axis->velocity_rad_s;
        return false;
    case DESCRIBED_AXIS_CURRENT:
        *value = axis->current_a;
        return false;
    case DESCRIBED_AXIS_TORQUE:
        *value = axis->torque_nm;
        return false;
    case DESCRIBED_DRIVE_TORQUE:
        *value = axis->current_a * board->config.axis[index].torque_nm_a;
        return false;
    case DESCRIBED_AXIS_DUTY:
        *value = node->supply_v > 0.0 ? axis->voltage_v / node->supply_v : 0.0;
        return false;
    case DESCRIBED_PISTON_PRESSURE:
    case DESCRIBED_ROD_PRESSURE:
        *value = axis->pressure_bar[field->meaning - DESCRIBED_PISTON_PRESSURE];
        return false;
    case DESCRIBED_VALVE_OPENING:
        *value = axis->valve_opening;
        return false;
    case DESCRIBED_TEMPERATURE:
        *value = axis->temperature_c;
        return false;
    /* State */
    case DESCRIBED_LAW:
        *count = node->protocol->nlaw ? node->protocol->law[axis->law].value : 0;
        return true;
    case DESCRIBED_COMMANDS:
        *count = axis->commands;
        return true;
    case DESCRIBED_LATCHED_FAULTS:
        *count = described_fault_bits(node->protocol, axis->latched);
        return true;
    default:
        *count = 0;
        return true;
    }
}

/* Returns the faults of an axis (struct described_node_ops). */
static uint32_t described_motor_faults(const struct described_node *node, unsigned axis)
{
    return described_motor_of(&node->board)->axis[axis].faults;
}

/* Returns the state of an axis (struct described_node_ops). */
static int described_motor_state(const struct described_node *node, unsigned axis)
{
    return described_motor_of(&node->board)->axis[axis].state;
}

static const struct board_ops described_motor_ops = {
    .identity = {.type = 2, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX * DESCRIBED_AXES,
    .power_up = described_motor_power_up,
    .sample = described_motor_sample,
    .control = described_motor_control,
    .transmit = described_node_transmit,
    .shut_down = described_motor_shut_down,
    .fault = described_motor_is_faulty,
    .mode = described_motor_mode,
};

static const struct described_node_ops described_motor_node_ops = {
    .kind = DESCRIBED_MOTOR,
    .source = described_motor_source,
    .faults = described_motor_faults,
    .state = described_motor_state,
};

struct board *described_motor_create(struct arena *arena)
{
    struct described_motor *motor = arena_alloc(arena, 1, sizeof *motor);

    if (!motor) {
        return NULL;
    }
    motor->node.board.ops = &described_motor_ops;
    motor->node.ops = &described_motor_node_ops;
    return &motor->node.board;
}
