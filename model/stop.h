/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Mechanical stops: at the ends of a joint's range, and at the ends of the deflection of a series
 * spring. A stop is a spring and a damper without mass beside each other (Kelvin, Voigt) that only
 * push: with the depth x > 0 by which a coordinate is past its range, and its rate x',
 *   F = max(0, k x + d x')
 * against x. What returns faster than the stop can follow leaves it with nothing but k x^2/2 in it,
 * which is lost in its damper. So the law has no state, stores k x^2/2 and loses
 *   F x' - k x x' = d x'^2, or k x |x'| while it cannot follow: never less than nothing.
 *
 * Depths have a sign: positive above the range, negative below, zero within; torques are along the
 * coordinate, so against the depth. SI units (N m, rad; of a prismatic joint N, m). All functions
 * are pure and RT-safe.
 */
#ifndef MODEL_STOP_H
#define MODEL_STOP_H

#include "model/robot.h"

#include <stdbool.h>

/* Returns how far x is past the range, with a sign; 0 within it. */
double stop_depth(double lower, double upper, double x);

/* Returns the torque of the stop at that depth and rate of the coordinate. */
double stop_torque(const struct robot_stop *stop, double depth, double rate);

/* Return the energy in the stop, J, and the loss of its damper, W. */
double stop_energy(const struct robot_stop *stop, double depth);
double stop_loss(const struct robot_stop *stop, double depth, double rate);

/* The part of a stop in a step of h seconds of the implicit Euler scheme (or in a stage of another,
 * with its share of the step) that begins at x with that rate and leads, with the acceleration a,
 * to the rate' = rate + h a and to x + h rate'. */
struct stop_step {
    double torque;      /* at the end, torque - extra a */
    double extra;       /* inertia, never negative */
    int side;           /* 1: at the upper end, -1: at the lower end, 0: torque and extra are 0 */
    bool engaged, left; /* stop_step_revise has done that */
    double earlier;     /* torque by an earlier stage of the same step, weighted as this one's */
};

/* The stop acts if the coordinate, left alone, would be past its range at the end of the step and
 * press: so what comes fast is met within the step, not one later. */
void stop_step_begin(const struct robot_stop *stop, double lower, double upper, double x,
                     double rate, double h, struct stop_step *step);

/* Continues a stop that has acted on that side, not 0, in an earlier stage of the same step with
 * a torque, earlier, weighted as this one's: it acts wherever the coordinate is, and may pull what
 * it has pushed. A scheme that follows a stage's slope for longer than it was found for throws
 * what a stop has halted back at up to its own speed; here it takes that back. */
void stop_step_continue(const struct robot_stop *stop, double lower, double upper, double x,
                        double rate, double h, int side, double earlier, struct stop_step *step);

/* Now that a is known: leaves a stop that would pull, because something else turns the coordinate
 * back within the step, and engages one that the coordinate is thrown past within the step. True
 * when the step has changed and a is to be found anew; each is done once in a step at most, so that
 * this ends. */
bool stop_step_revise(const struct robot_stop *stop, double lower, double upper, double x,
                      double rate, double h, double a, struct stop_step *step);

/*
 * Passive joints: a linear spring and a damper without mass beside each other (Kelvin, Voigt)
 * between the two bodies that a joint joins, beside its drive or in the place of one: cables and
 * hoses across a joint, return springs, and the structure itself where a joint without a drive
 * stands for what bends. With the position q and its rest q_0 they press with
 *   tau = -K (q - q_0) - D q',
 * a law without state that stores K (q - q_0)^2/2 and turns D q'^2 into heat.
 *
 * SI units: N m, rad; of a prismatic joint N, m. All functions are pure and RT-safe.
 */
/* Returns whether a joint has one. */
bool passive_is_present(const struct robot_passive *passive);

double passive_torque(const struct robot_passive *passive, double q, double qd);

/* Return what is stored, J, and the damper's loss, W. */
double passive_energy(const struct robot_passive *passive, double q);
double passive_loss(const struct robot_passive *passive, double qd);

#endif
