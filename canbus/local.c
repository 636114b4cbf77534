/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus in the process. For each ordered pair of nodes there is one ring with one writer and one
 * reader, so that no lock is needed. The sender stamps every frame with a number of the whole bus;
 * a receiver merges its rings by that number and so sees one order.
 */
#include "base/ring.h"
#include "canbus/port_private.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* A frame on its way to a node. */
struct parcel {
    uint64_t number; /* place in the order of the bus */
    struct bus_frame frame;
};

enum { NODES_MAX = 256 };

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
};

struct local_bus {
    const char *name;
    bool fd;
    size_t max_nodes;
    pthread_mutex_t joining;
    _Atomic size_t count;      /* nodes that have joined; complete up to here */
    _Atomic uint64_t sequence; /* number of the next frame */
    struct node *nodes;
    struct lane *lanes; /* [receiver * max_nodes + sender] */
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
    return &bus->lanes[receiver * bus->max_nodes + sender];
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

static size_t local_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct node *sender = node_of(port);
    struct local_bus *bus = sender->bus;
    const size_t nodes = atomic_load_explicit(&bus->count, memory_order_acquire);
    uint64_t reached[NODES_MAX / 64] = {0}; /* bit set of the nodes that got something */
    size_t accepted = 0;

    for (size_t i = 0; i < count; i++) {
        struct parcel parcel;

        if (!port_may_send(port, &frames[i])) {
            port->counters.tx_dropped++;
            continue;
        }
        parcel.frame = frames[i];
        parcel.number = atomic_fetch_add_explicit(&bus->sequence, 1, memory_order_relaxed);
        for (size_t to = 0; to < nodes; to++) {
            if (to != sender->index && node_put(bus, to, sender->index, &parcel)) {
                reached[to / 64] |= UINT64_C(1) << to % 64;
            }
        }
        port_count_sent(port, &frames[i]);
        accepted++;
    }
    for (size_t to = 0; to < nodes; to++) {
        if (reached[to / 64] >> to % 64 & 1) {
            node_signal(&bus->nodes[to]);
        }
    }
    return accepted;
}

/* The lane whose oldest parcel comes first in the order of the bus, or NULL when all are empty. */
static struct lane *first_lane(const struct node *node)
{
    const size_t nodes = atomic_load_explicit(&node->bus->count, memory_order_acquire);
    struct lane *first = NULL;

    for (size_t from = 0; from < nodes; from++) {
        struct lane *lane = lane_of(node->bus, node->index, from);

        if (from == node->index) {
            continue;
        }
        if (!lane->has_head) {
            lane->has_head = ring_pop(&lane->ring, &lane->head);
        }
        if (lane->has_head && (!first || lane->head.number < first->head.number)) {
            first = lane;
        }
    }
    return first;
}

static void count_dropped(struct node *node)
{
    const size_t nodes = atomic_load_explicit(&node->bus->count, memory_order_acquire);

    for (size_t from = 0; from < nodes; from++) {
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

    while (count < max && (lane = first_lane(node))) {
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

        /* the inbox is empty: lower the signal, then look once more for what came meanwhile. A wake-up
         * that was written late is cleared by the call that finds nothing. */
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
    atomic_store_explicit(&node_of(port)->open, false, memory_order_release);
}

static const struct can_port_ops local_ops = {
    .name = "local",
    .receive = local_receive,
    .send = local_send,
    .descriptor = local_descriptor,
    .close = local_close,
};

/* Gives the lanes between different nodes their slots. */
static bool create_lanes(struct local_bus *bus, size_t inbox, struct arena *arena)
{
    bus->lanes = arena_alloc(arena, bus->max_nodes * bus->max_nodes, sizeof *bus->lanes);
    if (!bus->lanes) {
        return false;
    }
    for (size_t i = 0; i < bus->max_nodes * bus->max_nodes; i++) {
        void *slots;

        if (i / bus->max_nodes == i % bus->max_nodes) {
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

enum error_code local_bus_create(const char *name, size_t max_nodes, size_t inbox, bool fd,
                                 struct arena *arena, struct local_bus **bus, struct error *error)
{
    struct local_bus *created;

    if (max_nodes < 1 || max_nodes > NODES_MAX) {
        return error_set(error, ERROR_INPUT, "local bus %s: %zu nodes, expected 1 to %d", name,
                         max_nodes, NODES_MAX);
    }
    if (inbox < 1 || inbox > 1 << 20 || (inbox & (inbox - 1))) {
        return error_set(error, ERROR_INPUT,
                         "local bus %s: an inbox of %zu frames, expected a power of two up to 2^20",
                         name, inbox);
    }
    created = arena_alloc(arena, 1, sizeof *created);
    if (created) {
        created->name = arena_strdup(arena, name);
        created->max_nodes = max_nodes;
        created->fd = fd;
        created->nodes = arena_alloc(arena, max_nodes, sizeof *created->nodes);
    }
    if (!created || !created->name || !created->nodes || !create_lanes(created, inbox, arena)) {
        return error_set(error, ERROR_MEMORY,
                         "local bus %s: no memory for %zu nodes with an inbox of %zu frames", name,
                         max_nodes, inbox);
    }
    pthread_mutex_init(&created->joining, NULL);
    *bus = created;
    return ERROR_NONE;
}

/* With the mutex held: fills in the next node and publishes it. */
static enum error_code add_node(struct local_bus *bus, const struct frame_filter *filter,
                                size_t nfilter, struct can_port **port, struct error *error)
{
    const size_t index = atomic_load_explicit(&bus->count, memory_order_relaxed);
    struct node *node = &bus->nodes[index];

    if (index == bus->max_nodes) {
        return error_set(error, ERROR_MEMORY, "local bus %s: all %zu places are taken", bus->name,
                         bus->max_nodes);
    }
    node->event = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (node->event < 0) {
        return error_set_errno(error, errno, "local bus %s: cannot create an event descriptor",
                               bus->name);
    }
    node->port = (struct can_port){
        .ops = &local_ops,
        .bus = bus->name,
        .fd = bus->fd,
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
    *port = &node->port;
    return ERROR_NONE;
}

enum error_code local_bus_join(struct local_bus *bus, const struct frame_filter *filter,
                               size_t nfilter, struct can_port **port, struct error *error)
{
    enum error_code code;

    if (nfilter > LOCAL_BUS_FILTERS_MAX) {
        return error_set(error, ERROR_INPUT, "local bus %s: %zu filters, expected at most %d",
                         bus->name, nfilter, LOCAL_BUS_FILTERS_MAX);
    }
    pthread_mutex_lock(&bus->joining);
    code = add_node(bus, filter, nfilter, port, error);
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
