/* SPDX-License-Identifier: Apache-2.0 */
/* Our implementations of a robot's dynamics in the terms in which other simulators are compared
 * (app/bench/peers.h). Not RT-safe. */
#ifndef APP_BENCH_ENGINES_H
#define APP_BENCH_ENGINES_H

#include "app/bench/peers.h"

/* The implementations of struct dynamics, the numeric one first. The generator's code is what is
 * built in for the robot, else create compiles it (seconds). */
enum { BENCH_OURS = 2 };
extern const struct peer_dynamics bench_ours[BENCH_OURS];

enum { BENCH_NUMBERS = 1024 }; /* most coordinates of a robot below */

/* A robot of the first njoint joints of another; its parts are the other's. Memory from arena. */
enum error_code bench_part(const struct robot *whole, size_t njoint, struct arena *arena,
                           const struct robot **part, struct error *error);

/* Puts PEER_SLOTS random states into an engine: positions within limits, moderate rates and
 * torques, the same for every engine. */
void bench_put_states(const struct peer_dynamics *peer, void *engine, const struct robot *robot);

/* Average over the states of |a - b| / |b|, Euclidean norms of the accelerations that two engines
 * find; worst (may be NULL) gets the largest. Both engines hold the states of bench_put_states. */
double bench_difference(const struct peer_dynamics *a, void *engine_a,
                        const struct peer_dynamics *b, void *engine_b, size_t nv, double *worst);

#endif
