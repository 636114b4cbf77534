/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The seam between the simulator and a CAN bus. Back ends: socketcan (vcan or a real interface) and
 * local (in the process). A port belongs to one thread.
 */
#ifndef CANBUS_PORT_H
#define CANBUS_PORT_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

#include <stddef.h>

enum can_port_state {
    CAN_PORT_UP,      /* carrying frames (error active, or a bus without controller states) */
    CAN_PORT_WARNING, /* controller in error warning */
    CAN_PORT_PASSIVE, /* controller error passive */
    CAN_PORT_BUS_OFF, /* controller bus-off */
    CAN_PORT_DOWN,    /* interface is down */
    CAN_PORT_GONE,    /* interface was removed */
};

/* What happened on a port since it was opened. */
struct can_counters {
    uint64_t rx_frames, tx_frames;
    uint64_t rx_bits, tx_bits; /* sums of frame_bits(), for the load figure */
    uint64_t rx_dropped;       /* lost before we read them (SO_RXQ_OVFL, full local inbox) */
    uint64_t tx_dropped;       /* not sent: frame invalid, queue full, or interface down */
    uint64_t tx_queue_full;    /* times ENOBUFS/EAGAIN was met */
    uint64_t error_frames;
    uint64_t rx_malformed; /* short reads, impossible lengths */
    uint64_t down_events;  /* times the interface was found down or gone */
};

/* Accept a data or remote frame of this identifier length when (id & mask) == (filter.id & mask),
 * as SocketCAN does with CAN_EFF_FLAG in the mask. Of several filters one has to match; without any
 * filter everything passes. Error frames always pass. */
struct frame_filter {
    uint32_t id, mask;
    bool extended;
};

struct can_port;

struct can_port_ops {
    const char *name; /* "socketcan", "local" */
    /* Up to max frames that have arrived, in order; never waits. RT-safe. */
    size_t (*receive)(struct can_port *port, struct bus_frame *frames, size_t max);
    /* Sends frames in order; returns how many were accepted. The others are dropped and counted: an
     * invalid frame alone, everything behind a full queue. What is dropped is never sent later: the
     * next cycle carries newer values. Never waits. RT-safe. */
    size_t (*send)(struct can_port *port, const struct bus_frame *frames, size_t count);
    /* A descriptor that polls readable when frames wait; for threads that may sleep. */
    int (*descriptor)(const struct can_port *port);
    void (*close)(struct can_port *port);
};

/* A back end's private struct begins with this. */
struct can_port {
    const struct can_port_ops *ops;
    const char *bus; /* interface or bus name, for messages and logs */
    bool fd;         /* FD frames may be sent */
    enum can_port_state state;
    struct can_counters counters;
};

struct socketcan_config {
    const char *interface;
    bool fd;                           /* ask for FD; refused with a message when the MTU says no */
    const struct frame_filter *filter; /* NULL = everything */
    size_t nfilter;
    bool receive_own;         /* also what this port sent, where the filters let it through */
    int receive_buffer_bytes; /* 0 = 4 MiB, forced when allowed */
};

/* Opens a raw socket on an interface. Distinct messages for: kernel without CAN
 * (ERROR_UNSUPPORTED), no such interface, not a CAN interface, FD on an interface without it
 * (ERROR_INPUT), interface down, no permission (ERROR_SYSTEM). Error frames are subscribed and
 * move port->state. A later loss of the interface sets state DOWN or GONE; receive and send try to
 * come back at most once a second, also when the interface was created anew. frame->time_ns is
 * when the kernel received the frame, on CLOCK_MONOTONIC. Memory from arena. Not RT-safe. */
enum error_code socketcan_open(const struct socketcan_config *config, struct arena *arena,
                               struct can_port **port, struct error *error);

/* Whether the kernel can open CAN sockets at all. Not RT-safe. */
bool socketcan_available(void);

/* Whether the named interface exists (any state). Not RT-safe. */
bool socketcan_interface_exists(const char *interface);

/* A bus in the process, ideal mode: a frame that one node sends is at every other node at once;
 * nothing is delayed, time_ns stays as the sender set it. Every receiver gets all frames in the
 * order in which they were sent; of frames that are sent while another thread is still inside its
 * send call the order is open. Nodes may live in different threads (lock-free). */
struct local_bus;

enum { LOCAL_BUS_FILTERS_MAX = 128 };

/* inbox: frames that a node holds of each other node before it drops what that one sends, and
 * counts it as rx_dropped (power of two). fd: nodes may send FD frames. Memory from arena: about
 * max_nodes^2 * inbox * 96 bytes. Not RT-safe. */
enum error_code local_bus_create(const char *name, size_t max_nodes, size_t inbox, bool fd,
                                 struct arena *arena, struct local_bus **bus, struct error *error);

/* Joins the bus as a node; what was sent before is not received. From any thread, while others send.
 * The filters (at most LOCAL_BUS_FILTERS_MAX) are copied. The place of a port that was closed is
 * not given out again: max_nodes bounds the joins of the bus's life. A node signals its descriptor
 * only after descriptor() was asked for once, so that a polling node costs no system call. Not
 * RT-safe. */
enum error_code local_bus_join(struct local_bus *bus, const struct frame_filter *filter,
                               size_t nfilter, struct can_port **port, struct error *error);

/* Closes what the bus holds, also of ports that are still open; no thread may use them then. NULL
 * is allowed. Not RT-safe. */
void local_bus_destroy(struct local_bus *bus);

/* Shorthands. */
static inline size_t can_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    return port->ops->receive(port, frames, max);
}

static inline size_t can_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    return port->ops->send(port, frames, count);
}

#endif
