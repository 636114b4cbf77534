/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus in the process. For each ordered pair of nodes there is one ring with one writer and one
 * reader, so that no lock is needed. The sender stamps every frame with a number of the whole bus;
 * a receiver merges its rings by that number and so sees one order.
 *
 * In wire mode the wire is one more place in that square: senders write into the rings that it
 * reads, stamped with the time, and what it has carried it writes into the receivers' rings.
 */
#include "base/ring.h"
#include "canbus/port_private.h"
#include "canbus/wire.h"

#include <linux/can/error.h>

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* A frame on its way to a node. */
struct parcel {
    uint64_t number; /* place in the order of the bus */
    struct bus_frame frame;
};

enum { NODES_MAX = 256, QUEUE_DEFAULT = 256, BITRATE_DEFAULT = 1000000 };

/* Bits of node.signal. */
enum {
    SIGNAL_WANTED = 1, /* somebody may sleep on the descriptor */
    SIGNAL_RAISED = 2, /* frames were put in since the node last found nothing */
};

/* From one sender to one receiver. head is the receiver's: the oldest parcel, already taken out of
 * the ring to compare its number with those of other senders. */
struct lane {
    struct ring ring;
    struct parcel head;
    bool has_head;
    _Atomic uint64_t dropped; /* the sender's count of what the full ring refused */
    uint64_t dropped_seen;    /* the receiver's: what it has counted of that */
};

struct node {
    struct can_port port;
    struct local_bus *bus;
    size_t index;
    int event;
    _Atomic uint32_t signal;
    _Atomic bool open;
    struct frame_filter filter[LOCAL_BUS_FILTERS_MAX];
    size_t nfilter;

    /* wire mode: its controllers */
    size_t first_controller, controllers;
    uint64_t controller_mask;
    enum wire_state shown;         /* the state last reported to the port */
    _Atomic uint64_t wire_dropped; /* the wire's count of what it lost of accepted frames */
    uint64_t wire_dropped_seen;    /* the port's: what it has counted of that */
};

struct local_bus {
    const char *name;
    struct local_bus_config config;
    size_t places; /* in each row of lanes: the nodes, and the wire where there is one */
    pthread_mutex_t joining;
    _Atomic size_t count;      /* nodes that have joined; complete up to here */
    _Atomic uint64_t sequence; /* number of the next frame */
    struct node *nodes;
    struct lane *lanes; /* [receiver * places + sender] */

    /* wire mode; but for now_ns and plugged of the thread that advances */
    struct wire *wire;
    size_t controllers;               /* given out */
    _Atomic int64_t now_ns;           /* up to where the wire was advanced */
    _Atomic uint64_t plugged;         /* controllers whose port is open */
    uint64_t plugged_seen;            /* what the wire knows of that */
    enum wire_state *state;           /* of each controller */
    uint64_t dropped_seen;            /* of the wire's drops, what was handed on to the ports */
    uint64_t reached[NODES_MAX / 64]; /* ports that received something in this advance */
    void (*tap)(void *context, const struct bus_frame *frame);
    void *tap_context;
};

static struct node *node_of(struct can_port *port)
{
    return (struct node *)((char *)port - offsetof(struct node, port));
}

static const struct node *const_node_of(const struct can_port *port)
{
    return (const struct node *)((const char *)port - offsetof(struct node, port));
}

static struct lane *lane_of(const struct local_bus *bus, size_t receiver, size_t sender)
{
    return &bus->lanes[receiver * bus->places + sender];
}

static bool node_accepts(const struct node *node, const struct bus_frame *frame)
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

static void event_raise(int event)
{
    const uint64_t one = 1;
    ssize_t written;

    /* fails only when the counter is full, and then the descriptor is readable anyway */
    do {
        written = write(event, &one, sizeof one);
    } while (written < 0 && errno == EINTR);
}

static void event_clear(int event)
{
    uint64_t count;
    ssize_t got;

    do {
        got = read(event, &count, sizeof count);
    } while (got < 0 && errno == EINTR);
}

/* Puts one parcel into the inbox of a node; false when the node does not want it. */
static bool node_put(const struct local_bus *bus, size_t receiver, size_t sender,
                     const struct parcel *parcel)
{
    const struct node *node = &bus->nodes[receiver];
    struct lane *lane = lane_of(bus, receiver, sender);

    if (!atomic_load_explicit(&node->open, memory_order_acquire) ||
        !node_accepts(node, &parcel->frame)) {
        return false;
    }
    if (!ring_push(&lane->ring, parcel)) {
        atomic_fetch_add_explicit(&lane->dropped, 1, memory_order_relaxed);
    }
    return true;
}

/* Tells a node that frames are there. Both sides change `signal` by read-modify-write, which are in
 * one order: either the node sees our frames, or we see that it had found nothing and wake it. */
static void node_signal(struct node *node)
{
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_RAISED, memory_order_acq_rel);

    if ((before & SIGNAL_WANTED) && !(before & SIGNAL_RAISED)) {
        event_raise(node->event);
    }
}

static void signal_reached(const struct local_bus *bus, const uint64_t *reached)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t to = 0; to < nodes; to++) {
        if (reached[to / 64] >> to % 64 & 1) {
            node_signal(&bus->nodes[to]);
        }
    }
}

static bool bypasses_wire(const struct local_bus *bus, const struct bus_frame *frame)
{
    for (size_t i = 0; i < bus->config.nbypass; i++) {
        if (frame->id == bus->config.bypass_id[i] && !(frame->flags & FRAME_EXTENDED)) {
            return true;
        }
    }
    return (frame->flags & FRAME_ERROR) != 0;
}

/* To all other nodes at once, each of which is marked in `reached`. */
static void send_at_once(struct node *sender, struct parcel *parcel, uint64_t *reached)
{
    struct local_bus *bus = sender->bus;
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    parcel->number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);
    for (size_t to = 0; to < nodes; to++) {
        if (to != sender->index && node_put(bus, to, sender->index, parcel)) {
            reached[to / 64] |= UINT64_C(1) << to % 64;
        }
    }
}

/* Into the ring that the wire reads; false when it is full. */
static bool send_by_wire(struct node *sender, struct parcel *parcel)
{
    struct local_bus *bus = sender->bus;
    struct lane *lane = lane_of(bus, bus->config.max_nodes, sender->index);

    parcel->frame.time_ns = atomic_load_explicit(&bus->now_ns, memory_order_acquire);
    parcel->number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);
    return parcel->frame.node < sender->controllers && ring_push(&lane->ring, parcel);
}

static void count_wire_dropped(struct node *node)
{
    uint64_t dropped = atomic_load_explicit(&node->wire_dropped, memory_order_relaxed);

    node->port.counters.tx_dropped += dropped - node->wire_dropped_seen;
    node->wire_dropped_seen = dropped;
}

static size_t local_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct node *sender = node_of(port);
    const struct local_bus *bus = sender->bus;
    uint64_t reached[NODES_MAX / 64] = {0}; /* bit set of the nodes that got something */
    size_t accepted = 0;

    for (size_t i = 0; i < count; i++) {
        struct parcel parcel;
        bool taken = port_may_send(port, &frames[i]);

        if (taken) {
            parcel.frame = frames[i];
            if (!bus->wire || bypasses_wire(bus, &frames[i])) {
                send_at_once(sender, &parcel, reached);
            } else {
                taken = send_by_wire(sender, &parcel);
            }
        }
        if (!taken) {
            port->counters.tx_dropped++;
            continue;
        }
        port_count_sent(port, &frames[i]);
        accepted++;
    }
    signal_reached(bus, reached);
    count_wire_dropped(sender);
    return accepted;
}

static bool comes_before(const struct parcel *a, const struct parcel *b, bool by_time)
{
    if (by_time && a->frame.time_ns != b->frame.time_ns) {
        return a->frame.time_ns < b->frame.time_ns;
    }
    return a->number < b->number;
}

/* The lane to a place (a node, or the wire) whose oldest parcel comes first in the order of the
 * bus, or NULL when all are empty. What goes to the wire is stamped before it is numbered: there
 * the time comes first. */
static struct lane *first_lane(const struct local_bus *bus, size_t place, bool by_time)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    struct lane *first = NULL;

    for (size_t from = 0; from < bus->places; from++) {
        struct lane *lane = lane_of(bus, place, from);

        if (from == place || (from >= nodes && from < bus->config.max_nodes)) {
            continue;
        }
        if (!lane->has_head) {
            lane->has_head = ring_pop(&lane->ring, &lane->head);
            if (!lane->has_head) {
                continue;
            }
        }
        if (!first || comes_before(&lane->head, &first->head, by_time)) {
            first = lane;
        }
    }
    return first;
}

static void count_dropped(struct node *node)
{
    for (size_t from = 0; from < node->bus->places; from++) {
        struct lane *lane = lane_of(node->bus, node->index, from);
        uint64_t dropped = atomic_load_explicit(&lane->dropped, memory_order_relaxed);

        node->port.counters.rx_dropped += dropped - lane->dropped_seen;
        lane->dropped_seen = dropped;
    }
}

static size_t take_frames(struct node *node, struct bus_frame *frames, size_t max)
{
    struct lane *lane;
    size_t count = 0;

    while (count < max && (lane = first_lane(node->bus, node->index, false))) {
        frames[count] = lane->head.frame;
        lane->has_head = false;
        port_count_received(&node->port, &frames[count]);
        count++;
    }
    return count;
}

static size_t local_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct node *node = node_of(port);
    size_t count = take_frames(node, frames, max);

    if (count < max) {
        uint32_t signal = atomic_load_explicit(&node->signal, memory_order_relaxed);

        /* the inbox is empty: lower the signal, then look once more for what came meanwhile. A
         * wake-up that was written late is cleared by the call that finds nothing. */
        if ((signal & SIGNAL_RAISED) || !count) {
            if (signal & SIGNAL_WANTED) {
                event_clear(node->event);
            }
            atomic_fetch_and_explicit(&node->signal, ~(uint32_t)SIGNAL_RAISED,
                                      memory_order_acq_rel);
            count += take_frames(node, frames + count, max - count);
        }
    }
    count_dropped(node);
    count_wire_dropped(node);
    return count;
}

static int local_descriptor(const struct can_port *port)
{
    const struct node *known = const_node_of(port);
    struct node *node = &known->bus->nodes[known->index];
    uint32_t before = atomic_fetch_or_explicit(&node->signal, SIGNAL_WANTED, memory_order_acq_rel);

    if (!(before & SIGNAL_WANTED) && (before & SIGNAL_RAISED)) {
        event_raise(node->event);
    }
    return node->event;
}

/* The descriptor stays open until the bus goes, as a sender may be about to write to it. */
static void local_close(struct can_port *port)
{
    struct node *node = node_of(port);

    atomic_store_explicit(&node->open, false, memory_order_release);
    atomic_fetch_and_explicit(&node->bus->plugged, ~node->controller_mask, memory_order_release);
}

/* ---- wire mode ---- */

static struct node *owner_of(const struct local_bus *bus, size_t controller)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t i = 0; i < nodes; i++) {
        if (bus->nodes[i].controller_mask >> controller & 1) {
            return &bus->nodes[i];
        }
    }
    return NULL;
}

/* From the wire to a node. */
static void wire_put(struct local_bus *bus, size_t to, const struct bus_frame *frame)
{
    struct parcel parcel = {.frame = *frame};

    parcel.number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);
    if (node_put(bus, to, bus->config.max_nodes, &parcel)) {
        bus->reached[to / 64] |= UINT64_C(1) << to % 64;
    }
}

static void carry(struct local_bus *bus, const struct wire_event *event)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);

    for (size_t to = 0; to < nodes; to++) {
        const struct node *node = &bus->nodes[to];

        if ((node->controller_mask & event->receivers) &&
            !(node->controller_mask >> event->node & 1)) {
            wire_put(bus, to, event->frame);
        }
    }
    if (bus->tap) {
        bus->tap(bus->tap_context, event->frame);
    }
}

/* What SocketCAN would send to a program about its controller. */
static struct bus_frame state_frame(enum wire_state before, const struct wire_event *event)
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

/* The state of a port: the worst of its controllers that are on the bus, bus-off when none is. */
static enum wire_state state_of_port(const struct local_bus *bus, const struct node *node)
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

/* A controller has changed its state: its port hears of it when that changes the port's. */
static void report_state(struct local_bus *bus, const struct wire_event *event)
{
    struct node *owner = owner_of(bus, event->node);
    struct wire_event shown = *event;
    enum wire_state before;
    struct bus_frame frame;

    bus->state[event->node] = event->state;
    if (!owner) {
        return;
    }
    before = owner->shown;
    shown.state = state_of_port(bus, owner);
    if (shown.state != before) {
        owner->shown = shown.state;
        frame = state_frame(before, &shown);
        wire_put(bus, owner->index, &frame);
    }
}

static void wire_event(void *context, const struct wire_event *event)
{
    struct local_bus *bus = context;

    if (event->kind == WIRE_TRANSMIT) {
        carry(bus, event);
    } else if (event->kind == WIRE_STATUS && event->node < bus->controllers) {
        report_state(bus, event);
    }
}

/* Ports that came or went plug their controllers in or out. */
static void follow_plugs(struct local_bus *bus)
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

/* What the wire has dropped of accepted frames goes into the counters of the ports. */
static void hand_on_drops(struct local_bus *bus)
{
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    const uint64_t total = wire_dropped(bus->wire);

    if (total == bus->dropped_seen) {
        return;
    }
    bus->dropped_seen = total;
    for (size_t i = 0; i < nodes; i++) {
        struct node *node = &bus->nodes[i];
        uint64_t dropped = 0;

        for (size_t k = 0; k < node->controllers; k++) {
            struct wire_node_stats of_node;

            wire_node_stats(bus->wire, node->first_controller + k, &of_node);
            for (int drop = 0; drop < WIRE_DROPS; drop++) {
                dropped += of_node.dropped[drop];
            }
        }
        atomic_store_explicit(&node->wire_dropped, dropped, memory_order_relaxed);
    }
}

void local_bus_advance(struct local_bus *bus, int64_t now_ns)
{
    struct lane *lane;

    if (!bus->wire) {
        return;
    }
    follow_plugs(bus);
    while ((lane = first_lane(bus, bus->config.max_nodes, true))) {
        const struct bus_frame *frame = &lane->head.frame;
        const size_t sender = (size_t)(lane - bus->lanes) % bus->places;

        wire_advance(bus->wire, frame->time_ns);
        wire_transmit(bus->wire, bus->nodes[sender].first_controller + frame->node, frame);
        lane->has_head = false;
    }
    wire_advance(bus->wire, now_ns);
    hand_on_drops(bus);
    atomic_store_explicit(&bus->now_ns, now_ns, memory_order_release);
    signal_reached(bus, bus->reached);
    memset(bus->reached, 0, sizeof bus->reached);
}

struct wire *local_bus_wire(const struct local_bus *bus)
{
    return bus->wire;
}

size_t local_bus_node(const struct can_port *port)
{
    return const_node_of(port)->first_controller;
}

void local_bus_tap(struct local_bus *bus, void (*tap)(void *context, const struct bus_frame *frame),
                   void *context)
{
    bus->tap = tap;
    bus->tap_context = context;
}

/* ---- creation ---- */

static const struct can_port_ops local_ops = {
    .name = "local",
    .receive = local_receive,
    .send = local_send,
    .descriptor = local_descriptor,
    .close = local_close,
};

/* Gives the lanes between different places their slots. */
static bool create_lanes(struct local_bus *bus, size_t inbox, struct arena *arena)
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
        slots = arena_alloc(arena, inbox, sizeof(struct parcel));
        if (!slots) {
            return false;
        }
        ring_init(&bus->lanes[i].ring, slots, sizeof(struct parcel), (uint32_t)inbox);
    }
    return true;
}

static enum error_code create_wire(struct local_bus *bus, struct arena *arena, struct error *error)
{
    struct local_bus_config *config = &bus->config;
    struct wire_config wire = {
        .context = bus,
        .notify = wire_event,
        .events = 1 << WIRE_TRANSMIT | 1 << WIRE_STATUS,
    };
    enum error_code code;

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
    code = wire_create(&wire, arena, &bus->wire, error);
    if (code) {
        return error_prefix(error, "local bus %s", config->name);
    }
    bus->state = arena_alloc(arena, config->wire_nodes, sizeof *bus->state);
    if (!bus->state) {
        return error_set(error, ERROR_MEMORY, "local bus %s: no memory for its wire", config->name);
    }
    /* nobody is there yet who could acknowledge */
    for (size_t i = 0; i < config->wire_nodes; i++) {
        wire_connect(bus->wire, i, false);
    }
    return ERROR_NONE;
}

static enum error_code check_config(const struct local_bus_config *config, struct error *error)
{
    if (config->max_nodes < 1 || config->max_nodes > NODES_MAX) {
        return error_set(error, ERROR_INPUT, "local bus %s: %zu nodes, expected 1 to %d",
                         config->name, config->max_nodes, NODES_MAX);
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
    enum error_code code = check_config(config, error);
    struct local_bus *created;

    if (code) {
        return code;
    }
    created = arena_alloc(arena, 1, sizeof *created);
    if (created) {
        created->name = arena_strdup(arena, config->name);
        created->config = *config;
        created->config.name = created->name;
        created->places = config->max_nodes + wire;
        created->nodes = arena_alloc(arena, config->max_nodes, sizeof *created->nodes);
    }
    if (!created || !created->name || !created->nodes ||
        !create_lanes(created, config->inbox, arena)) {
        return error_set(error, ERROR_MEMORY,
                         "local bus %s: no memory for %zu nodes with an inbox of %zu frames",
                         config->name, config->max_nodes, config->inbox);
    }
    if (wire) {
        code = create_wire(created, arena, error);
        if (code) {
            return code;
        }
    }
    pthread_mutex_init(&created->joining, NULL);
    *bus = created;
    return ERROR_NONE;
}

/* With the mutex held: the next controllers of the wire become the node's. */
static enum error_code add_controllers(struct local_bus *bus, struct node *node, size_t count,
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

/* With the mutex held: fills in the next node and publishes it. */
static enum error_code add_node(struct local_bus *bus, size_t controllers,
                                const struct frame_filter *filter, size_t nfilter,
                                struct can_port **port, struct error *error)
{
    const size_t index = atomic_load_explicit(&bus->count, memory_order_relaxed);
    struct node *node = &bus->nodes[index];

    enum error_code code;

    if (index == bus->config.max_nodes) {
        return error_set(error, ERROR_MEMORY, "local bus %s: all %zu places are taken", bus->name,
                         bus->config.max_nodes);
    }
    code = add_controllers(bus, node, controllers, error);
    if (code) {
        return code;
    }
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
    code = add_node(bus, nodes, filter, nfilter, port, error);
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
