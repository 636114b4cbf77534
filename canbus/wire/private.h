/* SPDX-License-Identifier: Apache-2.0 */
/* The state of the wire, and the functions that its files share. All RT-safe. */
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
    WIRE_RECOVERY_RUNS = 128, /* number of runs of WIRE_RUN_BITS recessive bits */
    WIRE_RUN_BITS = 11,
};

#define WIRE_NEVER INT64_MAX
#define WIRE_BIT(node) (UINT64_C(1) << (node))

struct wire_slot {
    struct bus_frame frame;
    int64_t ready_ns;
    uint32_t priority; /* result of wire_priority */
    uint32_t order;    /* order of arrival at the node */
};

struct wire_node {
    struct wire_slot *slot;
    uint16_t *heap;  /* waiting slots, the next one first */
    uint16_t *spare; /* free slots */
    size_t waiting, nspare;
    uint16_t flying; /* slot of the frame on the wire */
    uint32_t order;
    int64_t hold_ns; /* earliest next start (suspend transmission, or after plugging in) */
    int64_t void_ns; /* unplugged: end of its last attempt */

    /* In bus-off */
    int64_t recovery_ns; /* when counting begins */
    unsigned runs;       /* runs of WIRE_RUN_BITS seen so far */

    struct wire_node_stats stats;
};

/* Remainder of a time after rounding to ns, less than half a nanosecond. Units of ns / (bit/s), for
 * the nominal and the data bit rate. 0 if both rates divide 1 GHz. */
struct wire_rest {
    int64_t nominal, data;
};

/* The frame or error on the wire. Its outcome is decided when it starts. */
struct wire_flight {
    bool busy;
    bool disturbed; /* wire_disturb has decided the outcome */
    bool failed;
    bool repeat;         /* received, but the sender sends it again */
    uint64_t senders;    /* mask; several bits: equal frames, or a collision */
    uint64_t beaten;     /* passive senders that dropped out of a collision */
    uint64_t first;      /* receivers that detected the error first */
    uint64_t blind;      /* passive receivers that detected an error alone */
    uint64_t lost, late; /* receivers that lose the frame, or get it late */
    bool unacknowledged;
    enum wire_error error;
    int64_t start_ns, end_ns; /* end of EOF or of the error delimiter */
    struct wire_rest rest;    /* rounding remainder of end_ns */
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
    size_t size; /* size of the wire's memory, which begins here */
    struct wire_tables tables;
    int64_t now_ns;
    int64_t until_ns; /* end of the present advance */
    int64_t delimiter_ns;
    struct wire_node *node; /* config.nodes, then the foreign node of collisions */

    /* Masks of nodes */
    uint64_t all;     /* without the foreign node */
    uint64_t pending; /* nodes with waiting frames */
    uint64_t off;     /* nodes in bus-off */
    uint64_t unplugged;
    uint64_t counting; /* nodes with TEC or REC above 0 */

    int64_t idle_ns;       /* end of the last intermission */
    struct wire_rest rest; /* rounding remainder of idle_ns */
    int64_t recessive_ns;  /* idle bus: time since when it has been recessive */
    struct wire_flight flight;

    struct wire_armed fault[WIRE_FAULTS_MAX];
    size_t armed;
    struct random_stream random;
    struct wire_late late[WIRE_LATE_MAX];
    size_t nlate;
    struct wire_bits bits[2];

    struct wire_load load;
    struct wire_stats stats;
};

/* Runs the following block with `node` set to the index of each bit in a mask. */
#define WIRE_FOR_EACH(node, mask)                                                                  \
    for (uint64_t left_ = (mask), bit_;                                                            \
         left_ && ((node) = (size_t)__builtin_ctzll(left_), bit_ = left_ & -left_, true);          \
         left_ ^= bit_)

static inline int64_t wire_bits_ns(const struct wire *wire, int64_t bits)
{
    return (bits * 1000000000 + wire->config.bitrate / 2) / wire->config.bitrate;
}

/* Returns the duration of a number of bits, ns. Adds the rounding remainder *rest and updates
 * it. */
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

/* Returns the nodes that receive and acknowledge the frame on the wire, as a mask. */
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

/* Changes the error counters and the resulting state; bus-off empties the queue. */
void wire_count_errors(struct wire *wire, size_t node, int64_t time_ns, int tec, int rec);

/* wire_recovery_end returns when bus-off ends if the bus
 * stays idle. wire_count_runs counts the recessive bits that nodes in bus-off have seen when a
 * frame starts. */
int64_t wire_recovery_end(const struct wire *wire, const struct wire_node *node);
void wire_count_runs(struct wire *wire, int64_t start_ns);

/* errors.c. At its start, decides the outcome of a frame that may meet faults, collisions or no
 * receiver; counts the errors at its end. */
void wire_disturb(struct wire *wire);
void wire_finish_error(struct wire *wire);

/* stats.c */
void wire_load_add(struct wire_load *load, int64_t window_ns, int64_t from_ns, int64_t to_ns);

#endif
