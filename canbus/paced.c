/* SPDX-License-Identifier: Apache-2.0 */
/* Puts a wire in virtual time in front of a port without wire time. */
#include "canbus/paced.h"

#include "canbus/port_private.h"

enum { BATCH = 64 };

struct paced {
    struct can_port port;
    struct paced_port_config config;
    struct wire *wire;
    uint64_t dropped; /* dropped by the wire, or invalid */
    void (*tap)(void *context, const struct bus_frame *frame);
    void *tap_context;
    struct bus_frame batch[BATCH];
    size_t count;
};

static struct paced *paced_of_port(const struct can_port *port)
{
    return container_of(port, struct paced, port);
}

/* Copies state and counters of the inner port, and adds the frames dropped here. */
static void paced_copy_state(struct paced *paced)
{
    paced->port.state = paced->port.inner->state;
    paced->port.counters = paced->port.inner->counters;
    paced->port.counters.tx_dropped += paced->dropped;
}

/* Sends the carried frames of the batch through the inner port. */
static void paced_send_batch(struct paced *paced)
{
    can_send(paced->port.inner, paced->batch, paced->count);
    paced->count = 0;
}

/* Adds a carried frame to the batch for sending. A received frame only goes to the tap. */
static void paced_receive_wire_event(void *context, const struct wire_event *event)
{
    struct paced *paced = context;

    if (paced->tap) {
        paced->tap(paced->tap_context, event->frame);
    }
    if (event->node == paced->config.nodes) {
        return; /* a received frame: do not send it back */
    }
    if (paced->count == BATCH) {
        paced_send_batch(paced);
    }
    paced->batch[paced->count++] = *event->frame;
}

/* Checks whether a frame bypasses the wire: an error frame, or an identifier that takes no time
 * (STEP, DONE). */
static bool paced_bypasses_wire(const struct paced *paced, const struct bus_frame *frame)
{
    return (frame->flags & FRAME_ERROR) ||
           frame_has_standard_id(frame, paced->config.bypass_id, paced->config.nbypass);
}

/* Queues frames on the wire; frames that bypass it are sent at once. Returns how many were
 * accepted. */
static size_t paced_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct paced *paced = paced_of_port(port);
    size_t accepted = 0;

    for (size_t i = 0; i < count; i++) {
        bool taken;

        if (!port_may_send(port, &frames[i]) || frames[i].node >= paced->config.nodes) {
            taken = false;
        } else if (paced_bypasses_wire(paced, &frames[i])) {
            taken = can_send(paced->port.inner, &frames[i], 1) == 1;
            accepted += taken;
            continue; /* the inner port counts the frame as sent or dropped */
        } else {
            taken = wire_transmit(paced->wire, frames[i].node, &frames[i]);
        }
        accepted += taken;
        paced->dropped += !taken;
    }
    paced_copy_state(paced);
    return accepted;
}

/* Receives from the inner port at once. The frames also occupy the wire, as frames of the last
 * controller. */
static size_t paced_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct paced *paced = paced_of_port(port);
    size_t count = can_receive(paced->port.inner, frames, max);

    for (size_t i = 0; i < count; i++) {
        if (!paced_bypasses_wire(paced, &frames[i])) {
            /* If the queue is full the frame is dropped, because the wire could not have carried
             * it */
            wire_transmit(paced->wire, paced->config.nodes, &frames[i]);
        }
    }
    paced_copy_state(paced);
    return count;
}

void paced_port_advance(struct can_port *port, int64_t now_ns)
{
    struct paced *paced = paced_of_port(port);

    wire_advance(paced->wire, now_ns);
    paced_send_batch(paced);
    paced_copy_state(paced);
}

void paced_port_tap(struct can_port *port,
                    void (*tap)(void *context, const struct bus_frame *frame), void *context)
{
    paced_of_port(port)->tap = tap;
    paced_of_port(port)->tap_context = context;
}

struct wire *paced_port_wire(const struct can_port *port)
{
    return paced_of_port(port)->wire;
}

static const struct can_port_ops paced_ops = {
    .name = "paced",
    .receive = paced_receive,
    .send = paced_send,
    .descriptor = port_inner_descriptor,
    .close = port_inner_close,
};

enum error_code paced_port_create(const struct paced_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error)
{
    struct paced *paced = arena_alloc(arena, 1, sizeof *paced);
    struct wire_config wire = {
        .bitrate = config->bitrate,
        .data_bitrate = config->data_bitrate,
        .fd = config->port->fd,
        .nodes = config->nodes + 1,
        .queue = config->queue,
        .order = config->fifo ? WIRE_FIFO : WIRE_PRIORITY,
        .notify = paced_receive_wire_event,
        .context = paced,
        .events = 1 << WIRE_TRANSMIT,
    };
    enum error_code code;

    if (!paced) {
        return error_set(error, ERROR_MEMORY, "bus %s: no memory for its wire", config->port->bus);
    }
    code = wire_create(&wire, arena, &paced->wire, error);
    if (code) {
        return error_prefix(error, "bus %s", config->port->bus);
    }
    paced->config = *config;
    paced->port = (struct can_port){
        .ops = &paced_ops, .bus = config->port->bus, .fd = config->port->fd, .inner = config->port};
    paced_copy_state(paced);
    *port = &paced->port;
    return ERROR_NONE;
}
