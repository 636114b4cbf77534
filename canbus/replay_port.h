/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that plays recorded frames in front of another port of any back end. A received batch
 * begins with the due recorded frames; the frames of the other port follow. Closing it closes the
 * other port. Counters and state are copied from the other port; played frames count as received.
 *
 * Time is virtual, and the owner advances it. The first receive at or after a frame's time returns
 * the frame. The port's functions are RT-safe.
 */
#ifndef CANBUS_REPLAY_PORT_H
#define CANBUS_REPLAY_PORT_H

#include "canbus/port.h"

struct replay_port_config {
    struct can_port *port;
    const struct bus_frame *frame; /* in order of time; borrowed */
    size_t count;
    const int64_t *now_ns; /* borrowed */
};

/* Creates the port in memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code replay_port_create(const struct replay_port_config *config, struct arena *arena,
                                   struct can_port **port, struct error *error);

#endif
