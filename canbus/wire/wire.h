/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN bus in virtual time: controllers with transmit queues on one wire. Frames take the exact
 * time of their stuffed bits (canbus/wire/bits.h), the lowest identifier wins the arbitration,
 * errors are signaled, counted and repeated by the rules of ISO 11898-1. Knows no thread and no
 * clock: time moves when the caller says so, and the same calls give the same events bit for bit.
 * The names of the events are those of FMI-LS-BUS.
 *
 * Time. wire_advance(to) ends every frame that ends by `to` and starts every frame that can start
 * before it; a frame handed over with wire_transmit is ready at the time up to which the wire was
 * last advanced. So everything that is handed over between two advances competes on equal terms,
 * whatever the order of the calls. A frame is received at the end of its seven bits of EOF; three
 * bits of intermission follow. Times are rounded to whole nanoseconds, exact where the bit rate
 * divides 1 GHz; of frames that follow each other no rounding adds up, unless faults may meet them.
 *
 * Queues. Each node has one bounded queue; what finds it full is dropped and counted. By default it
 * is a bank of mailboxes: the frame that would win the arbitration goes first, equal ones in the
 * order in which they came. WIRE_FIFO sends strictly in order, as controllers with a FIFO do, and
 * then an urgent frame waits behind others. A frame on the wire is not preempted.
 *
 * Errors. Every error ends the frame with an error flag of 6 bits, with the flags that other nodes
 * answer 6 to 12, and a delimiter of 8; the frame is sent again. Error counters (TEC, REC) move by
 * +8, +1 and -1 as the standard says; from 96 a node is in warning, from 128 error passive (its
 * flags are recessive and disturb nobody; after sending it waits another 8 bits), with TEC from 256
 * bus-off: it loses its queue and neither sends nor receives until it has seen 128 times 11
 * recessive bits, counted from restart_delay_ns after bus-off. A frame that no node acknowledges is
 * an error too; being alone makes a node error passive, never bus-off.
 *
 * All functions but wire_create are RT-safe and belong to one thread.
 */
#ifndef CANBUS_WIRE_WIRE_H
#define CANBUS_WIRE_WIRE_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

#include <stddef.h>

enum {
    WIRE_NODES_MAX = 63,
    WIRE_FAULTS_MAX = 16,
    WIRE_LATE_MAX = 64, /* frames that WIRE_FAULT_LATE holds back at a time */
    WIRE_IDS_MAX = 1536 /* identifiers that have a latency of their own */
};

enum wire_order { WIRE_PRIORITY, WIRE_FIFO };

/* The state of a node's controller (ISO 11898-1). */
enum wire_state { WIRE_ERROR_ACTIVE, WIRE_ERROR_WARNING, WIRE_ERROR_PASSIVE, WIRE_BUS_OFF };

/* What kind of error a node has found; those of FMI-LS-BUS. */
enum wire_error {
    WIRE_BIT_ERROR, /* the transmitter read something else than it sent */
    WIRE_STUFF_ERROR,
    WIRE_FORM_ERROR,
    WIRE_CRC_ERROR,
    WIRE_ACK_ERROR,
    WIRE_ERRORS
};

enum wire_event_kind {
    WIRE_TRANSMIT,         /* frame of node has been received by the nodes in `receivers` */
    WIRE_CONFIRM,          /* the same moment, for the node that sent it */
    WIRE_ARBITRATION_LOST, /* node had to give way to the frame; at the start of that */
    WIRE_BUS_ERROR,        /* node's frame was destroyed and will be repeated */
    WIRE_STATUS,           /* node's controller has changed to `state` */
};

struct wire_event {
    enum wire_event_kind kind;
    int64_t time_ns;
    size_t node;                   /* wire_config.nodes: the foreign one of WIRE_FAULT_COLLISION */
    const struct bus_frame *frame; /* time_ns of it is the time of the event; NULL with STATUS */
    uint64_t receivers;            /* bit of each node */
    enum wire_error error;         /* BUS_ERROR */
    enum wire_state state;         /* STATUS */
    unsigned tec, rec;             /* BUS_ERROR, STATUS: of the node, after */
};

/* Why a frame was dropped. */
enum wire_drop {
    WIRE_DROP_QUEUE_FULL,
    WIRE_DROP_BUS_OFF,   /* was in the queue, or came, while its node was bus-off */
    WIRE_DROP_INVALID,   /* impossible length or identifier; FD on a classic bus */
    WIRE_DROP_LATE_FULL, /* more than WIRE_LATE_MAX held back */
    WIRE_DROPS
};

struct wire_config {
    int64_t bitrate, data_bitrate; /* bit/s; data_bitrate: of FD frames with BRS, 0 = bitrate */
    bool fd;
    size_t nodes; /* 1 to WIRE_NODES_MAX */
    size_t queue; /* frames a node holds, 1 to 4096 */
    enum wire_order order;
    int64_t restart_delay_ns; /* bus-off until the recovery begins; negative: never */
    int64_t window_ns;        /* of the load now and at its peak; 0 = 100 ms */
    uint64_t seed;            /* of the faults' random numbers */
    /* Called from wire_advance in the order of time; must not call the wire. May be NULL. */
    void (*notify)(void *context, const struct wire_event *event);
    void *context;
    uint32_t events; /* bits 1 << enum wire_event_kind of those wanted; 0 = all */
};

struct wire;

/* Creates a wire in memory from arena. ERROR_INPUT names what is out of range. Not RT-safe. */
enum error_code wire_create(const struct wire_config *config, struct arena *arena,
                            struct wire **wire, struct error *error);

/* Hands a frame to a node's controller. False when it was dropped; wire_stats says why. */
bool wire_transmit(struct wire *wire, size_t node, const struct bus_frame *frame);

/* Runs the bus up to a time; an earlier one than before changes nothing. */
void wire_advance(struct wire *wire, int64_t to_ns);

int64_t wire_now(const struct wire *wire);

/* Returns all memory of the wire, with its faults, statistics and random numbers: copied and put
 * back to the same address it restores the wire. */
void *wire_memory(struct wire *wire, size_t *size);

/* ---- faults ---- */

enum wire_fault_kind {
    /* Noise on the line: a bit behind the arbitration field is inverted for everybody. */
    WIRE_FAULT_CORRUPT,
    /* One node alone reads a bit wrong (`receiver`): its error flag destroys the frame, unless it
     * is error passive and only misses it. */
    WIRE_FAULT_CORRUPT_AT,
    /* Received by nobody (or not by `receiver`) although the bus carried it: an overrun in the
     * receiving controller. */
    WIRE_FAULT_LOSS,
    /* The sender misses the last bit of EOF, when the receivers have taken the frame, and repeats
     * it. */
    WIRE_FAULT_DUPLICATE,
    /* Received delay_ns late, as from a receiver with a slow driver. */
    WIRE_FAULT_LATE,
    /* A foreign node sends the same identifier with other data at the same moment. That node counts
     * its own errors and may go bus-off, which ends the collisions until it recovers. */
    WIRE_FAULT_COLLISION,
};

enum { WIRE_ANY = -1 };

/* Hits the frames of `node` that match the identifier and start within [from_ns, until_ns). */
struct wire_fault {
    enum wire_fault_kind kind;
    int node;                  /* sender, WIRE_ANY = all */
    int receiver;              /* CORRUPT_AT: a node; LOSS, LATE: a node or WIRE_ANY */
    uint32_t id, id_mask;      /* (frame id ^ id) & id_mask == 0; mask 0 = every frame */
    double probability;        /* of each such frame; 0 or 1 and more: all */
    uint64_t count;            /* ends after so many hits; 0 = no limit */
    int64_t from_ns, until_ns; /* until_ns 0 = for ever */
    int64_t delay_ns;          /* LATE */
};

/* Arms a fault. Returns its number, or -1 when WIRE_FAULTS_MAX are armed or a node does not exist.
 * Numbers of faults that are over are given out again. */
int wire_inject(struct wire *wire, const struct wire_fault *fault);

/* Ends a fault; returns how many frames it has hit. */
uint64_t wire_heal(struct wire *wire, int fault);

/* Returns how many frames an armed fault has hit so far. */
uint64_t wire_fault_hits(const struct wire *wire, int fault);

/* Connects or disconnects one node: disconnected it receives nothing and nobody acknowledges what
 * it sends; connected again it joins after 11 recessive bits. */
void wire_connect(struct wire *wire, size_t node, bool connected);

/* Puts a node into bus-off at once, as after a short circuit. */
void wire_force_bus_off(struct wire *wire, size_t node);

/* ---- statistics ---- */

struct wire_node_stats {
    enum wire_state state;
    unsigned tec, rec, tec_peak, rec_peak;
    uint64_t confirmed, arbitration_lost, errors, bus_offs;
    uint64_t dropped[WIRE_DROPS];
    size_t queued, queued_peak;
};

struct wire_stats {
    uint64_t frames;              /* carried to their end */
    uint64_t errors[WIRE_ERRORS]; /* frames destroyed, by what their sender saw first */
    uint64_t arbitration_lost, bus_offs;
    uint64_t dropped[WIRE_DROPS];
    int64_t time_ns, busy_ns; /* frames, error frames and the intermission behind them */
    double load_mean, load_now, load_peak; /* 0 to 1; now = the last whole window */
    size_t queued, queued_peak;            /* of all nodes together */
};

/* Latency of an identifier, from wire_transmit to reception; all identifiers beyond WIRE_IDS_MAX
 * share one entry. */
struct wire_latency {
    uint32_t id;
    bool extended;
    bool others; /* the shared entry */
    uint64_t count;
    int64_t min_ns, max_ns, sum_ns;
};

void wire_stats(const struct wire *wire, struct wire_stats *stats);
uint64_t wire_dropped(const struct wire *wire); /* of all causes together */
void wire_node_stats(const struct wire *wire, size_t node, struct wire_node_stats *stats);

/* Checks whether some node has an error counter that is not 0, or is in bus-off. RT-safe. */
bool wire_has_errors(const struct wire *wire);

/* Copies up to max entries, in no particular order; returns how many there are. */
size_t wire_latencies(const struct wire *wire, struct wire_latency *latency, size_t max);

/* Returns the entry with the largest max_ns; its count is 0 before the first frame. */
struct wire_latency wire_worst_latency(const struct wire *wire);

const char *wire_error_name(enum wire_error error);
const char *wire_drop_name(enum wire_drop drop);

#endif
