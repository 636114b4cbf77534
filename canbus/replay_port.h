/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that plays recorded frames: it passes on another port of any back end, and in front of
 * what that receives come the frames of a list whose time has come. Closing it closes the other
 * port. Counters and state are those of the other port, played frames counted as received.
 *
 * Time is virtual and the owner's: a frame is received by the first call at or after its time. The
 * port's functions are RT-safe.
 */
#ifndef CANBUS_REPLAY_PORT_H
#define CANBUS_REPLAY_PORT_H

#include "canbus/port.h"

struct replay_port_config {
    struct can_port *port;
    const struct bus_frame *frame; /* in the order of their times; borrowed */
    size_t count;
    const int64_t *now_ns; /* borrowed */
};

/* Creates the port in memory from arena. ERROR_MEMORY. Not RT-safe. */
enum error_code replay_port_create(const struct replay_port_config *config, struct arena *arena,
                                   struct can_port **port, struct error *error);

#endif
