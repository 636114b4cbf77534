/* SPDX-License-Identifier: Apache-2.0 */
/* The local bus in wire mode: frames go into the rings that the wire reads, wait there for the
 * next advance, and go from the wire into the inboxes of those that have received them. */
#include "canbus/local_private.h"

#include <linux/can/error.h>

#include <string.h>

enum { QUEUE_DEFAULT = 256, BITRATE_DEFAULT = 1000000 };

/* ---- the senders' side ---- */

bool local_bypasses_wire(const struct local_bus *bus, const struct bus_frame *frame)
{
    return frame_has_standard_id(frame, bus->config.bypass_id, bus->config.nbypass) ||
           (frame->flags & FRAME_ERROR);
}

bool local_send_by_wire(struct local_node *sender, const struct bus_frame *frame)
{
    const struct local_bus *bus = sender->bus;
    struct ring *ring = &local_lane_between(bus, bus->config.max_nodes, sender->index)->ring;
    struct local_frame *entry = frame->node < sender->controllers ? ring_back(ring) : NULL;

    if (!entry) {
        return false;
    }
    entry->frame = *frame;
    ring_commit(ring);
    return true;
}

void local_count_wire_dropped(struct local_node *node)
{
    uint64_t dropped = atomic_load_explicit(&node->wire_dropped, memory_order_relaxed);

    node->port.counters.tx_dropped += dropped - node->wire_dropped_seen;
    node->wire_dropped_seen = dropped;
}

/* ---- events of the wire ---- */

/* Returns the node that owns a controller of the wire; NULL = none. */
static struct local_node *local_owner_of(const struct local_bus *bus, size_t controller)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t i = 0; i < nodes; i++) {
        if (bus->nodes[i].controller_mask >> controller & 1) {
            return &bus->nodes[i];
        }
    }
    return NULL;
}

/* Puts a frame of the wire into the inbox of a node. */
static void local_deliver_from_wire(struct local_bus *bus, size_t to, const struct bus_frame *frame)
{
    uint64_t number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);

    if (local_put_frame(bus, to, bus->config.max_nodes, number, frame)) {
        bus->reached[to / 64] |= UINT64_C(1) << to % 64;
    }
}

/* Delivers a frame that the wire has carried to the ports whose controllers have received it. */
static void local_deliver_carried(struct local_bus *bus, const struct wire_event *event)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t to = 0; to < nodes; to++) {
        const struct local_node *node = &bus->nodes[to];

        if ((node->controller_mask & event->receivers) &&
            !(node->controller_mask >> event->node & 1)) {
            local_deliver_from_wire(bus, to, event->frame);
        }
    }
    if (bus->tap) {
        bus->tap(bus->tap_context, event->frame);
    }
}

/* Makes the error frame by which SocketCAN would report a change of a controller's state. */
static struct bus_frame local_make_state_frame(enum wire_state before,
                                               const struct wire_event *event)
{
    struct bus_frame frame = {.flags = FRAME_ERROR, .len = 8, .time_ns = event->time_ns};
    const bool receiver = event->rec > event->tec;

    switch (event->state) {
    case WIRE_BUS_OFF:
        frame.id = CAN_ERR_BUSOFF;
        return frame;
    case WIRE_ERROR_PASSIVE:
        frame.data[1] = receiver ? CAN_ERR_CRTL_RX_PASSIVE : CAN_ERR_CRTL_TX_PASSIVE;
        break;
    case WIRE_ERROR_WARNING:
        frame.data[1] = receiver ? CAN_ERR_CRTL_RX_WARNING : CAN_ERR_CRTL_TX_WARNING;
        break;
    case WIRE_ERROR_ACTIVE:
        frame.data[1] = CAN_ERR_CRTL_ACTIVE;
        break;
    }
    frame.id = CAN_ERR_CRTL;
    if (before == WIRE_BUS_OFF && event->state == WIRE_ERROR_ACTIVE) {
        frame.id |= CAN_ERR_RESTARTED;
    }
    frame.data[6] = (uint8_t)(event->tec > 255 ? 255 : event->tec);
    frame.data[7] = (uint8_t)event->rec;
    return frame;
}

/* Returns the state of a port: the worst of its controllers that are on the bus, bus-off when
 * none is. */
static enum wire_state local_port_wire_state(const struct local_bus *bus,
                                             const struct local_node *node)
{
    enum wire_state worst = WIRE_ERROR_ACTIVE;
    size_t off = 0;

    for (size_t i = 0; i < node->controllers; i++) {
        enum wire_state state = bus->state[node->first_controller + i];

        off += state == WIRE_BUS_OFF;
        worst = state != WIRE_BUS_OFF && state > worst ? state : worst;
    }
    return off == node->controllers ? WIRE_BUS_OFF : worst;
}

/* Records a controller's new state; its port gets an error frame when that changes the port's
 * state. */
static void local_report_state(struct local_bus *bus, const struct wire_event *event)
{
    struct local_node *owner = local_owner_of(bus, event->node);
    struct wire_event shown = *event;
    enum wire_state before;
    struct bus_frame frame;

    bus->state[event->node] = event->state;
    if (!owner) {
        return;
    }
    before = owner->shown;
    shown.state = local_port_wire_state(bus, owner);
    if (shown.state != before) {
        owner->shown = shown.state;
        frame = local_make_state_frame(before, &shown);
        local_deliver_from_wire(bus, owner->index, &frame);
    }
}

/* Handles an event of the wire: a frame to deliver, or a controller that has changed its state. */
static void local_receive_wire_event(void *context, const struct wire_event *event)
{
    struct local_bus *bus = context;

    if (event->kind == WIRE_TRANSMIT) {
        local_deliver_carried(bus, event);
    } else if (event->kind == WIRE_STATUS && event->node < bus->controllers) {
        local_report_state(bus, event);
    }
}

/* ---- the advance ---- */

/* Connects the controllers of ports that were opened, disconnects those of ports that were
 * closed. */
static void local_update_plugs(struct local_bus *bus)
{
    const uint64_t plugged = atomic_load_explicit(&bus->plugged, memory_order_acquire);
    const uint64_t changed = plugged ^ bus->plugged_seen;

    for (size_t i = 0; changed >> i; i++) {
        if (changed >> i & 1) {
            wire_connect(bus->wire, i, plugged >> i & 1);
        }
    }
    bus->plugged_seen = plugged;
}

/* Adds what the wire has dropped of accepted frames to the counters of their ports. */
static void local_report_wire_drops(struct local_bus *bus)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    const uint64_t total = wire_dropped(bus->wire);

    /* Look at the controllers only when the wire has dropped anything */
    if (total == bus->dropped_seen) {
        return;
    }
    bus->dropped_seen = total;
    for (size_t i = 0; i < nodes; i++) {
        struct local_node *node = &bus->nodes[i];
        uint64_t dropped = 0;

        for (size_t k = 0; k < node->controllers; k++) {
            struct wire_node_stats of_node;

            wire_node_stats(bus->wire, node->first_controller + k, &of_node);
            for (int drop = 0; drop < WIRE_DROPS; drop++) {
                dropped += of_node.dropped[drop];
            }
        }
        atomic_fetch_add_explicit(&node->wire_dropped, dropped - node->wire_dropped_told,
                                  memory_order_relaxed);
        node->wire_dropped_told = dropped;
    }
}

/* Hands what a port has sent since the last advance to its controllers; the frames become ready
 * at the time up to which the wire was advanced. The order between ports does not matter, as no
 * controller belongs to two. */
static void local_transmit_waiting(struct local_bus *bus, size_t sender)
{
    struct ring *ring = &local_lane_between(bus, bus->config.max_nodes, sender)->ring;
    const size_t first = bus->nodes[sender].first_controller;
    const struct local_frame *entry;

    while ((entry = ring_front(ring))) {
        wire_transmit(bus->wire, first + entry->frame.node, &entry->frame);
        ring_drop(ring);
    }
}

void local_bus_advance(struct local_bus *bus, int64_t now_ns)
{
    size_t nodes;

    if (!bus->wire) {
        return;
    }
    /* Plugs and frames first, so that the wire sees them at the time of the last advance */
    local_update_plugs(bus);
    nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    for (size_t from = 0; from < nodes; from++) {
        local_transmit_waiting(bus, from);
    }
    wire_advance(bus->wire, now_ns);
    local_report_wire_drops(bus);
    local_signal_nodes(bus, bus->reached);
    memset(bus->reached, 0, sizeof bus->reached);
}

struct wire *local_bus_wire(const struct local_bus *bus)
{
    return bus->wire;
}

void local_bus_tap(struct local_bus *bus, void (*tap)(void *context, const struct bus_frame *frame),
                   void *context)
{
    bus->tap = tap;
    bus->tap_context = context;
}

/* ---- creation ---- */

enum error_code local_wire_create(struct local_bus *bus, struct arena *arena, struct error *error)
{
    struct local_bus_config *config = &bus->config;
    struct wire_config wire = {
        .context = bus,
        .notify = local_receive_wire_event,
        .events = 1 << WIRE_TRANSMIT | 1 << WIRE_STATUS,
    };
    enum error_code code;

    /* The configuration with its defaults */
    config->bitrate = config->bitrate ? config->bitrate : BITRATE_DEFAULT;
    config->wire_nodes = config->wire_nodes ? config->wire_nodes : config->max_nodes;
    wire.bitrate = config->bitrate;
    wire.data_bitrate = config->data_bitrate;
    wire.fd = config->fd;
    wire.nodes = config->wire_nodes;
    wire.queue = config->queue ? config->queue : QUEUE_DEFAULT;
    wire.order = config->fifo ? WIRE_FIFO : WIRE_PRIORITY;
    wire.restart_delay_ns = config->restart_delay_ns;
    wire.seed = config->seed;

    /* The wire with its controllers, all disconnected: no port is open yet that could
     * acknowledge */
    code = wire_create(&wire, arena, &bus->wire, error);
    if (code) {
        return error_prefix(error, "local bus %s", config->name);
    }
    bus->state = arena_alloc(arena, config->wire_nodes, sizeof *bus->state);
    if (!bus->state) {
        return error_set(error, ERROR_MEMORY, "local bus %s: no memory for its wire", config->name);
    }
    for (size_t i = 0; i < config->wire_nodes; i++) {
        wire_connect(bus->wire, i, false);
    }
    return ERROR_NONE;
}

enum error_code local_wire_join(struct local_bus *bus, struct local_node *node, size_t count,
                                struct error *error)
{
    if (!bus->wire) {
        return ERROR_NONE;
    }
    if (count < 1 || count > bus->config.wire_nodes - bus->controllers) {
        return error_set(error, ERROR_MEMORY,
                         "local bus %s: %zu controllers wanted, %zu of %zu are left", bus->name,
                         count, bus->config.wire_nodes - bus->controllers, bus->config.wire_nodes);
    }
    node->first_controller = bus->controllers;
    node->controllers = count;
    node->controller_mask = ((UINT64_C(1) << count) - 1) << bus->controllers;
    bus->controllers += count;
    return ERROR_NONE;
}
