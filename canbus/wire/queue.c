/* SPDX-License-Identifier: Apache-2.0 */
/* Transmit queues of the nodes: binary heaps of slots, by priority or by age. */
#include "canbus/wire/private.h"

/* Checks whether a frame is sent before another: by priority when so configured, then by age. */
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

    /* Sift up: the new slot rises above those that come later */
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

    /* Sift down: the last slot sinks from the root to its place */
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

/* Counts a frame into a queue and keeps the peaks. */
static void wire_count_queued(struct wire *wire, struct wire_node *node)
{
    node->stats.queued++;
    wire->stats.queued++;
    if (node->stats.queued > node->stats.queued_peak) {
        node->stats.queued_peak = node->stats.queued;
    }
    if (wire->stats.queued > wire->stats.queued_peak) {
        wire->stats.queued_peak = wire->stats.queued;
    }
}

bool wire_transmit(struct wire *wire, size_t index, const struct bus_frame *frame)
{
    struct wire_node *node = &wire->node[index];
    struct wire_slot *slot;
    uint16_t free_slot;

    if (!frame_is_plain(frame) && (!frame_valid(frame) || (frame->flags & FRAME_ERROR) ||
                                   ((frame->flags & FRAME_FD) && !wire->config.fd))) {
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
    wire_count_queued(wire, node);
    wire->pending |= WIRE_BIT(index);
    return true;
}
