/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Advances a drive with effects (model/drives/effects.h) over a span with a constant joint rate and
 * constant bridge state, in a fixed number of parts. A part takes the exact flow of a similar
 * linear drive (model/drives/drive_flow.h). The difference to that drive is an additional torque
 * and voltage. A predictor and a corrector compute their means over the part. The scheme has order
 * 2 and is exact for linear drives. Events:
 *
 *   A rotor that comes to rest in a part stops where its speed, linear in time, is zero. Then it
 *   stays at rest, or turns back if the load exceeds the breakaway torque. A rotor at rest breaks
 *   away only at the start of a part; at rest its angle is bit-identical. A current that comes to
 *   zero is handled in the same way. Play and stops have no events: their error is of order 2 in
 *   the part's length.
 *
 * The number of operations is fixed except at events. SI units. RT-safe.
 */
#ifndef MODEL_DRIVES_EFFECTS_FLOW_H
#define MODEL_DRIVES_EFFECTS_FLOW_H

#include "model/drives/drive_flow.h"
#include "model/drives/effects.h"

/* Number of parts of a span. */
enum { EFFECTS_PARTS = 6 };

/* Linear drives, without effects and stops, that approximate a drive with effects. BENT: the spring
 * is bent; its stiffness is the sum of spring and hysteresis. LOOSE: the drive is within its play;
 * its stiffness is the hysteresis alone. */
enum effects_law { EFFECTS_BENT, EFFECTS_LOOSE, EFFECTS_LAWS };
struct effects_linear {
    struct robot_sea of[EFFECTS_LAWS];
};
void effects_linear_make(const struct robot_sea *sea, struct effects_linear *linear);

/* Flows of the linear drives over one part, bridge off and on. */
struct effects_flow {
    struct drive_flow of[EFFECTS_LAWS][2];
};

/* Computes the flows for a span of t seconds, whose parts resolve the drive's oscillations. */
void effects_flow_make(const struct effects_linear *linear, double t, struct effects_flow *flow);

/* Constants of a span. */
struct effects_span {
    const struct robot_sea *sea;
    const struct effects_linear *linear;
    const struct effects_flow *flow;
    struct effects_bridge bridge;
    double qd;       /* rate of the joint, rad/s */
    bool all_powers; /* account for all powers, not only the powers of the current */
};

/* Advances a drive through a span that starts with its joint at q. Adds the integrals of its
 * powers, J, to work. work NULL: no account, and the temperatures do not change. */
void effects_advance(const struct effects_span *span, double q, struct effects_state *state,
                     struct effects_power *work);

#endif
