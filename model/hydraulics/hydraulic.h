/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A hydraulic cylinder behind a servo valve that turns a joint (docs/hydraulics.md; Merritt,
 * Hydraulic Control Systems, 1967, chapters 3 and 6; Jelali, Kroll, Hydraulic Servo-systems, 2003):
 *
 *     s'' = w^2 (V/V_n - s) - 2 zeta w s'          spool, of full opening; the opening is cut at 1
 *     Q = K o(s) f(dp),  f = dp / (dp^2 + d^2)^(1/4)   each port; linear within d of zero
 *     V_1 p_1' = beta (Q_1 - A_1 x')               piston side, V_1 = V_0 + A_1 x
 *     V_2 p_2' = beta (Q_2 + A_2 x')               rod side, V_2 = V_0 + A_2 (stroke - x)
 *     tau = (p_1 A_1 - p_2 A_2 - F(x')) dx/dq
 *
 * Further terms: leakage past the piston; oil drawn from the return if a chamber's pressure falls
 * below it; friction F = b x' + F_c x' / sqrt(x'^2 + v_c^2). The piston position is x = l(q) -
 * closed, l^2 = a^2 + b^2 - 2 a b cos(q + offset): a triangle of the joint and the cylinder's two
 * pins. A positive opening connects the supply to the piston side. The hoses are connected so that
 * a positive voltage turns the joint in the positive direction. The supply is in
 * model/hydraulics/supply.h.
 *
 * SI units, gauge pressures. Pure functions. RT-safe.
 */
#ifndef MODEL_HYDRAULICS_HYDRAULIC_H
#define MODEL_HYDRAULICS_HYDRAULIC_H

#include "model/robot.h"

/* Parts of a cylinder's state. */
enum hydraulic_part {
    HYDRAULIC_SPOOL,      /* s, of full opening */
    HYDRAULIC_SPOOL_RATE, /* 1/s */
    HYDRAULIC_P1,         /* Pa */
    HYDRAULIC_P2,
    HYDRAULIC_STATE,
};

/* Inputs of a cylinder from the joint and the rest of the machine. */
struct hydraulic_port {
    double q, qd;        /* position and rate of the joint, rad, rad/s */
    double voltage;      /* voltage of the valve, V */
    double supply, back; /* pressures of supply and return, Pa */
    double shift;        /* offset of the spool's center, relative to its full opening */
    /* leakage past the piston in addition to the cylinder's own, m3/s per Pa */
    double leak;
    bool stuck; /* the spool does not move */
};

/* Powers, W, or their integrals over time, J. Balance: in = mechanical + orifice + leakage + the
 * rate of hydraulic_energy. in: oil from the supply minus oil to the return. mechanical: work on
 * the piston; friction is the part of it that is lost. orifice: loss in the ports, with the oil's
 * expansion. drawn: volume from the supply, m3/s or m3. */
struct hydraulic_power {
    double in, mechanical, orifice, leakage, friction, drawn;
};

/* Returns the length between the pins, m, and computes its derivative dx/dq, m/rad. */
double hydraulic_length(const struct robot_hydraulic *cylinder, double q, double *lever);

/* Returns the sign of dx/dq over a joint's range, 1 or -1: the direction in which a positive
 * voltage must push the piston so that the joint turns positively. */
double hydraulic_direction(const struct robot_hydraulic *cylinder, double lower, double upper);

/* Returns the voltage per rad/s at which the joint turns without load in the middle of its range,
 * mean of both directions, V s/rad. */
double hydraulic_speed_constant(const struct robot_hydraulic *cylinder,
                                const struct robot_hydraulic_supply *supply, double lower,
                                double upper);

/* Checks that the triangle is possible for a joint with this range. The error gives the reason. */
enum error_code hydraulic_check(const struct robot_hydraulic *cylinder, double lower, double upper,
                                struct error *error);

/* Returns tau on the joint, N m. */
double hydraulic_torque(const struct robot_hydraulic *cylinder, const double *state, double q,
                        double qd);

/* Returns the energy of the compressed oil in the chambers, J. */
double hydraulic_energy(const struct robot_hydraulic *cylinder, const double *state, double q);

/* Computes the time derivatives of the state; power may be NULL. */
void hydraulic_derive(const struct robot_hydraulic *cylinder, const double *state,
                      const struct hydraulic_port *port, double *derivative,
                      struct hydraulic_power *power);

/* Advances the state by t seconds with the joint moving from q at the constant rate qd: the spool
 * exactly, the pressures in a fixed number of parts by the scheme of docs/integrator.md (order 2,
 * L-stable). Adds the integrals of the powers to power. slope: derivative of the torque at the end
 * with respect to qd, never positive. power and slope may be NULL. */
void hydraulic_advance(const struct robot_hydraulic *cylinder, const struct hydraulic_port *port,
                       double t, double *state, struct hydraulic_power *power, double *slope);

/* Computes the pressures at rest without torque on the joint. They are between supply and return
 * pressure. */
void hydraulic_rest(const struct robot_hydraulic *cylinder, const struct robot_hydraulic_supply *s,
                    double *state);

/* Computes the pressures at rest with this torque on the joint. Starts from the pressures without
 * torque and gives each chamber half of the force, as far as supply and return pressure allow.
 * Returns false and leaves the state unchanged if no pressures in this range give the torque. */
bool hydraulic_rest_loaded(const struct robot_hydraulic *cylinder,
                           const struct robot_hydraulic_supply *s, double q, double torque,
                           double *state);

#endif
