/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus in the process. For each ordered pair of nodes there is one ring with one writer and one
 * reader, so that no lock is needed. The sender stamps every frame with a number of the whole bus;
 * a receiver merges its rings by that number and so sees one order.
 *
 * In wire mode (local_wire.c) the wire is one more place in that square: senders write into the
 * rings that it reads, and what it has carried it writes into the receivers' rings.
 */
#include "canbus/local_private.h"

#include <errno.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Checks whether a node's filters let a frame pass; without filters, and for error frames, all
 * do. */
static bool local_node_accepts(const struct local_node *node, const struct bus_frame *frame)
{
    const bool extended = frame->flags & FRAME_EXTENDED;

    if (!node->nfilter || (frame->flags & FRAME_ERROR)) {
        return true;
    }
    for (size_t i = 0; i < node->nfilter; i++) {
        const struct frame_filter *filter = &node->filter[i];

        if (filter->extended == extended && !((frame->id ^ filter->id) & filter->mask)) {
            return true;
        }
    }
    return false;
}

/* Makes an event descriptor readable. */
static void local_raise_event(int event)
{
    const uint64_t one = 1;
    ssize_t written;

    /* Fails only when the counter is full, and then the descriptor is readable anyway */
    do {
        written = write(event, &one, sizeof one);
    } while (written < 0 && errno == EINTR);
}

/* Makes an event descriptor unreadable until it is raised again. */
static void local_clear_event(int event)
{
    uint64_t count;
    ssize_t got;

    do {
        got = read(event, &count, sizeof count);
    } while (got < 0 && errno == EINTR);
}

bool local_put_frame(const struct local_bus *bus, size_t receiver, size_t sender, uint64_t number,
                     const struct bus_frame *frame)
{
    const struct local_node *node = &bus->nodes[receiver];
    struct local_lane *lane = local_lane_between(bus, receiver, sender);
    struct local_frame *entry;

    if (!atomic_load_explicit(&node->open, memory_order_acquire) ||
        !local_node_accepts(node, frame)) {
        return false;
    }
    entry = ring_back(&lane->ring);
    if (!entry) {
        atomic_fetch_add_explicit(&lane->dropped, 1, memory_order_relaxed);
        return true;
    }
    entry->number = number;
    entry->frame = *frame;
    ring_commit(&lane->ring);
    return true;
}

/* Signals a node that frames have arrived. Both sides change `signal` by read-modify-write
 * operations, which have one order: either the node sees the frames, or this side sees that the
 * node had found nothing, and wakes it. */
static void local_signal_node(struct local_node *node)
{
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_RAISED, memory_order_acq_rel);

    if ((before & SIGNAL_WANTED) && !(before & SIGNAL_RAISED)) {
        local_raise_event(node->event);
    }
}

void local_signal_nodes(const struct local_bus *bus, const uint64_t reached[LOCAL_NODES_MAX / 64])
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t word = 0; 64 * word < nodes; word++) {
        for (uint64_t left = reached[word]; left; left &= left - 1) {
            local_signal_node(&bus->nodes[64 * word + (size_t)__builtin_ctzll(left)]);
        }
    }
}

/* Ideal mode: puts a frame into the inboxes of all other nodes, each of which is marked in
 * `reached`. */
static void local_send_ideal(struct local_node *sender, const struct bus_frame *frame,
                             uint64_t *reached)
{
    struct local_bus *bus = sender->bus;
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    const uint64_t number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);

    for (size_t to = 0; to < nodes; to++) {
        if (to != sender->index && local_put_frame(bus, to, sender->index, number, frame)) {
            reached[to / 64] |= UINT64_C(1) << to % 64;
        }
    }
}

/* Sends frames to all other nodes at once, or through the wire in wire mode; returns how many
 * were accepted. */
static size_t local_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct local_node *sender = local_node_of_port(port);
    const struct local_bus *bus = sender->bus;
    uint64_t reached[LOCAL_NODES_MAX / 64] = {0};
    size_t accepted = 0;

    for (size_t i = 0; i < count; i++) {
        bool taken = port_may_send(port, &frames[i]);

        if (taken && bus->wire && !local_bypasses_wire(bus, &frames[i])) {
            taken = local_send_by_wire(sender, &frames[i]);
        } else if (taken) {
            local_send_ideal(sender, &frames[i], reached);
        }
        if (!taken) {
            port->counters.tx_dropped++;
            continue;
        }
        port_count_sent(port, &frames[i]);
        accepted++;
    }
    local_signal_nodes(bus, reached);
    local_count_wire_dropped(sender);
    return accepted;
}

/* Returns the lane of a node whose oldest frame comes first in the order of the bus, NULL when
 * all are empty. `count` is how many frames it holds; those with a number below `limit` come
 * before every other lane's. */
static struct local_lane *local_first_lane(const struct local_node *node, uint32_t *count,
                                           uint64_t *limit)
{
    const struct local_bus *bus = node->bus;
    uint64_t lowest = UINT64_MAX;
    struct local_lane *first = NULL;

    *limit = UINT64_MAX;
    for (size_t from = 0; from < bus->places; from++) {
        struct local_lane *lane = local_lane_between(bus, node->index, from);
        const uint32_t waiting = ring_count(&lane->ring);
        uint64_t number;

        if (!waiting) {
            continue;
        }
        number = ((const struct local_frame *)ring_front(&lane->ring))->number;
        if (number < lowest) {
            *limit = lowest;
            *count = waiting;
            lowest = number;
            first = lane;
        } else if (number < *limit) {
            *limit = number;
        }
    }
    return first;
}

/* Adds frames that full lanes have dropped since the last call to the port's counters. */
static void local_count_inbox_drops(struct local_node *node)
{
    for (size_t from = 0; from < node->bus->places; from++) {
        struct local_lane *lane = local_lane_between(node->bus, node->index, from);
        uint64_t dropped = atomic_load_explicit(&lane->dropped, memory_order_relaxed);

        node->port.counters.rx_dropped += dropped - lane->dropped_seen;
        lane->dropped_seen = dropped;
    }
}

/* Merges the frames of a node's lanes in the order of the bus; returns how many were taken, at
 * most max. */
static size_t local_take_frames(struct local_node *node, struct bus_frame *frames, size_t max)
{
    struct local_lane *lane;
    size_t taken = 0;
    uint32_t count;
    uint64_t limit;

    while (taken < max && (lane = local_first_lane(node, &count, &limit))) {
        const struct local_frame *entry = ring_front(&lane->ring);

        /* Take as many from this lane as come before every other lane's */
        do {
            frames[taken] = entry->frame;
            /* the sender's controller; the receiver may pass the frame on under its own */
            frames[taken].node = 0;
            ring_drop(&lane->ring);
            port_count_received(&node->port, &frames[taken]);
            taken++;
        } while (--count > 0 && taken < max && (entry = ring_front(&lane->ring)) &&
                 entry->number < limit);
    }
    return taken;
}

/* Receives up to max frames; lowers the node's signal once its inbox is empty. */
static size_t local_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct local_node *node = local_node_of_port(port);
    size_t count = local_take_frames(node, frames, max);

    if (count < max) {
        uint32_t signal = atomic_load_explicit(&node->signal, memory_order_relaxed);

        /* The inbox is empty: lower the signal, then look once more for what came meanwhile. A
         * wake-up that was written late is cleared by the call that finds nothing. */
        if ((signal & SIGNAL_RAISED) || !count) {
            if (signal & SIGNAL_WANTED) {
                local_clear_event(node->event);
            }
            atomic_fetch_and_explicit(&node->signal, ~(uint32_t)SIGNAL_RAISED,
                                      memory_order_acq_rel);
            count += local_take_frames(node, frames + count, max - count);
        }
    }
    local_count_inbox_drops(node);
    local_count_wire_dropped(node);
    return count;
}

/* Returns the event descriptor; from now on the node is woken when frames arrive. */
static int local_descriptor(const struct can_port *port)
{
    struct local_node *node = local_node_of_port(port);
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_WANTED, memory_order_acq_rel);

    if (!(before & SIGNAL_WANTED) && (before & SIGNAL_RAISED)) {
        local_raise_event(node->event);
    }
    return node->event;
}

/* Closes a port. Its descriptor stays open until the bus is destroyed, as a sender may be about
 * to write to it. */
static void local_close(struct can_port *port)
{
    struct local_node *node = local_node_of_port(port);

    atomic_store_explicit(&node->open, false, memory_order_release);
    atomic_fetch_and_explicit(&node->bus->plugged, ~node->controller_mask, memory_order_release);
}

/* ---- creation ---- */

static const struct can_port_ops local_ops = {
    .name = "local",
    .receive = local_receive,
    .send = local_send,
    .descriptor = local_descriptor,
    .close = local_close,
};

/* Allocates the ring of frames of each ordered pair of different places. */
static bool local_create_lanes(struct local_bus *bus, size_t inbox, struct arena *arena)
{
    const size_t lanes = bus->places * bus->places;

    bus->lanes = arena_alloc(arena, lanes, sizeof *bus->lanes);
    if (!bus->lanes) {
        return false;
    }
    for (size_t i = 0; i < lanes; i++) {
        void *slots;

        if (i / bus->places == i % bus->places) {
            continue;
        }
        slots = arena_alloc(arena, inbox, sizeof(struct local_frame));
        if (!slots) {
            return false;
        }
        ring_init(&bus->lanes[i].ring, slots, sizeof(struct local_frame), (uint32_t)inbox);
    }
    return true;
}

/* Checks the numbers of nodes and bypassed identifiers, and that the inbox is a power of two. */
static enum error_code local_check_config(const struct local_bus_config *config,
                                          struct error *error)
{
    if (config->max_nodes < 1 || config->max_nodes > LOCAL_NODES_MAX) {
        return error_set(error, ERROR_INPUT, "local bus %s: %zu nodes, expected 1 to %d",
                         config->name, config->max_nodes, LOCAL_NODES_MAX);
    }
    if (config->inbox < 1 || config->inbox > 1 << 20 || (config->inbox & (config->inbox - 1))) {
        return error_set(error, ERROR_INPUT,
                         "local bus %s: an inbox of %zu frames, expected a power of two up to 2^20",
                         config->name, config->inbox);
    }
    if (config->nbypass > LOCAL_BUS_BYPASS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "local bus %s: %zu identifiers of the bypass, expected at most %d",
                         config->name, config->nbypass, LOCAL_BUS_BYPASS_MAX);
    }
    return ERROR_NONE;
}

enum error_code local_bus_create(const struct local_bus_config *config, struct arena *arena,
                                 struct local_bus **bus, struct error *error)
{
    const bool wire = config->mode == LOCAL_BUS_WIRE;
    enum error_code code = local_check_config(config, error);
    struct local_bus *created;

    if (code) {
        return code;
    }

    /* The bus with its nodes and lanes; the wire takes one more place */
    created = arena_alloc(arena, 1, sizeof *created);
    if (created) {
        created->name = arena_strdup(arena, config->name);
        created->config = *config;
        created->config.name = created->name;
        created->places = config->max_nodes + wire;
        created->nodes = arena_alloc(arena, config->max_nodes, sizeof *created->nodes);
    }
    if (!created || !created->name || !created->nodes ||
        !local_create_lanes(created, config->inbox, arena)) {
        return error_set(error, ERROR_MEMORY,
                         "local bus %s: no memory for %zu nodes with an inbox of %zu frames",
                         config->name, config->max_nodes, config->inbox);
    }

    /* The wire */
    if (wire) {
        code = local_wire_create(created, arena, error);
        if (code) {
            return code;
        }
    }
    pthread_mutex_init(&created->joining, NULL);
    *bus = created;
    return ERROR_NONE;
}

/* Fills in the next node and publishes it to senders. The caller holds the mutex. */
static enum error_code local_add_node(struct local_bus *bus, size_t controllers,
                                      const struct frame_filter *filter, size_t nfilter,
                                      struct can_port **port, struct error *error)
{
    const size_t index = atomic_load_explicit(&bus->count, memory_order_relaxed);
    struct local_node *node = &bus->nodes[index];
    enum error_code code;

    /* A place on the bus and controllers on its wire */
    if (index == bus->config.max_nodes) {
        return error_set(error, ERROR_MEMORY, "local bus %s: all %zu places are taken", bus->name,
                         bus->config.max_nodes);
    }
    code = local_wire_join(bus, node, controllers, error);
    if (code) {
        return code;
    }

    /* The node, invisible to senders until all of it is there */
    node->event = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (node->event < 0) {
        return error_set_errno(error, errno, "local bus %s: cannot create an event descriptor",
                               bus->name);
    }
    node->port = (struct can_port){
        .ops = &local_ops,
        .bus = bus->name,
        .fd = bus->config.fd,
        .state = CAN_PORT_UP,
    };
    node->bus = bus;
    node->index = index;
    node->nfilter = nfilter;
    for (size_t i = 0; i < nfilter; i++) {
        node->filter[i] = filter[i];
    }

    /* Publish it: from now on senders put frames into its lanes */
    atomic_store_explicit(&node->open, true, memory_order_relaxed);
    atomic_store_explicit(&bus->count, index + 1, memory_order_release);
    atomic_fetch_or_explicit(&bus->plugged, node->controller_mask, memory_order_release);
    *port = &node->port;
    return ERROR_NONE;
}

enum error_code local_bus_join_nodes(struct local_bus *bus, size_t nodes,
                                     const struct frame_filter *filter, size_t nfilter,
                                     struct can_port **port, struct error *error)
{
    enum error_code code;

    if (nfilter > LOCAL_BUS_FILTERS_MAX) {
        return error_set(error, ERROR_INPUT, "local bus %s: %zu filters, expected at most %d",
                         bus->name, nfilter, LOCAL_BUS_FILTERS_MAX);
    }
    pthread_mutex_lock(&bus->joining);
    code = local_add_node(bus, nodes, filter, nfilter, port, error);
    pthread_mutex_unlock(&bus->joining);
    return code;
}

enum error_code local_bus_join(struct local_bus *bus, const struct frame_filter *filter,
                               size_t nfilter, struct can_port **port, struct error *error)
{
    return local_bus_join_nodes(bus, 1, filter, nfilter, port, error);
}

void local_bus_destroy(struct local_bus *bus)
{
    if (!bus) {
        return;
    }
    for (size_t i = 0; i < atomic_load(&bus->count); i++) {
        atomic_store(&bus->nodes[i].open, false);
        close(bus->nodes[i].event);
    }
    pthread_mutex_destroy(&bus->joining);
}
