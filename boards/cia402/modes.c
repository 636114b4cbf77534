/* SPDX-License-Identifier: Apache-2.0 */
/* Modes of operation of a cia402 axis: trapezoidal profiles, homing, modes and loops. */
#include "boards/cia402/private.h"

#include <stdlib.h>

/*
 * Trapezoidal profiles in steps of dt. The position moves with the velocity at the end of the step.
 * Stopping from velocity v with deceleration d therefore takes a distance v^2 / (2 d) + v dt / 2.
 * The remaining distance limits the velocity.
 */

/* Runs one step of dt s of a profile towards a velocity. */
static void cia402_profile_accelerate(struct cia402_profile *profile, double velocity,
                                      double acceleration, double deceleration, double dt)
{
    double v = profile->velocity;
    bool slower = fabs(velocity) < fabs(v) || velocity * v < 0.0;
    double step = (slower ? deceleration : acceleration) * dt;

    profile->velocity = fabs(velocity - v) <= step ? velocity : v + copysign(step, velocity - v);
    profile->position += profile->velocity * dt;
}

/* Runs one step of dt s of a trapezoidal profile towards a goal. */
static void cia402_profile_move(struct cia402_profile *profile, double goal, double speed,
                                double acceleration, double deceleration, double dt)
{
    double way = goal - profile->position, distance = fabs(way);
    double half = deceleration * dt / 2.0;
    double v = way < 0.0 ? -profile->velocity : profile->velocity;
    double most = fmin(speed, sqrt(half * half + 2.0 * deceleration * distance) - half);

    if (v < 0.0) { /* moving away from the goal */
        v = fmin(v + deceleration * dt, most);
    } else {
        v = v < most ? fmin(v + acceleration * dt, most) : fmax(v - deceleration * dt, most);
    }
    if (v * dt >= distance && v <= 2.0 * deceleration * dt) {
        profile->position = goal;
        profile->velocity = 0.0;
        return;
    }
    profile->velocity = way < 0.0 ? -v : v;
    profile->position += profile->velocity * dt;
}

/*
 * Homing (CiA 402-2). An enabled axis looks for an edge of a switch, then for the next index pulse
 * if the method requires one. The place of the edge or pulse is the home position: there the
 * position is minus the home offset.
 *
 * Each method with a switch has three parts. First, the axis searches fast, in the method's first
 * direction, until the switch is on. A limit switch on the way reverses the search once if the
 * method allows it; otherwise homing fails. Second, if the edge must be crossed from the off side,
 * the axis leaves the switch fast. Third, the axis crosses the edge slowly in the method's
 * direction.
 */

#define STEP_S 1e-3 /* step of the loops */

/* Bits of the digital inputs 0x60fd */
enum {
    INPUT_NEGATIVE = 1 << 0,
    INPUT_POSITIVE = 1 << 1,
    INPUT_HOME = 1 << 2,
    INPUT_NONE = 0,
};

/* The homing methods. number: CiA 402 number; input: switch; first, last: direction of the search
 * and direction across the edge, 1 or -1; from_on: the switch is on before the edge; turns: a limit
 * switch reverses the search; index: home is an index pulse. Without switch and pulse, home is the
 * present position. */
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

/* Returns the method with a number; NULL = unknown. */
static const struct cia402_homing_method *cia402_homing_find(int64_t number)
{
    for (size_t i = 0; i < ARRAY_COUNT(methods); i++) {
        if (methods[i].number == number) {
            return &methods[i];
        }
    }
    return NULL;
}

/* Returns whether a joint has the switch and the pulse that a method requires. */
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

/* ---- home position ---- */

/* Makes an encoder reading the home position. Shifts all positions to the new origin. */
static void cia402_homing_take(struct cia402_axis *axis, int64_t encoder)
{
    int64_t shift = encoder + axis->settings.home_offset - axis->home;

    axis->home += shift;
    axis->position -= shift;
    axis->position_demand -= shift;
    axis->profile.position -= (double)shift;
    axis->goal = axis->profile.position;
}

/* Returns the number of the index pulse at or below the rotor angle. */
static double cia402_homing_pulses(const struct cia402_axis *axis)
{
    return floor(axis->base.motor_rad / axis->index_rad);
}

/* ---- parts of the procedure ---- */

/* Starts a part of the procedure in a direction. */
static void cia402_homing_enter(struct cia402_axis *axis, enum cia402_homing_part part,
                                int direction)
{
    axis->homing = part;
    axis->homing_direction = direction;
    axis->homing_pulses = part == CIA402_HOMING_INDEX ? cia402_homing_pulses(axis) : 0.0;
}

/* Ends the procedure; found: the home position is known. */
static void cia402_homing_end(struct cia402_axis *axis, bool found)
{
    axis->homing_found = found;
    axis->homing_failed = !found;
    cia402_homing_enter(axis, CIA402_HOMING_STOPS, 0);
}

/* Returns whether the limit switch ahead is on, unless the method searches for this switch. */
static bool cia402_homing_is_blocked(const struct cia402_axis *axis,
                                     const struct cia402_homing_method *method)
{
    int64_t ahead = axis->homing_direction < 0 ? INPUT_NEGATIVE : INPUT_POSITIVE;

    return axis->homing_direction != 0 && ahead != method->input && axis->digital_inputs & ahead;
}

/* Starts the next part of the procedure when the present part is complete. */
static void cia402_homing_watch(struct cia402_axis *axis, const struct cia402_homing_method *method)
{
    bool on = axis->digital_inputs & method->input;
    double pulses;

    /* Check whether the present part is complete */
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
        if (on != method->from_on && method->index) {
            cia402_homing_enter(axis, CIA402_HOMING_INDEX, method->last);
        } else if (on != method->from_on) {
            cia402_homing_take(axis, axis->motor_encoder);
            cia402_homing_end(axis, true);
        }
        break;
    case CIA402_HOMING_INDEX: /* home is the first index pulse that the rotor passes */
        pulses = cia402_homing_pulses(axis);
        if (pulses != axis->homing_pulses) {
            double at = axis->homing_direction > 0 ? pulses : axis->homing_pulses;

            cia402_homing_take(axis, cia402_counts(at * axis->index_rad, CIA402_POSITION_RAD));
            cia402_homing_end(axis, true);
        }
        break;
    default:
        break;
    }

    /* Fail at a limit switch; after a reversal, the switch is no longer ahead */
    if (cia402_homing_is_blocked(axis, method)) {
        cia402_homing_end(axis, false);
    }
}

static void cia402_homing_start(struct cia402_axis *axis)
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

static void cia402_homing_step(struct cia402_axis *axis)
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

/*
 * Modes of operation of an enabled axis, in steps of a millisecond, down to the bridge voltage.
 *
 * Positions and velocities are those of the rotor, on the link side of the gear. The velocity loop
 * outputs a voltage: v = kw w_ref + kp e + ki int e dt, with the back-EMF constant kw. The factory
 * gains are proportional to kw. A motor with a time constant J R / (Kt Kw) of a few milliseconds
 * needs no inner current loop. The position loop adds its error times a gain g to the velocity.
 *
 * The position modes have a separate integral gain ki, because an integral makes the motor follow
 * an oscillating load. With w_ref = -g theta, the real part of voltage over speed is kw + kp - ki g
 * / w^2. It is negative below w = sqrt(ki g / (kw + kp)). The motor then excites a robot that sways
 * on springs below this frequency, until it falls.
 *
 * The winding's resistance limits the voltage, so that the current stays within its limit. The
 * torque modes hand a current to the drive's own controller (boards/axis.h).
 */

enum { STOP_MAX_MS = 2000, TORQUE_NEAR = 50 };

/* ---- references and braking ---- */

void cia402_axis_stand(struct cia402_axis *axis)
{
    axis->profile = (struct cia402_profile){(double)axis->position, 0.0};
    axis->goal = (double)axis->position;
    axis->moving = axis->has_next = axis->stopping = false;
    axis->homing = CIA402_HOMING_RESTS;
    /* Discard the target of an axis that is on. A target written before the axis is switched on
     * stays */
    axis->has_target = axis->has_target && !cia402_axis_is_on(axis);
    axis->interpolation_left_ms = 0;
    axis->torque_reference = 0.0;
    axis->velocity_integral_v = axis->base.voltage_v = 0.0;
    axis->base.law.on = false;
    axis->following_ms = axis->reached_ms = axis->standstill_ms = axis->stop_ms = 0;
}

/* Starts to brake the axis from its present velocity, in any mode. */
void cia402_axis_stop(struct cia402_axis *axis, enum cia402_ramp ramp, enum cia402_state then)
{
    const struct cia402_axis_settings *p = &axis->settings;

    axis->stopping = true;
    axis->stop_state = then;
    axis->stop_ms = 0;
    axis->moving = axis->has_next = false;
    axis->homing = CIA402_HOMING_RESTS;
    axis->stop_by_current = ramp == CIA402_RAMP_CURRENT;
    axis->stop_deceleration =
        (double)(ramp == CIA402_RAMP_QUICK ? p->quick_stop_deceleration : p->profile_deceleration);
    axis->profile = (struct cia402_profile){
        (double)axis->position,
        axis->stop_by_current ? 0.0 : axis->base.velocity_rad_s / CIA402_POSITION_RAD};
}

bool cia402_axis_has_stopped(const struct cia402_axis *axis)
{
    bool still = llabs(axis->velocity) <= axis->settings.velocity_threshold;

    return axis->stopping && axis->profile.velocity == 0.0 &&
           (still || axis->stop_ms >= STOP_MAX_MS);
}

bool cia402_axis_controls_position(const struct cia402_axis *axis)
{
    return !axis->stopping && (axis->mode == CIA402_PROFILE_POSITION ||
                               axis->mode == CIA402_CYCLIC_POSITION || axis->mode == CIA402_HOMING);
}

/* Returns whether an axis has software limits of position. */
static bool cia402_axis_has_limits(const struct cia402_axis *axis)
{
    return axis->settings.position_limit[0] < axis->settings.position_limit[1];
}

/* Clamps a position to the software limits. */
static double cia402_axis_bound(struct cia402_axis *axis, double position)
{
    double low = (double)axis->settings.position_limit[0];
    double high = (double)axis->settings.position_limit[1];

    if (!cia402_axis_has_limits(axis) || (position >= low && position <= high)) {
        return position;
    }
    axis->limited = true;
    return position < low ? low : high;
}

/* Clamps a velocity to the limits of the profile and of the motor. */
static double cia402_axis_bound_velocity(struct cia402_axis *axis, double velocity)
{
    double of_motor = (double)axis->settings.max_motor_rpm / axis->rpm_rad / CIA402_POSITION_RAD;
    double most = fmin((double)axis->settings.max_profile_velocity, of_motor);

    axis->limited = axis->limited || fabs(velocity) > most;
    return fmax(fmin(velocity, most), -most);
}

/* ---- set points by the controlword ---- */

void cia402_axis_take_set_point(struct cia402_axis *axis, int64_t before)
{
    bool rises = axis->controlword & ~before & CIA402_CW_NEW_SET_POINT;

    if (!(axis->controlword & CIA402_CW_NEW_SET_POINT)) {
        axis->set_point_taken = false;
        if (axis->homing != CIA402_HOMING_RESTS && axis->homing != CIA402_HOMING_STOPS) {
            axis->homing_found = false;
            cia402_homing_enter(axis, CIA402_HOMING_STOPS, 0);
        }
    }
    if (rises && axis->mode == CIA402_PROFILE_POSITION && !axis->has_next) {
        /* Accept a set point. If another one is active, the new one waits, unless the controlword
         * demands it at once. */
        bool relative = axis->controlword & CIA402_CW_RELATIVE;
        double from = !relative ? 0.0 : axis->moving ? axis->goal : (double)axis->position_demand;
        double goal = from + (double)axis->target_position;

        if (axis->moving && !(axis->controlword & CIA402_CW_AT_ONCE)) {
            axis->has_next = true;
            axis->next_goal = goal;
        } else {
            axis->goal = goal;
            axis->moving = true;
            axis->has_next = false;
        }
        axis->set_point_taken = true;
        axis->reached_ms = 0;
    } else if (rises && axis->mode == CIA402_HOMING) {
        cia402_homing_start(axis);
    }
}

/* ---- loops ---- */

/* Returns the voltage of the velocity loop: back-EMF, PI control and torque offset, limited by
 * current and supply. ki: integral gain, mV/rad. */
static double cia402_axis_velocity_law(struct cia402_axis *axis, double velocity, int64_t ki)
{
    double ohm = axis->base.config->winding_ohm, supply_v = axis->base.supply_v;
    const struct cia402_axis_settings *p = &axis->settings;
    double kw = (double)p->current_gain[2] * 1e-3, now = axis->base.velocity_rad_s;
    double error = velocity * CIA402_POSITION_RAD - now;
    double step = (double)ki * 1e-3 * error * STEP_S;
    double rated_a = (double)axis->rated_current_ma * 1e-3, limit_v = supply_v;
    double offset_v = (double)axis->torque_offset * 1e-3 * rated_a * ohm;
    double v = kw * velocity * CIA402_POSITION_RAD + (double)p->velocity_gain[0] * 1e-3 * error +
               axis->velocity_integral_v + step + offset_v;
    double bound = v;

    /* Limit the current: the voltage may differ from the back-EMF by R times the current limit */
    if (ohm > 0.0) {
        double most = (double)(p->max_torque < p->max_current ? p->max_torque : p->max_current);

        limit_v = ohm * rated_a * most * 1e-3;
        bound = fmax(fmin(v, kw * now + limit_v), kw * now - limit_v);
    }
    bound = fmax(fmin(bound, supply_v), -supply_v);
    if (bound == v || step * (v - bound) < 0.0) {
        axis->velocity_integral_v += step;
    }
    axis->limited = axis->limited || bound != v;
    axis->velocity_demand = cia402_counts(velocity, 1.0);
    return bound;
}

/* Returns the voltage of the position loop, which sets the velocity of the velocity loop. */
static double cia402_axis_position_law(struct cia402_axis *axis)
{
    double gain = (double)axis->settings.position_gain * 0.1;
    double error = axis->profile.position - (double)axis->position;

    axis->position_demand = cia402_counts(axis->profile.position, 1.0);
    return cia402_axis_velocity_law(axis, axis->profile.velocity + gain * error,
                                    axis->settings.velocity_gain[2]);
}

/* ---- modes ---- */

/* Advances the profile towards the goal, or halts it. At the goal, activates the next set point. */
static void cia402_axis_step_profile_position(struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    double speed = cia402_axis_bound_velocity(axis, (double)p->profile_velocity);
    double deceleration = (double)p->profile_deceleration;

    if (axis->controlword & CIA402_CW_HALT) {
        double halt = p->halt_option == 2 ? (double)p->quick_stop_deceleration : deceleration;

        cia402_profile_accelerate(&axis->profile, 0.0, halt, halt, STEP_S);
        return;
    }
    cia402_profile_move(&axis->profile, cia402_axis_bound(axis, axis->goal), speed,
                        (double)p->profile_acceleration, deceleration, STEP_S);
    if (axis->moving && axis->profile.velocity == 0.0) {
        axis->moving = axis->has_next;
        if (axis->has_next) {
            axis->goal = axis->next_goal;
            axis->has_next = false;
        }
    }
}

/* Returns `wanted`, or 0 if the joint is beyond a software limit and `wanted` leads further. */
static double cia402_axis_lead_back(struct cia402_axis *axis, double wanted)
{
    int64_t link = axis->link_encoder - axis->home;
    bool further = cia402_axis_has_limits(axis) &&
                   ((link > axis->settings.position_limit[1] && wanted > 0.0) ||
                    (link < axis->settings.position_limit[0] && wanted < 0.0));

    axis->limited = axis->limited || further;
    return further ? 0.0 : wanted;
}

/* Moves the torque reference to its target; profile mode limits the slope. Hands the current to the
 * current controller. */
static void cia402_axis_step_torque(struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    double slope = (double)p->torque_slope * STEP_S;
    bool halt = axis->mode == CIA402_TORQUE && axis->controlword & CIA402_CW_HALT;
    double most = (double)(p->max_torque < p->max_current ? p->max_torque : p->max_current);
    double torque = halt ? 0.0 : (double)(axis->target_torque + axis->torque_offset);
    double wanted = fmax(fmin(torque, most), -most), change = wanted - axis->torque_reference;
    double thousandth_a = 1e-3 * (double)axis->rated_current_ma * 1e-3;
    double henry = axis->base.config->winding_h;

    axis->limited = axis->limited || fabs(torque) > most;
    if (axis->mode == CIA402_CYCLIC_TORQUE || fabs(change) <= slope) {
        axis->torque_reference = wanted;
    } else {
        axis->torque_reference += copysign(slope, change);
    }
    torque = cia402_axis_lead_back(axis, axis->torque_reference);
    axis->torque_demand = cia402_counts(torque, 1.0);
    axis_follow_law(
        &axis->base,
        &(struct current_law){.current_a = torque * thousandth_a,
                              .limit_a = most * thousandth_a,
                              .bandwidth_rad_s =
                                  henry > 0.0 ? (double)p->current_gain[0] * 1e-3 / henry : 0.0});
}

/* Runs one step of the active mode. Returns the bridge voltage, as measured in torque modes. */
static double cia402_axis_step_mode(struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    bool halt = axis->controlword & CIA402_CW_HALT;
    int64_t ki = p->velocity_gain[1], left;
    double velocity;

    switch (axis->mode) {
    /* Position modes */
    case CIA402_PROFILE_POSITION:
        cia402_axis_step_profile_position(axis);
        return cia402_axis_position_law(axis);
    case CIA402_CYCLIC_POSITION: /* linear interpolation to the target */
        left = axis->interpolation_left_ms > 1 ? axis->interpolation_left_ms : 1;
        velocity = axis->has_target ? cia402_axis_bound(axis, (double)axis->target_position) -
                                          axis->profile.position
                                    : 0.0;
        velocity = cia402_axis_bound_velocity(axis, velocity / ((double)left * STEP_S));
        axis->interpolation_left_ms = left - 1;
        axis->profile.position += velocity * STEP_S;
        axis->profile.velocity = velocity + (double)axis->velocity_offset;
        return cia402_axis_position_law(axis);
    case CIA402_HOMING:
        cia402_homing_step(axis);
        return cia402_axis_position_law(axis);

    /* Velocity modes */
    case CIA402_PROFILE_VELOCITY:
        velocity = halt ? 0.0 : cia402_axis_bound_velocity(axis, (double)axis->target_velocity);
        cia402_profile_accelerate(&axis->profile, velocity, (double)p->profile_acceleration,
                                  (double)(halt && p->halt_option == 2 ? p->quick_stop_deceleration
                                                                       : p->profile_deceleration),
                                  STEP_S);
        velocity = cia402_axis_lead_back(axis, axis->profile.velocity);
        return cia402_axis_velocity_law(axis, velocity, ki);
    case CIA402_CYCLIC_VELOCITY:
        velocity = (double)(axis->target_velocity + axis->velocity_offset);
        velocity = cia402_axis_lead_back(axis, cia402_axis_bound_velocity(axis, velocity));
        return cia402_axis_velocity_law(axis, velocity, ki);

    /* Torque modes and voltage mode */
    case CIA402_TORQUE:
    case CIA402_CYCLIC_TORQUE:
        cia402_axis_step_torque(axis);
        return axis->base.voltage_v;
    case CIA402_VOLTAGE_MODE:
        return cia402_axis_lead_back(axis, (double)axis->target_voltage * CIA402_VOLTAGE_V);
    default:
        return 0.0;
    }
}

void cia402_axis_step(struct cia402_axis *axis)
{
    double v = 0.0;

    /* Activate a newly written mode */
    if (axis->mode != axis->settings.mode) {
        axis->mode = (enum cia402_mode)axis->settings.mode;
        axis->mode_display = axis->mode;
        if (!axis->stopping) {
            cia402_axis_stand(axis);
        }
    }
    axis->base.law.on = false;
    if (!cia402_axis_is_on(axis)) {
        axis->base.voltage_v = 0.0;
        return;
    }
    axis->limited = false;
    axis->torque_demand = axis->velocity_demand = 0;
    axis->position_demand = axis->position;
    if (axis->stopping) {
        /* With no ramp: keep the reference at the position, so that the voltage brakes as hard as
         * the current limit allows. At standstill the reference stays and holds the rotor */
        axis->stop_ms++;
        if (axis->stop_by_current && llabs(axis->velocity) > axis->settings.velocity_threshold) {
            axis->profile.position = (double)axis->position;
        }
        cia402_profile_accelerate(&axis->profile, 0.0, axis->stop_deceleration,
                                  axis->stop_deceleration, STEP_S);
        v = cia402_axis_position_law(axis);
    } else {
        v = cia402_axis_step_mode(axis);
    }
    axis->base.voltage_v = fmax(fmin(v, axis->base.supply_v), -axis->base.supply_v);
}

/* ---- bits of the statusword that depend on the mode ---- */

/* Updates the following error and the times for the statusword, once a millisecond. */
void cia402_axis_count_times(struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    bool still = llabs(axis->velocity) <= p->velocity_threshold;
    bool near = false;

    axis->following_error = cia402_axis_controls_position(axis) && cia402_axis_is_on(axis)
                                ? axis->position_demand - axis->position
                                : 0;
    if (axis->mode == CIA402_PROFILE_POSITION) {
        near = !axis->moving &&
               fabs(axis->goal - (double)axis->position) <= (double)p->position_window;
    } else if (axis->mode == CIA402_PROFILE_VELOCITY) {
        near = llabs(axis->velocity - axis->target_velocity) <= p->velocity_window;
    }
    axis->standstill_ms = still ? axis->standstill_ms + 1 : 0;
    axis->reached_ms = near ? axis->reached_ms + 1 : 0;
    axis->following_ms =
        llabs(axis->following_error) > p->following_window ? axis->following_ms + 1 : 0;
}

/* Returns whether the target is reached, bit 10 of the statusword. */
static bool cia402_axis_has_reached(const struct cia402_axis *axis)
{
    const struct cia402_axis_settings *p = &axis->settings;
    bool still = axis->standstill_ms > p->velocity_threshold_ms;

    if (axis->controlword & CIA402_CW_HALT || axis->stopping) {
        return still;
    }
    switch (axis->mode) {
    case CIA402_PROFILE_POSITION:
        return axis->reached_ms > p->position_window_ms;
    case CIA402_PROFILE_VELOCITY:
        return axis->reached_ms > p->velocity_window_ms;
    case CIA402_TORQUE:
        return llabs(axis->torque - axis->target_torque) <= TORQUE_NEAR;
    case CIA402_HOMING:
        return axis->homing == CIA402_HOMING_RESTS && still;
    default:
        return false;
    }
}

/* Returns bit 12 of the statusword, which depends on the mode. */
static bool cia402_axis_bit_12(const struct cia402_axis *axis)
{
    switch (axis->mode) {
    case CIA402_PROFILE_POSITION:
        return axis->set_point_taken || axis->has_next;
    case CIA402_PROFILE_VELOCITY:
        return axis->standstill_ms > axis->settings.velocity_threshold_ms;
    case CIA402_HOMING:
        return axis->homed;
    case CIA402_CYCLIC_POSITION:
    case CIA402_CYCLIC_VELOCITY:
    case CIA402_CYCLIC_TORQUE:
    case CIA402_VOLTAGE_MODE:
        return !axis->stopping && !axis->limited && !(axis->present & CIA402_FAULT_STALE);
    default:
        return false;
    }
}

unsigned cia402_axis_mode_status(const struct cia402_axis *axis)
{
    bool follows = axis->following_ms <= axis->settings.following_timeout_ms;
    unsigned word = 0;

    if (!cia402_axis_is_on(axis)) {
        return axis->mode == CIA402_HOMING && axis->homed ? CIA402_SW_MODE_12 : 0;
    }
    word |= axis->limited ? CIA402_SW_INTERNAL_LIMIT : 0;
    word |= cia402_axis_has_reached(axis) ? CIA402_SW_TARGET_REACHED : 0;
    word |= cia402_axis_bit_12(axis) ? CIA402_SW_MODE_12 : 0;
    word |= cia402_axis_controls_position(axis) &&
                    (axis->mode == CIA402_HOMING ? axis->homing_failed : !follows)
                ? CIA402_SW_MODE_13
                : 0;
    return word;
}

/* ---- objects ---- */

enum cia402_abort cia402_axis_write_mode(struct cia402_node *node, const struct cia402_entry *entry,
                                         int64_t value)
{
    struct cia402_axis *axis = &node->axis[entry->unit];

    /* Each mode above 0 needs its bit in 0x6502; a valve has no bits for torque modes */
    if (value != CIA402_VOLTAGE_MODE && value != CIA402_NO_MODE &&
        (value < 0 || value > CIA402_CYCLIC_TORQUE ||
         !(axis->supported_modes >> (value - 1) & 1))) {
        return CIA402_ABORT_VALUE;
    }
    axis->settings.mode = value;
    return CIA402_DONE;
}

enum cia402_abort cia402_axis_write_target(struct cia402_node *node,
                                           const struct cia402_entry *entry, int64_t value)
{
    struct cia402_axis *axis = &node->axis[entry->unit];

    *cia402_field(node, entry) = value;
    axis->command_ns = node->board.boards->now_ns;
    axis->has_target = axis->has_target || entry->object->index == CIA402_O_TARGET_POSITION;
    axis->interpolation_left_ms = axis->settings.interpolation_ms;
    return CIA402_DONE;
}

enum cia402_abort cia402_axis_write_option(struct cia402_node *node,
                                           const struct cia402_entry *entry, int64_t value)
{
    /* Option 4, stop at the voltage limit, is not supported */
    if (value == 4) {
        return CIA402_ABORT_VALUE;
    }
    *cia402_field(node, entry) = value;
    return CIA402_DONE;
}

enum cia402_abort cia402_axis_write_when_off(struct cia402_node *node,
                                             const struct cia402_entry *entry, int64_t value)
{
    if (cia402_axis_is_on(&node->axis[entry->unit])) {
        return CIA402_ABORT_STATE;
    }
    *cia402_field(node, entry) = value;
    node->board.boards->settings_changes++;
    return CIA402_DONE;
}
