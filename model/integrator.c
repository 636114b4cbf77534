/* SPDX-License-Identifier: Apache-2.0 */
/* Runge-Kutta schemes: RK4 in fixed steps, and the adaptive pair of Dormand and Prince. */
#include "model/integrator.h"

#include "base/portable_math.h"

#include <math.h>
#include <string.h>

/* Computes out = y + h k. */
static void advance_stage(size_t n, const double *y, double h, const double *restrict k,
                          double *restrict out)
{
    for (size_t i = 0; i < n; i++) {
        out[i] = y[i] + h * k[i];
    }
}

/* Adds `change` and the rounding error of earlier sums to y. *lost receives the new rounding error
 * (Knuth, The Art of Computer Programming, 4.2.2, theorem B). */
static void add_exactly(double change, double *y, double *lost)
{
    double part = change + *lost, sum = *y + part, taken = sum - *y;

    *lost = (*y - (sum - taken)) + (part - taken);
    *y = sum;
}

void integrator_rk4(integrator_function *f, void *context, double t, double h, size_t n, double *y,
                    double *lost, double *scratch)
{
    double *k1 = scratch, *k2 = k1 + n, *k3 = k2 + n, *k4 = k3 + n, *stage = k4 + n;

    f(context, t, y, k1);
    advance_stage(n, y, 0.5 * h, k1, stage);
    f(context, t + 0.5 * h, stage, k2);
    advance_stage(n, y, 0.5 * h, k2, stage);
    f(context, t + 0.5 * h, stage, k3);
    advance_stage(n, y, h, k3, stage);
    f(context, t + h, stage, k4);

    for (size_t i = 0; i < n; i++) {
        add_exactly(h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]), &y[i], &lost[i]);
    }
}

enum { DOPRI5_STAGES = DOPRI5_SCRATCH - 1 };

static const double dopri5_c[DOPRI5_STAGES] = {0.0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1.0, 1.0};

/* Coefficients of the stages. The last row is the solution of order 5. */
static const double dopri5_a[DOPRI5_STAGES][DOPRI5_STAGES - 1] = {
    {0.0},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};

/* Coefficients of the error: solution of order 5 minus solution of order 4. */
static const double dopri5_e[DOPRI5_STAGES] = {
    71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

/* Step control: exponents, safety factor, and limits of the ratio of successive steps. */
#define CONTROL_BETA 0.04
#define CONTROL_ALPHA (0.2 - 0.75 * CONTROL_BETA)
#define CONTROL_SAFETY 0.9
#define CONTROL_SHRINK 0.2
#define CONTROL_GROW 10.0

/* First step and smallest step, relative to the whole span h. */
#define FIRST_STEP 1e-3
#define LEAST_STEP 1e-12

bool integrator_dopri5(integrator_function *f, void *context, double t, double h, size_t n,
                       double *y, struct integrator_dopri5 *control, double *scratch)
{
    double *k = scratch, *stage = k + DOPRI5_STAGES * n, *last = k + (DOPRI5_STAGES - 1) * n;
    double done = 0.0, step = control->next > 0.0 ? control->next : FIRST_STEP * h;
    bool rejected = false;

    f(context, t, y, k);
    control->evaluations++;
    for (size_t tried = 0; tried < control->tries && step > LEAST_STEP * h; tried++) {
        bool final = step >= h - done;
        double error, factor;

        /* Try a step that ends no later than the span */
        control->next = step;
        step = final ? h - done : step;

        /* Compute slopes 2 to 7. The state of the last slope is the result of the step */
        for (int s = 1; s < DOPRI5_STAGES; s++) {
            memcpy(stage, y, n * sizeof *y);
            for (int m = 0; m < s; m++) {
                for (size_t i = 0; i < n; i++) {
                    stage[i] += step * dopri5_a[s][m] * k[(size_t)m * n + i];
                }
            }
            f(context, (t + done) + dopri5_c[s] * step, stage, k + (size_t)s * n);
        }
        control->evaluations += DOPRI5_STAGES - 1;

        /* Compute the root mean square of the step's error over the state, relative to the
         * tolerances */
        double sum = 0.0;

        for (size_t i = 0; i < n; i++) {
            double scale = control->atol + control->rtol * fmax(fabs(y[i]), fabs(stage[i]));
            double difference = 0.0;

            for (int s = 0; s < DOPRI5_STAGES; s++) {
                difference += dopri5_e[s] * k[(size_t)s * n + i];
            }
            sum += (step * difference / scale) * (step * difference / scale);
        }
        error = sqrt(sum / (double)n);

        /* If the error is too large, repeat with a shorter step */
        if (!(error <= 1.0)) {
            step *= isfinite(error)
                        ? fmax(CONTROL_SHRINK, CONTROL_SAFETY * portable_pow(error, -0.2))
                        : CONTROL_SHRINK;
            rejected = true;
            continue;
        }

        /* Accept the step. Its last slope is the first slope of the next step, and the errors give
         * the next step's length */
        memcpy(y, stage, n * sizeof *y);
        memcpy(k, last, n * sizeof *k);
        factor = CONTROL_SAFETY * portable_pow(fmax(error, 1e-10), -CONTROL_ALPHA) *
                 portable_pow(fmax(control->last_error, 1e-4), CONTROL_BETA);
        factor = fmin(CONTROL_GROW, fmax(CONTROL_SHRINK, factor));
        factor = rejected ? fmin(factor, 1.0) : factor;
        control->last_error = error;
        rejected = false;
        if (final) {
            /* A shortened last step must not reduce the length of the next one */
            control->next = fmax(control->next, step * factor);
            return true;
        }
        done += step;
        step *= factor;
    }
    return false;
}
