/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to canbus: what the local bus (local.c) shares with its wire (local_wire.c) and its
 * saving (local_save.c): the nodes, and the square matrix of rings between them, in which the wire
 * is one more place. What sends and receives is RT-safe, creation and joining are not.
 */
#ifndef CANBUS_LOCAL_PRIVATE_H
#define CANBUS_LOCAL_PRIVATE_H

#include "base/array.h"
#include "base/ring.h"
#include "canbus/port_private.h"
#include "canbus/wire/wire.h"

#include <pthread.h>
#include <stdatomic.h>

/* A frame on its way to a node. */
struct local_frame {
    uint64_t number; /* place in the order of the bus; nothing on the way to the wire */
    struct bus_frame frame;
};

enum { LOCAL_NODES_MAX = 256 };

/* Bits of node.signal. */
enum {
    SIGNAL_WANTED = 1, /* somebody may sleep on the descriptor */
    SIGNAL_RAISED = 2, /* frames were put in since the node last found nothing */
};

/* The frames on their way from one sender to one receiver. */
struct local_lane {
    struct ring ring;         /* of frames */
    _Atomic uint64_t dropped; /* the sender's count of what the full ring refused */
    uint64_t dropped_seen;    /* how many of these the receiver has counted */
};

struct local_node {
    struct can_port port;
    struct local_bus *bus;
    size_t index;
    int event;
    _Atomic uint32_t signal;
    _Atomic bool open;
    struct frame_filter filter[LOCAL_BUS_FILTERS_MAX];
    size_t nfilter;

    /* Wire mode: its controllers */
    size_t first_controller, controllers;
    uint64_t controller_mask;
    enum wire_state shown;         /* the state last reported to the port */
    _Atomic uint64_t wire_dropped; /* the wire's count of what it lost of accepted frames */
    uint64_t wire_dropped_seen;    /* how many of these the port has counted */
    uint64_t wire_dropped_told;    /* of what the wire's statistics say, what was added there */
};

struct local_bus {
    const char *name;
    struct local_bus_config config;
    size_t places; /* in each row of lanes: the nodes, and the wire where there is one */
    pthread_mutex_t joining;
    _Atomic size_t count;      /* nodes that have joined; complete up to here */
    _Atomic uint64_t sequence; /* number of the next frame */
    struct local_node *nodes;
    struct local_lane *lanes; /* [receiver * places + sender] */

    /* Wire mode; but for plugged of the thread that advances */
    struct wire *wire;
    size_t controllers;       /* given out */
    _Atomic uint64_t plugged; /* controllers whose port is open */
    uint64_t plugged_seen;    /* the ones that the wire has seen so far */
    enum wire_state *state;   /* of each controller */
    uint64_t dropped_seen;    /* the wire's drops that have been passed on to the ports */
    uint64_t reached[LOCAL_NODES_MAX / 64]; /* ports that received something in this advance */
    void (*tap)(void *context, const struct bus_frame *frame);
    void *tap_context;
};

static inline struct local_lane *local_lane_between(const struct local_bus *bus, size_t receiver,
                                                    size_t sender)
{
    return &bus->lanes[receiver * bus->places + sender];
}

static inline struct local_node *local_node_of_port(const struct can_port *port)
{
    return container_of(port, struct local_node, port);
}

/* local.c: puts a frame from a place into the inbox of a node, false = the node's filters do not
 * let it pass; signals the nodes marked in `reached` that frames are there. */
bool local_put_frame(const struct local_bus *bus, size_t receiver, size_t sender, uint64_t number,
                     const struct bus_frame *frame);
void local_signal_nodes(const struct local_bus *bus, const uint64_t reached[LOCAL_NODES_MAX / 64]);

/* local_wire.c: checks whether a frame is no traffic of the robot (STEP, DONE, errors) and takes
 * no time. */
bool local_bypasses_wire(const struct local_bus *bus, const struct bus_frame *frame);

/* Puts a frame into the ring that the wire reads; false when that is full, or when frame->node is
 * no node of the port. */
bool local_send_by_wire(struct local_node *sender, const struct bus_frame *frame);

/* Adds the frames that the wire has dropped since the last call to the counters of the port. */
void local_count_wire_dropped(struct local_node *node);

enum error_code local_wire_create(struct local_bus *bus, struct arena *arena, struct error *error);

/* Gives a node the next controllers of the wire, if the bus has one. The caller holds the bus's
 * mutex. */
enum error_code local_wire_join(struct local_bus *bus, struct local_node *node, size_t count,
                                struct error *error);

#endif
