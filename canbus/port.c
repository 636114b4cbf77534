/* SPDX-License-Identifier: Apache-2.0 */
/* Counters and controller states, common to all ports. */
#include "canbus/port_private.h"

#include <stdatomic.h>

/* Returns the state that an error frame reports, or the present one if it reports none. */
static enum can_port_state port_state_after_error(enum can_port_state state,
                                                  const struct bus_frame *frame)
{
    const uint8_t controller = frame->len > 1 ? frame->data[1] : 0;

    if (frame->id & CAN_ERR_BUSOFF) {
        return CAN_PORT_BUS_OFF;
    }
    if (frame->id & CAN_ERR_RESTARTED) {
        return CAN_PORT_UP;
    }
    /* A stuck queue causes error states, so an error state does not end STUCK */
    if ((frame->id & CAN_ERR_CRTL) && state != CAN_PORT_STUCK) {
        if (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) {
            return CAN_PORT_PASSIVE;
        }
        if (controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) {
            return CAN_PORT_WARNING;
        }
        if (controller & CAN_ERR_CRTL_ACTIVE) {
            return CAN_PORT_UP;
        }
    }
    return state;
}

void port_count_error(struct can_port *port, const struct bus_frame *frame)
{
    port->counters.error_frames++;
    /* After the loss of the interface, ignore old error frames that are still queued */
    if (port->state != CAN_PORT_DOWN && port->state != CAN_PORT_GONE) {
        port->state = port_state_after_error(port->state, frame);
    }
}

int port_inner_descriptor(const struct can_port *port)
{
    return port->inner->ops->descriptor(port->inner);
}

void port_inner_close(struct can_port *port)
{
    port->inner->ops->close(port->inner);
}

void can_state_post(struct can_state_box *box, enum can_port_state state)
{
    const uint32_t number = (atomic_load_explicit(&box->post, memory_order_relaxed) >> 8) + 1;

    /* The top bit makes the value nonzero, because 0 means that nothing was posted. The number
     * distinguishes a repeated state from an old one */
    atomic_store_explicit(&box->post, (number & 0x7fffff) << 8 | 1u << 31 | (uint32_t)state,
                          memory_order_relaxed);
}

const char *can_port_state_name(enum can_port_state state)
{
    static const char *const names[] = {
        [CAN_PORT_UP] = "up",
        [CAN_PORT_WARNING] = "error warning",
        [CAN_PORT_PASSIVE] = "error passive",
        [CAN_PORT_BUS_OFF] = "bus-off",
        [CAN_PORT_DOWN] = "down",
        [CAN_PORT_GONE] = "gone",
        [CAN_PORT_STUCK] = "stuck: its queue does not empty",
    };

    return names[state];
}
