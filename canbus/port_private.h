/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to the back ends of can_port: counters, and the states that error frames
 * report. */
#ifndef CANBUS_PORT_PRIVATE_H
#define CANBUS_PORT_PRIVATE_H

#include "canbus/port.h"

/* Counts a received frame; an error frame changes port->state. RT-safe. */
void port_count_received(struct can_port *port, const struct bus_frame *frame);

/* Counts a frame that the bus has accepted. RT-safe. */
void port_count_sent(struct can_port *port, const struct bus_frame *frame);

/* Operations `descriptor` and `close` of a port that wraps another port. They call the inner
 * port. */
int port_inner_descriptor(const struct can_port *port);
void port_inner_close(struct can_port *port);

/* Checks whether a port may send a frame: valid, and FD only on an FD bus. RT-safe. */
bool port_may_send(const struct can_port *port, const struct bus_frame *frame);

#endif
