/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint couplings: a spring and a damper without mass beside each other (Kelvin, Voigt) between a
 * joint, the follower, and where its leader wants it. With the error e = q_f - m q_l - o, m the
 * multiplier and o the offset, they press with
 *   F = K e + D e',
 * by -F on the follower and by +m F on the leader, so that what one takes the other gives: the law
 * has no state, stores K e^2/2 and turns D e'^2 into heat.
 *
 * Positions, rates and torques are arrays by joint. SI units, those of the follower (N m, rad; of a
 * prismatic one N, m). All functions are RT-safe.
 */
#ifndef MODEL_COUPLING_H
#define MODEL_COUPLING_H

#include "model/robot.h"

/* Returns the error e of the joints' positions, and e' of their rates. */
double coupling_error(const struct robot_coupling *coupling, const double *q);
double coupling_rate(const struct robot_coupling *coupling, const double *qd);

/* Returns the force F at an error and its rate. */
double coupling_force(const struct robot_coupling *coupling, double error, double rate);

/* Adds the torques that F exerts on both joints. */
void coupling_press(const struct robot_coupling *coupling, double force, double *torque);

/* Returns the energy stored at an error, J, and the damper's loss, W. */
double coupling_energy(const struct robot_coupling *coupling, double error);
double coupling_loss(const struct robot_coupling *coupling, double rate);

/* Largest error (rad or m) of a follower's position in a file: people write six digits. */
#define COUPLING_ALIGNED 1e-6

/* Moves every follower to where its leader wants it. */
void coupling_align(const struct robot *robot, double *q);

/* The forces F of n couplings by which accelerations change: with the columns y_i that a unit of
 * w_i makes (+1 on follower i, -m_i on its leader), nv numbers each, one after the other,
 *   (W^T Y + diag(compliance)) F = W^T a + c,  a <- a - Y F.
 * That is the sum of a system's inverse and of n terms of rank one (Woodbury; Golub, Van Loan,
 * Matrix Computations, 2.1.4), written for the forces, which stay small where the couplings are
 * stiff; compliance 0 holds the followers exactly. */

/* Fills the lower triangle of factor (n x n, by rows) with the Cholesky factor of that matrix: not
 * a number where rounding has left no positive pivot. */
void coupling_factorize(const struct robot *robot, const double *column, const double *compliance,
                        double *factor);

/* Computes force (n) and corrects a. c is free: 0 holds the accelerations, more pulls the error
 * back. */
void coupling_correct(const struct robot *robot, const double *column, const double *factor,
                      const double *c, double *force, double *a);

#endif
