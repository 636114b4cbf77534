/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The sine of a known frequency in samples of a signal, by least squares:
 *
 *     y = a cos(p) + b sin(p) + c + d u
 *
 * with the phase p of each sample and u, its place in the measurement, for a slow drift. Samples
 * may come at any times. RT-safe.
 */
#ifndef TASKS_SINE_FIT_H
#define TASKS_SINE_FIT_H

#include <stdbool.h>
#include <stddef.h>

enum { SINE_FIT_TERMS = 5 }; /* 1, u, cos, sin, y */

struct sine_fit {
    double product[SINE_FIT_TERMS][SINE_FIT_TERMS]; /* sums over the samples; the upper triangle */
    double first; /* first sample; the others are taken relative to it */
    size_t count;
};

struct sine {
    double cosine, sine; /* a, b */
    /* The part of the signal's variance about its drift that is this sine, 0 to 1: its coherence
     * with the excitation. 0: it cannot be told. */
    double coherence;
};

void sine_fit_start(struct sine_fit *fit);

/* Adds a sample: phase in rad; u from -1 to 1; share is the gain of the sine in the sample: 1,
 * or sin(x)/x for a mean over 2 x rad. */
void sine_fit_add(struct sine_fit *fit, double phase_rad, double u, double share, double y);

/* Solves for the sine. Returns false, and zeros, when the samples do not tell: too few, or all
 * at the same phases. */
bool sine_fit_solve(const struct sine_fit *fit, struct sine *sine);

#endif
