/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the simulator and a CAN bus. Back ends: socketcan (vcan or a real
 * interface) and local (in the process). A port belongs to one thread. Receiving and sending are
 * RT-safe; opening and closing are not. Other functions say whether they are RT-safe.
 */
#ifndef CANBUS_PORT_H
#define CANBUS_PORT_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

enum can_port_state {
    CAN_PORT_UP,      /* carrying frames (error active, or a bus without controller states) */
    CAN_PORT_WARNING, /* controller in error warning */
    CAN_PORT_PASSIVE, /* controller error passive */
    CAN_PORT_BUS_OFF, /* controller bus-off */
    CAN_PORT_DOWN,    /* interface is down (ip link set down) */
    CAN_PORT_GONE,    /* interface was removed */
    CAN_PORT_STUCK,   /* no frame was sent for SOCKETCAN_STUCK_NS: the queue is full */
};

/* Returns the name of a state: "up", "gone", ... RT-safe. */
const char *can_port_state_name(enum can_port_state state);

/* Counters of a port since it was opened. */
struct can_counters {
    uint64_t rx_frames, tx_frames;
    uint64_t rx_bits, tx_bits; /* sums of frame_bits(), for the bus load */
    uint64_t fast_bits;        /* sum of frame_fast_bits(), received and sent */
    /* frames lost before reception (socket buffer or local inbox full); complete when no frame
     * waits */
    uint64_t rx_dropped;
    /* frames not sent: invalid, queue full, or interface down. On a bus with wire time also
     * accepted frames that were lost later, in a full queue or by bus-off */
    uint64_t tx_dropped;
    uint64_t tx_queue_full; /* number of ENOBUFS/EAGAIN errors */
    uint64_t error_frames;
    uint64_t rx_malformed; /* short reads, impossible lengths */
    uint64_t down_events;  /* number of times when the interface went down or was removed */
    uint64_t tx_held;      /* frames kept for the next cycle because the queue was full */
};

/* Accepts data and remote frames of this identifier length if (id & mask) == (filter.id & mask), as
 * SocketCAN does with CAN_EFF_FLAG in the mask. A frame passes if one of several filters matches,
 * or if there is no filter. Error frames always pass. */
struct frame_filter {
    uint32_t id, mask;
    bool extended;
};

struct can_port;

struct can_port_ops {
    const char *name; /* "socketcan", "local" */
    /* Receives up to max waiting frames in order; never waits. RT-safe. */
    size_t (*receive)(struct can_port *port, struct bus_frame *frames, size_t max);
    /* Sends frames in order. Returns how many were accepted; the others are dropped and counted. If
     * a frame is invalid, only this frame is dropped. If the queue is full, all further frames are
     * dropped. Dropped frames are never sent later, because the next cycle has newer values. A port
     * on a real interface holds some frames when the queue is full, see socketcan_open. Never
     * waits. RT-safe. */
    size_t (*send)(struct can_port *port, const struct bus_frame *frames, size_t count);
    /* Returns a descriptor that becomes readable when frames wait; -1 = none. Call it before each
     * poll, because on a local bus each call enables only one wake-up. RT-safe. */
    int (*descriptor)(const struct can_port *port);
    /* Not RT-safe. */
    void (*close)(struct can_port *port);
};

/* The base of each back end's private struct. */
struct can_port {
    const struct can_port_ops *ops;
    const char *bus;        /* interface or bus name, for messages and logs */
    bool fd;                /* FD frames may be sent */
    struct can_port *inner; /* port behind this one; NULL = none */
    enum can_port_state state;
    struct can_counters counters;
};

/* A mailbox for a controller's state. Error frames do not report every recovery. A thread therefore
 * queries the controller and posts the state for the ports. post 0 = nothing posted. RT-safe. */
struct can_state_box {
    _Atomic uint32_t post; /* number << 8 | enum can_port_state */
};

/* Posts a controller's state to its ports. From one thread. RT-safe. */
void can_state_post(struct can_state_box *box, enum can_port_state state);

struct socketcan_config {
    const char *interface;
    bool fd;                           /* request FD; error when the interface's MTU is too small */
    const struct frame_filter *filter; /* NULL = everything */
    size_t nfilter;
    bool receive_own;         /* receive this port's own frames too, if the filters accept them */
    int receive_buffer_bytes; /* 0 = 4 MiB; above the system's limit if allowed */
    const struct can_state_box *controller; /* NULL = only error frames change the state */
    bool sought; /* another thread searches for a lost interface with socketcan_seek */
};

enum { SOCKETCAN_HELD_MAX = 128, SOCKETCAN_STUCK_NS = 100000000 };

/* Opens a raw socket on an interface. Memory from arena. Not RT-safe. Each of these causes has its
 * own message: kernel without CAN (ERROR_UNSUPPORTED); no such interface, not a CAN interface, FD
 * on an interface without it (ERROR_INPUT); interface down, no permission (ERROR_SYSTEM).
 *
 * The port receives error frames, which change port->state. A later loss of the interface sets the
 * state DOWN or GONE. receive and send then search for the interface at most once a second, even if
 * it is created again. A search waits for the kernel's interface lock. For a real-time loop, set
 * config.sought, and another thread searches.
 *
 * frame->time_ns is the kernel's reception time on CLOCK_MONOTONIC. It never decreases. If somebody
 * sets the time of day meanwhile, it is limited to the range from the last frame to now.
 *
 * A real interface has a short queue (txqueuelen); sending to a full one fails (ENOBUFS). The port
 * then holds the failed frames, one per identifier, up to SOCKETCAN_HELD_MAX. The next receive or
 * send sends them first. While the queue stays full, a newer frame replaces the held one of its
 * identifier, because in periodic frames only the newest value matters. Replaced frames, including
 * replies, and frames without room count as tx_dropped. If no frame was sent for
 * SOCKETCAN_STUCK_NS, no node acknowledges (no other node, or bus-off). The state is then STUCK.
 * The port tries again after 10, 20, 40 ... ms, at most a second apart, until an attempt
 * succeeds. */
enum error_code socketcan_open(const struct socketcan_config *config, struct arena *arena,
                               struct can_port **port, struct error *error);

/* Searches for the lost interface of a port with config.sought. The port uses a found interface at
 * its next receive or send. Call it about once a second from one thread other than the port's. Not
 * RT-safe. */
void socketcan_seek(struct can_port *port);

/* Checks whether the kernel supports CAN sockets. Not RT-safe. */
bool socketcan_available(void);

/*
 * A bus in the process. Its nodes may belong to different threads (lock-free).
 *
 * Ideal mode: a sent frame is at every other node at once; time_ns stays as the sender set it.
 * Every receiver gets all frames in the order of sending. Frames that two threads send at the same
 * time may have any order relative to each other.
 *
 * Wire mode: frames pass through a wire in virtual time (canbus/wire/wire.h), which
 * local_bus_advance moves. A frame enters its node's controller at the time of the last advance,
 * even if a later call moves it there. It is received, with time_ns set, in the call that reaches
 * the end of its EOF. A port whose controller changes its state receives the error frame that
 * SocketCAN would send. Frames with bypass identifiers are not robot traffic and take no time.
 */
struct local_bus;
struct wire;

enum { LOCAL_BUS_FILTERS_MAX = 128, LOCAL_BUS_BYPASS_MAX = 4 };

enum local_bus_mode { LOCAL_BUS_IDEAL, LOCAL_BUS_WIRE };

struct local_bus_config {
    const char *name;
    size_t max_nodes; /* most joins during the life of the bus */
    /* capacity in frames for each pair of ports, and for the wire and each port; a power of two.
     * When it is full, further frames are dropped and counted as rx_dropped */
    size_t inbox;
    bool fd; /* nodes may send FD frames */
    enum local_bus_mode mode;

    /* Wire mode; 0 = the default in [] */
    int64_t bitrate;          /* [1 Mbit/s] */
    int64_t data_bitrate;     /* [bitrate] */
    size_t wire_nodes;        /* controllers of all ports, at most 63 [max_nodes] */
    size_t queue;             /* queue of a controller, frames [256] */
    bool fifo;                /* controllers send in order instead of by priority */
    int64_t restart_delay_ns; /* delay of the recovery after bus-off; negative = no recovery */
    uint64_t seed;            /* for faults with a probability */
    uint32_t bypass_id[LOCAL_BUS_BYPASS_MAX]; /* standard identifiers */
    size_t nbypass;
};

/* Creates a bus in memory from arena: about max_nodes^2 * inbox * 96 bytes, in wire mode (max_nodes
 * + 2)^2. Not RT-safe. */
enum error_code local_bus_create(const struct local_bus_config *config, struct arena *arena,
                                 struct local_bus **bus, struct error *error);

/* Joins the bus and opens a port. It does not receive earlier frames. From any thread, also while
 * other ports send. Copies the filters (at most LOCAL_BUS_FILTERS_MAX). The place of a closed port
 * is not used again, so max_nodes limits all joins. After a call of descriptor() a port signals its
 * descriptor once. A port that never waits therefore costs no system call. Not RT-safe.
 *
 * nodes: number of the port's controllers on the wire, such as one per simulated board. frame.node
 * selects the sending controller. Each controller has its own queue and error counters. They
 * acknowledge each other's frames but do not receive them. The port's state is the worst of its
 * controllers on the bus, bus-off if none is. In ideal mode the number has no effect. */
enum error_code local_bus_join(struct local_bus *bus, size_t nodes,
                               const struct frame_filter *filter, size_t nfilter,
                               struct can_port **port, struct error *error);

/* Runs the wire up to a virtual time and delivers the frames that have arrived. Returns the time
 * reached: now_ns, or earlier where the listener sends; call it again after sending. No effect in
 * ideal mode. Call it from one thread only, the thread that advances time. RT-safe. */
int64_t local_bus_advance(struct local_bus *bus, int64_t now_ns);

/* Sets the listener of the node that joined first: local_bus_advance hands it the frames of the
 * wire at the end of their EOF, in the node's stead. It returns the time at which the node next
 * sends; INT64_MAX = none. Frames that bypass the wire go to the port. Set it before the first
 * frame. No effect in ideal mode. */
void local_bus_listen(struct local_bus *bus,
                      int64_t (*listener)(void *context, const struct bus_frame *frame),
                      void *context);

/* Returns the wire, for inspection and fault injection from the thread that advances it; NULL in
 * ideal mode. RT-safe. */
struct wire *local_bus_wire(const struct local_bus *bus);

/* Sets a function that local_bus_advance calls for every frame that the wire has carried
 * completely, in the order of the wire. Call it before the first frame. No effect in ideal mode.
 * RT-safe. */
void local_bus_tap(struct local_bus *bus, void (*tap)(void *context, const struct bus_frame *frame),
                   void *context);

/* Saves the frames in transit between the first `own` nodes, and between them and the wire;
 * restoring puts them in transit again, so that virtual time can go back. Only the thread that
 * advances the bus may call it, and no other thread may use these nodes. Save the wire's memory
 * (canbus/wire/wire.h) at the same time. memory: local_bus_save_size bytes, aligned to 8; false =
 * too many frames are in transit. Frames of other nodes stay, and the counters of all ports
 * continue. RT-safe. */
size_t local_bus_save_size(const struct local_bus *bus);
bool local_bus_save(const struct local_bus *bus, size_t own, void *memory);
void local_bus_restore(struct local_bus *bus, size_t own, const void *memory);

/* Closes all descriptors of the bus, also of open ports; no thread may use the ports then. NULL is
 * allowed. Not RT-safe. */
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
