/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An intruder on every bus: a node that sends random frames, STEP frames of a wrong tick among
 * them, but never a valid STEP and no DONE.
 */
#ifndef SOAK_INTRUDER_H
#define SOAK_INTRUDER_H

#include "base/random.h"
#include "sim/buses.h"

struct intruder {
    const struct rig *rig;
    struct bus_ports ports;
    struct random_stream random;
    uint64_t frames;
};

/* Sends a burst now and then. rude: boards may take its frames for the host's; else no board
 * receives them. tick: what a valid STEP would expect. */
void intruder_step(struct intruder *intruder, bool rude, uint32_t tick);

#endif
