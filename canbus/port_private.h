/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the back ends of can_port: counting, and the states that error frames report. */
#ifndef CANBUS_PORT_PRIVATE_H
#define CANBUS_PORT_PRIVATE_H

#include "canbus/port.h"

/* Counts a frame that is handed to the user; an error frame moves port->state. RT-safe. */
void port_count_received(struct can_port *port, const struct bus_frame *frame);

/* Counts a frame that the bus has accepted. RT-safe. */
void port_count_sent(struct can_port *port, const struct bus_frame *frame);

/* Descriptor and close of a port in front of another: those of the other one. */
int port_inner_descriptor(const struct can_port *port);
void port_inner_close(struct can_port *port);

/* Checks whether a port may send a frame: valid, and FD only where the bus has it. RT-safe. */
bool port_may_send(const struct can_port *port, const struct bus_frame *frame);

#endif
