/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the forces of joint couplings, and solves the small linear system of all couplings of a
 * robot. */
#include "model/coupling.h"

#include <math.h>

double coupling_error(const struct robot_coupling *coupling, const double *q)
{
    return q[coupling->follower] - coupling->multiplier * q[coupling->leader] - coupling->offset;
}

double coupling_rate(const struct robot_coupling *coupling, const double *qd)
{
    return qd[coupling->follower] - coupling->multiplier * qd[coupling->leader];
}

double coupling_force(const struct robot_coupling *coupling, double error, double rate)
{
    return coupling->stiffness * error + coupling->damping * rate;
}

void coupling_press(const struct robot_coupling *coupling, double force, double *torque)
{
    torque[coupling->follower] -= force;
    torque[coupling->leader] += coupling->multiplier * force;
}

double coupling_energy(const struct robot_coupling *coupling, double error)
{
    return 0.5 * coupling->stiffness * error * error;
}

double coupling_loss(const struct robot_coupling *coupling, double rate)
{
    return coupling->damping * rate * rate;
}

void coupling_align(const struct robot *robot, double *q)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        q[coupling->follower] = coupling->multiplier * q[coupling->leader] + coupling->offset;
    }
}

void coupling_factorize(const struct robot *robot, const double *column, const double *compliance,
                        double *factor)
{
    const size_t n = robot->ncoupling, first = robot->nv - robot->njoint;

    for (size_t row = 0; row < n; row++) {
        for (size_t k = 0; k <= row; k++) {
            /* The matrix element is the effect of a unit force of coupling k on the acceleration of
             * this row's error. Cholesky factorization, row by row */
            double sum = coupling_rate(&robot->coupling[row], column + k * robot->nv + first);

            sum += k == row ? compliance[row] : 0.0;
            for (size_t i = 0; i < k; i++) {
                sum -= factor[row * n + i] * factor[k * n + i];
            }
            factor[row * n + k] = k == row ? sqrt(sum) : sum / factor[k * n + k];
        }
    }
}

void coupling_correct(const struct robot *robot, const double *column, const double *factor,
                      const double *c, double *force, double *a)
{
    const size_t n = robot->ncoupling, first = robot->nv - robot->njoint;

    /* Forward, then backward substitution */
    for (size_t row = 0; row < n; row++) {
        force[row] = coupling_rate(&robot->coupling[row], a + first) + c[row];
        for (size_t k = 0; k < row; k++) {
            force[row] -= factor[row * n + k] * force[k];
        }
        force[row] /= factor[row * n + row];
    }
    for (size_t row = n; row-- > 0;) {
        for (size_t k = row + 1; k < n; k++) {
            force[row] -= factor[k * n + row] * force[k];
        }
        force[row] /= factor[row * n + row];
    }

    /* Correct all accelerations for the forces */
    for (size_t k = 0; k < n; k++) {
        for (size_t i = 0; i < robot->nv; i++) {
            a[i] -= force[k] * column[k * robot->nv + i];
        }
    }
}
