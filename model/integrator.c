/* SPDX-License-Identifier: Apache-2.0 */
/* Fixed-step integration schemes. */
#include "model/integrator.h"

enum { RK4_STAGES = 4 };

size_t integrator_rk4_scratch(size_t n)
{
    return (RK4_STAGES + 1) * n; /* the slopes, and the state that the next one is taken at */
}

/* out = y + h k */
static void advance(size_t n, const double *y, double h, const double *restrict k,
                    double *restrict out)
{
    for (size_t i = 0; i < n; i++) {
        out[i] = y[i] + h * k[i];
    }
}

void integrator_rk4(integrator_function *f, void *context, double t, double h, size_t n, double *y,
                    double *scratch)
{
    double *k1 = scratch, *k2 = k1 + n, *k3 = k2 + n, *k4 = k3 + n, *stage = k4 + n;

    f(context, t, y, k1);
    advance(n, y, 0.5 * h, k1, stage);
    f(context, t + 0.5 * h, stage, k2);
    advance(n, y, 0.5 * h, k2, stage);
    f(context, t + 0.5 * h, stage, k3);
    advance(n, y, h, k3, stage);
    f(context, t + h, stage, k4);

    for (size_t i = 0; i < n; i++) {
        y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}
