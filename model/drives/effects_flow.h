/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive with effects (model/drives/effects.h) through a given time in which its joint moves at a
 * constant rate and its bridge does the same: in a fixed number of parts. What of a part is linear
 * follows the exact flow (model/drives/drive_flow.h) of a linear drive near to it; the rest, a
 * torque and a voltage, is taken as their means over the part by a predictor and a corrector: order
 * 2, and exact for what is linear. Events:
 *
 *   a rotor that comes to rest in a part does so where its speed, linear in time, is zero; it then
 *   rests, or turns back under what of the load exceeds the breakaway torque; one that rests breaks
 *   away at the begin of a part. While it rests its angle does not change by a bit. A current that
 *   comes to zero likewise. Play and stops are met between two parts or by the means: error of
 *   order 2 in the part's length.
 *
 * The work is fixed but for what happens at events. SI units. RT-safe.
 */
#ifndef MODEL_DRIVES_EFFECTS_FLOW_H
#define MODEL_DRIVES_EFFECTS_FLOW_H

#include "model/drives/drive_flow.h"
#include "model/drives/effects.h"

/* Parts of a span. */
enum { EFFECTS_PARTS = 6 };

/* The linear drives near to one with effects, which are without them and without stops: where its
 * spring is bent, as stiff as spring and hysteresis are together, and where its play leaves it
 * loose, as stiff as hysteresis is. */
enum effects_law { EFFECTS_BENT, EFFECTS_LOOSE, EFFECTS_LAWS };
struct effects_linear {
    struct robot_sea of[EFFECTS_LAWS];
};
void effects_linear_make(const struct robot_sea *sea, struct effects_linear *linear);

/* Flows of the linear drives over one part, bridge off and on. */
struct effects_flow {
    struct drive_flow of[EFFECTS_LAWS][2];
};

/* Computes the flows of a span of t seconds; those of implicit Euler where the rotor's swing is
 * not resolved. */
void effects_flow_make(const struct effects_linear *linear, double t, struct effects_flow *flow);

/* What is held over a span. */
struct effects_span {
    const struct robot_sea *sea;
    const struct effects_linear *linear;
    const struct effects_flow *flow;
    struct effects_bridge bridge;
    double qd;       /* rate of the joint, rad/s */
    bool all_powers; /* account for all, not just for those of the current */
};

/* Advances a drive whose joint is at q through a span; adds the integrals of its powers, J, to
 * work, NULL = no account, and then no temperatures change either. */
void effects_advance(const struct effects_span *span, double q, struct effects_state *state,
                     struct effects_power *work);

#endif
