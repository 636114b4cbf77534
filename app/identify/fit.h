/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fits free numbers so that free-running simulations follow recordings (output error): least
 * squares by Levenberg and Marquardt's method (MINPACK) with derivatives by differences, bounds by
 * a change of variables, priors as measurements of their own. Not RT-safe.
 */
#ifndef APP_IDENTIFY_FIT_H
#define APP_IDENTIFY_FIT_H

#include "app/identify/bench.h"
#include "rig/rig.h"

/* A number that is looked for. */
struct fit_free {
    int parameter;
    double start, lower, upper;
    double expected, sigma; /* prior; sigma 0 = none */
};

struct fit_problem {
    const struct rig *rig;
    const struct trial_robot *trial; /* what it starts from; the free ones' start goes first */
    const struct bench_law *law;
    const struct recording *recording; /* those that are fitted to: use[i] */
    const bool *use;                   /* NULL = all */
    size_t nrecording, nfree;
    struct fit_free free[IDENTIFY_FREE_MAX];
    double robust_rad;
    int steps; /* most iterations */
    void (*progress)(void *context, int step, double rms_rad);
    void *context;
};

/* What is known of a number after a fit. */
enum fit_verdict {
    FIT_KNOWN, /* to better than FIT_KNOWN_SHARE of its value (2 sigma) */
    FIT_ROUGH, /* less well */
    FIT_BOUND, /* the fit ended at a bound: the recordings would have it beyond, or do not care */
    FIT_NOT_TOLD, /* 2 sigma is no less than its value or half of its bounds */
};
extern const struct word fit_verdict_words[];

#define FIT_KNOWN_SHARE 0.05

struct fit_result {
    double value[IDENTIFY_FREE_MAX];
    double sigma[IDENTIFY_FREE_MAX]; /* with the residual's own correlation in time */
    double correlation[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX];
    enum fit_verdict verdict[IDENTIFY_FREE_MAX];
    double rms_rad;   /* of what was fitted to */
    double coherence; /* rows that count as one independent measurement */
    int simulations;
    struct trial_robot trial; /* with the values set */
};

/* Prepares a problem: the free numbers of the bench, or with keys (nkey of them) those, with the
 * bench's bounds and priors where it has them. */
enum error_code fit_prepare(const struct bench *bench, const char *const *key, size_t nkey,
                            struct fit_problem *problem, struct error *error);

enum error_code fit_solve(const struct fit_problem *problem, struct fit_result *result,
                          struct error *error);

/* ---- simulations of recordings (simulate.c), which may run in several threads at once ---- */

/* Simulates a recording with the numbers of a trial from where it begins, at rest: position gets
 * the joint's angle at each of the recording's times, rad, as the recording counts it. A simulation
 * that diverges goes on with its last position. */
enum error_code simulate_recording(const struct rig *rig, const struct trial_robot *trial,
                                   const struct bench_law *law, const struct recording *recording,
                                   double *position, struct error *error);

/* Errors of a simulated recording, rad. */
struct simulation_error {
    double mean, rms, worst; /* mean of the absolute values */
};
struct simulation_error simulation_compare(const struct recording *recording,
                                           const double *position);

#endif
