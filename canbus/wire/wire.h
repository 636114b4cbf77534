/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN bus in virtual time: controllers with transmit queues on one wire. Frames take the exact
 * time of their stuffed bits (canbus/wire/bits.h), and the lowest identifier wins the arbitration.
 * Errors are signaled, counted and repeated as in ISO 11898-1. It uses no thread and no clock: the
 * caller moves time, and equal calls give bit-identical events. Events have the names of
 * FMI-LS-BUS.
 *
 * Time. wire_advance(to) ends every frame that ends by `to` and starts every frame that can start
 * before it. A frame from wire_transmit is ready at the time of the last advance. All frames
 * between two advances therefore compete equally, in any order of the calls. A frame is received at
 * the end of its seven bits of EOF; three bits of intermission follow. Times are rounded to whole
 * nanoseconds; they are exact if the bit rate divides 1 GHz. Rounding errors do not accumulate over
 * consecutive frames, except frames to which a fault may apply.
 *
 * Queues. Each node has one bounded queue; frames that find it full are dropped and counted. By
 * default it is a bank of mailboxes: the frame that would win the arbitration goes first, equal
 * ones in order of arrival. WIRE_FIFO sends strictly in order, as controllers with a FIFO do; an
 * urgent frame then waits behind others. A frame on the wire is not preempted.
 *
 * Errors. Every error ends the frame: error flags of 6 to 12 bits in total and a delimiter of 8
 * bits follow. The sender then sends the frame again. Error counters (TEC, REC) change by +8, +1
 * and -1 as in the standard. From 96 a node is in warning. From 128 it is error passive: its flags
 * are recessive and disturb no other node, and after sending it waits another 8 bits. From a TEC of
 * 256 it is bus-off: it loses its queue and neither sends nor receives. It recovers after 128 runs
 * of 11 recessive bits, counted from restart_delay_ns after bus-off. A frame without acknowledgment
 * is an error too; it makes a lone node error passive, never bus-off.
 *
 * All functions except wire_create are RT-safe and belong to one thread.
 */
#ifndef CANBUS_WIRE_WIRE_H
#define CANBUS_WIRE_WIRE_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

enum {
    WIRE_NODES_MAX = 63,
    WIRE_FAULTS_MAX = 16,
    WIRE_LATE_MAX = 64, /* most frames that WIRE_FAULT_LATE holds back */
};

enum wire_order { WIRE_PRIORITY, WIRE_FIFO };

/* The state of a node's controller (ISO 11898-1). */
enum wire_state { WIRE_ERROR_ACTIVE, WIRE_ERROR_WARNING, WIRE_ERROR_PASSIVE, WIRE_BUS_OFF };

/* Kind of an error, as in FMI-LS-BUS. */
enum wire_error {
    WIRE_BIT_ERROR, /* the transmitter read a different bit than it sent */
    WIRE_STUFF_ERROR,
    WIRE_FORM_ERROR,
    WIRE_CRC_ERROR,
    WIRE_ACK_ERROR,
    WIRE_ERRORS
};

enum wire_event_kind {
    WIRE_TRANSMIT,         /* the nodes in `receivers` have received the frame of `node` */
    WIRE_CONFIRM,          /* at the same time, for the sending node */
    WIRE_ARBITRATION_LOST, /* `node` lost the arbitration to the frame; at its start */
    WIRE_BUS_ERROR,        /* node's frame was destroyed and will be repeated */
    WIRE_STATUS,           /* the controller of `node` has changed to `state` */
};

struct wire_event {
    enum wire_event_kind kind;
    int64_t time_ns;
    /* wire_config.nodes = the foreign node of WIRE_FAULT_COLLISION */
    size_t node;
    const struct bus_frame *frame; /* its time_ns is the time of the event; NULL for STATUS */
    uint64_t receivers;            /* mask of nodes */
    enum wire_error error;         /* only for BUS_ERROR */
    enum wire_state state;         /* only for STATUS */
    unsigned tec, rec;             /* only for BUS_ERROR and STATUS: counters after the event */
};

/* Why a frame was dropped. */
enum wire_drop {
    WIRE_DROP_QUEUE_FULL,
    WIRE_DROP_BUS_OFF,   /* its node was bus-off, or became bus-off while it waited */
    WIRE_DROP_INVALID,   /* impossible length or identifier; FD on a classic bus */
    WIRE_DROP_LATE_FULL, /* more than WIRE_LATE_MAX held back */
    WIRE_DROPS
};

struct wire_config {
    int64_t bitrate, data_bitrate; /* bit/s; data_bitrate: of FD frames with BRS, 0 = bitrate */
    bool fd;
    size_t nodes; /* 1 to WIRE_NODES_MAX */
    size_t queue; /* queue of each node in frames, 1 to 4096 */
    enum wire_order order;
    int64_t restart_delay_ns; /* delay of the recovery after bus-off; negative = never */
    int64_t window_ns;        /* averaging window of the present and the peak load; 0 = 100 ms */
    uint64_t seed;            /* seed of the faults' random numbers */
    /* wire_advance calls it for each event, in order of time. It must not call functions of the
     * wire, except wire_stop. May be NULL. */
    void (*notify)(void *context, const struct wire_event *event);
    void *context;
    uint32_t events; /* wanted events, bits 1 << enum wire_event_kind; 0 = all */
};

struct wire;

/* Creates a wire in memory from arena. ERROR_INPUT names a value out of range. Not RT-safe. */
enum error_code wire_create(const struct wire_config *config, struct arena *arena,
                            struct wire **wire, struct error *error);

/* Gives a frame to a node's controller. Returns false when it was dropped; wire_stats has the
 * reason. */
bool wire_transmit(struct wire *wire, size_t node, const struct bus_frame *frame);

/* Runs the bus up to a time. An earlier time than before has no effect. Returns the time that the
 * bus has reached: to_ns, or the time of wire_stop. */
int64_t wire_advance(struct wire *wire, int64_t to_ns);

/* Makes the present wire_advance end at a time, which is not before the present event. Only for
 * `notify`: a node that has received a frame can send at that time. */
void wire_stop(struct wire *wire, int64_t time_ns);

/* Returns the memory of the wire, which includes faults, statistics and random numbers. To restore
 * the wire, copy a saved copy back to the same address. */
void *wire_memory(struct wire *wire, size_t *size);

/* ---- faults ---- */

enum wire_fault_kind {
    /* Noise on the line: all nodes read one bit behind the arbitration field inverted. */
    WIRE_FAULT_CORRUPT,
    /* Only `receiver` reads a bit inverted. Its error flag destroys the frame; if it is error
     * passive, it only misses the frame. */
    WIRE_FAULT_CORRUPT_AT,
    /* The bus carries the frame, but no node (or not `receiver`) receives it: an overrun in the
     * receiving controller. */
    WIRE_FAULT_LOSS,
    /* The sender misreads the last bit of EOF, after the receivers have accepted the frame, and
     * sends it again. */
    WIRE_FAULT_DUPLICATE,
    /* Receivers get the frame delay_ns late, as with a slow driver. */
    WIRE_FAULT_LATE,
    /* A foreign node sends the same identifier with other data at the same time. It counts its own
     * errors and may go bus-off, which ends the collisions until it recovers. */
    WIRE_FAULT_COLLISION,
};

enum { WIRE_ANY = -1 };

/* Applies to frames of `node` that match the identifier and start within [from_ns, until_ns). */
struct wire_fault {
    enum wire_fault_kind kind;
    int node;                  /* sending node, WIRE_ANY = all */
    int receiver;              /* CORRUPT_AT: a node; LOSS, LATE: a node or WIRE_ANY */
    uint32_t id, id_mask;      /* (frame id ^ id) & id_mask == 0; mask 0 = every frame */
    double probability;        /* per frame; 0 or >= 1: every frame */
    uint64_t count;            /* ends after this many hits; 0 = no limit */
    int64_t from_ns, until_ns; /* until_ns 0 = no end */
    int64_t delay_ns;          /* only for LATE */
};

/* Arms a fault. Returns its number, or -1 when WIRE_FAULTS_MAX are armed or a node does not exist.
 * Numbers of ended faults are used again. */
int wire_inject(struct wire *wire, const struct wire_fault *fault);

/* Ends a fault. Returns the number of frames that it has hit. */
uint64_t wire_heal(struct wire *wire, int fault);

/* Connects or disconnects a node. A disconnected node receives nothing, and its frames get no
 * acknowledgment. A newly connected node joins the bus after 11 recessive bits. */
void wire_connect(struct wire *wire, size_t node, bool connected);

/* ---- statistics ---- */

struct wire_node_stats {
    enum wire_state state;
    unsigned tec, rec, tec_peak, rec_peak;
    uint64_t confirmed, arbitration_lost, errors, bus_offs;
    uint64_t dropped[WIRE_DROPS];
    size_t queued, queued_peak;
};

struct wire_stats {
    uint64_t frames;              /* frames carried completely */
    uint64_t errors[WIRE_ERRORS]; /* destroyed frames, by the first error that their sender saw */
    uint64_t arbitration_lost, bus_offs;
    uint64_t dropped[WIRE_DROPS];
    int64_t time_ns, busy_ns;              /* busy: frames, error frames and intermissions */
    double load_mean, load_now, load_peak; /* 0 to 1; now = the last complete window */
    size_t queued, queued_peak;            /* present and greatest number of frames in all queues */
    /* longest time from wire_transmit to reception, and the identifier of its frame */
    int64_t latency_max_ns;
    uint32_t latency_max_id;
};

void wire_stats(const struct wire *wire, struct wire_stats *stats);
uint64_t wire_dropped(const struct wire *wire); /* all causes */
void wire_node_stats(const struct wire *wire, size_t node, struct wire_node_stats *stats);

/* Checks whether some node has an error counter above 0 or is in bus-off. RT-safe. */
bool wire_has_errors(const struct wire *wire);

const char *wire_error_name(enum wire_error error);
const char *wire_drop_name(enum wire_drop drop);

#endif
