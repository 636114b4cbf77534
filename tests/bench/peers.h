/* SPDX-License-Identifier: Apache-2.0 */
/* Private to the module of other simulators (app/bench/peers.h): what each source file gives. */
#ifndef TESTS_BENCH_PEERS_H
#define TESTS_BENCH_PEERS_H

#include "app/bench/peers.h"

/* Each exists where its library was found: PEERS_WITH_SIMBODY, _MUJOCO, _ODE. */
extern const struct peer_dynamics peer_simbody;
extern const struct peer_dynamics peer_mujoco;
extern const struct peer_pendulum peer_ode;

#endif
