/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint couplings: a joint, the follower, is joined to the target position that its leader gives,
 * by a massless spring and damper in parallel (Kelvin, Voigt). The error is e = q_f - m q_l - o,
 * with the multiplier m and the offset o. The force is
 *
 *   F = K e + D e'
 *
 * It acts as -F on the follower and as +m F on the leader, so that no energy is created. The law
 * has no state, stores K e^2/2 and dissipates D e'^2.
 *
 * Positions, rates and torques are arrays by joint. SI units of the follower (N m, rad; prismatic:
 * N, m). All functions are RT-safe.
 */
#ifndef MODEL_COUPLING_H
#define MODEL_COUPLING_H

#include "model/robot.h"

/* Returns the error e for positions, or e' for rates. */
double coupling_error(const struct robot_coupling *coupling, const double *q);
double coupling_rate(const struct robot_coupling *coupling, const double *qd);

/* Returns the force F for an error and its rate. */
double coupling_force(const struct robot_coupling *coupling, double error, double rate);

/* Adds the torques that F exerts on both joints. */
void coupling_press(const struct robot_coupling *coupling, double force, double *torque);

/* coupling_energy returns the energy stored at an error, J. coupling_loss returns the loss of the
 * damper, W. */
double coupling_energy(const struct robot_coupling *coupling, double error);
double coupling_loss(const struct robot_coupling *coupling, double rate);

/* Largest error of a follower's position in a file, rad or m. Files have six digits. */
#define COUPLING_ALIGNED 1e-6

/* Moves each follower to the position that its leader gives. */
void coupling_align(const struct robot *robot, double *q);

/* The forces F of n couplings, and how they change accelerations. Column y_i is the acceleration
 * by a unit of w_i (+1 on follower i, -m_i on its leader); columns have nv numbers each, one after
 * the other.
 *
 *   (W^T Y + diag(compliance)) F = W^T a + c,  a <- a - Y F.
 *
 * This is the inverse of a system plus n terms of rank one (Woodbury; Golub, Van Loan, Matrix
 * Computations, 2.1.4). It is solved for the forces, which stay moderate for stiff couplings.
 * compliance 0 makes the coupling rigid. */

/* Fills the lower triangle of factor (n x n, by rows) with the Cholesky factor of W^T Y +
 * diag(compliance). The result is NAN if rounding leaves no positive pivot. */
void coupling_factorize(const struct robot *robot, const double *column, const double *compliance,
                        double *factor);

/* Computes the forces (n) and corrects a. c: right-hand side; 0 keeps the error's acceleration at
 * zero, a larger value pulls the error back. */
void coupling_correct(const struct robot *robot, const double *column, const double *factor,
                      const double *c, double *force, double *a);

#endif
