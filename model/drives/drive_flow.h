/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The exact solution of a series elastic drive, eqs (2) to (4) of model/drives/actuator.h, over a
 * given time. Between two ticks the voltage is constant. If the joint moves at a constant rate r,
 * the three equations are linear with constant coefficients. With the deflection d = qm - q:
 *
 *     d'   = qm' - r
 *     J qm'' = Kt I - Dm qm' - Ks d - Ds (qm' - r)
 *     L I' = V - R I - Kw qm'
 *
 * So motor angle, motor speed and current at the end are linear in (d, qm', I) at the start and in
 * r and V. The coefficients come from the matrix exponential of the 5x5 system with r and V as
 * constant states (Van Loan, Computing integrals involving the matrix exponential, 1978). A drive
 * under its own current controller (model/drives/current_loop.h) is a linear system too, with
 * another third equation and two more states. SI units, link side. Pure functions. RT-safe.
 */
#ifndef MODEL_DRIVES_DRIVE_FLOW_H
#define MODEL_DRIVES_DRIVE_FLOW_H

#include "model/drives/actuator.h"

/* Inputs of a flow. */
enum drive_flow_input {
    FLOW_DEFLECTION, /* qm - q at the start, rad */
    FLOW_SPEED,      /* qm' at the start, rad/s */
    FLOW_CURRENT,    /* I at the start, A */
    FLOW_RATE,       /* rate of the joint, constant, rad/s */
    FLOW_VOLTAGE,    /* voltage at the terminals, constant, V */
    FLOW_INPUTS
};

/* Changes of motor angle, motor speed and current over the time t (s), per unit of each input.
 * Changes instead of end values keep a constant state bit-identical. */
struct drive_flow {
    double t;
    double qm[FLOW_INPUTS], qmd[FLOW_INPUTS], I[FLOW_INPUTS];
};

/* Largest angle of a rotor's oscillation on its spring that an exact flow resolves, rad. */
#define SWING_RESOLVED 0.5

/* Returns whether a rotor on a spring of stiffness Ks oscillates too fast for t seconds. */
static inline bool drive_swings_fast(double Ks, double J, double t)
{
    return !(Ks * t * t <= SWING_RESOLVED * SWING_RESOLVED * J);
}

/* Computes the flow of a drive over t > 0 seconds, exact to rounding for any stiffness. bridge_on
 * false: the current stays constant. Takes about 1,500 multiplications. */
void drive_flow_make(const struct robot_sea *sea, bool bridge_on, double t,
                     struct drive_flow *flow);

/* Computes the flow as `scale` times the change in an implicit Euler step of t seconds. Use it for
 * drives whose rotor oscillates on its spring too fast for the step. */
void drive_flow_make_implicit(const struct robot_sea *sea, bool bridge_on, double t, double scale,
                              struct drive_flow *flow);

/* ---- drives under a current controller ---- */

/* States and constant inputs of the flow of a drive under a current controller. LOOP_ERROR:
 * position target minus qm, rad; LOOP_FILTER: filtered command minus command, A; LOOP_CONSTANT:
 * current, A, or voltage, V. */
enum loop_input {
    LOOP_DEFLECTION,
    LOOP_SPEED,
    LOOP_CURRENT,
    LOOP_ERROR,
    LOOP_FILTER,
    LOOP_STATES,
    LOOP_RATE = LOOP_STATES,
    LOOP_CONSTANT,
    LOOP_INPUTS
};

/* The winding's equation, I' = constant C + error e + filter f - speed qm' - current I. f decays
 * with filter_s; 0 = there is none. */
struct loop_row {
    double speed, current, error, filter, constant, filter_s;
};

/* As struct drive_flow. */
struct loop_flow {
    double t;
    double qm[LOOP_INPUTS], qmd[LOOP_INPUTS], I[LOOP_INPUTS];
};

/* Computes the exact flow of a drive with this winding's equation over t > 0 seconds. Takes about
 * 4,000 multiplications. */
void loop_flow_make(const struct robot_sea *sea, const struct loop_row *row, double t,
                    struct loop_flow *flow);

/* Adds the changes by a flow to a state. */
static inline void loop_flow_add(const struct loop_flow *flow, const double input[LOOP_INPUTS],
                                 struct sea_state *state)
{
    for (int k = 0; k < LOOP_INPUTS; k++) {
        state->qm += flow->qm[k] * input[k];
        state->qmd += flow->qmd[k] * input[k];
        state->I += flow->I[k] * input[k];
    }
}

/* Returns the state after the flow's time, from the present state, the joint's position q, its
 * rate qd and the constant voltage V. */
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
