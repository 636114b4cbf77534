/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fits a sine of known frequency to samples of a signal by least squares:
 *
 *     y = a cos(p) + b sin(p) + c + d u
 *
 * p is the phase of a sample. u, -1 to 1, is the position of a sample in the measurement; d u
 * models a slow drift. The sample times are arbitrary. RT-safe.
 */
#ifndef TASKS_SINE_FIT_H
#define TASKS_SINE_FIT_H

#include <stdbool.h>
#include <stddef.h>

enum { SINE_FIT_TERMS = 5 }; /* 1, u, cos, sin, y */

struct sine_fit {
    double product[SINE_FIT_TERMS][SINE_FIT_TERMS]; /* sums over the samples, upper triangle */
    double first; /* first sample; later samples are stored relative to it */
    size_t count;
};

struct sine {
    double cosine, sine; /* a, b */
    /* Coherence with the excitation, 0 to 1: the fraction of the signal's variance about its drift
     * that the sine explains. 0 = unknown. */
    double coherence;
};

void sine_fit_start(struct sine_fit *fit);

/* Adds a sample. phase_rad: phase of the excitation. u: -1 to 1. share: gain of the sine in the
 * sample. The gain is 1 for a point sample, and sin(x)/x for a mean over 2 x rad. */
void sine_fit_add(struct sine_fit *fit, double phase_rad, double u, double share, double y);

/* Solves for the sine. Returns false, and zeros, if there are too few samples or too few different
 * phases. */
bool sine_fit_solve(const struct sine_fit *fit, struct sine *sine);

#endif
