/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Effects of a real drive beyond eqs (2) to (4) of model/drives/actuator.h: gear friction,
 * backlash, hysteresis and kinematic error of a harmonic drive, cogging, a winding that warms up,
 * and a bridge with dead time and diodes. Equations, sources and keys: docs/drives.md. With all of
 * them
 *
 *     d = qm + e(qm) - q                       deflection behind the gear's error e
 *     J qm'' = Kt I - (Dm + k I^2) qm' - (1 + e') (tau_s + z) + c(qm) - F(qm') sgn qm'
 *     tau = tau_s + z                          on the link
 *     L I' = V - V_h sgn I - (R + R_b) I - Kw qm'
 *     z' = sigma (d' - |d'| z / z_max)         Dahl
 *
 * tau_s is the spring's torque beyond the play, c the cogging torque. F is Stribeck's curve plus
 * friction from the torques that the gear carries. Both sgn functions are set-valued at zero: a
 * rotor at rest stays at rest while |load| <= F(0), and no current flows while |V - Kw qm'| <= V_h.
 * A mode says which of the two is held at zero; the equations of a mode are smooth. With a
 * presliding stiffness sigma_f, friction is a Maxwell slip element, a torque f between -F and F in
 * place of F sgn qm': f' = sigma_f qm' until |f| is F. R, Kt and Kw depend on the temperatures,
 * Kt and Kw also on the current.
 * Current ripple and switching of the bridge only dissipate power.
 *
 * SI units, link side, temperatures in degree C. Pure functions of drives whose effects are not
 * NULL. RT-safe.
 */
#ifndef MODEL_DRIVES_EFFECTS_H
#define MODEL_DRIVES_EFFECTS_H

#include "model/drives/current_loop.h"

struct effects_state {
    struct sea_state sea;
    double hysteresis; /* z, N m */
    double winding_c, housing_c;
    double grip; /* torque of friction with a presliding stiffness, N m */
};

/* State of the bridge, seen from the winding. */
struct effects_bridge {
    bool conducts;  /* false: no current can flow */
    double voltage; /* V, mean over the switching period */
    /* V_h: voltage lost to dead time; with the bridge off, voltage of supply and diodes */
    double hold;
    double diodes;    /* part of hold that heats the diodes */
    double switching; /* switching loss divided by |current|, V */
    double ripple;    /* mean square of the current's ripple, A^2 */
    /* the drive's own current controller, which then sets the voltage; NULL = it is off. begin_s:
     * start of an implicit step, from the start of the substep */
    const struct current_loop *loop;
    double begin_s;
};

/* Signs of rotor speed and current; 0 = held at zero. With a presliding stiffness, slide is the
 * sign of friction that slides; 0 = it bends. */
struct effects_mode {
    int slide, flow;
};

/* Returns the mode of a state: the signs of rotor speed and current. */
struct effects_mode effects_find_mode(const struct robot_sea *sea,
                                      const struct effects_state *state, double q, double qd,
                                      const struct effects_bridge *bridge);

/* Computes the time derivatives in a mode. */
void effects_derivative(const struct robot_sea *sea, const struct effects_state *state, double q,
                        double qd, const struct effects_bridge *bridge,
                        const struct effects_mode *mode, struct effects_state *derivative);

/* Checks that the parameters of effects are possible for a drive. The error names the wrong
 * parameters. */
enum error_code effects_check(const struct robot_sea *sea, struct error *error);

/* Returns the frequency of small oscillations of the rotor in its cogging torque, rad/s. */
double effects_cogging_rate(const struct robot_sea *sea);

/* Largest product of this frequency and a substep, rad, at which the integrator conserves the
 * energy of the cogging. */
#define EFFECTS_COGGING_SWING 2.0

/* Returns tau on the link, N m. */
double effects_torque(const struct robot_sea *sea, const struct effects_state *state, double q,
                      double qd);

/* Returns the derivative of the current alone, A/s. */
double effects_current_rate(const struct robot_sea *sea, const struct effects_state *state,
                            const struct effects_bridge *bridge, const struct effects_mode *mode);

/* Returns the deflection d, rad. */
double effects_deflection(const struct robot_sea *sea, double qm, double q);

/* Torques that a gear carries, N m: from the motor, and from the load, -(1 + e') tau. Each is
 * positive if it turns the joint forward. */
struct effects_carried {
    double motor, external;
};
struct effects_carried effects_carried(const struct robot_sea *sea,
                                       const struct effects_state *state, double q, double qd);

/* Returns the friction F of the gear at a speed, N m. It consists of Coulomb friction, Stribeck
 * friction, and friction from the torques that the gear carries. */
double effects_friction(const struct robot_sea *sea, double speed,
                        const struct effects_carried *carried);

/* Returns whether a drive has rigid gear friction: its rotor may stay at rest under a load. */
bool effects_sticks(const struct robot_sea *sea);

/* Returns the factor of Kt and Kw of a motor that saturates, 1/sqrt(1 + (I/I_s)^2); 1 for a drive
 * without effects. */
double effects_saturation(const struct robot_sea *sea, double I);

/* Returns the viscous damping of the rotor at a current, N m s/rad: friction and iron loss. */
double effects_damping(const struct robot_sea *sea, double I);

/* Returns the current at which Kt I with saturation is this torque, A; INFINITY if none. */
double effects_current(const struct robot_sea *sea, double torque);

/* Returns the grip that friction F allows. */
double effects_limit_grip(double grip, double friction);

/* Returns the energy of the grip, J. */
double effects_grip_energy(const struct robot_sea *sea, double grip);

/* Returns the resistance that the skin effect adds at a speed, ohm; 0 for a drive without
 * effects. */
double effects_skin(const struct robot_sea *sea, double speed);

/* Returns the resistance R of a winding, ohm, at its temperature and speed. */
double effects_winding(const struct robot_sea *sea, const struct effects_state *state);

/* Returns the resistance in the current path: R of the winding plus R_b of the bridge, ohm. */
double effects_resistance(const struct robot_sea *sea, const struct effects_state *state);

/* Returns z after the deflection has changed by `way` in one direction. *loss receives the
 * dissipated energy, J. */
double effects_hysteresis(const struct robot_sea *sea, double z, double way, double *loss);

/* Power balance in a mode, W: electrical (from the supply) = bridge (heat) + joule + motor
 * (viscous, as in struct sea_power) + gear (friction) + spring_damping + hysteresis + the rate of
 * effects_energy + tau q' to the link. */
struct effects_power {
    double electrical, bridge, joule, motor, gear, spring_damping, hysteresis;
};
void effects_power(const struct robot_sea *sea, const struct effects_state *state, double q,
                   double qd, const struct effects_bridge *bridge, const struct effects_mode *mode,
                   struct effects_power *power);

/* Computes only the first three powers, which do not depend on the motor's angle. */
void effects_power_current(const struct robot_sea *sea, const struct effects_state *state,
                           const struct effects_bridge *bridge, const struct effects_mode *mode,
                           struct effects_power *power);

/* Returns the stored energy, J: sea_energy, hysteresis, grip and cogging. Heat is not stored. */
double effects_energy(const struct robot_sea *sea, const struct effects_state *state, double q);

/* End of an implicit Euler step. */
struct effects_end {
    struct effects_state state;
    double torque, slope;      /* tau, N m, and its derivative with respect to the joint's rate */
    struct loop_regime regime; /* of the current controller */
};

/* Advances a drive by an implicit Euler step of h seconds from *begin, while its joint moves from q
 * at the rate qd. keeps_friction: F is that of *begin, so that tau is continuous in qd. The step
 * adds no energy for any h and any stiffness: tau at the end times qd h is no more than the loss of
 * stored energy plus the work of the bridge. Temperatures do not change. */
void effects_step_implicit(const struct robot_sea *sea, const struct effects_bridge *bridge,
                           double h, double q, double qd, bool keeps_friction,
                           const struct effects_state *begin, struct effects_end *end);

/* Returns the voltage of the bridge at which the current stays as it is, V. */
double effects_steady_voltage(const struct robot_sea *sea, const struct effects_state *state,
                              const struct effects_bridge *bridge);

/* Returns the current after `length` seconds under the current controller, whose step of h seconds
 * from *begin ended at *end. */
double effects_loop_current(const struct robot_sea *sea, const struct effects_bridge *bridge,
                            double h, double length, const struct effects_state *begin,
                            const struct effects_end *end);

/* Updates the temperatures after t seconds in which the winding received this heat, J (trapezoidal
 * rule). */
void effects_warm(const struct robot_sea *sea, double heat, double t, struct effects_state *state);

/* Returns the motor's angle qm at which a drive, with or without effects, carries tau at rest with
 * the joint at q. Ignores hysteresis. */
double effects_motor_rest(const struct robot_sea *sea, double q, double tau);

#endif
