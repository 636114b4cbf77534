/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Mechanical stops at the ends of a joint's range, and at the ends of a series spring's deflection.
 * A stop is a massless spring and damper in parallel (Kelvin, Voigt) that only pushes. With the
 * depth x > 0 of the coordinate past its range, and the rate x', the force is
 *
 *   F = max(0, k x + d x') against x.
 *
 * If the coordinate returns faster than the stop can follow, the stored energy k x^2/2 is lost in
 * the damper. So the law has no state, stores k x^2/2 and dissipates
 *
 *   F x' - k x x' = d x'^2, or k x |x'| while it cannot follow: never negative.
 *
 * Depths have a sign: positive above the range, negative below, zero within. Torques are along the
 * coordinate, so they oppose the depth. SI units (N m, rad; prismatic: N, m). All functions are
 * pure and RT-safe.
 */
#ifndef MODEL_STOP_H
#define MODEL_STOP_H

#include "model/robot.h"

#include <stdbool.h>

/* Returns the signed depth of x past the range; 0 within it. */
double stop_depth(double lower, double upper, double x);

/* Returns the torque of the stop for this depth and rate of the coordinate. */
double stop_torque(const struct robot_stop *stop, double depth, double rate);

/* stop_energy returns the energy stored in the stop, J. stop_loss returns the loss of its damper,
 * W. */
double stop_energy(const struct robot_stop *stop, double depth);
double stop_loss(const struct robot_stop *stop, double depth, double rate);

/* State of a stop in an implicit Euler step of h seconds. A stage of another scheme counts as a
 * step of its own length. The step begins at position x with the given rate. With the acceleration
 * a, it ends at rate' = rate + h a and at x + h rate'. */
struct stop_step {
    double torque; /* the torque at the end of the step is torque - extra a */
    double extra;  /* additional inertia, never negative */
    /* 1: stop at the upper end, -1: at the lower end, 0: inactive (torque and extra are 0) */
    int side;
    bool engaged, left; /* stop_step_revise has engaged or released the stop */
    /* torque from an earlier stage of the same step, with the weight of this stage */
    double earlier;
};

/* Begins a step. The stop is active if, without it, the coordinate would end the step past its
 * range and press the stop. So a fast coordinate is stopped within the step, not one step later. */
void stop_step_begin(const struct robot_stop *stop, double lower, double upper, double x,
                     double rate, double h, struct stop_step *step);

/* Continues a stop that acted in an earlier stage of the same step. side (not 0): end at which it
 * acted. earlier: its torque in that stage, with the weight of this stage. The stop is active at
 * any position and may pull. Reason: the scheme extends the earlier stage's slope beyond that
 * stage. This alone would throw a stopped coordinate back with up to its own speed. The pull in
 * this stage removes the surplus. */
void stop_step_continue(const struct robot_stop *stop, double lower, double upper, double x,
                        double rate, double h, int side, double earlier, struct stop_step *step);

/* Revises the stop for the solved acceleration a. Releases a stop that would pull because another
 * force turns the coordinate back within the step. Engages a stop that the coordinate would pass
 * within the step. Returns true after a change: a must then be solved again. Each change happens at
 * most once per step, so the iteration ends. */
bool stop_step_revise(const struct robot_stop *stop, double lower, double upper, double x,
                      double rate, double h, double a, struct stop_step *step);

/*
 * Passive joints: a massless linear spring and damper in parallel (Kelvin, Voigt) between the two
 * bodies of a joint, in addition to its drive or without one. It models cables and hoses across a
 * joint, return springs, or a flexible structure. With the position q and the rest position q_0 the
 * torque is
 *
 *   tau = -K (q - q_0) - D q'
 *
 * The law has no state, stores K (q - q_0)^2/2 and dissipates D q'^2.
 *
 * SI units: N m, rad; prismatic: N, m. All functions are pure and RT-safe.
 */
/* Returns whether a joint has a passive spring or damper. */
bool passive_is_present(const struct robot_passive *passive);

double passive_torque(const struct robot_passive *passive, double q, double qd);

/* passive_energy returns the stored energy, J. passive_loss returns the loss of the damper, W. */
double passive_energy(const struct robot_passive *passive, double q);
double passive_loss(const struct robot_passive *passive, double qd);

#endif
