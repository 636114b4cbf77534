/* SPDX-License-Identifier: Apache-2.0 */
/* Our implementations of a robot's dynamics, in the form in which other simulators are compared
 * (app/bench/peers.h). Not RT-safe. */
#ifndef APP_BENCH_ENGINES_H
#define APP_BENCH_ENGINES_H

#include "app/bench/peers.h"

/* The implementations of struct dynamics, the numeric one first. The generated code is that built
 * in for the robot; otherwise create compiles it, which takes seconds. */
enum { BENCH_OURS = 2 };
extern const struct peer_dynamics bench_ours[BENCH_OURS];

enum { BENCH_NUMBERS = 1024 }; /* coordinates of a robot below, at most */

/* Makes a robot of the first njoint joints of another, whose parts it shares. Memory from arena. */
enum error_code bench_part(const struct robot *whole, size_t njoint, struct arena *arena,
                           const struct robot **part, struct error *error);

/* Puts PEER_SLOTS random states into an engine, the same ones for every engine: positions within
 * limits, moderate rates and torques. */
void bench_put_states(const struct peer_dynamics *peer, void *engine, const struct robot *robot);

/* Returns the average over the states of |a - b| / |b|, Euclidean norms of the accelerations that
 * two engines find; worst (may be NULL) receives the largest. Both engines hold the states of
 * bench_put_states. */
double bench_difference(const struct peer_dynamics *a, void *engine_a,
                        const struct peer_dynamics *b, void *engine_b, size_t nv, double *worst);

#endif
