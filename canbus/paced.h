/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that takes as long as a real bus would, over one that takes no time (vcan). Frames that
 * are sent go over a wire in virtual time (canbus/wire/wire.h) and leave through the other port
 * when that wire has carried them; frames that come in have arrived already and are passed on at
 * once, but occupy the wire too, as those of one more controller. The state is that of the other
 * port; frames that the wire drops count as tx_dropped. The resolution in time is that of the calls
 * of paced_port_advance.
 *
 * Closing it closes the other port. The port's functions are RT-safe where the other port's are.
 */
#ifndef CANBUS_PACED_H
#define CANBUS_PACED_H

#include "canbus/port.h"
#include "canbus/wire/wire.h"

enum { PACED_PORT_BYPASS_MAX = 2 };

struct paced_port_config {
    struct can_port *port; /* what frames really go over */
    int64_t bitrate, data_bitrate;
    size_t nodes; /* controllers that the port stands for (frame.node), at most 62 */
    size_t queue; /* of each */
    bool fifo;
    uint32_t bypass_id[PACED_PORT_BYPASS_MAX]; /* standard identifiers that take no time */
    size_t nbypass;
};

/* Creates the port in memory from arena. Not RT-safe. */
enum error_code paced_port_create(const struct paced_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error);

/* Moves the wire to a virtual time and sends on what it has carried by then. RT-safe. */
void paced_port_advance(struct can_port *port, int64_t now_ns);

/* Calls tap for every frame of either side that the wire has carried, from paced_port_advance; to
 * be set before the first frame. RT-safe. */
void paced_port_tap(struct can_port *port,
                    void (*tap)(void *context, const struct bus_frame *frame), void *context);

/* Returns the wire, to inspect it: the nodes of the port, then the node of incoming frames.
 * RT-safe. */
struct wire *paced_port_wire(const struct can_port *port);

#endif
