/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the back ends of can_port: counting, and the states that error frames report. */
#ifndef CANBUS_PORT_PRIVATE_H
#define CANBUS_PORT_PRIVATE_H

#include "canbus/port.h"

/* The calls below for frames that are not plain, or a port in bus-off. RT-safe. */
void port_count_received_any(struct can_port *port, const struct bus_frame *frame);
void port_count_sent_any(struct can_port *port, const struct bus_frame *frame);
bool port_may_send_any(const struct can_port *port, const struct bus_frame *frame);

/* Counts a frame that is handed to the user; an error frame moves port->state. RT-safe. */
static inline void port_count_received(struct can_port *port, const struct bus_frame *frame)
{
    if (frame_is_plain(frame) && port->state != CAN_PORT_BUS_OFF) {
        port->counters.rx_frames++;
        port->counters.rx_bits += frame_plain_bits(frame);
    } else {
        port_count_received_any(port, frame);
    }
}

/* Counts a frame that the bus has accepted. RT-safe. */
static inline void port_count_sent(struct can_port *port, const struct bus_frame *frame)
{
    if (frame_is_plain(frame)) {
        port->counters.tx_frames++;
        port->counters.tx_bits += frame_plain_bits(frame);
    } else {
        port_count_sent_any(port, frame);
    }
}

/* Checks whether a port may send a frame: valid, and FD only where the bus has it. RT-safe. */
static inline bool port_may_send(const struct can_port *port, const struct bus_frame *frame)
{
    return frame_is_plain(frame) || port_may_send_any(port, frame);
}

#endif
