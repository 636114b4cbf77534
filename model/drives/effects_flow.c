/* SPDX-License-Identifier: Apache-2.0 */
/* Advances drives with effects through a span, part by part. */
#include "model/drives/effects_flow.h"

#include "base/portable_math.h"

#include <math.h>

/* Stiffness of a linear drive without a spring, N m/rad: negligible, but not zero. */
#define LEAST_STIFFNESS 1e-6

void effects_linear_make(const struct robot_sea *sea, struct effects_linear *linear)
{
    const double hysteresis = sea->Ks > 0.0 ? sea->effects->hysteresis_stiffness : 0.0;
    struct robot_sea bent = *sea;

    bent.effects = NULL;
    bent.R += sea->effects->bridge_ohm;
    bent.stop = (struct robot_stop){0};
    bent.Ks = fmax(LEAST_STIFFNESS, sea->Ks + hysteresis);
    linear->of[EFFECTS_BENT] = bent;
    bent.Ks = fmax(LEAST_STIFFNESS, hysteresis);
    bent.Ds = 0.0;
    linear->of[EFFECTS_LOOSE] = bent;
}

void effects_flow_make(const struct effects_linear *linear, double t, struct effects_flow *flow)
{
    t /= EFFECTS_PARTS;
    for (int law = 0; law < EFFECTS_LAWS; law++) {
        const struct robot_sea *sea = &linear->of[law];

        for (int on = 0; on < 2; on++) {
            drive_flow_make(sea, on, t, &flow->of[law][on]);
        }
    }
}

/* Loads on a drive in addition to the loads of the linear drive: torque, N m, and voltage, V. */
struct extra_load {
    double torque, voltage;
};

/* Computes the additional loads from the difference between the derivatives of the drive and of the
 * linear drive. */
static struct extra_load find_extra_load(const struct effects_span *span, double q,
                                         enum effects_law law, const struct effects_mode *mode,
                                         const struct effects_state *state)
{
    const struct robot_sea *linear = &span->linear->of[law];
    struct effects_state rate;
    struct sea_state plain;

    effects_derivative(span->sea, state, q, span->qd, &span->bridge, mode, &rate);
    sea_derivative(linear, &state->sea, q, span->qd, span->bridge.voltage, mode->flow != 0, &plain);
    return (struct extra_load){.torque = linear->J * (rate.sea.qmd - plain.qmd),
                               .voltage = linear->L * (rate.sea.I - plain.I)};
}

/* Advances the linear drive under an additional load. A torque acts as a shift of the spring's
 * deflection. */
static struct sea_state flow_loaded(const struct effects_span *span, double q, enum effects_law law,
                                    const struct effects_mode *mode, const struct sea_state *begin,
                                    const struct extra_load *extra)
{
    return drive_flow_advance(&span->flow->of[law][mode->flow != 0], begin,
                              q + extra->torque / span->linear->of[law].Ks, span->qd,
                              span->bridge.voltage + extra->voltage);
}

/* Advances the hysteresis by the change of the deflection since the start. Adds its loss to
 * work. */
static void follow_hysteresis(const struct effects_span *span, double deflection, double q_end,
                              const struct effects_state *begin, struct effects_state *end,
                              struct effects_power *work)
{
    double loss;

    if (span->sea->effects->hysteresis == 0.0) {
        return;
    }
    end->hysteresis =
        effects_hysteresis(span->sea, begin->hysteresis,
                           effects_deflection(span->sea, end->sea.qm, q_end) - deflection, &loss);
    if (work) {
        work->hysteresis += loss;
    }
}

/* Returns the current of a rotor at rest after t seconds (exact solution of the winding's
 * equation). */
static double flow_winding(const struct effects_span *span, const struct effects_mode *mode,
                           const struct effects_state *state, double I, double t)
{
    double R = effects_resistance(span->sea, state), L = span->sea->L;
    double voltage = span->bridge.voltage - span->bridge.hold * mode->flow;

    if (mode->flow == 0) {
        return I;
    }
    return R > 0.0 ? I - (voltage / R - I) * portable_expm1(-R * t / L) : I + t * voltage / L;
}

/* Corrects the end of a part in which the rotor came to rest: it stops where its speed, linear in
 * time, is zero. Then it stays at rest or turns back. */
static void stop_rotor(const struct effects_span *span, double q, double deflection, double h,
                       const struct effects_state *begin, struct effects_state *end)
{
    const double v0 = begin->sea.qmd, v1 = end->sea.qmd;
    const double part = v0 == 0.0 ? 0.0 : v0 / (v0 - v1), rest = (1.0 - part) * h;
    struct effects_state there = *end, rate;
    struct effects_mode mode;

    /* Compute the state when the rotor stops */
    there.sea.qm = begin->sea.qm + 0.5 * part * h * v0;
    there.sea.qmd = 0.0;
    there.sea.I = begin->sea.I + part * (end->sea.I - begin->sea.I);
    q += part * h * span->qd;
    follow_hysteresis(span, deflection, q, begin, &there, NULL);

    /* If the rotor stays at rest, only the winding continues. Otherwise the rotor accelerates
     * during the remaining time of the part */
    mode = effects_find_mode(span->sea, &there, q, span->qd, &span->bridge);
    if (mode.slide == 0 || v0 == 0.0) {
        there.sea.I = flow_winding(span, &mode, &there, there.sea.I, rest);
    } else {
        effects_derivative(span->sea, &there, q, span->qd, &span->bridge, &mode, &rate);
        there.sea.qmd = rest * rate.sea.qmd;
        there.sea.qm += 0.5 * rest * there.sea.qmd;
        there.sea.I = end->sea.I;
    }
    end->sea = there.sea;
}

/* Events in a part. */
struct part_events {
    bool any;
    bool current; /* true: the current came to zero; the following members are valid */
    /* charge before the zero, C; heat in the resistances before the zero, J */
    double charge, heat;
};

/* Returns the charge (C) in t seconds in a winding with initial current I under this voltage. */
static double flow_charge(double I, double voltage, double R, double L, double t)
{
    const double goal = voltage / R;

    return R > 0.0 ? goal * t - (I - goal) * L / R * portable_expm1(-R * t / L)
                   : I * t + 0.5 * voltage / L * t * t;
}

/* Corrects the end of a part in which the current came to zero, at constant speed of the rotor.
 * Sets the current, and removes the torque of the current that did not flow from the rotor's
 * motion. */
static void stop_current(const struct effects_span *span, double q_end, double h,
                         const struct effects_mode *mode, const struct effects_state *begin,
                         struct effects_state *end, struct part_events *events)
{
    const double R = effects_resistance(span->sea, begin), L = span->sea->L;
    const double I = begin->sea.I;
    struct effects_state still = *begin, rate;
    struct effects_mode next;
    double voltage, stop, rest;

    /* Find the voltage that reduces the current, and the time when the current is zero */
    still.sea.I = 0.0;
    effects_derivative(span->sea, &still, q_end, span->qd, &span->bridge, mode, &rate);
    voltage = L * rate.sea.I;
    stop = I == 0.0 ? 0.0 : R > 0.0 ? L / R * portable_log1p(-R * I / voltage) : -L * I / voltage;
    stop = voltage * I < 0.0 ? fmin(h, stop) : I == 0.0 ? 0.0 : h;
    rest = h - stop;
    events->any = events->current = true;
    events->charge = flow_charge(I, voltage, R, L, stop);
    events->heat = voltage * events->charge + 0.5 * L * I * I;

    /* Compute the state after the zero */
    end->sea.I = 0.0;
    next = effects_find_mode(span->sea, end, q_end, span->qd, &span->bridge);
    if (next.flow != 0) {
        effects_derivative(span->sea, end, q_end, span->qd, &span->bridge, &next, &rate);
        end->sea.I = rest * rate.sea.I;
    }
    if (end->sea.qmd != 0.0) {
        const double charge = flow_charge(0.0, voltage, R, L, rest);
        const double kick = span->sea->Kt / span->sea->J * (0.5 * rest * end->sea.I - charge);

        end->sea.qmd += kick;
        end->sea.qm += kick * rest / 3.0;
    }
}

/* ---- accounts ---- */

/* Returns the value at the middle of a part, from the cubic through the values and rates at both
 * ends. */
static double middle_value(double x0, double x1, double rate0, double rate1, double h)
{
    return 0.5 * (x0 + x1) + 0.125 * h * (rate0 - rate1);
}

/* Adds weight times the powers to work, without gear friction and hysteresis, which are accounted
 * elsewhere. */
static void add_power(const struct effects_span *span, double q, const struct effects_mode *mode,
                      const struct effects_state *state, double weight, struct effects_power *work)
{
    struct effects_power power = {0};

    if (span->all_powers) {
        effects_power(span->sea, state, q, span->qd, &span->bridge, mode, &power);
    } else {
        effects_power_current(span->sea, state, &span->bridge, mode, &power);
    }
    work->electrical += weight * power.electrical;
    work->bridge += weight * power.bridge;
    work->joule += weight * power.joule;
    work->motor += weight * power.motor;
    work->spring_damping += weight * power.spring_damping;
}

/* Adds the integrals of the powers over a part by Simpson's rule. The states follow the cubic
 * through both ends, or a line in a part with an event. The work of friction is torque times
 * distance. */
static void account_part(const struct effects_span *span, double q, double h,
                         const struct part_events *events, const struct effects_mode *mode,
                         const struct effects_state *begin, const struct effects_state *end,
                         struct effects_power *work)
{
    const double q_end = q + h * span->qd, q_middle = q + 0.5 * h * span->qd;
    struct effects_state rate0 = {.hysteresis = 0.0}, rate1 = rate0, middle = *begin;
    struct effects_state from = *begin, to = *end;

    /* A current with an event is accounted here; Simpson's rule below then excludes the current */
    if (events->current) {
        from.sea.I = to.sea.I = 0.0;

        /* Add the integrals for the current that came to zero */
        const struct effects_bridge *bridge = &span->bridge;
        const double R = effects_resistance(span->sea, begin);
        const double heat =
            R > 0.0 ? events->heat * effects_winding(span->sea, begin) / R : events->heat;
        const double switching = bridge->switching * fabs(events->charge);

        work->electrical +=
            (bridge->voltage - (bridge->hold - bridge->diodes) * mode->flow) * events->charge +
            switching;
        work->bridge +=
            bridge->diodes * mode->flow * events->charge + switching + (events->heat - heat);
        work->joule += heat;
    }
    /* Compute the rates at both ends for the cubic */
    if (!events->any && span->all_powers) {
        effects_derivative(span->sea, &from, q, span->qd, &span->bridge, mode, &rate0);
        effects_derivative(span->sea, &to, q_end, span->qd, &span->bridge, mode, &rate1);
    } else if (!events->any) {
        rate0.sea.I = effects_current_rate(span->sea, &from, &span->bridge, mode);
        rate1.sea.I = effects_current_rate(span->sea, &to, &span->bridge, mode);
    }
    /* Simpson's rule with weights 1, 4, 1 */
    middle.sea.qm = middle_value(from.sea.qm, to.sea.qm, rate0.sea.qm, rate1.sea.qm, h);
    middle.sea.qmd = middle_value(from.sea.qmd, to.sea.qmd, rate0.sea.qmd, rate1.sea.qmd, h);
    middle.sea.I = middle_value(from.sea.I, to.sea.I, rate0.sea.I, rate1.sea.I, h);
    add_power(span, q, mode, &from, h / 6.0, work);
    add_power(span, q_middle, mode, &middle, 4.0 * h / 6.0, work);
    add_power(span, q_end, mode, &to, h / 6.0, work);
    if (span->all_powers) {
        const struct effects_carried first = effects_carried(span->sea, begin, q, span->qd);
        const struct effects_carried last = effects_carried(span->sea, end, q_end, span->qd);

        work->gear += 0.5 * fabs(end->sea.qm - begin->sea.qm) *
                      (effects_friction(span->sea, begin->sea.qmd, &first) +
                       effects_friction(span->sea, end->sea.qmd, &last));
    }
}

void effects_advance(const struct effects_span *span, double q, struct effects_state *state,
                     struct effects_power *work)
{
    const double h = span->flow->of[EFFECTS_BENT][0].t;
    const double heat = work ? work->joule : 0.0;
    double deflection = effects_deflection(span->sea, state->sea.qm, q);

    for (int part = 0; part < EFFECTS_PARTS; part++) {
        struct effects_mode mode = effects_find_mode(span->sea, state, q, span->qd, &span->bridge);
        const double q_end = q + h * span->qd;
        struct effects_state end = *state;
        struct part_events events = {.any = false};

        /* Advance the rotor, then the current, each with its event */
        if (mode.slide == 0) {
            end.sea.I = flow_winding(span, &mode, state, state->sea.I, h);
        } else {
            /* Advance a moving rotor to the end of the part, ignoring events. The additional loads
             * are means of their values at both ends (predictor and corrector). */
            const double play = 0.5 * span->sea->effects->backlash;
            const enum effects_law law = fabs(deflection) < play ? EFFECTS_LOOSE : EFFECTS_BENT;
            struct extra_load first = find_extra_load(span, q, law, &mode, state), last;

            end.sea = flow_loaded(span, q, law, &mode, &state->sea, &first);
            follow_hysteresis(span, deflection, q + h * span->qd, state, &end, NULL);
            last = find_extra_load(span, q + h * span->qd, law, &mode, &end);
            first.torque = 0.5 * (first.torque + last.torque);
            first.voltage = 0.5 * (first.voltage + last.voltage);
            end.sea = flow_loaded(span, q, law, &mode, &state->sea, &first);

            if (effects_sticks(span->sea) && end.sea.qmd * mode.slide < 0.0) {
                stop_rotor(span, q, deflection, h, state, &end);
                events.any = true;
            }
        }
        if (span->bridge.hold > 0.0 && end.sea.I * mode.flow < 0.0) {
            stop_current(span, q_end, h, &mode, state, &end, &events);
        }
        follow_hysteresis(span, deflection, q_end, state, &end, work);
        if (work) {
            account_part(span, q, h, &events, &mode, state, &end, work);
        }
        deflection = effects_deflection(span->sea, end.sea.qm, q_end);
        *state = end;

        q += h * span->qd;
    }
    if (work) {
        effects_warm(span->sea, work->joule - heat, h * EFFECTS_PARTS, state);
    }
}
