/* SPDX-License-Identifier: Apache-2.0 */
/* The nodes of the wire: transmit queues (binary heaps by priority or age), error counters,
 * controller states, bus-off and recovery, connection to the bus. */
#include "canbus/wire/private.h"

/* ---- queues ---- */

/* Checks whether a frame is sent before another: by priority if so configured, then by age. */
static bool wire_slot_goes_before(const struct wire *wire, const struct wire_slot *a,
                                  const struct wire_slot *b)
{
    if (wire->config.order == WIRE_PRIORITY && a->priority != b->priority) {
        return a->priority < b->priority;
    }
    return (int32_t)(a->order - b->order) < 0;
}

void wire_queue_push(const struct wire *wire, struct wire_node *node, uint16_t slot)
{
    size_t at = node->waiting++;

    /* Sift up: move the new slot above later ones */
    while (at > 0) {
        size_t parent = (at - 1) / 2;

        if (!wire_slot_goes_before(wire, &node->slot[slot], &node->slot[node->heap[parent]])) {
            break;
        }
        node->heap[at] = node->heap[parent];
        at = parent;
    }
    node->heap[at] = slot;
}

uint16_t wire_queue_pop(const struct wire *wire, struct wire_node *node)
{
    const uint16_t first = node->heap[0], moved = node->heap[--node->waiting];
    size_t at = 0, child;

    /* Sift down: move the last slot from the root to its place */
    while ((child = 2 * at + 1) < node->waiting) {
        if (child + 1 < node->waiting &&
            wire_slot_goes_before(wire, &node->slot[node->heap[child + 1]],
                                  &node->slot[node->heap[child]])) {
            child++;
        }
        if (!wire_slot_goes_before(wire, &node->slot[node->heap[child]], &node->slot[moved])) {
            break;
        }
        node->heap[at] = node->heap[child];
        at = child;
    }
    node->heap[at] = moved;
    return first;
}

void wire_count_drop(struct wire *wire, size_t node, enum wire_drop drop)
{
    wire->node[node].stats.dropped[drop]++;
    wire->stats.dropped[drop]++;
}

bool wire_transmit(struct wire *wire, size_t index, const struct bus_frame *frame)
{
    struct wire_node *node = &wire->node[index];
    struct wire_slot *slot;
    uint16_t free_slot;

    if (!frame_valid(frame) || (frame->flags & FRAME_ERROR) ||
        ((frame->flags & FRAME_FD) && !wire->config.fd)) {
        wire_count_drop(wire, index, WIRE_DROP_INVALID);
        return false;
    }
    if (wire->off & WIRE_BIT(index)) {
        wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        return false;
    }
    if (!node->nspare) {
        wire_count_drop(wire, index, WIRE_DROP_QUEUE_FULL);
        return false;
    }
    /* The frame becomes ready now */
    free_slot = node->spare[--node->nspare];
    slot = &node->slot[free_slot];
    slot->frame = *frame;
    slot->ready_ns = wire->now_ns;
    slot->priority = wire_priority(frame);
    slot->order = node->order++;
    wire_queue_push(wire, node, free_slot);

    /* Count a queued frame and update the peaks */
    node->stats.queued++;
    wire->stats.queued++;
    if (node->stats.queued > node->stats.queued_peak) {
        node->stats.queued_peak = node->stats.queued;
    }
    if (wire->stats.queued > wire->stats.queued_peak) {
        wire->stats.queued_peak = wire->stats.queued;
    }
    wire->pending |= WIRE_BIT(index);
    return true;
}

/* ---- controllers ---- */

/* Returns the state for a node's error counters (ISO 11898-1: 96, 128 and 256). */
static enum wire_state wire_node_state(const struct wire_node *node)
{
    if (node->stats.tec >= WIRE_BUS_OFF_FROM) {
        return WIRE_BUS_OFF;
    }
    if (wire_is_passive(node)) {
        return WIRE_ERROR_PASSIVE;
    }
    return node->stats.tec >= WIRE_WARNING_FROM || node->stats.rec >= WIRE_WARNING_FROM
               ? WIRE_ERROR_WARNING
               : WIRE_ERROR_ACTIVE;
}

void wire_count_errors(struct wire *wire, size_t index, int64_t time_ns, int tec, int rec)
{
    struct wire_node *node = &wire->node[index];
    struct wire_node_stats *stats = &node->stats;
    enum wire_state before = stats->state;

    /* Change the counters. After a good reception, a passive receiver returns below the limit at
     * once */
    stats->tec = tec < 0 && !stats->tec ? 0 : (unsigned)((int)stats->tec + tec);
    if (rec < 0) {
        stats->rec =
            stats->rec >= WIRE_PASSIVE_FROM ? WIRE_PASSIVE_FROM - 1 : stats->rec - (stats->rec > 0);
    } else {
        stats->rec += (unsigned)rec;
        stats->rec = stats->rec > 255 ? 255 : stats->rec;
    }
    stats->tec_peak = stats->tec > stats->tec_peak ? stats->tec : stats->tec_peak;
    stats->rec_peak = stats->rec > stats->rec_peak ? stats->rec : stats->rec_peak;

    /* Find the new state */
    wire->counting &= ~WIRE_BIT(index);
    wire->counting |= stats->tec || stats->rec ? WIRE_BIT(index) : 0;
    stats->state = wire_node_state(node);
    if (stats->state == before) {
        return;
    }

    /* If the state changed, enter bus-off if needed, and emit an event */
    if (stats->state == WIRE_BUS_OFF) {
        /* Take a node off the bus: drop its queue and set the time of its recovery */
        while (node->waiting) {
            wire_slot_free(wire, node, node->heap[--node->waiting]);
            wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        }
        wire->pending &= ~WIRE_BIT(index);
        wire->off |= WIRE_BIT(index);
        node->runs = 0;
        node->recovery_ns = wire->config.restart_delay_ns < 0
                                ? WIRE_NEVER
                                : time_ns + wire->config.restart_delay_ns;
        node->stats.bus_offs++;
        wire->stats.bus_offs++;
    }
    wire_notify(wire, &(struct wire_event){.kind = WIRE_STATUS,
                                           .time_ns = time_ns,
                                           .node = index,
                                           .state = stats->state,
                                           .tec = stats->tec,
                                           .rec = stats->rec});
}

void wire_connect(struct wire *wire, size_t node, bool connected)
{
    if (connected && wire->unplugged & WIRE_BIT(node)) {
        wire->unplugged &= ~WIRE_BIT(node);
        /* It joins after eleven recessive bits; before time 0 they have already passed */
        wire->node[node].hold_ns =
            wire->now_ns > 0 ? wire->now_ns + wire_bits_ns(wire, WIRE_RUN_BITS) : 0;
    } else if (!connected && !(wire->unplugged & WIRE_BIT(node))) {
        wire->unplugged |= WIRE_BIT(node);
        wire->node[node].void_ns = wire->now_ns;
    }
}

int64_t wire_recovery_end(const struct wire *wire, const struct wire_node *node)
{
    int64_t from = node->recovery_ns > wire->recessive_ns ? node->recovery_ns : wire->recessive_ns;

    if (node->recovery_ns == WIRE_NEVER) {
        return WIRE_NEVER;
    }
    /* Number of runs of eleven recessive bits still to come */
    return from + wire_bits_ns(wire, (int64_t)(WIRE_RECOVERY_RUNS - node->runs) * WIRE_RUN_BITS);
}

void wire_count_runs(struct wire *wire, int64_t start_ns)
{
    const int64_t run_ns = wire_bits_ns(wire, WIRE_RUN_BITS);
    size_t index;

    WIRE_FOR_EACH(index, wire->off)
    {
        struct wire_node *node = &wire->node[index];
        int64_t from =
            node->recovery_ns > wire->recessive_ns ? node->recovery_ns : wire->recessive_ns;

        if (start_ns > from) {
            node->runs += (unsigned)((start_ns - from) / run_ns);
        }
    }
}
