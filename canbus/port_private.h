/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to the back ends of can_port: counters, and the states that error frames
 * report. */
#ifndef CANBUS_PORT_PRIVATE_H
#define CANBUS_PORT_PRIVATE_H

#include "base/array.h"
#include "canbus/port.h"

#include <linux/can/error.h>

/* Counts a received error frame, which changes port->state. RT-safe. */
void port_count_error(struct can_port *port, const struct bus_frame *frame);

/* Counts a received frame. RT-safe. */
static inline void port_count_received(struct can_port *port, const struct bus_frame *frame)
{
    if (frame->flags & FRAME_ERROR) {
        port_count_error(port, frame);
        return;
    }
    port->counters.rx_frames++;
    port->counters.rx_bits += frame_bits(frame);
    port->counters.fast_bits += frame->flags & FRAME_BRS ? frame_fast_bits(frame) : 0;
    /* Not every driver reports a recovery, but traffic proves it */
    if (port->state == CAN_PORT_BUS_OFF) {
        port->state = CAN_PORT_UP;
    }
}

/* Counts a frame that the bus has accepted. RT-safe. */
static inline void port_count_sent(struct can_port *port, const struct bus_frame *frame)
{
    port->counters.tx_frames++;
    port->counters.tx_bits += frame_bits(frame);
    port->counters.fast_bits += frame->flags & FRAME_BRS ? frame_fast_bits(frame) : 0;
}

/* Operations `descriptor` and `close` of a port that wraps another port. They call the inner
 * port. */
int port_inner_descriptor(const struct can_port *port);
void port_inner_close(struct can_port *port);

/* Checks whether a port may send a frame: valid, and FD only on an FD bus. RT-safe. */
static inline bool port_may_send(const struct can_port *port, const struct bus_frame *frame)
{
    return frame_valid(frame) && (port->fd || !(frame->flags & FRAME_FD));
}

#endif
