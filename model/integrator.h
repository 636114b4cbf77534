/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fixed-step integration of y' = f(t, y) over a flat state. RT-safe: scratch is the caller's.
 */
#ifndef MODEL_INTEGRATOR_H
#define MODEL_INTEGRATOR_H

#include <stddef.h>

/* dydt (n) from y (n) at time t (s). */
typedef void integrator_function(void *context, double t, const double *y, double *dydt);

/* Doubles of scratch that integrator_rk4 needs for n states. */
size_t integrator_rk4_scratch(size_t n);

/* Advances y (n) from t by h seconds with the classical fourth-order Runge-Kutta scheme (Hairer,
 * Norsett, Wanner, Solving ODEs I, II.1, table 1.2). */
void integrator_rk4(integrator_function *f, void *context, double t, double h, size_t n, double *y,
                    double *scratch);

#endif
