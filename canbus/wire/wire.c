/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a wire and advances its time: arbitration, reception, late frames, recovery. */
#include "canbus/wire/private.h"

/* ---- creation ---- */

enum { QUEUE_MAX = 4096, FOREIGN_QUEUE = 1 };

/* Window over which the load is measured, ns. */
#define WINDOW_DEFAULT_NS 100000000

/* Checks the ranges of a wire's configuration. */
static enum error_code wire_check_config(const struct wire_config *config, struct error *error)
{
    if (config->nodes < 1 || config->nodes > WIRE_NODES_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu nodes on a wire, expected 1 to %d",
                         config->nodes, WIRE_NODES_MAX);
    }
    if (config->queue < 1 || config->queue > QUEUE_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found a transmit queue of %zu frames, expected 1 to %d", config->queue,
                         QUEUE_MAX);
    }
    if (config->bitrate < 1000 || config->bitrate > 1000000) {
        return error_set(error, ERROR_INPUT, "found a bit rate of %lld bit/s, expected 1000 to 1e6",
                         (long long)config->bitrate);
    }
    if (config->data_bitrate &&
        (config->data_bitrate < config->bitrate || config->data_bitrate > 20000000)) {
        return error_set(error, ERROR_INPUT,
                         "found a data bit rate of %lld bit/s, expected the nominal %lld to 20e6",
                         (long long)config->data_bitrate, (long long)config->bitrate);
    }
    if (config->window_ns < 0) {
        return error_set(error, ERROR_INPUT, "found a negative window of the load");
    }
    return ERROR_NONE;
}

/* Allocates the transmit queue of a node with all slots free; false = out of memory. */
static bool wire_create_node(struct wire_node *node, size_t queue, struct arena *arena)
{
    node->slot = arena_alloc(arena, queue, sizeof *node->slot);
    node->heap = arena_alloc(arena, queue, sizeof *node->heap);
    node->spare = arena_alloc(arena, queue, sizeof *node->spare);
    if (!node->slot || !node->heap || !node->spare) {
        return false;
    }
    while (node->nspare < queue) {
        node->spare[node->nspare] = (uint16_t)(queue - 1 - node->nspare);
        node->nspare++;
    }
    return true;
}

enum error_code wire_create(const struct wire_config *config, struct arena *arena,
                            struct wire **out, struct error *error)
{
    struct wire *wire;
    enum error_code code = wire_check_config(config, error);
    bool good;

    if (code) {
        return code;
    }

    /* Allocate the wire, its nodes and the foreign node in one block, for wire_memory */
    wire = arena_alloc(arena, 1, sizeof *wire);
    good = wire && (wire->node = arena_alloc(arena, config->nodes + 1, sizeof *wire->node));
    for (size_t i = 0; good && i <= config->nodes; i++) {
        good = wire_create_node(&wire->node[i], i < config->nodes ? config->queue : FOREIGN_QUEUE,
                                arena);
    }
    if (!good) {
        return error_set(error, ERROR_MEMORY, "no memory for a wire of %zu nodes", config->nodes);
    }

    /* Apply the defaults to the configuration */
    wire->config = *config;
    if (!config->data_bitrate) {
        wire->config.data_bitrate = config->bitrate;
    }
    if (!config->window_ns) {
        wire->config.window_ns = WINDOW_DEFAULT_NS;
    }
    if (!config->events) {
        wire->config.events = UINT32_MAX;
    }

    /* Derived values */
    wire_tables_make(&wire->tables);
    wire->all = WIRE_BIT(config->nodes) - 1;
    wire->delimiter_ns = wire_bits_ns(wire, WIRE_DELIMITER_BITS);
    wire->random = random_named(config->seed, "wire");
    wire->size = (size_t)(arena->memory + arena->used - (unsigned char *)wire);
    *out = wire;
    return ERROR_NONE;
}

void *wire_memory(struct wire *wire, size_t *size)
{
    *size = wire->size;
    return wire;
}

void wire_notify(const struct wire *wire, const struct wire_event *event)
{
    if (wire->config.notify && wire->config.events & 1u << event->kind) {
        wire->config.notify(wire->config.context, event);
    }
}

/* ---- arbitration ---- */

/* Returns the earliest time at which a node with waiting frames may start one, ns. */
static inline int64_t wire_node_may_start(const struct wire *wire, size_t index)
{
    const struct wire_node *node = &wire->node[index];
    int64_t at = node->slot[node->heap[0]].ready_ns;

    at = wire->idle_ns > at ? wire->idle_ns : at;
    return node->hold_ns > at ? node->hold_ns : at;
}

/* Result of the next arbitration. */
struct wire_arbitration {
    int64_t at_ns;   /* WIRE_NEVER = no node has a waiting frame */
    uint64_t winner; /* the nodes with the lowest priority number */
    uint64_t loser;  /* the other nodes that start at this time */
};

/* Finds the next arbitration: the earliest start, and the lowest priority number among the nodes
 * that start then. */
static inline struct wire_arbitration wire_next_arbitration(const struct wire *wire)
{
    struct wire_arbitration next = {.at_ns = WIRE_NEVER};
    uint32_t lowest = UINT32_MAX;
    size_t index;

    WIRE_FOR_EACH(index, wire->pending & ~wire->unplugged)
    {
        const struct wire_node *node = &wire->node[index];
        const uint32_t priority = node->slot[node->heap[0]].priority;
        const int64_t at = wire_node_may_start(wire, index);
        const uint64_t bit = WIRE_BIT(index);

        if (at < next.at_ns) {
            next = (struct wire_arbitration){.at_ns = at, .winner = bit};
            lowest = priority;
        } else if (at > next.at_ns) {
            continue;
        } else if (priority < lowest) {
            next.loser |= next.winner;
            next.winner = bit;
            lowest = priority;
        } else if (priority == lowest) {
            next.winner |= bit;
        } else {
            next.loser |= bit;
        }
    }
    return next;
}

/* Counts and reports the nodes that have lost an arbitration. */
static void wire_notify_losers(struct wire *wire, uint64_t losers, const struct bus_frame *frame)
{
    size_t index;

    WIRE_FOR_EACH(index, losers)
    {
        wire->node[index].stats.arbitration_lost++;
        wire->stats.arbitration_lost++;
        if (!(wire->config.events & 1 << WIRE_ARBITRATION_LOST)) {
            continue;
        }
        wire_notify(wire, &(struct wire_event){.kind = WIRE_ARBITRATION_LOST,
                                               .time_ns = wire->flight.start_ns,
                                               .node = index,
                                               .frame = frame});
    }
}

/* Moves the first frame of a node's queue to the wire. The controller sets ESI of an FD frame when
 * it is error passive. */
static void wire_take_from_queue(struct wire *wire, size_t index)
{
    struct wire_node *node = &wire->node[index];
    struct bus_frame *frame;

    node->flying = wire_queue_pop(wire, node);
    wire->pending &= node->waiting ? UINT64_MAX : ~WIRE_BIT(index);
    frame = &node->slot[node->flying].frame;
    if (frame->flags & FRAME_FD) {
        frame->flags &= (uint8_t)~FRAME_ESI;
        frame->flags |= wire_is_passive(node) ? FRAME_ESI : 0;
    }
}

/* Starts the winning frame and decides its outcome. */
static void wire_start_frame(struct wire *wire, const struct wire_arbitration *arbitration)
{
    struct wire_flight *flight = &wire->flight;
    const int64_t time_ns = arbitration->at_ns;
    struct wire_length length;
    struct bus_frame *frame;
    size_t index;

    /* Start exactly at the end of the last frame (rest), so that rounding errors do not
     * accumulate */
    *flight =
        (struct wire_flight){.busy = true, .start_ns = time_ns, .senders = arbitration->winner};
    if (time_ns == wire->idle_ns) {
        flight->rest = wire->rest;
    }
    WIRE_FOR_EACH(index, flight->senders)
    {
        wire_take_from_queue(wire, index);
    }

    /* The idle time before the frame counts toward the recovery of nodes in bus-off */
    if (wire->off) {
        wire_count_runs(wire, time_ns);
    }

    /* Compute its end, with stuff bits */
    frame = &wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame;
    frame->time_ns = time_ns;
    wire_notify_losers(wire, arbitration->loser, frame);
    length = wire_frame_length(&wire->tables, frame);
    flight->end_ns =
        time_ns + wire_span_ns(length.nominal, wire->config.bitrate, &flight->rest.nominal);
    if (length.data) {
        flight->end_ns += wire_span_ns(length.data, wire->config.data_bitrate, &flight->rest.data);
    }

    /* Usually nothing disturbs the frame: its length decides its end */
    if (wire->armed || (flight->senders & (flight->senders - 1)) || !wire_listeners(wire)) {
        flight->disturbed = true;
        wire_disturb(wire);
    }
}

/* ---- the end of a frame ---- */

/* Reports a received frame to its receivers (a mask). */
static void wire_deliver_frame(struct wire *wire, size_t sender, const struct bus_frame *frame,
                               uint64_t receivers)
{
    if (receivers) {
        wire_notify(wire, &(struct wire_event){.kind = WIRE_TRANSMIT,
                                               .time_ns = frame->time_ns,
                                               .node = sender,
                                               .frame = frame,
                                               .receivers = receivers});
    }
}

/* Stores a frame for receivers that get it late. */
static void wire_deliver_late(struct wire *wire, size_t sender, const struct bus_frame *frame,
                              uint64_t receivers)
{
    struct wire_late *late = &wire->late[wire->nlate];

    if (wire->nlate == WIRE_LATE_MAX) {
        wire_count_drop(wire, sender, WIRE_DROP_LATE_FULL);
        return;
    }
    wire->nlate++;
    late->frame = *frame;
    late->frame.time_ns = late->time_ns = frame->time_ns + wire->flight.late_ns;
    late->node = sender;
    late->receivers = receivers;
}

/* Ends a good frame: reception, confirmation, error counters. */
static void wire_finish_good(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    const uint64_t listeners = wire_listeners(wire);
    const uint64_t receivers = listeners & ~(flight->lost | flight->blind);
    const size_t sender = (size_t)__builtin_ctzll(flight->senders);
    struct bus_frame *frame = &wire_flying(wire, sender)->frame;
    size_t index;

    frame->time_ns = flight->end_ns;
    wire->stats.frames++;
    wire_deliver_frame(wire, sender, frame, receivers & ~flight->late);
    if (receivers & flight->late) {
        wire_deliver_late(wire, sender, frame, receivers & flight->late);
    }
    /* Duplicate: the sender detects an error and sends the frame again */
    if (flight->repeat) {
        return;
    }
    WIRE_FOR_EACH(index, flight->senders)
    {
        /* Confirm a frame to its sender, count its latency, and free its slot */
        struct wire_node *node = &wire->node[index];
        struct wire_slot *slot = &node->slot[node->flying];
        const int64_t latency_ns = wire->flight.end_ns - slot->ready_ns;

        slot->frame.time_ns = wire->flight.end_ns;
        node->stats.confirmed++;
        if (index < wire->config.nodes && latency_ns > wire->stats.latency_max_ns) {
            wire->stats.latency_max_ns = latency_ns;
            wire->stats.latency_max_id = slot->frame.id;
        }
        if (wire->config.events & 1 << WIRE_CONFIRM) {
            wire_notify(wire, &(struct wire_event){.kind = WIRE_CONFIRM,
                                                   .time_ns = wire->flight.end_ns,
                                                   .node = index,
                                                   .frame = &slot->frame});
        }
        wire_slot_free(wire, node, node->flying);
    }
    /* Success lowers the error counters of senders and receivers */
    WIRE_FOR_EACH(index, wire->counting & (flight->senders | (listeners & ~flight->blind)))
    {
        bool sent = flight->senders & WIRE_BIT(index);

        wire_count_errors(wire, index, flight->end_ns, sent ? -1 : 0, sent ? 0 : -1);
    }
}

/* Puts unsent frames back into the queues. */
static void wire_return_to_queue(struct wire *wire, uint64_t nodes)
{
    size_t index;

    WIRE_FOR_EACH(index, nodes)
    {
        struct wire_node *node = &wire->node[index];

        if (index == wire->config.nodes) {
            wire_slot_free(wire, node, node->flying);
        } else if (wire->off & WIRE_BIT(index)) {
            wire_slot_free(wire, node, node->flying);
            wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        } else {
            wire_queue_push(wire, node, node->flying);
            wire->pending |= WIRE_BIT(index);
        }
    }
}

/* Ends the frame on the wire; the bus is idle after the intermission. */
static void wire_finish_frame(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;

    wire->rest = flight->rest;
    wire->idle_ns = flight->end_ns +
                    wire_span_ns(WIRE_INTERMISSION_BITS, wire->config.bitrate, &wire->rest.nominal);
    wire->recessive_ns = flight->end_ns - wire->delimiter_ns;
    if (flight->disturbed || wire->off | wire->unplugged | wire->counting) {
        /* End a disturbed frame, or one with disturbed senders */
        const uint64_t senders = flight->senders | flight->beaten;
        const uint64_t gone = senders & (wire->off | wire->unplugged);
        size_t index;

        /* A node that was unplugged or put into bus-off meanwhile has sent nothing */
        wire_return_to_queue(wire, gone);
        flight->senders &= ~gone;
        flight->beaten &= ~gone;

        /* The receivers may have accepted the frame, even if it is sent again */
        if (flight->senders && !flight->failed) {
            wire_finish_good(wire);
        }
        if (flight->failed || flight->repeat) {
            wire_return_to_queue(wire, flight->senders);
        }
        wire_return_to_queue(wire, flight->beaten);

        /* Update the error counters; suspend transmission of senders that are now passive */
        if (flight->failed || flight->repeat || flight->beaten || flight->blind) {
            wire_finish_error(wire);
        }
        WIRE_FOR_EACH(index, senders & wire->counting)
        {
            if (wire_is_passive(&wire->node[index])) {
                wire->node[index].hold_ns = wire->idle_ns + wire_bits_ns(wire, WIRE_SUSPEND_BITS);
            }
        }
    } else {
        wire_finish_good(wire);
    }
    wire->stats.busy_ns += wire->idle_ns - flight->start_ns;
    wire_load_add(&wire->load, wire->config.window_ns, flight->start_ns, wire->idle_ns);
    flight->busy = false;
}

/* ---- events other than frames ---- */

/* Returns the time when an unplugged node ends its next attempt to send. Without acknowledgment,
 * its own error flag follows. WIRE_NEVER = no waiting frame, or the error counter no longer
 * changes. */
static int64_t wire_attempt_end(const struct wire *wire, size_t index)
{
    const struct wire_node *node = &wire->node[index];
    const struct wire_slot *slot = &node->slot[node->heap[0]];
    const int64_t begin = slot->ready_ns > node->void_ns ? slot->ready_ns : node->void_ns;

    if (!node->waiting || wire_is_passive(node)) {
        return WIRE_NEVER;
    }
    /* The attempt lasts up to the ACK slot, without ACK delimiter and EOF. Error flag, delimiter
     * and intermission follow */
    return begin +
           wire_length_ns(wire_frame_length(&wire->tables, &slot->frame), wire->config.bitrate,
                          wire->config.data_bitrate) +
           wire_bits_ns(wire, WIRE_ERROR_FLAG_BITS + WIRE_DELIMITER_BITS + WIRE_INTERMISSION_BITS -
                                  WIRE_EOF_BITS - 1);
}

enum wire_step_kind { STEP_NONE, STEP_FINISH, STEP_RECOVER, STEP_LATE, STEP_ATTEMPT, STEP_START };

struct wire_step {
    enum wire_step_kind kind;
    int64_t time_ns;
    size_t index;
};

/* Replaces the earliest step found so far if this step is earlier. */
static void wire_keep_earlier_step(struct wire_step *step, enum wire_step_kind kind,
                                   int64_t time_ns, size_t index)
{
    if (time_ns < step->time_ns) {
        *step = (struct wire_step){kind, time_ns, index};
    }
}

/* Takes the next step of any kind up to to_ns; false = there is none. */
static bool wire_take_step(struct wire *wire, int64_t to_ns)
{
    /* Find the next step up to and including to_ns. If steps are simultaneous, the first in the
     * order below wins. */
    struct wire_step step = {STEP_NONE, to_ns < WIRE_NEVER ? to_ns + 1 : to_ns, 0};
    size_t index;

    if (wire->flight.busy) {
        wire_keep_earlier_step(&step, STEP_FINISH, wire->flight.end_ns, 0);
    } else if (wire->off) {
        WIRE_FOR_EACH(index, wire->off)
        {
            wire_keep_earlier_step(&step, STEP_RECOVER, wire_recovery_end(wire, &wire->node[index]),
                                   index);
        }
    }
    for (size_t i = 0; i < wire->nlate; i++) {
        wire_keep_earlier_step(&step, STEP_LATE, wire->late[i].time_ns, i);
    }
    WIRE_FOR_EACH(index, wire->unplugged & wire->pending)
    {
        wire_keep_earlier_step(&step, STEP_ATTEMPT, wire_attempt_end(wire, index), index);
    }
    if (!wire->flight.busy && wire->pending & ~wire->unplugged) {
        const int64_t at = wire_next_arbitration(wire).at_ns;

        if (at < to_ns) {
            wire_keep_earlier_step(&step, STEP_START, at, 0);
        }
    }

    struct wire_late *late = &wire->late[step.index];
    struct wire_arbitration arbitration;

    switch (step.kind) {
    case STEP_NONE:
        return false;
    case STEP_FINISH:
        wire_finish_frame(wire);
        break;
    case STEP_RECOVER:
        /* A node ends its bus-off with both error counters at 0 */
        wire->off &= ~WIRE_BIT(step.index);
        wire->node[step.index].stats.tec = wire->node[step.index].stats.rec = 0;
        wire_count_errors(wire, step.index, step.time_ns, 0, 0);
        break;
    case STEP_LATE:
        /* A late frame arrives */
        wire_deliver_frame(wire, late->node, &late->frame, late->receivers);
        wire->nlate--;
        memmove(late, late + 1, (wire->nlate - step.index) * sizeof *late);
        break;
    case STEP_ATTEMPT:
        /* A lone sender counts errors until it is error passive */
        wire->node[step.index].void_ns = step.time_ns;
        wire->node[step.index].stats.errors++;
        wire_count_errors(wire, step.index, step.time_ns, 8, 0);
        break;
    case STEP_START:
        arbitration = wire_next_arbitration(wire);
        wire_start_frame(wire, &arbitration);
        break;
    }
    return true;
}

/* Takes the next step in the fast case: no node is off or unplugged and no late frame waits, so
 * that only frames can happen. */
static bool wire_take_frame_step(struct wire *wire, int64_t to_ns)
{
    struct wire_arbitration next;

    if (wire->flight.busy) {
        if (wire->flight.end_ns > to_ns) {
            return false;
        }
        wire_finish_frame(wire);
        return true;
    }
    if (!wire->pending) {
        return false;
    }
    next = wire_next_arbitration(wire);
    if (next.at_ns >= to_ns) {
        return false;
    }
    wire_start_frame(wire, &next);
    return true;
}

int64_t wire_advance(struct wire *wire, int64_t to_ns)
{
    if (to_ns <= wire->now_ns) {
        return wire->now_ns;
    }
    wire->until_ns = to_ns;
    /* Usually only frames can happen: use the fast case */
    while (wire->off | wire->unplugged | wire->nlate ? wire_take_step(wire, wire->until_ns)
                                                     : wire_take_frame_step(wire, wire->until_ns)) {
    }
    wire->now_ns = wire->until_ns;
    return wire->now_ns;
}

void wire_stop(struct wire *wire, int64_t time_ns)
{
    wire->until_ns = time_ns < wire->until_ns ? time_ns : wire->until_ns;
}
