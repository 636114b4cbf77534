/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A motor board of a described protocol. It has up to four axes with the file's states, faults that
 * open the bridge, and a command time-out. A fatal fault enters the state with law fault. The axis
 * stays there until the host clears the fault: with a frame that clears faults, or, if the protocol
 * has no such frame, by commanding a state with law off. Beyond a position limit, open laws
 * (voltage, current, torque) obey only set points that lead back. Other laws clamp their target.
 *
 * Each law runs once a millisecond and uses the law below it:
 *
 *   position   v* = position_per_s (p* - p) + velocity target
 *   velocity   torque* = velocity_nm_s_rad (v* - v) + integral + torque target
 *   impedance  torque* = kp (p* - p) + kd (v* - v) + torque target
 *   torque     current* = torque* / torque constant
 *   current    the drive's own controller (boards/axis.h), within the current limit
 *
 * The controller applies kp, kd and velocity_nm_s_rad to the rotor's angle and speed at all times.
 *
 * A servo valve drives its axis at a speed proportional to its voltage. Therefore the velocity law
 * sets the voltage to v* times the back-EMF constant.
 */
#include "boards/described/private.h"

#define TEMPERATURE_MAX_C 125.0 /* default limit */

/* Returns the index of an axis on its board. */
static unsigned axis_index(const struct described_node *node, const struct described_axis *axis)
{
    return (unsigned)(axis - node->axis);
}

/* Returns a setting of an axis. */
static double axis_setting(const struct described_axis *axis, enum described_meaning setting)
{
    return axis->setting[setting - DESCRIBED_SETTING];
}

/* Returns a target of an axis. */
static double axis_target(const struct described_axis *axis, enum described_meaning meaning)
{
    return axis->target[meaning - DESCRIBED_SET_POINT];
}

/* ---- states ---- */

/* Resets set points, integrals and overload. */
static void axis_forget(const struct described_node *node, struct described_axis *axis)
{
    memset(axis->target, 0, sizeof axis->target);
    axis->target[DESCRIBED_TO_VELOCITY_CAP - DESCRIBED_SET_POINT] = HUGE_VAL;
    axis->target[DESCRIBED_TO_CURRENT_CAP - DESCRIBED_SET_POINT] = HUGE_VAL;
    axis->command_ns = node->board.boards->now_ns;
    axis->integral_nm = axis->base.voltage_v = 0.0;
    axis->base.law.on = false;
    axis->base.overload_ms = 0.0;

    /* The position target becomes the present position, not 0 */
    axis->target[DESCRIBED_TO_POSITION - DESCRIBED_SET_POINT] =
        axis->base.motor_rad - axis->zero_rad;
}

/* Copies bridge state, law and faults of an axis to its base. */
static void axis_show(struct described_axis *axis)
{
    axis->base.on = described_axis_runs(axis);
    axis->base.faulty = axis->latched;
    axis->base.mode = (uint8_t)(axis->latched ? DESCRIBED_FAULT : axis->active);
}

/* Packs the state and the law of an axis into one number for events. described_describe_event
 * unpacks it. */
static uint32_t axis_mode(const struct described_axis *axis)
{
    return (uint32_t)axis->state | (uint32_t)axis->law << 8;
}

/* Enters a state with the host's selected law. A change of state or law resets set points and
 * loops. */
static void axis_enter(struct described_node *node, struct described_axis *axis, int state, int law)
{
    enum described_law before = axis->active;
    bool changed = state != axis->state;
    uint32_t old = axis_mode(axis);

    axis->entered_ns = changed ? node->board.boards->now_ns : axis->entered_ns;
    axis->state = state;
    axis->law = law;
    axis->result = node->protocol->state[state].result;
    axis->active = described_state_law(node->protocol, state, law);
    if (changed || axis->active != before) {
        board_event(&node->board, BOARD_EVENT_MODE, axis_index(node, axis), old, axis_mode(axis));
        axis_forget(node, axis);
    }
    axis_show(axis);
}

/* Enters a state that a host commands. An axis in fault enters only a permanent state with law off.
 * This state also clears faults, unless the protocol has a frame that clears faults. */
static void axis_command_state(struct described_node *node, struct described_axis *axis, int state)
{
    const struct described_state *to = &node->protocol->state[state];
    bool off = to->law == DESCRIBED_OFF && to->lasts_ns == 0;

    if (to->law == DESCRIBED_REFUSED) {
        axis->result = to->result;
        return;
    }
    if (off && !node->protocol->clears) {
        axis->latched = 0;
    }
    if (off || axis->latched == 0) {
        axis_enter(node, axis, state, axis->law);
    }
}

/* ---- commands ---- */

/* Sets a target from a field of a frame. */
static void axis_set_target(const struct described_node *node, struct described_axis *axis,
                            const struct described_field *field, int64_t count)
{
    const struct described_state *state = &node->protocol->state[axis->state];

    /* A set_point field is the target of the law in force */
    if (field->meaning == DESCRIBED_SET_POINT) {
        state = state->law == DESCRIBED_SELECTED ? &node->protocol->law[axis->law] : state;
        axis->target[described_law_target(state->law) - DESCRIBED_SET_POINT] =
            (double)count * state->set_point_scale;
    } else {
        axis->target[field->meaning - DESCRIBED_SET_POINT] =
            described_node_value(node, axis_index(node, axis), field, count);
    }
}

/* Returns the index of the state or law that a frame commands; `otherwise` if it commands none. */
static int frame_names(const struct described_frame *frame, enum described_meaning meaning,
                       const struct described_state *list, size_t count, const int64_t *values,
                       int otherwise)
{
    int field = described_find_field(frame, meaning);

    return field < 0 ? otherwise : described_find_state(list, count, values[field], true);
}

/* Latches an emergency stop, even if the axis is off. */
static void axis_stop(struct described_node *node, struct described_axis *axis)
{
    const uint32_t stopped = UINT32_C(1) << DESCRIBED_STOPPED;

    if (!(axis->latched & stopped)) {
        board_event(&node->board, BOARD_EVENT_FAULT, axis_index(node, axis), stopped, 0);
    }
    axis->latched |= stopped;
    axis->faults |= stopped;
    axis_enter(node, axis, described_fault_state(node->protocol, stopped), axis->law);
}

/* Writes a setting of an axis; a negative value becomes 0. Ignores a value that is not finite. */
static void axis_set(const struct described_node *node, struct described_axis *axis,
                     const struct described_field *field, int64_t count)
{
    const int64_t infinity = INT64_C(0x7f800000); /* exponent of a float that is not finite */

    if (!field->real || (count & infinity) != infinity) {
        axis->setting[field->meaning - DESCRIBED_SETTING] =
            fmax(described_node_value(node, axis_index(node, axis), field, count), 0.0);
    }
}

/* Counts a set point, which resets the time-out. */
static void axis_count_command(const struct described_node *node, struct described_axis *axis)
{
    axis->commands++;
    axis->command_ns = node->board.boards->now_ns;
}

/* Writes a parameter of an axis. Its value was checked (described_values_exist). */
static void axis_write(struct described_node *node, struct described_axis *axis,
                       const struct described_parameter *parameter, int64_t count)
{
    const struct described_protocol *protocol = node->protocol;
    const struct described_field *field = &parameter->field;
    const enum described_meaning meaning = field->meaning;

    if (meaning == DESCRIBED_STORED) {
        node->stored[axis_index(node, axis)][parameter - protocol->parameter] =
            (uint32_t)(count & (int64_t)field->mask);
    } else if (described_is_setting(meaning)) {
        axis_set(node, axis, field, count);
    } else if (meaning == DESCRIBED_LAW) {
        axis_enter(node, axis, axis->state,
                   described_find_state(protocol->law, protocol->nlaw, count, true));
    } else if (meaning == DESCRIBED_ADDRESS) {
        board_set_address(&node->board, (uint8_t)count);
    } else if (meaning == DESCRIBED_ANSWER_ID) {
        node->answer_id = (uint32_t)count;
    } else if (meaning >= DESCRIBED_SET_POINT && meaning < DESCRIBED_TARGETS_END) {
        axis_count_command(node, axis);
        if (described_axis_runs(axis)) {
            axis_set_target(node, axis, field, count);
        }
    }
}

/* Keeps the present values of all parameters over a restart. */
static void axis_save(struct described_node *node, const struct described_axis *axis)
{
    const unsigned index = axis_index(node, axis);

    for (size_t i = 0; i < node->protocol->nparameter; i++) {
        const struct described_parameter *parameter = &node->protocol->parameter[i];
        const enum described_meaning meaning = parameter->field.meaning;

        if (meaning == DESCRIBED_STORED || meaning == DESCRIBED_LAW ||
            meaning == DESCRIBED_ANSWER_ID || described_is_setting(meaning)) {
            node->kept[index][i] =
                (uint32_t)described_node_count(node, index, &parameter->field, NULL, NULL);
            node->is_kept[index][i] = parameter->writable;
        }
    }
}

/* Writes the parameters that a new drive has, or that were saved. */
static void axis_restore(struct described_node *node, struct described_axis *axis, bool first)
{
    const struct described_protocol *protocol = node->protocol;
    const struct described_model *model = &protocol->model[node->board.config.model];
    const unsigned index = axis_index(node, axis);

    for (size_t i = 0; i < protocol->nparameter; i++) {
        const struct described_field *field = &protocol->parameter[i].field;

        if (first) {
            node->kept[index][i] = (uint32_t)model->count[i];
            node->is_kept[index][i] = model->given[i];
        }
        if (node->is_kept[index][i]) {
            axis_write(node, axis, &protocol->parameter[i],
                       field->sign ? (int32_t)node->kept[index][i] : (int64_t)node->kept[index][i]);
        }
    }
}

/* Changes state, law and faults of an axis as a frame commands. Changes nothing and returns false
 * if the axis lacks the requested law. */
static bool axis_switch(struct described_node *node, struct described_axis *axis,
                        const struct described_frame *frame, const int64_t *values)
{
    const struct described_protocol *protocol = node->protocol;
    int law =
        frame_names(frame, DESCRIBED_LAW, protocol->law, protocol->nlaw, values, frame->select);
    int state = frame_names(frame, DESCRIBED_STATE, protocol->state, protocol->nstate, values, -1);
    int wanted;

    if (state < 0 && described_find_field(frame, DESCRIBED_STATE) >= 0) {
        state = protocol->unknown_state;
    }
    wanted = state < 0 ? frame->enter : state;

    /* A motor supports all laws. A servo valve supports no law that controls a current */
    if (axis->base.config->valve &&
        ((law >= 0 && !described_law_suits_valve(protocol->law[law].law)) ||
         (wanted >= 0 && !described_law_suits_valve(
                             described_state_law(protocol, wanted, law >= 0 ? law : axis->law))))) {
        return false;
    }

    /* Change faults, law and state before the targets, because these changes reset the targets */
    if (frame->clear) {
        axis->faults &= ~(axis->latched | protocol->sticky) | axis->present;
        axis->latched = 0;
        axis_show(axis);
        if (axis->active == DESCRIBED_FAULT) {
            axis_enter(node, axis, protocol->off_state, axis->law);
        }
    }
    if (law >= 0) {
        axis_enter(node, axis, axis->state, law);
    }
    if (state >= 0) {
        axis_command_state(node, axis, state);
    }
    if (frame->enter >= 0) {
        axis_command_state(node, axis, frame->enter);
    }
    if (frame->stop) {
        axis_stop(node, axis);
    }
    return true;
}

bool described_axis_obey(struct described_node *node, unsigned index,
                         const struct described_frame *frame, const int64_t *values)
{
    struct described_axis *axis = &node->axis[index];

    if (frame->switches && !axis_switch(node, axis, frame, values)) {
        return false;
    }
    if (frame->configures) {
        /* Write settings, parameters and the position reading. The state does not change. */
        int parameter = described_find_field(frame, DESCRIBED_PARAMETER);
        int written = described_find_field(frame, DESCRIBED_PARAMETER_VALUE);

        /* Settings and the position have fields of their own */
        for (size_t i = 0; i < frame->nfield; i++) {
            const struct described_field *field = &frame->field[i];

            if (described_is_setting(field->meaning)) {
                axis_set(node, axis, field, values[i]);
            } else if (field->meaning == DESCRIBED_HOST_NUMBER) {
                node->host_number = (uint32_t)values[i];
            } else if (field->meaning == DESCRIBED_ANSWER_ID) {
                node->answer_id = (uint32_t)values[i];
            } else if (field->meaning == DESCRIBED_NEW_ADDRESS) {
                board_set_address(&node->board, (uint8_t)values[i]);
            } else if (field->meaning == DESCRIBED_PRESENT_POSITION) {
                axis->zero_rad =
                    axis->base.motor_rad -
                    described_node_value(node, axis_index(node, axis), field, values[i]);
                axis_forget(node, axis);
            }
        }

        /* A parameter is selected by its number */
        if (parameter >= 0 && written >= 0) {
            axis_write(node, axis, described_find_parameter(node->protocol, values[parameter]),
                       values[written]);
        }
        if (frame->save) {
            axis_save(node, axis);
        }
    }
    if (frame->zero) {
        axis->zero_rad = axis->base.motor_rad;
        axis_forget(node, axis);
    }
    if (!frame->commands) {
        return true;
    }
    axis_count_command(node, axis);
    for (size_t i = 0; i < frame->nfield && described_axis_runs(axis); i++) {
        const struct described_field *field = &frame->field[i];

        if (field->meaning >= DESCRIBED_SET_POINT && field->meaning < DESCRIBED_TARGETS_END &&
            (frame->of_one || field->axis == index)) {
            axis_set_target(node, axis, field, values[i]);
        }
    }
    return true;
}

/* ---- power-up ---- */

/* Powers up a motor board (struct board_ops). */
static void described_motor_power_up(struct board *board)
{
    struct described_node *node = described_node_of(board);
    bool first = described_node_power_up(node);
    const struct described_gains *gains = &node->protocol->gains;
    const int64_t own_ns = node->protocol->command_timeout_ns;
    /* The host has set no limits yet: only the limits of the rig apply */
    const double setting[] = {
        [DESCRIBED_VELOCITY_LIMIT - DESCRIBED_SETTING] = HUGE_VAL,
        [DESCRIBED_CURRENT_LIMIT - DESCRIBED_SETTING] = HUGE_VAL,
        [DESCRIBED_POSITION_GAIN - DESCRIBED_SETTING] = gains->position_per_s,
        [DESCRIBED_VELOCITY_GAIN - DESCRIBED_SETTING] = gains->velocity_nm_s_rad,
        [DESCRIBED_INTEGRAL_GAIN - DESCRIBED_SETTING] = gains->velocity_nm_rad,
        [DESCRIBED_POSITION_SPEED_LIMIT - DESCRIBED_SETTING] = HUGE_VAL,
        [DESCRIBED_COMMAND_TIMEOUT - DESCRIBED_SETTING] =
            (double)(own_ns < 0 ? 0
                     : own_ns   ? own_ns
                                : board->config.command_timeout_ns) *
            1e-9,
    };

    for (unsigned i = 0; i < node->axes; i++) {
        struct described_axis *axis = &node->axis[i];

        axis->state = node->protocol->off_state;
        axis->law = 0;
        axis->active = DESCRIBED_OFF;
        axis->base.mode = DESCRIBED_OFF;
        axis->latched = axis->faults = axis->present = 0;
        axis->commands = 0;
        axis->temperature_c = PLANT_AMBIENT_C;
        axis->zero_rad = 0.0;
        memcpy(axis->setting, setting, sizeof axis->setting);
        axis_restore(node, axis, first);
        axis_forget(node, axis);
    }
    if (!first) {
        described_node_announce(node);
    }
}

/* ---- sensors ---- */

/* Rounds the temperatures of all axes (struct board_ops). Keeps the old value if there is no
 * reading. */
static void described_motor_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_node *node = described_node_of(board);

    (void)sensors;
    for (unsigned i = 0; i < node->axes; i++) {
        axis_find_angles(&node->axis[i].base);
        control_quantize(node->axis[i].base.winding_c, &node->axis[i].temperature_c);
    }
}

/* ---- faults ---- */

/* Returns the bit of a fault if the fault is present, else 0. */
static uint32_t fault_if(bool present, enum described_fault fault)
{
    return (uint32_t)present << fault;
}

/* Finds the faults of an axis and reacts to new ones: events, counters, the fault state. */
static void axis_watch_faults(struct described_node *node, struct described_axis *axis)
{
    struct boards_counters *counters = &node->board.boards->counters;
    const struct board *board = &node->board;
    const struct board_axis_config *config = axis->base.config;
    double hottest_c =
        config->temperature_limit_c > 0.0 ? config->temperature_limit_c : TEMPERATURE_MAX_C;
    const uint32_t common = axis_find_faults(board, &axis->base, config->current_limit_a);
    const double timeout_s = fmin(axis_setting(axis, DESCRIBED_COMMAND_TIMEOUT), 1e9);
    const int64_t timeout_ns = (int64_t)(timeout_s * 1e9 + 0.5);
    const bool stale = described_axis_runs(axis) && timeout_ns > 0 &&
                       board->boards->now_ns - axis->command_ns > timeout_ns;

    /* Fault bits below over-temperature are equal; pressure faults move down by six bits */
    uint32_t faults =
        (common & ((1u << DESCRIBED_OVER_TEMPERATURE) - 1)) |
        (common & (AXIS_UNDER_PRESSURE | AXIS_OVER_PRESSURE)) >> 6 |
        fault_if(axis->temperature_c > hottest_c, DESCRIBED_OVER_TEMPERATURE) |
        fault_if(stale, DESCRIBED_STALE) |
        fault_if(axis->base.link_rad < config->lower_rad || axis->base.link_rad > config->upper_rad,
                 DESCRIBED_LIMIT) |
        fault_if(board->lost_in_status, DESCRIBED_OVERFLOW);

    uint32_t risen = faults & ~(axis->present | axis->latched);
    unsigned index = axis_index(node, axis);

    if (risen >> DESCRIBED_STALE & 1) {
        /* Handle a command time-out: enter the protocol's state, or reset the set points */
        int state = node->protocol->timeout_state;
        int64_t command_ns = axis->command_ns;

        counters->timeouts++;
        board_event(&node->board, BOARD_EVENT_TIMEOUT, index, axis->active, 0);
        if (state >= 0) {
            axis->latched |= (uint32_t)(node->protocol->state[state].law == DESCRIBED_FAULT)
                             << DESCRIBED_STALE;
            axis_enter(node, axis, state, axis->law);
        } else {
            double voltage_v = axis->base.voltage_v, overload_ms = axis->base.overload_ms;
            bool follows_law = axis->base.law.on;

            axis_forget(node, axis);
            axis->command_ns = command_ns;
            axis->base.voltage_v = voltage_v;
            axis->base.law.on = follows_law;
            axis->base.overload_ms = overload_ms;
        }
    }
    if (risen >> DESCRIBED_LIMIT & 1 && described_axis_runs(axis)) {
        int32_t ticks = 0;

        control_quantize(axis->base.link_rad * axis->base.config->joint_ticks_per_rad, &ticks);
        board_event(&node->board, BOARD_EVENT_LIMIT, index, (uint32_t)ticks, 0);
    }
    if (risen & DESCRIBED_FATAL) {
        board_event(&node->board, BOARD_EVENT_FAULT, index, risen & DESCRIBED_FATAL, 0);
    }
    counters->trips += faults >> DESCRIBED_OVER_CURRENT & 1;
    counters->trips += risen >> DESCRIBED_OVER_TEMPERATURE & 1;
    if (faults & DESCRIBED_FATAL && described_axis_runs(axis)) {
        axis->latched |= faults & DESCRIBED_FATAL;
        axis_enter(node, axis, described_fault_state(node->protocol, axis->latched), axis->law);
    }
    axis->present = faults;
    axis->faults = faults | (axis->latched & ~node->protocol->momentary) |
                   (axis->faults & node->protocol->sticky);
}

/* ---- laws ---- */

double described_axis_current_limit(const struct described_node *node, unsigned axis)
{
    const struct board_axis_config *config = &node->board.config.axis[axis];
    double cap = fmax(axis_target(&node->axis[axis], DESCRIBED_TO_CURRENT_CAP), 0.0);
    double told = fmin(cap, axis_setting(&node->axis[axis], DESCRIBED_CURRENT_LIMIT));

    return fmin(config->current_limit_a, told / axis_gain_or_1(config->current_gain));
}

/* Returns the position target of an axis on the joint's scale. */
static double axis_position_target(const struct described_axis *axis)
{
    return axis_target(axis, DESCRIBED_TO_POSITION) + axis->zero_rad;
}

/* Hands a law to the current controller: a current, A, and a torque, N m, with its gains, as the
 * drive takes them. */
static void axis_current_law(const struct described_node *node, struct described_axis *axis,
                             double current_a, double torque_nm, double kp, double kd,
                             double speed_rad_s)
{
    const struct board_axis_config *config = axis->base.config;
    const double nm_a = config->torque_nm_a * axis_gain_or_1(config->torque_gain);
    const double a_nm = nm_a > 0.0 ? 1.0 / nm_a : 0.0;

    axis_follow_law(
        &axis->base,
        &(struct current_law){.current_a = current_a / axis_gain_or_1(config->current_gain) +
                                           torque_nm * a_nm,
                              .limit_a = described_axis_current_limit(node, axis_index(node, axis)),
                              .stiffness_a_rad = kp * a_nm,
                              .position_rad = axis_position_target(axis),
                              .damping_a_s_rad = kd * a_nm,
                              .speed_rad_s = speed_rad_s});
}

/* Runs the velocity loop. For a valve the voltage is proportional to the speed. */
static void axis_velocity_law(const struct described_node *node, struct described_axis *axis,
                              double wanted_rad_s)
{
    const struct board_axis_config *config = axis->base.config;
    double cap = fmax(axis_target(axis, DESCRIBED_TO_VELOCITY_CAP), 0.0);
    double limit = fmin(axis_setting(axis, DESCRIBED_VELOCITY_LIMIT), cap);
    double most = config->torque_nm_a * config->current_limit_a, error;

    wanted_rad_s = fmax(fmin(wanted_rad_s, limit), -limit);
    error = wanted_rad_s - axis->base.velocity_rad_s;

    if (config->valve) {
        axis_apply_voltage(&axis->base, config->bemf_v_s_rad * wanted_rad_s);
        return;
    }
    axis->integral_nm += axis_setting(axis, DESCRIBED_INTEGRAL_GAIN) * error * 1e-3;
    axis->integral_nm = fmax(fmin(axis->integral_nm, most), -most);
    axis_current_law(node, axis, 0.0, axis->integral_nm + axis_target(axis, DESCRIBED_TO_TORQUE),
                     0.0, axis_setting(axis, DESCRIBED_VELOCITY_GAIN), wanted_rad_s);
}

/* Runs the law in force. */
static void axis_run_law(const struct described_node *node, struct described_axis *axis)
{
    const struct board_axis_config *config = axis->base.config;
    double speed, wanted;

    switch (axis->active) {
    case DESCRIBED_CURRENT:
        axis_current_law(node, axis, axis_target(axis, DESCRIBED_TO_CURRENT), 0.0, 0.0, 0.0, 0.0);
        break;
    case DESCRIBED_TORQUE:
        axis_current_law(node, axis, 0.0, axis_target(axis, DESCRIBED_TO_TORQUE), 0.0, 0.0, 0.0);
        break;
    case DESCRIBED_VELOCITY:
        axis_velocity_law(node, axis, axis_target(axis, DESCRIBED_TO_VELOCITY));
        break;
    case DESCRIBED_POSITION:
        /* The loop stays within the joint's limits */
        speed = axis_setting(axis, DESCRIBED_POSITION_SPEED_LIMIT);
        wanted = fmax(fmin(axis_position_target(axis), config->upper_rad), config->lower_rad);
        wanted = axis_setting(axis, DESCRIBED_POSITION_GAIN) * (wanted - axis->base.motor_rad) +
                 axis_target(axis, DESCRIBED_TO_VELOCITY);
        axis_velocity_law(node, axis, fmax(fmin(wanted, speed), -speed));
        break;
    case DESCRIBED_IMPEDANCE:
        /* The target may be beyond the joint's limits, as on real drives. With the target at the
         * limit, a host that adds the rest of the spring's torque would drive the axis away */
        axis_current_law(node, axis, 0.0, axis_target(axis, DESCRIBED_TO_TORQUE),
                         axis_target(axis, DESCRIBED_TO_KP), axis_target(axis, DESCRIBED_TO_KD),
                         axis_target(axis, DESCRIBED_TO_VELOCITY));
        break;
    default:
        axis_apply_voltage(&axis->base,
                           axis->active == DESCRIBED_VOLTAGE
                               ? axis_target(axis, DESCRIBED_TO_VOLTAGE) +
                                     axis_target(axis, DESCRIBED_TO_DUTY) * axis->base.supply_v
                               : 0.0);
        break;
    }
}

/* ---- control ---- */

/* Zeroes the targets of open laws that would drive the axis further beyond a position limit. */
static void axis_heed_limits(struct described_axis *axis)
{
    static const enum described_meaning open[] = {DESCRIBED_TO_VOLTAGE, DESCRIBED_TO_DUTY,
                                                  DESCRIBED_TO_CURRENT, DESCRIBED_TO_TORQUE};
    const struct board_axis_config *config = axis->base.config;
    bool above = axis->base.link_rad > config->upper_rad,
         below = axis->base.link_rad < config->lower_rad;

    if (axis->active > DESCRIBED_TORQUE || !(above || below)) {
        return;
    }
    for (size_t i = 0; i < sizeof open / sizeof *open; i++) {
        double *target = &axis->target[open[i] - DESCRIBED_SET_POINT];

        if ((above && *target > 0.0) || (below && *target < 0.0)) {
            *target = 0.0;
        }
    }
}

/* Runs a tick of a motor board: faults, limits and laws (struct board_ops). */
static void described_motor_control(struct board *board, struct ms_span span)
{
    struct described_node *node = described_node_of(board);

    for (unsigned i = 0; i < node->axes; i++) {
        struct described_axis *axis = &node->axis[i];
        int64_t lasts_ns = node->protocol->state[axis->state].lasts_ns;

        if (lasts_ns > 0 && node->board.boards->now_ns - axis->entered_ns >= lasts_ns) {
            axis->latched = 0;
            axis_enter(node, axis, node->protocol->off_state, axis->law);
        }
        axis_watch_faults(node, axis);
        axis_heed_limits(axis);
        for (int64_t ms = span.from; ms < span.to; ms++) {
            axis_run_law(node, axis);
        }
    }
}

/* Opens the bridges of a motor board (struct board_ops). */
static void described_motor_shut_down(struct board *board)
{
    struct described_node *node = described_node_of(board);

    for (unsigned i = 0; i < node->axes; i++) {
        if (described_axis_runs(&node->axis[i])) {
            axis_enter(node, &node->axis[i], node->protocol->off_state, node->axis[i].law);
        }
    }
}

const struct board_ops described_motor_ops = {
    .size = sizeof(struct described_node),
    .identity = {.type = 2, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX * DESCRIBED_AXES,
    .power_up = described_motor_power_up,
    .sample = described_motor_sample,
    .control = described_motor_control,
    .transmit = described_node_transmit,
    .shut_down = described_motor_shut_down,
    .axes = offsetof(struct described_node, axis),
    .axis_size = sizeof(struct described_axis),
};
