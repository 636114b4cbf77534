/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Saving and restoring the local bus: the frames in the rings between the participants of one
 * thread. Rings are drained and filled by their own operations, as writer and reader are both the
 * calling thread; no other ring is touched.
 */
#include "canbus/local_private.h"

#include <string.h>

enum { SAVED_FRAMES_MAX = 2048, CONTROLLERS_MAX = 64 };

struct local_save {
    /* Copies of what the bus has last seen of the wire's controllers */
    uint64_t plugged_seen, dropped_seen;
    enum wire_state state[CONTROLLERS_MAX];

    size_t count;
    struct local_frame entry[SAVED_FRAMES_MAX]; /* lane after lane */
    /* Then a struct local_saved_node of each node, then the number of frames of each own lane */
};

struct local_saved_node {
    enum can_port_state port;
    enum wire_state shown;
    uint64_t wire_dropped_told;
};

/* Returns the array of nodes behind the saved frames. */
static struct local_saved_node *local_saved_nodes(const struct local_save *save)
{
    return (struct local_saved_node *)(uintptr_t)(save + 1);
}

/* Returns the array of frames per lane, behind the nodes. */
static uint64_t *local_saved_counts(const struct local_bus *bus, const struct local_save *save)
{
    return (uint64_t *)(uintptr_t)(local_saved_nodes(save) + bus->config.max_nodes);
}

size_t local_bus_save_size(const struct local_bus *bus)
{
    return sizeof(struct local_save) + bus->config.max_nodes * sizeof(struct local_saved_node) +
           bus->places * bus->places * sizeof(uint64_t);
}

/* Checks whether writer and reader of a lane are both the calling thread: nodes below `own`, or
 * the wire, whose place is the last. */
static bool local_lane_is_own(const struct local_bus *bus, size_t own, size_t to, size_t from)
{
    size_t wire = bus->config.max_nodes;

    return to != from && (to < own || to == wire) && (from < own || from == wire);
}

/* Copies the frames of a lane without removing them; false when there is no room for them. */
static bool local_save_lane(const struct local_lane *lane, struct local_save *save, uint64_t *count)
{
    uint32_t tail = atomic_load_explicit(&lane->ring.tail, memory_order_relaxed);

    *count = ring_count(&lane->ring);
    if (*count > SAVED_FRAMES_MAX - save->count) {
        return false;
    }
    for (uint32_t i = 0; i < *count; i++) {
        const struct local_frame *slots =
            (const struct local_frame *)(const void *)lane->ring.slots;

        save->entry[save->count++] = slots[(tail + i) & lane->ring.mask];
    }
    return true;
}

bool local_bus_save(const struct local_bus *bus, size_t own, void *memory)
{
    struct local_save *save = memory;
    uint64_t *count = local_saved_counts(bus, save);

    /* What the bus has seen of the wire */
    save->count = 0;
    save->plugged_seen = bus->plugged_seen;
    save->dropped_seen = bus->dropped_seen;
    if (bus->wire) {
        memcpy(save->state, bus->state, bus->config.wire_nodes * sizeof *bus->state);
    }
    /* The nodes */
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct local_node *node = &bus->nodes[n];

        local_saved_nodes(save)[n] =
            (struct local_saved_node){.port = n < own ? node->port.state : CAN_PORT_UP,
                                      .shown = node->shown,
                                      .wire_dropped_told = node->wire_dropped_told};
    }
    /* The frames in the lanes of the calling thread */
    for (size_t i = 0; i < bus->places * bus->places; i++) {
        if (local_lane_is_own(bus, own, i / bus->places, i % bus->places) &&
            !local_save_lane(&bus->lanes[i], save, &count[i])) {
            return false;
        }
    }
    return true;
}

void local_bus_restore(struct local_bus *bus, size_t own, const void *memory)
{
    const struct local_save *save = memory;
    const uint64_t *count = local_saved_counts(bus, save);
    const struct local_frame *entry = save->entry;

    /* What the bus has seen of the wire */
    bus->plugged_seen = save->plugged_seen;
    bus->dropped_seen = save->dropped_seen;
    if (bus->wire) {
        memcpy(bus->state, save->state, bus->config.wire_nodes * sizeof *bus->state);
    }

    /* The nodes; counters go on counting, and ports of other threads keep their state */
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct local_saved_node *kept = &local_saved_nodes(save)[n];

        bus->nodes[n].shown = kept->shown;
        bus->nodes[n].wire_dropped_told = kept->wire_dropped_told;
        if (n < own) {
            bus->nodes[n].port.state = kept->port;
        }
    }

    /* The frames in the own lanes, instead of those that are there now */
    for (size_t i = 0; i < bus->places * bus->places; i++) {
        struct ring *ring = &bus->lanes[i].ring;

        if (!local_lane_is_own(bus, own, i / bus->places, i % bus->places)) {
            continue;
        }
        while (ring_front(ring)) {
            ring_drop(ring);
        }
        for (uint64_t k = 0; k < count[i]; k++) {
            ring_push(ring, entry++);
        }
    }
}
