/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state machine of CiA 402 (IEC 61800-7-201, 6.2): commands of the controlword, transitions,
 * option codes, statusword. Writing a controlword makes one transition at once. One exception:
 * "enable operation" in READY TO SWITCH ON makes transition 3, and transition 4 in the next tick.
 */
#include "boards/cia402/private.h"

enum command {
    COMMAND_NONE,
    COMMAND_SHUTDOWN,
    COMMAND_SWITCH_ON, /* same bits as "disable operation" */
    COMMAND_DISABLE_VOLTAGE,
    COMMAND_QUICK_STOP,
    COMMAND_ENABLE_OPERATION,
    COMMANDS,
};

enum { WARNINGS = CIA402_FAULT_STALE | CIA402_FAULT_LIMIT };

/* The number of the transition for a command in a state; 0 = none. */
static const uint8_t transitions[CIA402_STATES][COMMANDS] = {
    [CIA402_SWITCH_ON_DISABLED] = {[COMMAND_SHUTDOWN] = 2},
    [CIA402_READY_TO_SWITCH_ON] = {[COMMAND_SWITCH_ON] = 3,
                                   [COMMAND_ENABLE_OPERATION] = 3,
                                   [COMMAND_QUICK_STOP] = 7,
                                   [COMMAND_DISABLE_VOLTAGE] = 7},
    [CIA402_SWITCHED_ON] = {[COMMAND_ENABLE_OPERATION] = 4,
                            [COMMAND_SHUTDOWN] = 6,
                            [COMMAND_QUICK_STOP] = 10,
                            [COMMAND_DISABLE_VOLTAGE] = 10},
    [CIA402_OPERATION_ENABLED] = {[COMMAND_SWITCH_ON] = 5,
                                  [COMMAND_SHUTDOWN] = 8,
                                  [COMMAND_DISABLE_VOLTAGE] = 9,
                                  [COMMAND_QUICK_STOP] = 11},
    [CIA402_QUICK_STOP_ACTIVE] = {[COMMAND_DISABLE_VOLTAGE] = 12, [COMMAND_ENABLE_OPERATION] = 16},
};

/* The bits of the statusword in each state. */
static const uint16_t state_bits[CIA402_STATES] = {
    [CIA402_NOT_READY] = 0x00,
    [CIA402_SWITCH_ON_DISABLED] = 0x40,
    [CIA402_READY_TO_SWITCH_ON] = 0x21,
    [CIA402_SWITCHED_ON] = 0x23,
    [CIA402_OPERATION_ENABLED] = 0x27,
    [CIA402_QUICK_STOP_ACTIVE] = 0x07,
    [CIA402_FAULT_REACTION_ACTIVE] = 0x0f,
    [CIA402_FAULT] = 0x08,
};

/* Returns the command of a controlword. */
static enum command controlword_command(int64_t word)
{
    return word & CIA402_CW_FAULT_RESET           ? COMMAND_NONE
           : !(word & CIA402_CW_ENABLE_VOLTAGE)   ? COMMAND_DISABLE_VOLTAGE
           : !(word & CIA402_CW_QUICK_STOP)       ? COMMAND_QUICK_STOP
           : !(word & CIA402_CW_SWITCH_ON)        ? COMMAND_SHUTDOWN
           : !(word & CIA402_CW_ENABLE_OPERATION) ? COMMAND_SWITCH_ON
                                                  : COMMAND_ENABLE_OPERATION;
}

/* Enters a state. */
static void cia402_axis_enter(struct cia402_node *node, struct cia402_axis *axis,
                              enum cia402_state state)
{
    bool was_on = cia402_axis_is_on(axis), is_on = cia402_state_is_on(state);

    if (state == axis->state) {
        return;
    }
    if (is_on != was_on) {
        axis->command_ns = is_on ? node->board.boards->now_ns : axis->command_ns;
        cia402_axis_stand(axis);
    }
    board_event(&node->board, BOARD_EVENT_MODE, cia402_axis_number(node, axis), axis->state, state);
    axis->state = state;
    axis->base.mode = (uint8_t)state;
    axis->base.on = is_on;
    axis->base.faulty = state == CIA402_FAULT || state == CIA402_FAULT_REACTION_ACTIVE;
    if (was_on && !is_on) {
        axis->target_voltage = axis->target_torque = 0;
        axis->base.overload_ms = 0.0;
    }
}

/* ---- transitions ---- */

/* Begins a quick stop with its option code. */
static void cia402_axis_stop_quickly(struct cia402_node *node, struct cia402_axis *axis)
{
    int64_t option = axis->settings.quick_stop_option;
    enum cia402_ramp ramp = option == 1 || option == 5   ? CIA402_RAMP_SLOW
                            : option == 2 || option == 6 ? CIA402_RAMP_QUICK
                                                         : CIA402_RAMP_CURRENT;

    if (option == 0) {
        cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED);
        return;
    }
    cia402_axis_enter(node, axis, CIA402_QUICK_STOP_ACTIVE);
    cia402_axis_stop(axis, ramp,
                     option >= 5 ? CIA402_QUICK_STOP_ACTIVE : CIA402_SWITCH_ON_DISABLED);
}

/* Makes a transition by its number. */
static void cia402_axis_make_transition(struct cia402_node *node, struct cia402_axis *axis,
                                        unsigned number)
{
    enum cia402_state state = number == 5 ? CIA402_SWITCHED_ON : CIA402_READY_TO_SWITCH_ON;
    int64_t option = number == 5 ? axis->settings.disable_option : axis->settings.shutdown_option;

    /* Transition numbers of IEC 61800-7-201 */
    switch (number) {
    case 2:
    case 6:
        cia402_axis_enter(node, axis, CIA402_READY_TO_SWITCH_ON);
        break;
    case 3:
        cia402_axis_enter(node, axis, CIA402_SWITCHED_ON);
        break;
    case 4:
        cia402_axis_enter(node, axis, CIA402_OPERATION_ENABLED);
        break;
    case 5: /* option code 1 = with a ramp; a repeated controlword does not restart the ramp */
    case 8:
        if (option != 1) {
            cia402_axis_enter(node, axis, state);
        } else if (!axis->stopping || axis->stop_state != state) {
            cia402_axis_stop(axis, CIA402_RAMP_SLOW, state);
        }
        break;
    case 7:
    case 9:
    case 10:
    case 12:
        cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED);
        break;
    case 11:
        cia402_axis_stop_quickly(node, axis);
        break;
    case 16:
        if (axis->settings.quick_stop_option >= 5) {
            cia402_axis_stand(axis);
            cia402_axis_enter(node, axis, CIA402_OPERATION_ENABLED);
        }
        break;
    default:
        break;
    }
}

/* Makes transition 15 if no cause of the fault remains. */
static void cia402_axis_reset_fault(struct cia402_node *node, struct cia402_axis *axis)
{
    if (axis->state != CIA402_FAULT || axis->present & ~(uint32_t)WARNINGS) {
        return;
    }
    axis->latched = 0;
    axis->error_code = 0;
    cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED);
    for (unsigned k = 0; k < node->axes; k++) {
        if (node->axis[k].latched) {
            return;
        }
    }
    cia402_emcy_clear(node);
}

enum cia402_abort cia402_axis_write_controlword(struct cia402_node *node,
                                                const struct cia402_entry *entry, int64_t value)
{
    struct cia402_axis *axis = &node->axis[entry->unit];
    int64_t before = axis->controlword;
    enum command command = controlword_command(value);

    axis->controlword = value;
    if (value & ~before & CIA402_CW_FAULT_RESET) {
        cia402_axis_reset_fault(node, axis);
        return CIA402_DONE;
    }

    /* "Enable operation" cancels a ramp that would leave OPERATION ENABLED */
    if (axis->state == CIA402_OPERATION_ENABLED && axis->stopping &&
        command == COMMAND_ENABLE_OPERATION) {
        cia402_axis_stand(axis);
    }
    cia402_axis_make_transition(node, axis, transitions[axis->state][command]);
    if (axis->state == CIA402_OPERATION_ENABLED && !axis->stopping) {
        cia402_axis_take_set_point(axis, before);
    }
    return CIA402_DONE;
}

/* ---- faults and loss of the connection ---- */

/* Starts the reaction to a fault. drivable: the bridge may stay closed to brake. */
static void cia402_axis_react(struct cia402_node *node, struct cia402_axis *axis, bool drivable)
{
    int64_t option = axis->settings.fault_option;
    bool ramp = drivable && option > 0 && cia402_axis_is_on(axis);

    if (axis->state == CIA402_FAULT || (axis->state == CIA402_FAULT_REACTION_ACTIVE && drivable)) {
        return;
    }
    cia402_axis_enter(node, axis, CIA402_FAULT_REACTION_ACTIVE); /* transition 13 */
    if (ramp) {
        cia402_axis_stop(axis, option == 2 ? CIA402_RAMP_QUICK : CIA402_RAMP_SLOW, CIA402_FAULT);
    } else {
        cia402_axis_enter(node, axis, CIA402_FAULT); /* transition 14 */
    }
}

void cia402_axis_lose_connection(struct cia402_node *node, struct cia402_axis *axis)
{
    if (!cia402_axis_is_on(axis)) {
        return;
    }
    /* Option code 0x6007: 1 = fault, 2 = no voltage, 3 = quick stop */
    switch (axis->settings.abort_option) {
    case 1:
        axis->latched |= CIA402_FAULT_CONNECTION;
        axis->error_code = 0x8130;
        cia402_axis_react(node, axis, true);
        break;
    case 2:
        cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED);
        break;
    case 3:
        if (axis->state == CIA402_OPERATION_ENABLED) {
            cia402_axis_stop_quickly(node, axis);
        }
        break;
    default:
        break;
    }
}

/* Objects that are also settings of the simulator (struct board_settings). */

static const struct {
    const char *name, *unit;
    uint16_t index;
    uint8_t sub;
} rows[] = {
    {"current_kp", "mV/A", 0x4014, 1},
    {"current_ki", "mV/(A s)", 0x4014, 2},
    {"back_emf", "mV s/rad", 0x4014, 3},
    {"velocity_kp", "mV s/rad", 0x4015, 1},
    {"velocity_ki", "mV/rad", 0x4015, 2},
    {"position_ki", "mV/rad", 0x4015, 3},
    {"position_kp", "0.1/s", 0x4016, 0},
    {"current_limit", "mA", 0x4012, 0},
    {"temperature_limit", "degree C", 0x4013, 0},
};

/* Returns the dictionary object of a setting. */
static struct cia402_entry cia402_setting_entry(unsigned axis, size_t index)
{
    const struct cia402_object *object = cia402_object_at(rows[index].index, rows[index].sub);

    return (struct cia402_entry){object, rows[index].sub, (uint8_t)axis, 0, object->type};
}

/* Describes a setting (struct board_settings). */
static void cia402_setting_describe(const struct board *board, unsigned axis, size_t index,
                                    struct board_setting *setting)
{
    const struct cia402_entry entry = cia402_setting_entry(axis, index);

    *setting = (struct board_setting){.name = rows[index].name,
                                      .unit = rows[index].unit,
                                      .min = (double)cia402_lowest(entry.object),
                                      .max = (double)cia402_most(cia402_node_of(board), &entry),
                                      .whole = true,
                                      .value = (double)cia402_value(cia402_node_of(board), &entry)};
}

/* Sets a setting (struct board_settings). */
static bool cia402_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    const struct cia402_entry entry = cia402_setting_entry(axis, index);

    *cia402_field(cia402_node_of(board), &entry) = (int64_t)value;
    return true;
}

static const struct board_settings cia402_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = cia402_setting_describe,
    .set = cia402_setting_set,
};

/* Constants of a drive node. */

enum {
    /* Faults that open the bridge at once, because the drive cannot brake */
    OPENS_BRIDGE = CIA402_FAULT_UNDER_VOLTAGE | CIA402_FAULT_OVER_VOLTAGE |
                   CIA402_FAULT_OVER_CURRENT | CIA402_FAULT_MOTOR_ENCODER |
                   CIA402_FAULT_LINK_ENCODER | CIA402_FAULT_TORQUE_SENSOR |
                   CIA402_FAULT_UNDER_PRESSURE | CIA402_FAULT_OVER_PRESSURE,
    FATAL =
        OPENS_BRIDGE | CIA402_FAULT_TEMPERATURE | CIA402_FAULT_FOLLOWING | CIA402_FAULT_CONNECTION,
    FRAMES_MAX = 2 + CIA402_EMERGENCIES + CIA402_PDOS,
    POSITION_GAIN = 400, /* position gain 40/s; unit 0.1/s */
    /* position gain 12/s: behind a valve, the load oscillates on the oil at about 10 Hz with little
     * damping */
    VALVE_POSITION_GAIN = 120,
    TORQUE_MODES = 1 << (CIA402_TORQUE - 1) | 1 << (CIA402_CYCLIC_TORQUE - 1),
};

/* Gains of the velocity loop, in multiples of the back-EMF constant. An error decays in half the
 * motor's own time constant, which tolerates the 1 ms delay of the steps. The integral compensates
 * a load after about 50 ms */
#define VELOCITY_KP 1.0
#define VELOCITY_KI 40.0

/* Integral gain of the velocity loop in the position modes. The loop does not excite robots that
 * sway on springs at 4.5 rad/s or faster (modes.c). The integral compensates a load after about 2
 * s. Until then the load moves the rotor by load R / (Kt 2 kw g): 2 mrad for 4 N m on COMAN */
#define POSITION_KI 1.0

/* Integral gain for a valve. A valve reaches its speed at once; the integral compensates the
 * valve's overlap within 0.5 s */
#define VALVE_VELOCITY_KI 2.0

/* For each fault: its code in EMCY and 0x603f, and its bits of the error register. */
static const struct {
    uint32_t fault;
    uint16_t code;
    uint8_t error_register;
} error_codes[] = {
    {CIA402_FAULT_UNDER_VOLTAGE, 0x3220, 0x04},  {CIA402_FAULT_OVER_VOLTAGE, 0x3210, 0x04},
    {CIA402_FAULT_OVER_CURRENT, 0x2310, 0x02},   {CIA402_FAULT_MOTOR_ENCODER, 0x7305, 0x20},
    {CIA402_FAULT_LINK_ENCODER, 0x7306, 0x20},   {CIA402_FAULT_TORQUE_SENSOR, 0xff01, 0x80},
    {CIA402_FAULT_TEMPERATURE, 0x4310, 0x08},    {CIA402_FAULT_FOLLOWING, 0x8611, 0x20},
    {CIA402_FAULT_UNDER_PRESSURE, 0xff02, 0x80}, {CIA402_FAULT_OVER_PRESSURE, 0xff03, 0x80},
};

/* ---- power-up ---- */

void cia402_axis_set_factory(struct cia402_axis *axis, const struct board_axis_config *config,
                             const struct board_config *board)
{
    struct cia402_axis_settings *p = &axis->settings;
    const double hz = config->current_loop_hz > 0.0 ? config->current_loop_hz : CURRENT_LOOP_HZ;

    /* Limits, time-out and position gain */
    p->current_limit_ma = cia402_counts(config->current_limit_a, 1e-3);
    p->position_limit[0] = cia402_counts(config->lower_rad, CIA402_POSITION_RAD);
    p->position_limit[1] = cia402_counts(config->upper_rad, CIA402_POSITION_RAD);
    p->timeout_ms = control_clamp(board->command_timeout_ns / MS, 0, UINT16_MAX);
    p->position_gain = config->valve ? VALVE_POSITION_GAIN : POSITION_GAIN;
    /* Switches, gear and rated current */
    cia402_homing_list(axis, &config->switches);
    axis->rpm_rad = (config->gear > 0.0 ? config->gear : 1.0) * 60.0 / (2.0 * M_PI);
    axis->rated_current_ma = p->current_limit_ma;
    /* A valve has no current loop. Its gains are its speed constant and the integral gain */
    if (config->valve) {
        p->current_gain[2] = cia402_counts(config->bemf_v_s_rad, 1e-3);
        p->velocity_gain[1] = cia402_counts(VALVE_VELOCITY_KI * config->bemf_v_s_rad, 1e-3);
        p->velocity_gain[2] = p->velocity_gain[1];
        axis->rated_torque_mnm = cia402_counts(config->torque_full_scale_nm, 1e-3);
        axis->supported_modes &= ~TORQUE_MODES;
        return;
    }
    /* Tune the loops of a motor from its winding and back-EMF */
    axis->rated_torque_mnm = cia402_counts(config->current_limit_a * config->bemf_v_s_rad, 1e-3);
    if (config->winding_ohm > 0.0) {
        p->current_gain[0] = cia402_counts(2.0 * M_PI * hz * config->winding_h, 1e-3);
        p->current_gain[1] = cia402_counts(2.0 * M_PI * hz * config->winding_ohm, 1e-3);
        p->current_gain[2] = cia402_counts(config->bemf_v_s_rad, 1e-3);
        p->velocity_gain[0] = cia402_counts(VELOCITY_KP * config->bemf_v_s_rad, 1e-3);
        p->velocity_gain[1] = cia402_counts(VELOCITY_KI * config->bemf_v_s_rad, 1e-3);
        p->velocity_gain[2] = cia402_counts(POSITION_KI * config->bemf_v_s_rad, 1e-3);
    }
}

/* Powers up a drive: resets state, faults, targets and homing of its axes (struct board_ops). */
static void cia402_motor_power_up(struct board *board)
{
    struct cia402_node *node = cia402_node_of(board);

    node->axes = board_config_axes(&board->config);
    cia402_node_power_up(node);
    for (unsigned i = 0; i < node->axes; i++) {
        struct cia402_axis *axis = &node->axis[i];

        axis->state = CIA402_NOT_READY;
        axis->base.mode = CIA402_NOT_READY;
        axis->latched = axis->present = 0;
        axis->faults = axis->error_code = axis->controlword = axis->statusword = 0;
        axis->target_voltage = axis->target_torque = axis->target_velocity = 0;
        axis->target_position = axis->velocity_offset = axis->torque_offset = 0;
        axis->mode = CIA402_NO_MODE;
        axis->mode_display = 0;
        axis->home = 0;
        axis->homed = axis->homing_failed = axis->set_point_taken = axis->limited = false;
        axis->has_target = false;
        cia402_axis_stand(axis);
    }
}

/* ---- sensors ---- */

/* Publishes the samples of all axes (struct board_ops). */
static void cia402_motor_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct cia402_node *node = cia402_node_of(board);

    (void)sensors;
    for (unsigned i = 0; i < node->axes; i++) {
        struct cia402_axis *axis = &node->axis[i];

        axis_find_angles(&axis->base);

        /* Write the samples of an axis into its objects, torque and current in thousandths of the
         * rated values. A missing reading keeps the old value. */
        const struct axis *base = &axis->base;
        double rated_a = fmax((double)axis->rated_current_ma, 1.0) * 1e-3;
        double rated_nm = fmax((double)axis->rated_torque_mnm, 1.0) * 1e-3;
        int32_t temperature = (int32_t)axis->temperature_c;

        axis->motor_encoder = cia402_counts(base->motor_rad, CIA402_POSITION_RAD);
        axis->link_encoder = cia402_counts(base->link_rad, CIA402_POSITION_RAD);
        axis->deflection = axis->motor_encoder - axis->link_encoder;
        axis->position = axis->motor_encoder - axis->home;
        axis->velocity = cia402_counts(base->velocity_rad_s, CIA402_POSITION_RAD);
        axis->current_ma = cia402_counts(base->current_a, 1e-3);
        axis->current = cia402_counts(base->current_a / rated_a, 1e-3);
        axis->torque =
            base->config->valve ? cia402_counts(base->torque_nm / rated_nm, 1e-3) : axis->current;
        axis->spring_torque = cia402_counts(base->torque_nm, CIA402_SPRING_NM);
        control_quantize(base->winding_c, &temperature);
        axis->temperature_c = temperature;
        axis->supply_mv = cia402_counts(base->supply_v, 1e-3);
        axis->valve_opening = cia402_counts(base->valve_opening, 1e-3);
        for (int side = 0; side < 2; side++) {
            int64_t counts = cia402_counts(base->pressure_pa[side], CIA402_PRESSURE_BAR * 1e5);

            axis->pressure[side] = control_clamp(counts, 0, UINT16_MAX);
        }
        cia402_homing_sample(axis, &axis->base.config->switches);
        for (int64_t k = 0; k < axis->base.passed_ms; k++) {
            cia402_axis_count_times(axis);
        }
        axis->statusword =
            state_bits[axis->state] | CIA402_SW_REMOTE |
            (axis->present & CIA402_FAULT_UNDER_VOLTAGE ? 0 : CIA402_SW_VOLTAGE_ENABLED) |
            (axis->present & WARNINGS ? CIA402_SW_WARNING : 0) | cia402_axis_mode_status(axis);
    }
}

/* ---- faults ---- */

/* Finds the faults of an axis. New faults cause an event, an emergency message and the fault
 * reaction. */
static void cia402_axis_watch_faults(struct cia402_node *node, struct cia402_axis *axis)
{
    struct board *board = &node->board;

    /* Find the faults and warnings that the axis has now */
    const struct cia402_axis_settings *p = &axis->settings;
    int64_t link = axis->link_encoder - axis->home, low = p->position_limit[0],
            high = p->position_limit[1];
    bool enabled = axis->state == CIA402_OPERATION_ENABLED;
    bool off_course = axis->following_ms > p->following_timeout_ms;
    bool expects_commands = axis->mode == CIA402_VOLTAGE_MODE || axis->mode == CIA402_TORQUE ||
                            axis->mode == CIA402_CYCLIC_TORQUE ||
                            axis->mode == CIA402_CYCLIC_VELOCITY;
    bool stale = expects_commands && enabled && p->timeout_ms > 0 &&
                 board->boards->now_ns - axis->command_ns > p->timeout_ms * MS;

    uint32_t present =
        axis_find_faults(board, &axis->base, (double)p->current_limit_ma * 1e-3) |
        (axis->temperature_c > p->temperature_limit_c ? CIA402_FAULT_TEMPERATURE : 0u) |
        (off_course && cia402_axis_controls_position(axis) && enabled ? CIA402_FAULT_FOLLOWING
                                                                      : 0u) |
        (stale ? CIA402_FAULT_STALE : 0u) |
        (low < high && (link < low || link > high) ? CIA402_FAULT_LIMIT : 0u);
    uint32_t risen = present & ~(axis->present | axis->latched);
    unsigned number = cia402_axis_number(node, axis);

    axis->present = present;
    axis->latched |= present & FATAL;
    axis->faults = present | axis->latched;
    board->boards->counters.trips +=
        (risen & (CIA402_FAULT_OVER_CURRENT | CIA402_FAULT_TEMPERATURE)) != 0;
    if (risen & CIA402_FAULT_STALE) {
        axis->target_voltage = axis->target_torque = axis->target_velocity = 0;
        board->boards->counters.timeouts++;
        board_event(board, BOARD_EVENT_TIMEOUT, number, axis->state, 0);
    }
    if (risen & CIA402_FAULT_LIMIT && cia402_axis_is_on(axis)) {
        board_event(board, BOARD_EVENT_LIMIT, number, (uint32_t)axis->link_encoder, 0);
    }
    for (size_t i = 0; i < ARRAY_COUNT(error_codes); i++) {
        if (risen & error_codes[i].fault) {
            axis->error_code = error_codes[i].code;
            cia402_emcy_raise(node, error_codes[i].code, error_codes[i].error_register, number,
                              (uint32_t)axis->faults);
        }
    }
    if (risen & FATAL) {
        board_event(board, BOARD_EVENT_FAULT, number, risen & FATAL, 0);
    }
    if (present & FATAL) {
        cia402_axis_react(node, axis, !(present & OPENS_BRIDGE));
    }
}

/* ---- control ---- */

/* Runs one tick of a drive: services, faults, states and loops (struct board_ops). */
static void cia402_motor_control(struct board *board, struct ms_span span)
{
    struct cia402_node *node = cia402_node_of(board);

    cia402_node_step(node, span);
    for (unsigned i = 0; i < node->axes; i++) {
        struct cia402_axis *axis = &node->axis[i];

        cia402_axis_watch_faults(node, axis);
        /* Transitions that need no command */
        if (axis->state == CIA402_NOT_READY) {
            cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED); /* transition 1 */
        } else if (axis->state == CIA402_SWITCHED_ON) {
            if (controlword_command(axis->controlword) == COMMAND_ENABLE_OPERATION) {
                cia402_axis_enter(node, axis, CIA402_OPERATION_ENABLED); /* transition 4, after 3 */
            }
        } else if (axis->stopping && cia402_axis_has_stopped(axis)) {
            cia402_axis_enter(node, axis, axis->stop_state); /* transition 5, 8, 12 or 14 */
        }
        for (int64_t ms = span.from; ms < span.to; ms++) {
            cia402_axis_step(axis);
        }
        axis->voltage = cia402_counts(axis->base.voltage_v, CIA402_VOLTAGE_V);
    }
}

/* Opens the bridges of a drive (struct board_ops). */
static void cia402_motor_shut_down(struct board *board)
{
    struct cia402_node *node = cia402_node_of(board);

    for (unsigned i = 0; i < node->axes; i++) {
        struct cia402_axis *axis = &node->axis[i];

        if (cia402_axis_is_on(axis) || axis->state == CIA402_SWITCHED_ON) {
            cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED);
        }
    }
}

const struct board_ops cia402_motor_ops = {
    .size = sizeof(struct cia402_motor),
    .identity = {.type = CIA402_KIND_DRIVE, .major = 1, .minor = 0, .build = 1},
    .periodic_max = FRAMES_MAX,
    .power_up = cia402_motor_power_up,
    .sample = cia402_motor_sample,
    .control = cia402_motor_control,
    .transmit = cia402_node_transmit,
    .shut_down = cia402_motor_shut_down,
    .axes = offsetof(struct cia402_motor, axis),
    .axis_size = sizeof(struct cia402_axis),
    .settings = &cia402_settings,
};
