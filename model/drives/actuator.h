/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Series elastic DC drives and parallel springs, paper eqs (2)-(5), link side of the gear:
 *   J qm'' + Dm qm' + tau = Kt I                 (2)
 *   tau = Ks (qm - q) + Ds (qm' - q')            (3), with the sign that (2) needs
 *   L I' + R I + Kw qm' = V                      (4)
 * tau acts on the link with positive sign. The paper prints eq. (3) with the opposite sign, which
 * is inconsistent with (2). Kt and Kw are the motor's constants times N. Beyond its largest
 * deflection, a spring has a stop (model/stop.h) in parallel, included in tau and in all energies.
 * RT-safe.
 */
#ifndef MODEL_DRIVES_ACTUATOR_H
#define MODEL_DRIVES_ACTUATOR_H

#include "model/robot.h"

#include <math.h>

struct sea_state {
    double qm;  /* rad */
    double qmd; /* rad/s */
    double I;   /* A */
};

/* Returns tau of eq. (3), N m on the link, plus the torque of the spring's stop when the spring
 * presses it. */
double sea_torque_pressed(const struct robot_sea *sea, const struct sea_state *state, double q,
                          double qd);

/* Returns tau of eq. (3), N m on the link, plus the torque of the spring's stop. */
static inline double sea_torque(const struct robot_sea *sea, const struct sea_state *state,
                                double q, double qd)
{
    const double deflection = state->qm - q;

    return fabs(deflection) <= sea->deflection ? sea->Ks * deflection + sea->Ds * (state->qmd - qd)
                                               : sea_torque_pressed(sea, state, q, qd);
}

/* Linear law of the spring near a deflection qm - q and its rate: tau = Ks (qm - q) + Ds (qm' - q')
 * + offset. The law includes the stop if the spring presses it. */
struct sea_spring {
    double Ks, Ds, offset;
};
struct sea_spring sea_spring_at(const struct robot_sea *sea, double deflection, double rate);

/* Returns the deflection (rad) at which the drive carries tau at rest. The spring or its stop must
 * be able to carry tau. */
double sea_deflection(const struct robot_sea *sea, double tau);

/* Computes the time derivatives by eqs (2) and (4). V: voltage at the terminals. bridge_on false:
 * I' = 0. The caller sets I to zero when the bridge opens. */
void sea_derivative(const struct robot_sea *sea, const struct sea_state *state, double q, double qd,
                    double V, bool bridge_on, struct sea_state *derivative);

/* Power balance, W: the electrical power V I equals the sum of winding heat R I^2, motor friction
 * Dm qm'^2, spring damping Ds (qm' - q')^2 with the loss of the stop, the rate of sea_energy, and
 * tau q' to the link. A physical motor has Kw = Kt. If a robot file gives different constants, the
 * lost power (Kw - Kt) I qm' counts as friction, so that the balance still closes. */
struct sea_power {
    double electrical, joule, friction, spring_damping;
};
void sea_power(const struct robot_sea *sea, const struct sea_state *state, double q, double qd,
               double V, struct sea_power *power);

/* Returns the stored energy, J: L I^2/2, J qm'^2/2, Ks (qm - q)^2/2, and the energy of the
 * spring's stop. */
double sea_energy(const struct robot_sea *sea, const struct sea_state *state, double q);

/* Returns the force of the parallel spring along x, eq. (5), N: k_p x + d_p x' while x < 0, else
 * 0. As in the paper, the damper also acts while the spring relaxes, so a fast release can give a
 * positive force. Power balance: force p' = joint torque q' + rate of k_p x^2/2 (while x < 0) +
 * d_p x'^2 (while x < 0). */
double parallel_spring_force(const struct robot_parallel_spring *spring, double p, double pd,
                             double q, double qd);

/* Returns the joint torque of the parallel spring, eq. (5): s r times its force; p in m and its
 * rate in m/s. */
double parallel_spring_torque(const struct robot_parallel_spring *spring, double p, double pd,
                              double q, double qd);

/* Linearizes the parallel spring for an implicit Euler step of h seconds from p, q with the rates
 * pd, qd. The torque at the end of the step is torque - extra qdd. A slack spring stays slack
 * during the step. */
void parallel_spring_step(const struct robot_parallel_spring *spring, double p, double pd, double q,
                          double qd, double h, double *torque, double *extra);

/* Returns the stored energy of the parallel spring, J. */
double parallel_spring_energy(const struct robot_parallel_spring *spring, double p, double q);

/* Returns the loss of the parallel spring's damper, W. */
double parallel_spring_damping(const struct robot_parallel_spring *spring, double p, double pd,
                               double q, double qd);

#endif
