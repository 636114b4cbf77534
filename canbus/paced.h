/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that adds the timing of a real bus to another port (vcan). Sent frames pass through a wire
 * in virtual time (canbus/wire/wire.h). The other port sends each frame at the end of its wire
 * time. Received frames pass at once, because they have already arrived; they occupy the wire as
 * frames of one more controller. The state is copied from the other port. Frames that the wire
 * drops count as tx_dropped. The time resolution is the interval between calls of
 * paced_port_advance.
 *
 * Closing it closes the other port. The port's functions are RT-safe if the other port's are.
 */
#ifndef CANBUS_PACED_H
#define CANBUS_PACED_H

#include "canbus/port.h"
#include "canbus/wire/wire.h"

enum { PACED_PORT_BYPASS_MAX = 2 };

struct paced_port_config {
    struct can_port *port; /* port that carries the frames */
    int64_t bitrate, data_bitrate;
    size_t nodes; /* number of controllers of this port (frame.node), at most 62 */
    size_t queue; /* queue of each controller, frames */
    bool fifo;
    uint32_t bypass_id[PACED_PORT_BYPASS_MAX]; /* standard identifiers that take no time */
    size_t nbypass;
};

/* Creates the port in memory from arena. Not RT-safe. */
enum error_code paced_port_create(const struct paced_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error);

/* Advances the wire to a virtual time and sends the frames that it has carried by then. RT-safe. */
void paced_port_advance(struct can_port *port, int64_t now_ns);

/* Sets a function that paced_port_advance calls for every carried frame, sent or received. Call it
 * before the first frame. RT-safe. */
void paced_port_tap(struct can_port *port,
                    void (*tap)(void *context, const struct bus_frame *frame), void *context);

/* Returns the wire for inspection: first the nodes of the port, then the node of received frames.
 * RT-safe. */
struct wire *paced_port_wire(const struct can_port *port);

#endif
