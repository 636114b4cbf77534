/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The exact solution of a series elastic drive, eqs (2) to (4) of model/drives/actuator.h, over a
 * given time: between two ticks the voltage is held, and where the joint moves at a constant rate
 * r, the three equations are linear with constant coefficients. With the deflection d = qm - q
 *
 *     d'   = qm' - r
 *     J qm'' = Kt I - Dm qm' - Ks d - Ds (qm' - r)
 *     L I' = V - R I - Kw qm'
 *
 * so that motor angle, motor speed and current at the end are linear in (d, qm', I) at the begin
 * and in r and V: the matrix exponential of the 5x5 system with r and V as constant states (Van
 * Loan, Computing integrals involving the matrix exponential, 1978). SI units, link side. Pure
 * functions. RT-safe.
 */
#ifndef MODEL_DRIVES_DRIVE_FLOW_H
#define MODEL_DRIVES_DRIVE_FLOW_H

#include "model/drives/actuator.h"

/* What the end of a flow depends on. */
enum drive_flow_input {
    FLOW_DEFLECTION, /* qm - q at the begin, rad */
    FLOW_SPEED,      /* qm' at the begin, rad/s */
    FLOW_CURRENT,    /* I at the begin, A */
    FLOW_RATE,       /* rate of the joint, held, rad/s */
    FLOW_VOLTAGE,    /* voltage at the terminals, held, V */
    FLOW_INPUTS
};

/* Change of motor angle, motor speed and current over the time t (s), per unit of each input. The
 * change and not the end: what does not move stays where it is to the last bit. */
struct drive_flow {
    double t;
    double qm[FLOW_INPUTS], qmd[FLOW_INPUTS], I[FLOW_INPUTS];
};

/* Computes the flow of a drive over t seconds, t > 0, its error at rounding for any stiffness.
 * bridge_on false: the current stays what it is. About 1,500 products. */
void drive_flow_make(const struct robot_sea *sea, bool bridge_on, double t,
                     struct drive_flow *flow);

/* Computes the same by a step of t seconds of the implicit Euler scheme, and scale times its
 * change: for drives whose rotor swings on its spring too fast for the step. */
void drive_flow_make_implicit(const struct robot_sea *sea, bool bridge_on, double t, double scale,
                              struct drive_flow *flow);

/* Returns the state after the flow's time, from the state and the joint's position q now, the
 * joint's rate qd and the voltage V held. */
static inline struct sea_state drive_flow_advance(const struct drive_flow *flow,
                                                  const struct sea_state *state, double q,
                                                  double qd, double V)
{
    const double input[FLOW_INPUTS] = {state->qm - q, state->qmd, state->I, qd, V};
    struct sea_state end = *state;

    for (int k = 0; k < FLOW_INPUTS; k++) {
        end.qm += flow->qm[k] * input[k];
        end.qmd += flow->qmd[k] * input[k];
        end.I += flow->I[k] * input[k];
    }
    return end;
}

#endif
