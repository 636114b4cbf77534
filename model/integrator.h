/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Integration of y' = f(t, y) over a flat state, in fixed steps (RT-safe) or adaptive. The caller
 * owns the scratch.
 */
#ifndef MODEL_INTEGRATOR_H
#define MODEL_INTEGRATOR_H

#include <stdbool.h>
#include <stddef.h>

/* Computes dydt (n) from y (n) at time t (s). */
typedef void integrator_function(void *context, double t, const double *y, double *dydt);

/* Scratch per state variable, in doubles: the slopes of the stages, and the state at the next
 * stage. */
enum { RK4_SCRATCH = 5, DOPRI5_SCRATCH = 8 };

/* Advances y (n) from t by h seconds with the classical fourth-order Runge-Kutta scheme (Hairer,
 * Norsett, Wanner, Solving ODEs I, II.1, table 1.2). lost (n) receives the rounding error of y,
 * which the next call adds. So rounding errors of many short steps do not accumulate (Hairer,
 * Lubich, Wanner, Geometric Numerical Integration, VIII.5). Set lost to zero whenever y is set. */
void integrator_rk4(integrator_function *f, void *context, double t, double h, size_t n, double *y,
                    double *lost, double *scratch);

/* Settings of the adaptive scheme, and its memory between calls. */
struct integrator_dopri5 {
    double rtol, atol;  /* > 0; the error of a step is relative to atol + rtol |y_i| */
    size_t tries;       /* maximum number of steps in one call, accepted or rejected */
    double next;        /* length of the next step, s; 0 = unknown */
    double last_error;  /* error of the last accepted step */
    size_t evaluations; /* evaluations of f so far */
};

/* Advances y (n) from t by h seconds with the embedded pair of orders 5 and 4 of Dormand and
 * Prince and proportional-integral control of the step (Hairer, Norsett, Wanner, Solving ODEs I,
 * II.5 table 5.2; Hairer, Wanner, II, IV.2). The error of a step is the root mean square over the
 * state. Returns false if it does not reach the end within `tries` steps, or if its steps become
 * negligible relative to h because f is not finite; y is then the last state reached. */
bool integrator_dopri5(integrator_function *f, void *context, double t, double h, size_t n,
                       double *y, struct integrator_dopri5 *control, double *scratch);

#endif
