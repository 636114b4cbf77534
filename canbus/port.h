/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the simulator and a CAN bus. Back ends: socketcan (vcan or a real
 * interface) and local (in the process). A port belongs to one thread. Receiving and sending are
 * RT-safe; opening, closing and what else is said below is not.
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
    CAN_PORT_STUCK,   /* the interface's queue has been full for long: nothing leaves it */
};

/* Returns the name of a state: "up", "gone", ... RT-safe. */
const char *can_port_state_name(enum can_port_state state);

/* What happened on a port since it was opened. */
struct can_counters {
    uint64_t rx_frames, tx_frames;
    uint64_t rx_bits, tx_bits; /* sums of frame_bits(), for the load figure */
    uint64_t fast_bits;        /* sum of frame_fast_bits(), both ways */
    uint64_t rx_dropped;       /* lost before we read them (full socket buffer or local inbox);
                                * whole when all that waited has been received */
    uint64_t tx_dropped;       /* not sent: frame invalid, queue full, or interface down; on a bus
                                * with wire time also frames that were accepted first and then lost
                                * in a full queue or by bus-off */
    uint64_t tx_queue_full;    /* times ENOBUFS/EAGAIN was met */
    uint64_t error_frames;
    uint64_t rx_malformed; /* short reads, impossible lengths */
    uint64_t down_events;  /* times the interface was found down or gone */
    uint64_t tx_held;      /* frames that met a full queue and were kept for the next cycle */
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
     * next cycle carries newer values. A port on a real interface accepts some frames behind a full
     * queue, see socketcan_open. Never waits. RT-safe. */
    size_t (*send)(struct can_port *port, const struct bus_frame *frames, size_t count);
    /* A descriptor that polls readable when frames wait, for threads that may sleep; -1 = none.
     * RT-safe. */
    int (*descriptor)(const struct can_port *port);
    /* Not RT-safe. */
    void (*close)(struct can_port *port);
};

/* A back end's private struct begins with this. */
struct can_port {
    const struct can_port_ops *ops;
    const char *bus;        /* interface or bus name, for messages and logs */
    bool fd;                /* FD frames may be sent */
    struct can_port *inner; /* of a port in front of another; NULL = none */
    enum can_port_state state;
    struct can_counters counters;
};

/* A mailbox by which a thread that has asked a controller for its state tells the ports on it:
 * error frames alone do not announce every recovery. 0 = nothing yet. RT-safe. */
struct can_state_box {
    _Atomic uint32_t post; /* number << 8 | enum can_port_state */
};

/* Posts a controller's state to the ports on it. From one thread. RT-safe. */
void can_state_post(struct can_state_box *box, enum can_port_state state);

struct socketcan_config {
    const char *interface;
    bool fd; /* ask for FD; refused with a message when the MTU is too small */
    const struct frame_filter *filter; /* NULL = everything */
    size_t nfilter;
    bool receive_own;         /* also what this port sent, where the filters let it through */
    int receive_buffer_bytes; /* 0 = 4 MiB, forced when allowed */
    const struct can_state_box *controller; /* NULL = error frames alone move the state */
    bool sought; /* another thread looks for a lost interface: socketcan_seek */
};

enum { SOCKETCAN_HELD_MAX = 128, SOCKETCAN_STUCK_NS = 100000000 };

/* Opens a raw socket on an interface. Distinct messages for: kernel without CAN
 * (ERROR_UNSUPPORTED), no such interface, not a CAN interface, FD on an interface without it
 * (ERROR_INPUT), interface down, no permission (ERROR_SYSTEM). Error frames are subscribed and move
 * port->state. A later loss of the interface sets state DOWN or GONE; receive and send look for it
 * at most once a second, also when it was created anew, and wait for the kernel's interface lock
 * then; in a real-time loop another thread looks (config.sought). frame->time_ns is when the kernel
 * received the frame, on CLOCK_MONOTONIC; it never goes back, and lies between the frame before and
 * now also when the time of day was set meanwhile. Memory from arena. Not RT-safe.
 *
 * A real interface has a short queue (txqueuelen), and sending to a full one fails (ENOBUFS).
 * Frames that fail are held, one of each identifier and SOCKETCAN_HELD_MAX of them: the next
 * receive or send sends them before anything else. While the queue stays full a newer frame
 * replaces the held one of its identifier, as of periodic frames the newest value counts; the frame
 * that it replaces, and one that finds no room, is counted as tx_dropped, also when it was a reply.
 * When no frame has left for SOCKETCAN_STUCK_NS no node acknowledges them (no other node, bus-off):
 * state STUCK, and further attempts after 10, 20, 40 ... ms, at last once a second, until one
 * succeeds. */
enum error_code socketcan_open(const struct socketcan_config *config, struct arena *arena,
                               struct can_port **port, struct error *error);

/* Looks for the interface of a port that was opened as sought, when it has lost it; the port goes
 * on with it at its next receive or send. From one thread other than the port's, once a second,
 * say. Not RT-safe. */
void socketcan_seek(struct can_port *port);

/* Checks whether the kernel can open CAN sockets at all. Not RT-safe. */
bool socketcan_available(void);

/*
 * A bus in the process. Nodes may live in different threads (lock-free).
 *
 * Ideal mode: a frame that one node sends is at every other node at once; nothing is delayed,
 * time_ns stays as the sender set it. Every receiver gets all frames in the order in which they
 * were sent; of frames that are sent while another thread is still inside its send call the order
 * is open.
 *
 * Wire mode: the frames go over a wire in virtual time (canbus/wire/wire.h), which moves with
 * local_bus_advance. A frame is handed to its node's controller at the time last advanced to,
 * whenever the next call takes it over; it is received, with time_ns set, in the call that reaches
 * the end of its EOF. A port whose controller changes its state receives the error frame that
 * SocketCAN would send. Frames of the bypass identifiers, which are no traffic of the robot, take
 * no time.
 */
struct local_bus;
struct wire;

enum { LOCAL_BUS_FILTERS_MAX = 128, LOCAL_BUS_BYPASS_MAX = 4 };

enum local_bus_mode { LOCAL_BUS_IDEAL, LOCAL_BUS_WIRE };

struct local_bus_config {
    const char *name;
    size_t max_nodes; /* ports that may join in the bus's life */
    size_t inbox;     /* frames that a port holds of each other port, and of the wire, before it
                       * drops what comes from there and counts it as rx_dropped; a power of two */
    bool fd;          /* nodes may send FD frames */
    enum local_bus_mode mode;

    /* Wire mode; 0 = the default, in [] */
    int64_t bitrate;          /* [1 Mbit/s] */
    int64_t data_bitrate;     /* [bitrate] */
    size_t wire_nodes;        /* controllers of all ports together, at most 63 [max_nodes] */
    size_t queue;             /* frames a controller holds [256] */
    bool fifo;                /* controllers send in order instead of the most urgent first */
    int64_t restart_delay_ns; /* from bus-off to the recovery; negative: never by itself */
    uint64_t seed;            /* of faults with a probability */
    uint32_t bypass_id[LOCAL_BUS_BYPASS_MAX]; /* standard identifiers */
    size_t nbypass;
};

/* Creates a bus in memory from arena: about max_nodes^2 * inbox * 96 bytes, in wire mode
 * (max_nodes + 2)^2. Not RT-safe. */
enum error_code local_bus_create(const struct local_bus_config *config, struct arena *arena,
                                 struct local_bus **bus, struct error *error);

/* Joins the bus as a node; what was sent before is not received. From any thread, while others
 * send. The filters (at most LOCAL_BUS_FILTERS_MAX) are copied. The place of a port that was closed
 * is not given out again: max_nodes bounds the joins of the bus's life. A node signals its
 * descriptor only after descriptor() was asked for once, so that a polling node costs no system
 * call. Not RT-safe. */
enum error_code local_bus_join(struct local_bus *bus, const struct frame_filter *filter,
                               size_t nfilter, struct can_port **port, struct error *error);

/* The same for a port that stands for several controllers on the wire, as the boards of a
 * simulator: frame.node says which of them sends, each has its own queue and error counters, and
 * they acknowledge each other's frames but do not receive them. The port's state is that of the
 * worst of those on the bus, bus-off when none is. In ideal mode no different from
 * local_bus_join. */
enum error_code local_bus_join_nodes(struct local_bus *bus, size_t nodes,
                                     const struct frame_filter *filter, size_t nfilter,
                                     struct can_port **port, struct error *error);

/* Runs the wire up to a virtual time and delivers what has arrived. No effect in ideal mode. From
 * one thread: that of the participant that keeps time. RT-safe. */
void local_bus_advance(struct local_bus *bus, int64_t now_ns);

/* Returns the wire, to inspect it and to inject faults from the thread that advances it; NULL in
 * ideal mode. RT-safe. */
struct wire *local_bus_wire(const struct local_bus *bus);

/* Calls tap, in the thread that advances, for every frame that the wire has carried to its end, in
 * the order of the wire. To be set before the first frame. No effect in ideal mode. RT-safe. */
void local_bus_tap(struct local_bus *bus, void (*tap)(void *context, const struct bus_frame *frame),
                   void *context);

/* Saves the frames on their way between the first `own` nodes that joined, and between them and the
 * wire; restoring makes them be on their way again, so that virtual time can go back. The calling
 * thread must be the only one that uses these nodes, and the one that advances; the wire itself is
 * saved by its memory (canbus/wire/wire.h) at the same time. memory has local_bus_save_size bytes,
 * aligned to 8; false when more frames are on their way than it holds. Frames from and to other
 * nodes stay where they are, and the counters of all ports go on. RT-safe. */
size_t local_bus_save_size(const struct local_bus *bus);
bool local_bus_save(const struct local_bus *bus, size_t own, void *memory);
void local_bus_restore(struct local_bus *bus, size_t own, const void *memory);

/* Closes what the bus holds, also of ports that are still open; no thread may use them then. NULL
 * is allowed. Not RT-safe. */
void local_bus_destroy(struct local_bus *bus);

/* The operations of a port. RT-safe. */
static inline size_t can_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    return port->ops->receive(port, frames, max);
}

static inline size_t can_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    return port->ops->send(port, frames, count);
}

#endif
