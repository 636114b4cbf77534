/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state machine of CiA 402 (IEC 61800-7-201, 6.2): commands of the controlword, transitions,
 * option codes, statusword. A controlword is obeyed when it is written, one transition for each,
 * but for "enable operation" in READY TO SWITCH ON, which is transition 3 and in the next tick 4.
 */
#include "boards/cia402/private.h"

enum command {
    COMMAND_NONE,
    COMMAND_SHUTDOWN,
    COMMAND_SWITCH_ON, /* and disable operation */
    COMMAND_DISABLE_VOLTAGE,
    COMMAND_QUICK_STOP,
    COMMAND_ENABLE_OPERATION,
    COMMANDS,
};

enum { WARNINGS = CIA402_FAULT_STALE | CIA402_FAULT_LIMIT };

/* The number of the transition that a command makes in a state; 0: none. */
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

/* The statusword's bits of a state. */
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

void cia402_axis_enter(struct cia402_node *node, struct cia402_axis *axis, enum cia402_state state)
{
    bool was_on = cia402_axis_is_on(axis);

    if (state == axis->state) {
        return;
    }
    board_event(&node->board, BOARD_EVENT_MODE, cia402_axis_number(node, axis), axis->state, state);
    axis->state = state;
    if (cia402_axis_is_on(axis) && !was_on) {
        axis->command_ns = node->board.boards->now_ns;
        cia402_axis_stand(axis);
    } else if (was_on && !cia402_axis_is_on(axis)) {
        axis->target_voltage = axis->target_torque = 0;
        axis->overload_ms = 0.0;
        cia402_axis_stand(axis);
    }
}

/* ---- transitions ---- */

/* Begins a quick stop by its option code. */
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

/* Enters a state where the drive function is off, on a ramp if the option code wants one; a
 * repeated controlword does not restart the ramp. */
static void cia402_axis_leave_operation(struct cia402_node *node, struct cia402_axis *axis,
                                        bool ramp, enum cia402_state state)
{
    if (!ramp) {
        cia402_axis_enter(node, axis, state);
    } else if (!axis->stopping || axis->stop_state != state) {
        cia402_axis_stop(axis, CIA402_RAMP_SLOW, state);
    }
}

/* Enables operation again after a quick stop that ends in its own state. */
static void cia402_axis_resume(struct cia402_node *node, struct cia402_axis *axis)
{
    if (axis->settings.quick_stop_option >= 5) {
        cia402_axis_stand(axis);
        cia402_axis_enter(node, axis, CIA402_OPERATION_ENABLED);
    }
}

/* Makes a transition by its number. */
static void cia402_axis_make_transition(struct cia402_node *node, struct cia402_axis *axis,
                                        unsigned number)
{
    /* Numbers of IEC 61800-7-201 */
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
    case 5:
        cia402_axis_leave_operation(node, axis, axis->settings.disable_option == 1,
                                    CIA402_SWITCHED_ON);
        break;
    case 8:
        cia402_axis_leave_operation(node, axis, axis->settings.shutdown_option == 1,
                                    CIA402_READY_TO_SWITCH_ON);
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
        cia402_axis_resume(node, axis);
        break;
    default:
        break;
    }
}

/* Makes transition 15, if the causes of the fault are gone. */
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

    /* Enabled again while a ramp leads out of operation: it goes on */
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

void cia402_axis_step_state(struct cia402_node *node, struct cia402_axis *axis)
{
    if (axis->state == CIA402_NOT_READY) {
        cia402_axis_enter(node, axis, CIA402_SWITCH_ON_DISABLED); /* 1 */
    } else if (axis->state == CIA402_SWITCHED_ON) {
        if (controlword_command(axis->controlword) == COMMAND_ENABLE_OPERATION) {
            cia402_axis_enter(node, axis, CIA402_OPERATION_ENABLED); /* 4, after 3 */
        }
    } else if (axis->stopping && cia402_axis_has_stopped(axis)) {
        cia402_axis_enter(node, axis, axis->stop_state); /* 5, 8, 12, 14 */
    }
}

/* ---- what does not come from the controlword ---- */

void cia402_axis_react(struct cia402_node *node, struct cia402_axis *axis, bool drivable)
{
    int64_t option = axis->settings.fault_option;
    bool ramp = drivable && option > 0 && cia402_axis_is_on(axis);

    if (axis->state == CIA402_FAULT || (axis->state == CIA402_FAULT_REACTION_ACTIVE && drivable)) {
        return;
    }
    cia402_axis_enter(node, axis, CIA402_FAULT_REACTION_ACTIVE); /* 13 */
    if (ramp) {
        cia402_axis_stop(axis, option == 2 ? CIA402_RAMP_QUICK : CIA402_RAMP_SLOW, CIA402_FAULT);
    } else {
        cia402_axis_enter(node, axis, CIA402_FAULT); /* 14 */
    }
}

void cia402_axis_lose_connection(struct cia402_node *node, struct cia402_axis *axis)
{
    if (!cia402_axis_is_on(axis)) {
        return;
    }
    /* The option code 0x6007: a fault, no voltage, or a quick stop */
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

void cia402_axis_update_status(struct cia402_axis *axis)
{
    unsigned word = state_bits[axis->state] | CIA402_SW_REMOTE;

    word |= axis->present & CIA402_FAULT_UNDER_VOLTAGE ? 0 : CIA402_SW_VOLTAGE_ENABLED;
    word |= axis->present & WARNINGS ? CIA402_SW_WARNING : 0;
    axis->statusword = word | cia402_axis_mode_status(axis);
}
