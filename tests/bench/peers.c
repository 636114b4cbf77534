/* SPDX-License-Identifier: Apache-2.0 */
/* The entry of the module with other simulators. */
#include "tests/bench/peers.h"

const struct peers *hil_peers(void)
{
    static struct peer_dynamics dynamics[2];
    static struct peer_pendulum pendulum[1];
    static struct peers peers = {.abi = PEERS_ABI,
                                 .robot_size = sizeof(struct robot),
                                 .dynamics = dynamics,
                                 .pendulum = pendulum};

    peers.ndynamics = peers.npendulum = 0;
#ifdef PEERS_WITH_SIMBODY
    dynamics[peers.ndynamics++] = peer_simbody;
#endif
#ifdef PEERS_WITH_MUJOCO
    dynamics[peers.ndynamics++] = peer_mujoco;
#endif
#ifdef PEERS_WITH_ODE
    pendulum[peers.npendulum++] = peer_ode;
#endif
    return &peers;
}
