/* SPDX-License-Identifier: Apache-2.0 */
/* Private to canbus/wire: the state of the wire, and what its parts call of each other. All
 * RT-safe. */
#ifndef CANBUS_WIRE_PRIVATE_H
#define CANBUS_WIRE_PRIVATE_H

#include "base/random.h"
#include "canbus/wire/bits.h"
#include "canbus/wire/wire.h"

enum {
    WIRE_PASSIVE_FROM = 128, /* TEC or REC */
    WIRE_WARNING_FROM = 96,
    WIRE_BUS_OFF_FROM = 256, /* TEC */
    WIRE_SUSPEND_BITS = 8,
    WIRE_RECOVERY_RUNS = 128, /* of WIRE_RUN_BITS recessive bits */
    WIRE_RUN_BITS = 11,
    WIRE_ID_SLOTS = 2048,
};

#define WIRE_NEVER INT64_MAX
#define WIRE_BIT(node) (UINT64_C(1) << (node))

struct wire_slot {
    struct bus_frame frame;
    int64_t ready_ns;
    uint32_t priority; /* wire_priority */
    uint32_t order;    /* of arrival at the node */
};

struct wire_node {
    struct wire_slot *slot;
    uint16_t *heap;  /* slots that wait, the next one first */
    uint16_t *spare; /* slots that are free */
    size_t waiting, nspare;
    uint16_t flying; /* slot of the frame on the wire */
    uint32_t order;
    int64_t hold_ns; /* suspend transmission: may not start before */
    int64_t void_ns; /* unplugged: its last attempt ended */

    /* bus-off */
    int64_t recovery_ns; /* counting begins */
    unsigned runs;       /* of WIRE_RUN_BITS seen */

    struct wire_node_stats stats;
};

/* The rest of an exact time behind its whole nanoseconds, each less than half a nanosecond: in
 * ns / bit/s of the nominal and of the data bit rate. All 0 where both divide 1 GHz. */
struct wire_rest {
    int64_t nominal, data;
};

/* The frame or the error on the wire; all that will come of it is known when it starts. */
struct wire_flight {
    bool busy;
    bool disturbed; /* wire_disturb has decided what follows */
    bool failed;
    bool repeat;         /* received, but the sender missed it */
    uint64_t senders;    /* more than one: the same frame bit for bit, or an error */
    uint64_t beaten;     /* passive senders that dropped out of a collision */
    uint64_t first;      /* receivers that found the error before the others did */
    uint64_t blind;      /* passive receivers that found an error alone */
    uint64_t lost, late; /* receivers */
    bool unacknowledged;
    enum wire_error error;
    int64_t start_ns, end_ns; /* end of EOF or of the error delimiter */
    struct wire_rest rest;    /* of end_ns */
    int64_t late_ns;
};

struct wire_late {
    struct bus_frame frame;
    size_t node;
    uint64_t receivers;
    int64_t time_ns;
};

struct wire_load {
    int64_t window_begin_ns;
    int64_t window_busy_ns;
    double last, peak;
};

struct wire_armed {
    bool armed;
    struct wire_fault fault;
    uint64_t hits;
};

struct wire {
    struct wire_config config;
    size_t size; /* of the memory that begins here and holds all of the wire */
    struct wire_tables tables;
    int64_t now_ns;
    int64_t delimiter_ns;
    struct wire_node *node; /* config.nodes, and one more: the foreign node of collisions */

    /* A bit for each node */
    uint64_t all;     /* without the foreign node */
    uint64_t pending; /* has frames waiting */
    uint64_t off;     /* bus-off */
    uint64_t unplugged;
    uint64_t counting; /* TEC or REC is not 0 */

    int64_t idle_ns;       /* the end of the last intermission */
    struct wire_rest rest; /* of idle_ns */
    int64_t recessive_ns;  /* since when the line has been recessive, when nothing is on it */
    struct wire_flight flight;

    struct wire_armed fault[WIRE_FAULTS_MAX];
    size_t armed;
    struct random_stream random;
    struct wire_late late[WIRE_LATE_MAX];
    size_t nlate;
    struct wire_bits bits[2];

    struct wire_load load;
    struct wire_stats stats;
    struct wire_latency latency[WIRE_ID_SLOTS];
    struct wire_latency others;
    size_t nid;
};

/* Runs the following block with `node` as the index of each bit that is set in a mask. */
#define WIRE_FOR_EACH(node, mask)                                                                  \
    for (uint64_t left_ = (mask), bit_;                                                            \
         left_ && ((node) = (size_t)__builtin_ctzll(left_), bit_ = left_ & -left_, true);          \
         left_ ^= bit_)

static inline int64_t wire_bits_ns(const struct wire *wire, int64_t bits)
{
    return (bits * 1000000000 + wire->config.bitrate / 2) / wire->config.bitrate;
}

/* Returns the duration in ns of bits that begin *rest behind a whole nanosecond; *rest becomes
 * that of their end. */
static inline int64_t wire_span_ns(int64_t bits, int64_t bitrate, int64_t *rest)
{
    const int64_t exact = bits * 1000000000 + *rest;
    const int64_t ns = (exact + bitrate / 2) / bitrate;

    *rest = exact - ns * bitrate;
    return ns;
}

static inline bool wire_is_passive(const struct wire_node *node)
{
    return node->stats.tec >= WIRE_PASSIVE_FROM || node->stats.rec >= WIRE_PASSIVE_FROM;
}

/* Returns the nodes that read the frame on the wire and would acknowledge it, as a mask. */
static inline uint64_t wire_listeners(const struct wire *wire)
{
    return wire->all & ~(wire->off | wire->unplugged | wire->flight.senders | wire->flight.beaten);
}

static inline struct wire_slot *wire_flying(const struct wire *wire, size_t node)
{
    return &wire->node[node].slot[wire->node[node].flying];
}

/* nodes.c */
void wire_queue_push(const struct wire *wire, struct wire_node *node, uint16_t slot);
uint16_t wire_queue_pop(const struct wire *wire, struct wire_node *node);
void wire_count_drop(struct wire *wire, size_t node, enum wire_drop drop);

static inline void wire_slot_free(struct wire *wire, struct wire_node *node, uint16_t slot)
{
    node->spare[node->nspare++] = slot;
    node->stats.queued--;
    wire->stats.queued--;
}

/* wire.c */
void wire_notify(const struct wire *wire, const struct wire_event *event);

/* Changes the error counters and the state that follows from them; bus-off empties the
 * queue. */
void wire_count_errors(struct wire *wire, size_t node, int64_t time_ns, int tec, int rec);

/* Ends bus-off; returns when that will be if the bus stays idle; counts the recessive bits that
 * nodes in bus-off have seen when a frame starts. */
void wire_recover(struct wire *wire, size_t index, int64_t time_ns);
int64_t wire_recovery_end(const struct wire *wire, const struct wire_node *node);
void wire_count_runs(struct wire *wire, int64_t start_ns);

/* errors.c. Decides how a frame ends that may meet faults, collisions or no receiver, when it
 * starts; counts the errors of one that has ended so. */
void wire_disturb(struct wire *wire);
void wire_finish_error(struct wire *wire);

/* stats.c */
void wire_load_add(struct wire_load *load, int64_t window_ns, int64_t from_ns, int64_t to_ns);
void wire_latency_add(struct wire *wire, const struct bus_frame *frame, int64_t latency_ns);

#endif
