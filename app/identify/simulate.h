/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Free-running simulations of recordings: the plant of the rig, with its integrator and steps,
 * under the recorded commands, never set back to what was measured. Not RT-safe; the functions may
 * run in several threads at once.
 */
#ifndef APP_IDENTIFY_SIMULATE_H
#define APP_IDENTIFY_SIMULATE_H

#include "app/identify/bench.h"
#include "rig/rig.h"

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
