/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Somebody who only listens on every bus, and judges what passes: STEP and DONE by the protocol,
 * frames by their number, all of it by a hash in which two equal runs agree.
 */
#ifndef SOAK_WATCH_H
#define SOAK_WATCH_H

#include "sim/buses.h"

enum { WATCH_DUE = 512, WATCH_BATCH = 256 };

struct watch {
    const struct rig *rig;
    struct bus_ports ports;
    bool wire;
    uint64_t hash;              /* of every frame, in the order in which the buses were looked at */
    uint64_t frames[RIG_BUSES_MAX]; /* of the robot's traffic */
    uint64_t steps, refused, malformed;
    uint32_t tick; /* when all STEP frames seen until now have been carried out */
    struct watch_due {
        uint32_t tick;
        bool refusal;
    } due[WATCH_DUE]; /* answers that are to come, oldest first */
    size_t ndue;
    uint64_t done[RIG_BUSES_MAX], done_hash[RIG_BUSES_MAX];
    bool stopping; /* the simulator said that it stops */
    char failure[256];
    struct bus_frame batch[WATCH_BATCH];
};

/* Frames of the buses since the last call; false with failure set when they break a rule. settled: no
 * STEP is under way, so that every bus must have had its DONE. */
bool watch_look(struct watch *watch, bool settled);

#endif
