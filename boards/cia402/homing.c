/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Homing (CiA 402-2): an enabled axis looks for an edge of a switch, then where the method wants it
 * for the next index pulse, and makes of that place the home position; its position is 0 at the
 * home offset from there.
 *
 * Every method with a switch has the same three parts. The search goes in the method's first
 * direction, fast, until the switch is on; a limit switch on the way turns it around once, where
 * the method knows limit switches, or ends it. An edge that is taken from the off side is left
 * behind, fast, before the last part, which is slow, crosses the edge in its own direction.
 */
#include "boards/cia402/private.h"

#include "base/array.h"

#include <math.h>
#include <stdlib.h>

#define STEP_S 1e-3

/* Digital inputs of 0x60fd */
enum {
    INPUT_NEGATIVE = 1 << 0,
    INPUT_POSITIVE = 1 << 1,
    INPUT_HOME = 1 << 2,
    INPUT_NONE = 0,
};

/* A method: which switch; its first direction; the direction in which the edge is crossed, 1 or
 * -1; whether the switch is on before the edge is; whether the search turns at a limit switch; and
 * whether the home position is an index pulse. No switch and no pulse: where the axis stands. */
static const struct cia402_homing_method {
    int8_t number, input, first, last;
    bool from_on, turns, index;
} methods[] = {
    {1, INPUT_NEGATIVE, -1, 1, true, false, true},
    {2, INPUT_POSITIVE, 1, -1, true, false, true},
    {3, INPUT_HOME, 1, -1, true, false, true},
    {4, INPUT_HOME, 1, 1, false, false, true},
    {5, INPUT_HOME, -1, 1, true, false, true},
    {6, INPUT_HOME, -1, -1, false, false, true},
    {7, INPUT_HOME, 1, -1, true, true, true},
    {8, INPUT_HOME, 1, 1, false, true, true},
    {9, INPUT_HOME, 1, -1, false, true, true},
    {10, INPUT_HOME, 1, 1, true, true, true},
    {11, INPUT_HOME, -1, 1, true, true, true},
    {12, INPUT_HOME, -1, -1, false, true, true},
    {13, INPUT_HOME, -1, 1, false, true, true},
    {14, INPUT_HOME, -1, -1, true, true, true},
    {17, INPUT_NEGATIVE, -1, 1, true, false, false},
    {18, INPUT_POSITIVE, 1, -1, true, false, false},
    {19, INPUT_HOME, 1, -1, true, false, false},
    {20, INPUT_HOME, 1, 1, false, false, false},
    {21, INPUT_HOME, -1, 1, true, false, false},
    {22, INPUT_HOME, -1, -1, false, false, false},
    {23, INPUT_HOME, 1, -1, true, true, false},
    {24, INPUT_HOME, 1, 1, false, true, false},
    {25, INPUT_HOME, 1, -1, false, true, false},
    {26, INPUT_HOME, 1, 1, true, true, false},
    {27, INPUT_HOME, -1, 1, true, true, false},
    {28, INPUT_HOME, -1, -1, false, true, false},
    {29, INPUT_HOME, -1, 1, false, true, false},
    {30, INPUT_HOME, -1, -1, true, true, false},
    {33, INPUT_NONE, -1, -1, false, false, true},
    {34, INPUT_NONE, 1, 1, false, false, true},
    {35, INPUT_NONE, 0, 0, false, false, false},
    {37, INPUT_NONE, 0, 0, false, false, false},
};

_Static_assert(ARRAY_COUNT(methods) == CIA402_HOMING_METHODS, "a sub-index of 0x60e3 for each");

/* Finds a method by its number; NULL: none such. */
static const struct cia402_homing_method *cia402_homing_find(int64_t number)
{
    for (size_t i = 0; i < ARRAY_COUNT(methods); i++) {
        if (methods[i].number == number) {
            return &methods[i];
        }
    }
    return NULL;
}

/* Returns whether a joint has the switches and the pulse that a method needs. */
static bool cia402_homing_is_supported(const struct cia402_homing_method *method,
                                       const struct board_switches *switches)
{
    unsigned there = (switches->negative ? INPUT_NEGATIVE : 0u) |
                     (switches->positive ? INPUT_POSITIVE : 0u) |
                     (switches->home ? INPUT_HOME : 0u);

    return !((unsigned)method->input & ~there) && (!method->index || switches->index_rad > 0.0);
}

void cia402_homing_list(struct cia402_axis *axis, const struct board_switches *switches)
{
    size_t count = 0;

    for (size_t i = 0; i < ARRAY_COUNT(methods); i++) {
        axis->homing_methods[i] = 0;
        if (cia402_homing_is_supported(&methods[i], switches)) {
            axis->homing_methods[count++] = methods[i].number;
        }
    }
}

void cia402_homing_sample(struct cia402_axis *axis, const struct board_switches *switches)
{
    double link_rad = (double)axis->link_encoder * CIA402_POSITION_RAD;

    axis->digital_inputs =
        (switches->negative && link_rad <= switches->negative_rad ? INPUT_NEGATIVE : 0) |
        (switches->positive && link_rad >= switches->positive_rad ? INPUT_POSITIVE : 0) |
        (switches->home && link_rad >= switches->home_rad[0] && link_rad <= switches->home_rad[1]
             ? INPUT_HOME
             : 0);
    axis->index_rad = switches->index_rad;
}

/* ---- where it is ---- */

/* Makes a reading of the motor encoder the home position, from which all positions count. */
static void cia402_homing_take(struct cia402_axis *axis, int64_t encoder)
{
    int64_t shift = encoder + axis->settings.home_offset - axis->home;

    axis->home += shift;
    axis->position -= shift;
    axis->position_demand -= shift;
    axis->profile.position -= (double)shift;
    axis->goal = axis->profile.position;
}

/* Returns the number of index pulses so far, from a multiple of their distance on. */
static double cia402_homing_pulses(const struct cia402_axis *axis)
{
    return floor(axis->motor_rad / axis->index_rad);
}

/* ---- the parts ---- */

/* Enters a part of the procedure in a direction. */
static void cia402_homing_enter(struct cia402_axis *axis, enum cia402_homing_part part,
                                int direction)
{
    axis->homing = part;
    axis->homing_direction = direction;
    axis->homing_pulses = part == CIA402_HOMING_INDEX ? cia402_homing_pulses(axis) : 0.0;
}

/* Ends the procedure, with or without a home position. */
static void cia402_homing_end(struct cia402_axis *axis, bool found)
{
    axis->homing_found = found;
    axis->homing_failed = !found;
    cia402_homing_enter(axis, CIA402_HOMING_STOPS, 0);
}

/* Takes the edge that has been crossed as the home position, or looks for the pulse behind it. */
static void cia402_homing_reach_edge(struct cia402_axis *axis,
                                     const struct cia402_homing_method *method)
{
    if (method->index) {
        cia402_homing_enter(axis, CIA402_HOMING_INDEX, method->last);
    } else {
        cia402_homing_take(axis, axis->motor_encoder);
        cia402_homing_end(axis, true);
    }
}

/* Takes the first index pulse that the rotor passes as the home position. */
static void cia402_homing_watch_pulse(struct cia402_axis *axis)
{
    double pulses = cia402_homing_pulses(axis);
    double at = axis->homing_direction > 0 ? pulses : axis->homing_pulses;

    if (pulses != axis->homing_pulses) {
        cia402_homing_take(axis, cia402_counts(at * axis->index_rad, CIA402_POSITION_RAD));
        cia402_homing_end(axis, true);
    }
}

/* Returns whether a limit switch is in the way that the method does not look for. */
static bool cia402_homing_is_blocked(const struct cia402_axis *axis,
                                     const struct cia402_homing_method *method)
{
    int64_t ahead = axis->homing_direction < 0 ? INPUT_NEGATIVE : INPUT_POSITIVE;

    return axis->homing_direction != 0 && ahead != method->input && axis->digital_inputs & ahead;
}

/* Ends a part of the procedure when its condition holds, and begins the next. */
static void cia402_homing_watch(struct cia402_axis *axis, const struct cia402_homing_method *method)
{
    bool on = axis->digital_inputs & method->input;

    /* What ends a part, and begins the next */
    switch (axis->homing) {
    case CIA402_HOMING_SEARCH:
        if (on && method->from_on) {
            cia402_homing_enter(axis, CIA402_HOMING_EDGE, method->last);
        } else if (on) {
            cia402_homing_enter(axis, CIA402_HOMING_LEAVE, -method->last);
        } else if (method->turns && axis->homing_direction == method->first &&
                   cia402_homing_is_blocked(axis, method)) {
            axis->homing_direction = -method->first;
        }
        break;
    case CIA402_HOMING_LEAVE:
        if (!on) {
            cia402_homing_enter(axis, CIA402_HOMING_EDGE, method->last);
        }
        break;
    case CIA402_HOMING_EDGE:
        if (on != method->from_on) {
            cia402_homing_reach_edge(axis, method);
        }
        break;
    case CIA402_HOMING_INDEX:
        cia402_homing_watch_pulse(axis);
        break;
    default:
        break;
    }

    /* A part that has just turned around is not blocked */
    if (cia402_homing_is_blocked(axis, method)) {
        cia402_homing_end(axis, false);
    }
}

void cia402_homing_start(struct cia402_axis *axis)
{
    const struct cia402_homing_method *method = cia402_homing_find(axis->settings.homing_method);

    axis->homed = axis->homing_failed = false;
    if (!method) {
        axis->homing_failed = true;
    } else if (method->first == 0) {
        cia402_homing_take(axis, axis->motor_encoder);
        cia402_axis_stand(axis);
        axis->homed = true;
    } else {
        cia402_homing_enter(axis, method->input ? CIA402_HOMING_SEARCH : CIA402_HOMING_INDEX,
                            method->first);
    }
}

void cia402_homing_interrupt(struct cia402_axis *axis)
{
    if (axis->homing != CIA402_HOMING_RESTS && axis->homing != CIA402_HOMING_STOPS) {
        axis->homing_found = false;
        cia402_homing_enter(axis, CIA402_HOMING_STOPS, 0);
    }
}

void cia402_homing_step(struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    const struct cia402_homing_method *method = cia402_homing_find(p->homing_method);
    bool fast = axis->homing == CIA402_HOMING_SEARCH || axis->homing == CIA402_HOMING_LEAVE;
    double acceleration = (double)p->homing_acceleration, wanted;

    if (axis->homing == CIA402_HOMING_RESTS || !method) {
        return;
    }
    cia402_homing_watch(axis, method);
    wanted = axis->controlword & CIA402_CW_HALT
                 ? 0.0
                 : axis->homing_direction * (double)p->homing_speed[fast ? 0 : 1];
    cia402_profile_accelerate(&axis->profile, wanted, acceleration, acceleration, STEP_S);
    if (axis->homing == CIA402_HOMING_STOPS && axis->profile.velocity == 0.0) {
        axis->homed = axis->homing_found;
        axis->homing = CIA402_HOMING_RESTS;
    }
}

enum cia402_abort cia402_axis_write_homing(struct cia402_node *node,
                                           const struct cia402_entry *entry, int64_t value)
{
    const struct cia402_homing_method *method = cia402_homing_find(value);
    struct cia402_axis *axis = &node->axis[entry->unit];

    if (value != 0 && (!method || !cia402_homing_is_supported(
                                      method, &node->board.config.axis[entry->unit].switches))) {
        return CIA402_ABORT_VALUE;
    }
    if (axis->homing != CIA402_HOMING_RESTS) {
        return CIA402_ABORT_STATE;
    }
    *cia402_field(node, entry) = value;
    return CIA402_DONE;
}
