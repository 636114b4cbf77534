/* SPDX-License-Identifier: Apache-2.0 */
/* Fits a sine by least squares. The normal equations are solved by elimination in fixed order. */
#include "tasks/sine_fit.h"

#include "base/portable_math.h"

#include <math.h>
#include <string.h>

enum { DRIFT_TERMS = 2, COSINE = 2, SINE = 3, VALUE = 4 };

/* Smallest mean square of a term, after elimination of the earlier terms, that is not singular */
static const double SINGULAR = 1e-6;

void sine_fit_start(struct sine_fit *fit)
{
    memset(fit, 0, sizeof *fit);
}

void sine_fit_add(struct sine_fit *fit, double phase_rad, double u, double share, double y)
{
    double term[SINE_FIT_TERMS] = {1, u};

    if (fit->count == 0) {
        fit->first = y;
    }
    portable_sincos(phase_rad, &term[SINE], &term[COSINE]);
    term[COSINE] *= share;
    term[SINE] *= share;
    term[VALUE] = y - fit->first;
    for (int i = 0; i < SINE_FIT_TERMS; i++) {
        for (int k = i; k < SINE_FIT_TERMS; k++) {
            fit->product[i][k] += term[i] * term[k];
        }
    }
    fit->count++;
}

bool sine_fit_solve(const struct sine_fit *fit, struct sine *sine)
{
    double m[SINE_FIT_TERMS][SINE_FIT_TERMS], total = 0;

    /* Compute the sums of squares of the signal about its drift, and of the residual of the fit */
    *sine = (struct sine){0};
    memcpy(m, fit->product, sizeof m);
    /* Gaussian elimination of the symmetric normal equations, upper triangle */
    for (int i = 0; i < VALUE; i++) {
        if (!(m[i][i] > SINGULAR * (double)fit->count)) {
            return false;
        }
        if (i == DRIFT_TERMS) {
            total = m[VALUE][VALUE];
        }
        for (int j = i + 1; j < SINE_FIT_TERMS; j++) {
            for (int k = j; k < SINE_FIT_TERMS; k++) {
                m[j][k] -= m[i][j] * m[i][k] / m[i][i];
            }
        }
    }
    if (fit->count < SINE_FIT_TERMS) {
        return false;
    }

    /* Substitute back from the last term; a constant signal has no sine */
    sine->sine = m[SINE][VALUE] / m[SINE][SINE];
    sine->cosine = (m[COSINE][VALUE] - m[COSINE][SINE] * sine->sine) / m[COSINE][COSINE];
    if (total > 1e-14 * fit->product[VALUE][VALUE]) {
        sine->coherence = fmin(fmax(1 - m[VALUE][VALUE] / total, 0), 1);
    }
    return true;
}
