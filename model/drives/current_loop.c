/* SPDX-License-Identifier: Apache-2.0 */
/* Advances drives under their own current controllers. */
#include "model/drives/current_loop.h"

#include "base/portable_math.h"

#include <math.h>

/* Largest number of parts of a span, each with one regime, and of trials for the end of a part.
 * Largest excess over a limit within a regime, and at its end, as shares of the limit. */
enum { PARTS_MAX = 8, TRIALS = 24 };
#define LIMIT_TOLERANCE 1e-9
#define END_TOLERANCE 1e-7

/* Returns f t seconds after a start at f, and adds its integral. */
static double follow_filter(double filter_s, double command, double f, double t, double *integral)
{
    const double part = filter_s > 0.0 ? -portable_expm1(-t / filter_s) : 1.0;

    *integral += command * t + (f - command) * filter_s * part;
    return f + (command - f) * part;
}

/* Returns f at t and its integral from 0 to t. */
static double find_filtered(const struct current_loop *loop, double t, double *integral)
{
    const struct loop_command *command = loop->command;
    double f = loop->filtered;

    *integral = 0.0;
    f = follow_filter(loop->filter_s, command[0].current, f, fmin(t, loop->switch_s), integral);
    return t < loop->switch_s
               ? f
               : follow_filter(loop->filter_s, command[1].current, f, t - loop->switch_s, integral);
}

double loop_filtered(const struct current_loop *loop, double t)
{
    double integral;

    return find_filtered(loop, t, &integral);
}

double loop_target(const struct current_loop *loop, double t, double qm, double qmd, double *whole)
{
    const struct loop_command *law = loop_command_at(loop, t);
    const double target = loop_filtered(loop, t) + law->stiffness * (law->position - qm) +
                          law->damping * (law->speed - qmd);

    if (whole) {
        *whole = target;
    }
    return target > law->limit ? law->limit : target < -law->limit ? -law->limit : target;
}

void loop_fill_row(const struct robot_sea *sea, const struct current_loop *loop,
                   const struct loop_command *law, enum loop_kind kind, struct loop_row *row)
{
    const double w = loop->bandwidth;

    *row = (struct loop_row){.current = w, .constant = w};
    if (kind == LOOP_FREE) {
        row->speed = w * law->damping;
        row->error = w * law->stiffness;
        row->filter = w;
        row->filter_s = loop->filter_s;
    } else if (kind == LOOP_SATURATED) {
        *row = (struct loop_row){
            .speed = sea->Kw / sea->L, .current = sea->R / sea->L, .constant = 1.0 / sea->L};
    }
}

/* ---- exact flows ---- */

/* Returns the voltage that the loop needs in a state, V. */
static double loop_voltage(const struct loop_span *span, double target,
                           const struct sea_state *state)
{
    return span->sea->R * state->I + span->sea->Kw * state->qmd +
           span->sea->L * span->loop->bandwidth * (target - state->I);
}

/* Returns how far a state is from the end of a regime, as a share of its limit; negative beyond. */
static double regime_margin(const struct loop_span *span, const struct loop_regime *regime,
                            double t, const struct sea_state *state)
{
    const double limit = loop_command_at(span->loop, t)->limit, supply = span->loop->supply;
    double whole, target = loop_target(span->loop, t, state->qm, state->qmd, &whole);
    double margin = (double)INFINITY;

    if (regime->kind == LOOP_FREE) {
        margin =
            isinf(limit) ? (double)INFINITY : (limit - fabs(whole)) / (limit + LIMIT_TOLERANCE);
    } else if (regime->kind == LOOP_LIMITED) {
        margin = (regime->side * whole - limit) / (limit + LIMIT_TOLERANCE);
        target = regime->side * limit;
    }
    const double V = loop_voltage(span, target, state);

    return regime->kind == LOOP_SATURATED ? (regime->side * V - supply) / supply
                                          : fmin(margin, (supply - fabs(V)) / supply);
}

struct loop_regime loop_find_regime(const struct loop_span *span, double t,
                                    const struct sea_state *state)
{
    double whole, target = loop_target(span->loop, t, state->qm, state->qmd, &whole);
    const double V = loop_voltage(span, target, state);

    if (fabs(V) > span->loop->supply * (1.0 + LIMIT_TOLERANCE)) {
        return (struct loop_regime){.kind = LOOP_SATURATED, .side = V > 0.0 ? 1.0 : -1.0};
    }
    return target == whole
               ? (struct loop_regime){.kind = LOOP_FREE}
               : (struct loop_regime){.kind = LOOP_LIMITED, .side = target < whole ? 1.0 : -1.0};
}

/* Advances a state and its slope by a flow that starts at t, `passed` seconds after the start of
 * the span. */
static void follow_flow(const struct loop_span *span, const struct loop_regime *regime,
                        const struct loop_flow *flow, double t, double passed,
                        struct sea_state *state, struct sea_state *slope)
{
    const struct current_loop *loop = span->loop;
    const struct loop_command *law = loop_command_at(loop, t);
    const bool is_free = regime->kind == LOOP_FREE;
    const double tangent[LOOP_INPUTS] = {
        slope->qm - passed, slope->qmd, slope->I, is_free ? -slope->qm : 0.0, 0.0, 1.0, 0.0};
    const double input[LOOP_INPUTS] = {
        [LOOP_DEFLECTION] = state->qm - (span->q + passed * span->rate + span->shift),
        [LOOP_SPEED] = state->qmd,
        [LOOP_CURRENT] = state->I,
        [LOOP_ERROR] = is_free ? law->position - state->qm : 0.0,
        [LOOP_FILTER] = is_free ? loop_filtered(loop, t) - law->current : 0.0,
        [LOOP_RATE] = span->rate,
        [LOOP_CONSTANT] =
            is_free ? law->current + law->damping * law->speed
                    : regime->side * (regime->kind == LOOP_SATURATED ? loop->supply : law->limit)};

    loop_flow_add(flow, input, state);
    loop_flow_add(flow, tangent, slope);
}

/* Finds the time, at most `length`, at which a regime that started at t ends: just beyond its
 * limit. Fills the flow for that time. */
static double find_regime_end(const struct loop_span *span, const struct loop_regime *regime,
                              const struct loop_row *row, double t, double passed, double length,
                              const struct sea_state *state, double last, struct loop_flow *flow)
{
    double low = 0.0, high = length, first = fmax(regime_margin(span, regime, t, state), 0.0);

    /* The Illinois method, and bisection where it is slow */
    for (int i = 0; i < TRIALS && last < -END_TOLERANCE; i++) {
        const double share = fmin(fmax(first / (first - last), 0.01), 0.99);
        const double at = low + (high - low) * (i % 4 == 3 ? 0.5 : share);
        struct sea_state end = *state, slope = {0};
        struct loop_flow trial;
        double margin;

        loop_flow_make(span->sea, row, at, &trial);
        follow_flow(span, regime, &trial, t, passed, &end, &slope);
        margin = regime_margin(span, regime, t + at, &end);
        if (margin < -LIMIT_TOLERANCE) {
            high = at;
            last = margin;
            first *= 0.5;
        } else {
            low = at;
            first = fmax(margin, 0.0);
            last *= 0.5;
        }
    }
    loop_flow_make(span->sea, row, high, flow);
    return high;
}

void loop_advance(const struct loop_span *span, struct sea_state *state, struct sea_state *slope)
{
    const double end = span->begin + span->length;
    double t = span->begin;

    *slope = (struct sea_state){0.0, 0.0, 0.0};
    for (int part = 0; t < end; part++) {
        const double change = span->loop->switch_s;
        const double stop = t < change && change < end ? change : end;
        const struct loop_regime regime = loop_find_regime(span, t, state);
        const bool whole = t == span->begin && stop == end && span->flow[regime.kind];
        double length = stop - t, margin;
        struct sea_state last = *state, tangent = *slope;
        struct loop_flow flow;
        struct loop_row row;

        loop_fill_row(span->sea, span->loop, loop_command_at(span->loop, t), regime.kind, &row);
        if (!whole) {
            loop_flow_make(span->sea, &row, length, &flow);
        }
        follow_flow(span, &regime, whole ? span->flow[regime.kind] : &flow, t, t - span->begin,
                    &last, &tangent);
        /* The command after a change is not yet in force at the end of a part */
        margin = regime_margin(span, &regime, stop == change ? nextafter(stop, t) : stop, &last);
        if (part < PARTS_MAX && margin < -LIMIT_TOLERANCE) {
            length = find_regime_end(span, &regime, &row, t, t - span->begin, length, state, margin,
                                     &flow);
            follow_flow(span, &regime, &flow, t, t - span->begin, state, slope);
            t = length < stop - t ? t + length : stop;
            continue;
        }
        *state = last;
        *slope = tangent;
        t = stop;
    }
}

/* ---- implicit steps ---- */

/* Returns the command in force at the end of a step. */
static const struct loop_command *end_command(const struct loop_step *step)
{
    return loop_command_at(step->loop, step->t + step->length);
}

/* Returns I* at the end of a step, without the limit. v: the rotor's speed at the end. */
static double end_target(const struct loop_step *step, double v)
{
    const struct loop_command *law = end_command(step);
    double before, after;

    find_filtered(step->loop, step->t, &before);
    find_filtered(step->loop, step->t + step->length, &after);
    return (after - before) / step->length +
           law->stiffness * (law->position - step->qm - step->h * v) +
           law->damping * (law->speed - v);
}

struct loop_line loop_linearize(const struct loop_step *step, const struct loop_regime *regime)
{
    const struct current_loop *loop = step->loop;
    const struct loop_command *law = end_command(step);
    const double part = -portable_expm1(-loop->bandwidth * step->length);
    const double winding = step->L + step->length * step->R;

    switch (regime->kind) {
    case LOOP_FREE:
        return (struct loop_line){
            .I = step->I + part * (end_target(step, 0.0) - step->I),
            .yield = part * (law->stiffness * step->h + law->damping),
        };
    case LOOP_LIMITED:
        return (struct loop_line){.I = step->I + part * (regime->side * law->limit - step->I)};
    default:
        if (step->hold > 0.0 && regime->flow == 0.0) {
            return (struct loop_line){0};
        }
        return (struct loop_line){
            .I = (step->L * step->I +
                  step->length * (regime->side * loop->supply - regime->flow * step->hold)) /
                 winding,
            .yield = step->length * step->Kw / winding,
        };
    }
}

bool loop_revise_regime(const struct loop_step *step, double v, struct loop_regime *regime)
{
    const struct current_loop *loop = step->loop;
    const double target = end_target(step, v);
    const struct loop_line line = loop_linearize(step, regime);
    const double I = line.I - line.yield * v;
    const double V = step->R * I + step->L * (I - step->I) / step->length + step->Kw * v;

    const double side = V > 0.0 ? 1.0 : -1.0, flow = step->I != 0.0 ? copysign(1.0, step->I) : side;

    if (regime->kind == LOOP_SATURATED) {
        const bool turns = step->hold > 0.0 && I * regime->flow < 0.0;

        /* A current that crosses zero changes its sign. If it crosses zero again, it stays zero */
        if (turns) {
            regime->flow = regime->turned ? 0.0 : -regime->flow;
            regime->turned = true;
        }
        return turns;
    }
    if (regime->kind == LOOP_FREE && fabs(target) > end_command(step)->limit) {
        *regime = (struct loop_regime){.kind = LOOP_LIMITED, .side = target > 0.0 ? 1.0 : -1.0};
        return true;
    }
    if (fabs(V) + flow * side * step->hold > loop->supply * (1.0 + LIMIT_TOLERANCE)) {
        *regime = (struct loop_regime){.kind = LOOP_SATURATED, .side = side, .flow = flow};
        return true;
    }
    return false;
}

void loop_step_implicit(const struct loop_span *span, double length, struct sea_state *state,
                        struct sea_state *slope)
{
    const struct robot_sea *sea = span->sea;
    const double h = span->length, stretch = length / h, bend = h * sea->Ks + sea->Ds;
    const double deflection = state->qm - (span->q + h * span->rate + span->shift);
    const struct loop_step step = {.loop = span->loop,
                                   .R = sea->R,
                                   .L = sea->L,
                                   .Kw = sea->Kw,
                                   .t = span->begin,
                                   .h = h,
                                   .length = h,
                                   .I = state->I,
                                   .qm = state->qm};
    struct loop_step whole = step;
    struct loop_regime regime = {.kind = LOOP_FREE};
    struct loop_line line;
    double v, G;

    do {
        line = loop_linearize(&step, &regime);
        G = sea->J / h + sea->Dm + sea->Kt * line.yield + bend;
        v = (sea->J / h * state->qmd + sea->Kt * line.I - sea->Ks * deflection +
             sea->Ds * span->rate) /
            G;
    } while (loop_revise_regime(&step, v, &regime));

    whole.length = length;
    line = loop_linearize(&whole, &regime);
    *slope = (struct sea_state){.qm = stretch * h * bend / G, .qmd = stretch * bend / G};
    state->qm += stretch * h * v;
    state->qmd += stretch * (v - state->qmd);
    state->I = line.I - line.yield * v;
}
