/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive under its own current controller: a controlled current source. A PI current loop whose
 * zero cancels the winding, with decoupled back-EMF, gives I' = w (I* - I) with the bandwidth w. So
 * the loop needs no equation of its own. The target is
 *
 *     I* = f + stiffness (position - qm) + damping (speed - qm'),   |I*| <= limit
 *     f' = (current - f) / filter
 *
 * Only the command `current` passes the filter. The loop needs the terminal voltage
 * V = R I + L w (I* - I) + Kw qm'. If |V| exceeds the supply, the winding gets +-supply instead;
 * there is no integral that could wind up. The law holds between the ticks. SI units, link side;
 * gains in A/rad and A s/rad. Pure functions. RT-safe.
 */
#ifndef MODEL_DRIVES_CURRENT_LOOP_H
#define MODEL_DRIVES_CURRENT_LOOP_H

#include "model/drives/drive_flow.h"

/* A command, without errors of the drive's readings. */
struct loop_command {
    double current, position, speed, stiffness, damping, limit;
};

/* The controller in a substep. The command changes at switch_s from the start of the substep. */
struct current_loop {
    bool on;
    double bandwidth; /* w, rad/s */
    double filter_s;  /* 0 = none */
    double filtered;  /* f at the start of the substep, A */
    double supply;    /* V */
    double switch_s;
    struct loop_command command[2];
    struct loop_command given; /* the command that enters the delay */
};

/* What determines the current. */
enum loop_kind {
    LOOP_FREE,      /* the law */
    LOOP_LIMITED,   /* the current limit */
    LOOP_SATURATED, /* the supply */
    LOOP_KINDS
};
struct loop_regime {
    enum loop_kind kind;
    double side; /* sign of the limit that holds */
    double flow; /* LOOP_SATURATED in a bridge with loss: sign of the current; 0 = none flows */
    bool turned; /* the current has changed its sign once */
};

/* Returns the command in force t seconds after the start of the substep. */
static inline const struct loop_command *loop_command_at(const struct current_loop *loop, double t)
{
    return &loop->command[t >= loop->switch_s];
}

/* Returns f, A, at t seconds after the start of the substep. */
double loop_filtered(const struct current_loop *loop, double t);

/* Returns I* at t, within the limit. *whole (may be NULL) receives the value without the limit.
 * */
double loop_target(const struct current_loop *loop, double t, double qm, double qmd, double *whole);

/* Fills the winding's equation in a regime under the command `law`. */
void loop_fill_row(const struct robot_sea *sea, const struct current_loop *loop,
                   const struct loop_command *law, enum loop_kind kind, struct loop_row *row);

/* A drive without effects in a span, whose joint moves from q at `rate`. */
struct loop_span {
    const struct robot_sea *sea; /* spring with its stop, if the law of the stop holds */
    double shift;                /* of the deflection, by the law of the stop, rad */
    const struct current_loop *loop;
    /* flows of the span by regime under command[1]; NULL = not known */
    const struct loop_flow *flow[LOOP_KINDS];
    double begin, length; /* s, from the start of the substep */
    double q, rate;
};

/* Returns the regime at the start of a span, which holds at least for a moment. */
struct loop_regime loop_find_regime(const struct loop_span *span, double t,
                                    const struct sea_state *state);

/* Advances a drive through a span exactly; the regime may change on the way. *slope receives the
 * derivatives of the end with respect to the joint's rate. */
void loop_advance(const struct loop_span *span, struct sea_state *state, struct sea_state *slope);

/* Advances a drive by an implicit Euler step through the span, stretched to `length` seconds. */
void loop_step_implicit(const struct loop_span *span, double length, struct sea_state *state,
                        struct sea_state *slope);

/* ---- implicit steps ---- */

/* A step of h seconds from t on. The current follows its exponential for `length` seconds, toward
 * the target at the rotor's final position and speed. */
struct loop_step {
    const struct current_loop *loop;
    double R, L, Kw; /* of the warm drive */
    double hold;     /* voltage drop of the bridge, against the current, V */
    double t, h, length;
    double I, qm; /* at the start */
};

/* The current at the end, I - yield v, if the rotor ends with the speed v. */
struct loop_line {
    double I, yield;
};
struct loop_line loop_linearize(const struct loop_step *step, const struct loop_regime *regime);

/* Replaces the regime if it does not hold at the end of the step. v is the rotor's speed at the
 * end, solved in this regime. Begin with LOOP_FREE and repeat until it returns false: the regime
 * holds. The fifth call returns false at the latest. */
bool loop_revise_regime(const struct loop_step *step, double v, struct loop_regime *regime);

#endif
