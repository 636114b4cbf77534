/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A node that nobody has invited: sends what it likes on every bus, STEP frames of another tick among
 * it, but never one that would be right, and no DONE.
 */
#ifndef SOAK_STRANGER_H
#define SOAK_STRANGER_H

#include "base/random.h"
#include "sim/buses.h"

struct stranger {
    const struct rig *rig;
    struct bus_ports ports;
    struct random_stream random;
    uint64_t frames;
};

/* Now and then a burst. rude: the boards may take its frames for the host's; else they are such as
 * concern no board here. tick: what a right STEP would expect. */
void stranger_step(struct stranger *stranger, bool rude, uint32_t tick);

#endif
