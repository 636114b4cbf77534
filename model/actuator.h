/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Series elastic DC drives and parallel springs, paper eqs (2)-(5), link side of the gear:
 *   J qm'' + Dm qm' + tau = Kt I                 (2)
 *   tau = Ks (qm - q) + Ds (qm' - q')            (3), with the sign that (2) needs
 *   L I' + R I + Kw qm' = V                      (4)
 * tau acts on the link with its own sign. The paper prints eq. (3) with the opposite sign, which is
 * inconsistent with (2); Kt and Kw are N times the motor's own. RT-safe.
 */
#ifndef MODEL_ACTUATOR_H
#define MODEL_ACTUATOR_H

#include "model/robot.h"

struct sea_state {
    double qm;  /* rad */
    double qmd; /* rad/s */
    double I;   /* A */
};

/* tau of eq. (3), N m on the link. */
double sea_torque(const struct robot_sea *sea, const struct sea_state *state, double q, double qd);

/* Time derivatives by eqs (2) and (4). bridge_on false: no current flows and I' = 0 (the caller has
 * set I to zero when the bridge opened). V in volts at the terminals. */
void sea_derivative(const struct robot_sea *sea, const struct sea_state *state, double q, double qd,
                    double V, bool bridge_on, struct sea_state *derivative);

/* Power balance, W: electrical V I; heat R I^2, motor friction Dm qm'^2, spring damping. */
struct sea_power {
    double electrical, joule, friction, spring_damping;
};
void sea_power(const struct robot_sea *sea, const struct sea_state *state, double qd, double V,
               struct sea_power *power);

/* Stored energy, J: L I^2/2, J qm'^2/2, Ks (qm - q)^2/2. */
double sea_energy(const struct robot_sea *sea, const struct sea_state *state, double q);

/* Joint torque of the parallel spring, eq. (5); p and its rate in m and m/s. */
double parallel_spring_torque(const struct robot_parallel_spring *spring, double p, double pd,
                              double q, double qd);

#endif
