/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A listen-only node on every bus that checks the traffic: STEP and DONE by the protocol, frames by
 * their number, all of it by a hash that equal runs share.
 */
#ifndef SOAK_LISTENER_H
#define SOAK_LISTENER_H

#include "sim/buses.h"

enum { LISTENER_DUE = 512, LISTENER_BATCH = 256 };

struct listener {
    const struct rig *rig;
    struct bus_ports ports;
    bool wire;
    uint64_t hash; /* of every frame, in the order in which the buses were looked at */
    uint64_t frames[RIG_BUSES_MAX]; /* of the robot's traffic */
    uint64_t steps, refused, malformed;
    uint32_t tick; /* when all STEP frames seen until now have been carried out */
    struct listener_due {
        uint32_t tick;
        bool refusal;
    } due[LISTENER_DUE]; /* answers still expected, oldest first */
    size_t ndue;
    uint64_t done[RIG_BUSES_MAX], done_hash[RIG_BUSES_MAX];
    bool stopping; /* the simulator has announced its end */
    char failure[256];
    struct bus_frame batch[LISTENER_BATCH];
};

/* Checks the frames since the last call; false with failure set when they break a rule. settled: no
 * STEP is under way, so that every bus must have had its DONE. */
bool listener_check(struct listener *listener, bool settled);

#endif
