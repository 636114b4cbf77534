/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Implements the bus in the process. Each ordered pair of nodes has a ring with one writer and one
 * reader, so that no lock is needed. The sender gives every frame a number that is unique on the
 * bus. A receiver merges its rings by this number, so all receivers have the same order.
 *
 * In wire mode the wire is one more place on the bus. Senders write into the wire's rings, where
 * frames wait for the next advance. The wire writes the carried frames into the receivers' rings.
 */
#include "base/ring.h"
#include "canbus/port_private.h"
#include "canbus/wire/wire.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* A frame on its way to a node. */
struct local_frame {
    uint64_t number; /* position in the order of the bus; unused in rings to the wire */
    struct bus_frame frame;
};

enum { LOCAL_NODES_MAX = 256 };

/* Bits of node.signal. */
enum {
    SIGNAL_WANTED = 1, /* the next frame makes the descriptor readable */
    SIGNAL_RAISED = 2, /* frames have arrived since the node last found its inbox empty */
    SIGNAL_EVENT = 4,  /* the descriptor is readable, or a sender is about to make it readable */
};

struct local_node {
    struct can_port port;
    struct local_bus *bus;
    size_t index;
    int event;
    _Atomic uint32_t signal;
    bool event_late; /* the node has cleared SIGNAL_EVENT before the sender wrote to `event` */
    _Atomic bool open;
    _Atomic uint64_t inbox_dropped; /* frames that a full lane refused since the last receive */
    struct frame_filter filter[LOCAL_BUS_FILTERS_MAX];
    size_t nfilter;

    /* Wire mode: its controllers */
    size_t first_controller, controllers;
    uint64_t controller_mask;
    enum wire_state shown;         /* the state last reported to the port */
    _Atomic uint64_t wire_dropped; /* accepted frames that the wire lost, counted by the wire */
    uint64_t wire_dropped_seen;    /* part of wire_dropped that the port has counted */
    uint64_t wire_dropped_told;    /* drops of the wire already added to wire_dropped */
};

struct local_bus {
    const char *name;
    struct local_bus_config config;
    size_t places; /* lanes per row: max_nodes, and in wire mode one more */
    pthread_mutex_t joining;
    _Atomic size_t count;      /* number of joined nodes; all of them are complete */
    _Atomic uint64_t sequence; /* number of the next frame */
    struct local_node *nodes;
    /* Lanes, each with the frames in transit from one sender to one receiver:
     * [receiver * places + sender] */
    struct ring *lanes;

    /* Wire mode; used by the advancing thread only, except `plugged` */
    struct wire *wire;
    size_t controllers;                     /* controllers in use */
    _Atomic uint64_t plugged;               /* controllers whose port is open */
    uint64_t plugged_seen;                  /* value of `plugged` that the wire has applied */
    enum wire_state *state;                 /* state of each controller */
    uint64_t dropped_seen;                  /* drops of the wire already passed to the ports */
    uint64_t reached[LOCAL_NODES_MAX / 64]; /* mask of ports that received frames in this advance */
    void (*tap)(void *context, const struct bus_frame *frame);
    void *tap_context;
    int64_t (*listener)(void *context, const struct bus_frame *frame); /* NULL = the inbox */
    void *listener_context;
};

static inline struct ring *local_lane_between(const struct local_bus *bus, size_t receiver,
                                              size_t sender)
{
    return &bus->lanes[receiver * bus->places + sender];
}

static inline struct local_node *local_node_of_port(const struct can_port *port)
{
    return container_of(port, struct local_node, port);
}

/* Checks whether a node's filters accept a frame. Without filters, and for error frames, returns
 * true. */
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

    /* A write fails only if the counter is full, and the descriptor is then already readable */
    do {
        written = write(event, &one, sizeof one);
    } while (written < 0 && errno == EINTR);
}

/* Makes an event descriptor unreadable until it is raised again. Returns whether it was
 * readable. */
static bool local_clear_event(int event)
{
    uint64_t count;
    ssize_t got;

    do {
        got = read(event, &count, sizeof count);
    } while (got < 0 && errno == EINTR);
    return got > 0;
}

/* Puts a frame into a lane of a node. Returns false if the node does not receive it. */
static inline bool local_put_frame(struct local_node *node, struct ring *lane, uint64_t number,
                                   const struct bus_frame *frame)
{
    struct local_frame *entry;

    if (!atomic_load_explicit(&node->open, memory_order_acquire) ||
        !local_node_accepts(node, frame)) {
        return false;
    }
    entry = ring_back(lane);
    if (!entry) {
        atomic_fetch_add_explicit(&node->inbox_dropped, 1, memory_order_relaxed);
        return true;
    }
    entry->number = number;
    entry->frame = *frame;
    ring_commit(lane);
    return true;
}

/* Wakes a node that waits; now: the last value of its signal. If several senders signal, only the
 * sender that clears SIGNAL_WANTED writes to the descriptor. */
static void local_wake_node(struct local_node *node, uint32_t now)
{
    while (now & SIGNAL_WANTED) {
        const uint32_t next = (now & ~(uint32_t)SIGNAL_WANTED) | SIGNAL_EVENT;

        if (atomic_compare_exchange_weak_explicit(&node->signal, &now, next, memory_order_acq_rel,
                                                  memory_order_relaxed)) {
            local_raise_event(node->event);
            return;
        }
    }
}

/* Signals a node that frames have arrived. Both sides change `signal` with atomic read-modify-write
 * operations, so all changes have one order. Either the node sees the frames, or the sender sees
 * that the node waits, and wakes it once. */
static inline void local_signal_node(struct local_node *node)
{
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_RAISED, memory_order_acq_rel);

    if (before & SIGNAL_WANTED) {
        local_wake_node(node, before | SIGNAL_RAISED);
    }
}

static inline void local_signal_nodes(const struct local_bus *bus,
                                      const uint64_t reached[LOCAL_NODES_MAX / 64])
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t word = 0; 64 * word < nodes; word++) {
        for (uint64_t left = reached[word]; left; left &= left - 1) {
            local_signal_node(&bus->nodes[64 * word + (size_t)__builtin_ctzll(left)]);
        }
    }
}

enum { QUEUE_DEFAULT = 256, BITRATE_DEFAULT = 1000000 };

/* ---- the senders' side ---- */

static bool local_send_by_wire(struct local_node *sender, const struct bus_frame *frame)
{
    const struct local_bus *bus = sender->bus;
    struct ring *ring = local_lane_between(bus, bus->config.max_nodes, sender->index);
    struct local_frame *entry = frame->node < sender->controllers ? ring_back(ring) : NULL;

    if (!entry) {
        return false;
    }
    entry->frame = *frame;
    ring_commit(ring);
    return true;
}

static void local_count_wire_dropped(struct local_node *node)
{
    uint64_t dropped = atomic_load_explicit(&node->wire_dropped, memory_order_relaxed);

    node->port.counters.tx_dropped += dropped - node->wire_dropped_seen;
    node->wire_dropped_seen = dropped;
}

/* ---- events of the wire ---- */

/* Puts a frame of the wire into the inbox of a node. */
static void local_deliver_from_wire(struct local_bus *bus, size_t to, const struct bus_frame *frame)
{
    uint64_t number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);

    if (local_put_frame(&bus->nodes[to], local_lane_between(bus, to, bus->config.max_nodes), number,
                        frame)) {
        bus->reached[to / 64] |= UINT64_C(1) << to % 64;
    }
}

/* Hands a frame to the listener of the first node. The wire stops when the listener sends. */
static void local_deliver_to_listener(struct local_bus *bus, const struct bus_frame *frame)
{
    struct local_node *node = &bus->nodes[0];
    int64_t next_ns;

    if (atomic_load_explicit(&node->open, memory_order_relaxed)) {
        port_count_received(&node->port, frame);
        next_ns = bus->listener(bus->listener_context, frame);
        wire_stop(bus->wire, next_ns > frame->time_ns ? next_ns : frame->time_ns);
    }
}

/* Makes the error frame that SocketCAN would send for a change of a controller's state. */
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

/* Handles an event of the wire: a frame to deliver, or a controller that has changed its state. */
static void local_receive_wire_event(void *context, const struct wire_event *event)
{
    struct local_bus *bus = context;

    if (event->kind == WIRE_TRANSMIT) {
        /* Deliver a carried frame to the ports whose controllers have received it */
        const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

        for (size_t to = 0; to < nodes; to++) {
            const struct local_node *node = &bus->nodes[to];

            if (!(node->controller_mask & event->receivers) ||
                node->controller_mask >> event->node & 1) {
                continue;
            }
            if (to == 0 && bus->listener) {
                local_deliver_to_listener(bus, event->frame);
            } else {
                local_deliver_from_wire(bus, to, event->frame);
            }
        }
        if (bus->tap) {
            bus->tap(bus->tap_context, event->frame);
        }
    } else if (event->kind == WIRE_STATUS && event->node < bus->controllers) {
        /* Record a controller's new state; its port gets an error frame when that changes the
         * port's state */
        const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
        struct local_node *owner = NULL; /* of the controller */
        struct wire_event shown = *event;
        enum wire_state before;
        struct bus_frame frame;

        bus->state[event->node] = event->state;
        for (size_t i = 0; i < nodes && !owner; i++) {
            owner = bus->nodes[i].controller_mask >> event->node & 1 ? &bus->nodes[i] : NULL;
        }
        if (owner) {
            before = owner->shown;

            /* The state of a port: the worst of its controllers on the bus, bus-off if none is */
            enum wire_state worst = WIRE_ERROR_ACTIVE;
            size_t off = 0;

            for (size_t i = 0; i < owner->controllers; i++) {
                enum wire_state state = bus->state[owner->first_controller + i];

                off += state == WIRE_BUS_OFF;
                worst = state != WIRE_BUS_OFF && state > worst ? state : worst;
            }
            shown.state = off == owner->controllers ? WIRE_BUS_OFF : worst;

            if (shown.state != before) {
                owner->shown = shown.state;
                frame = local_make_state_frame(before, &shown);
                local_deliver_from_wire(bus, owner->index, &frame);
            }
        }
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

/* Adds accepted frames that the wire lost to the counters of their ports. */
static void local_report_wire_drops(struct local_bus *bus)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    const uint64_t total = wire_dropped(bus->wire);

    /* Check the controllers only if the wire has dropped frames */
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

int64_t local_bus_advance(struct local_bus *bus, int64_t now_ns)
{
    int64_t reached_ns;
    size_t nodes;

    if (!bus->wire) {
        return now_ns;
    }
    /* Apply plugs and frames first, so that the wire sees them at the time of the last advance */
    local_update_plugs(bus);
    nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    /* Move the frames that ports have sent since the last advance to their controllers. The frames
     * become ready at the time of the last advance. The order between ports does not matter,
     * because each controller belongs to one port. */
    for (size_t from = 0; from < nodes; from++) {
        struct ring *ring = local_lane_between(bus, bus->config.max_nodes, from);
        const size_t first = bus->nodes[from].first_controller;
        const struct local_frame *entry;

        while ((entry = ring_front(ring))) {
            wire_transmit(bus->wire, first + entry->frame.node, &entry->frame);
            ring_drop(ring);
        }
    }
    reached_ns = wire_advance(bus->wire, now_ns);
    if (reached_ns >= now_ns) {
        local_report_wire_drops(bus);
        local_signal_nodes(bus, bus->reached);
        memset(bus->reached, 0, sizeof bus->reached);
    }
    return reached_ns;
}

void local_bus_listen(struct local_bus *bus,
                      int64_t (*listener)(void *context, const struct bus_frame *frame),
                      void *context)
{
    bus->listener = listener;
    bus->listener_context = context;
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

static enum error_code local_wire_create(struct local_bus *bus, struct arena *arena,
                                         struct error *error)
{
    struct local_bus_config *config = &bus->config;
    struct wire_config wire = {
        .context = bus,
        .notify = local_receive_wire_event,
        .events = 1 << WIRE_TRANSMIT | 1 << WIRE_STATUS,
    };
    enum error_code code;

    /* Apply the defaults to the configuration */
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

    /* Create the wire with all controllers disconnected, because no open port can acknowledge
     * yet */
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

static enum error_code local_wire_join(struct local_bus *bus, struct local_node *node, size_t count,
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

/* ---- the port ---- */

/* Ideal mode: puts a frame into the inboxes of all other nodes and marks them in `reached`. */
static void local_send_ideal(struct local_node *sender, const struct bus_frame *frame,
                             uint64_t *reached)
{
    struct local_bus *bus = sender->bus;
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    const uint64_t number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);
    struct ring *lane = local_lane_between(bus, 0, sender->index);
    struct local_node *node = bus->nodes;

    for (size_t to = 0; to < nodes; to++, node++, lane += bus->places) {
        if (node != sender && local_put_frame(node, lane, number, frame)) {
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

        /* Error frames and the frames of the lockstep protocol bypass the wire */
        if (taken && bus->wire && !(frames[i].flags & FRAME_ERROR) &&
            !frame_has_standard_id(&frames[i], bus->config.bypass_id, bus->config.nbypass)) {
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

/* Returns the lane with the next frame in the order of the bus; NULL = all lanes are empty. *count:
 * frames in this lane. *limit: smallest number in the other lanes. */
static struct ring *local_first_lane(const struct local_node *node, uint32_t *count,
                                     uint64_t *limit)
{
    struct ring *lane = local_lane_between(node->bus, node->index, 0), *first = NULL;
    const struct ring *end = lane + node->bus->places;
    uint64_t lowest = UINT64_MAX;

    *limit = UINT64_MAX;
    for (; lane < end; lane++) {
        const struct local_frame *front = ring_front(lane);

        if (front && front->number < lowest) {
            *limit = lowest;
            *count = ring_count(lane);
            lowest = front->number;
            first = lane;
        } else if (front && front->number < *limit) {
            *limit = front->number;
        }
    }
    return first;
}

/* Merges the frames of a node's lanes in the order of the bus, at most max. Returns their
 * number. */
static size_t local_take_frames(struct local_node *node, struct bus_frame *frames, size_t max)
{
    struct ring *lane;
    size_t taken = 0;
    uint32_t count;
    uint64_t limit;

    while (taken < max && (lane = local_first_lane(node, &count, &limit))) {
        const struct local_frame *entry = ring_front(lane);

        /* Take the frames of this lane that come before the frames of all other lanes */
        do {
            frames[taken] = entry->frame;
            /* Clear the sender's controller, because the receiver may send the frame by its own
             * controllers */
            frames[taken].node = 0;
            ring_drop(lane);
            port_count_received(&node->port, &frames[taken]);
            taken++;
        } while (--count > 0 && taken < max && (entry = ring_front(lane)) && entry->number < limit);
    }
    return taken;
}

/* Receives up to max frames; lowers the node's signal once its inbox is empty. */
static size_t local_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct local_node *node = local_node_of_port(port);
    const uint32_t signal = atomic_load_explicit(&node->signal, memory_order_relaxed);
    size_t count;

    /* Lower the signal before the frames are taken, because a later frame raises it again */
    if (signal & SIGNAL_RAISED) {
        atomic_fetch_and_explicit(&node->signal, ~SIGNAL_RAISED, memory_order_acq_rel);
    }
    count = local_take_frames(node, frames, max);
    if (count == max) {
        atomic_fetch_or_explicit(&node->signal, SIGNAL_RAISED, memory_order_acq_rel);
    } else if ((signal & SIGNAL_EVENT) || node->event_late) {
        node->event_late = !local_clear_event(node->event);
        atomic_fetch_and_explicit(&node->signal, ~SIGNAL_EVENT, memory_order_acq_rel);
    }
    if (atomic_load_explicit(&node->inbox_dropped, memory_order_relaxed) > 0) {
        port->counters.rx_dropped +=
            atomic_exchange_explicit(&node->inbox_dropped, 0, memory_order_relaxed);
    }
    local_count_wire_dropped(node);
    return count;
}

/* Returns the event descriptor, which the next frame makes readable. */
static int local_descriptor(const struct can_port *port)
{
    struct local_node *node = local_node_of_port(port);
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_WANTED, memory_order_acq_rel);

    /* If frames already wait, make it readable at once */
    if ((before & SIGNAL_RAISED) && !(before & SIGNAL_EVENT)) {
        local_signal_node(node);
    }
    return node->event;
}

/* Closes a port. Its descriptor stays open until the bus is destroyed, because a sender may be
 * about to write to it. */
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
        ring_init(&bus->lanes[i], slots, sizeof(struct local_frame), (uint32_t)inbox);
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

    /* Allocate the bus with nodes and lanes; the wire needs one more place */
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

    /* Create the wire */
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

    /* Allocate a place on the bus and controllers on its wire */
    if (index == bus->config.max_nodes) {
        return error_set(error, ERROR_MEMORY, "local bus %s: all %zu places are taken", bus->name,
                         bus->config.max_nodes);
    }
    code = local_wire_join(bus, node, controllers, error);
    if (code) {
        return code;
    }

    /* Fill in the node; senders do not see it yet */
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

enum error_code local_bus_join(struct local_bus *bus, size_t nodes,
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

/* ---- saving ---- */

/* Saved frames of the rings between the nodes of one thread. This thread is writer and reader of
 * these rings, so it drains and fills them with the normal operations. Other rings do not
 * change. */

enum { SAVED_FRAMES_MAX = 2048, CONTROLLERS_MAX = 64 };

struct local_save {
    /* Copies of the bus's counts of the wire's controllers */
    uint64_t plugged_seen, dropped_seen;
    enum wire_state state[CONTROLLERS_MAX];

    size_t count;
    struct local_frame entry[SAVED_FRAMES_MAX]; /* entries of one lane after the other */
    /* After this struct: a struct local_saved_node per node, then the number of frames of each
     * saved lane */
};

struct local_saved_node {
    enum can_port_state port;
    enum wire_state shown;
    uint64_t wire_dropped_told;
};

/* Returns the array of nodes behind the saved frames. */
static struct local_saved_node *local_saved_nodes(const struct local_save *save)
{
    return (struct local_saved_node *)(uintptr_t)(save + 1);
}

/* Returns the array of frames per lane, behind the nodes. */
static uint64_t *local_saved_counts(const struct local_bus *bus, const struct local_save *save)
{
    return (uint64_t *)(uintptr_t)(local_saved_nodes(save) + bus->config.max_nodes);
}

size_t local_bus_save_size(const struct local_bus *bus)
{
    return sizeof(struct local_save) + bus->config.max_nodes * sizeof(struct local_saved_node) +
           bus->places * bus->places * sizeof(uint64_t);
}

/* Checks whether the calling thread is writer and reader of a lane: both ends are nodes below `own`
 * or the wire, which has the last place. */
static bool local_lane_is_own(const struct local_bus *bus, size_t own, size_t to, size_t from)
{
    size_t wire = bus->config.max_nodes;

    return to != from && (to < own || to == wire) && (from < own || from == wire);
}

/* Copies the frames of a lane without removing them; false = no room. */
static bool local_save_lane(const struct ring *lane, struct local_save *save, uint64_t *count)
{
    uint32_t tail = atomic_load_explicit(&lane->tail, memory_order_relaxed);

    *count = ring_count(lane);
    if (*count > SAVED_FRAMES_MAX - save->count) {
        return false;
    }
    for (uint32_t i = 0; i < *count; i++) {
        const struct local_frame *slots = (const struct local_frame *)(const void *)lane->slots;

        save->entry[save->count++] = slots[(tail + i) & lane->mask];
    }
    return true;
}

bool local_bus_save(const struct local_bus *bus, size_t own, void *memory)
{
    struct local_save *save = memory;
    uint64_t *count = local_saved_counts(bus, save);

    /* Save the bus's counts of the wire */
    save->count = 0;
    save->plugged_seen = bus->plugged_seen;
    save->dropped_seen = bus->dropped_seen;
    if (bus->wire) {
        memcpy(save->state, bus->state, bus->config.wire_nodes * sizeof *bus->state);
    }
    /* Save the nodes */
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct local_node *node = &bus->nodes[n];

        local_saved_nodes(save)[n] =
            (struct local_saved_node){.port = n < own ? node->port.state : CAN_PORT_UP,
                                      .shown = node->shown,
                                      .wire_dropped_told = node->wire_dropped_told};
    }
    /* Save the frames in the lanes of the calling thread */
    for (size_t i = 0; i < bus->places * bus->places; i++) {
        if (local_lane_is_own(bus, own, i / bus->places, i % bus->places) &&
            !local_save_lane(&bus->lanes[i], save, &count[i])) {
            return false;
        }
    }
    return true;
}

void local_bus_restore(struct local_bus *bus, size_t own, const void *memory)
{
    const struct local_save *save = memory;
    const uint64_t *count = local_saved_counts(bus, save);
    const struct local_frame *entry = save->entry;

    /* Restore the bus's counts of the wire */
    bus->plugged_seen = save->plugged_seen;
    bus->dropped_seen = save->dropped_seen;
    if (bus->wire) {
        memcpy(bus->state, save->state, bus->config.wire_nodes * sizeof *bus->state);
    }

    /* Restore the nodes; counters continue, and ports of other threads keep their state */
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct local_saved_node *kept = &local_saved_nodes(save)[n];

        bus->nodes[n].shown = kept->shown;
        bus->nodes[n].wire_dropped_told = kept->wire_dropped_told;
        if (n < own) {
            bus->nodes[n].port.state = kept->port;
        }
    }

    /* Replace the frames in the own lanes */
    for (size_t i = 0; i < bus->places * bus->places; i++) {
        struct ring *ring = &bus->lanes[i];

        if (!local_lane_is_own(bus, own, i / bus->places, i % bus->places)) {
            continue;
        }
        while (ring_front(ring)) {
            ring_drop(ring);
        }
        for (uint64_t k = 0; k < count[i]; k++) {
            ring_push(ring, entry++);
        }
    }
}
