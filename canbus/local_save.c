/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The local bus going back in time: what is in the rings between the participants of one thread.
 * Rings are drained and filled by their own operations, as their writer and their reader, who are
 * both the calling thread; no other ring is touched.
 */
#include "canbus/local_private.h"

#include <string.h>

enum { PARCELS_MAX = 2048, CONTROLLERS_MAX = 64 };

struct moment {
    /* The wire's other half: what is known here of its controllers */
    uint64_t plugged_seen, dropped_seen;
    enum wire_state state[CONTROLLERS_MAX];

    size_t count;
    struct parcel parcel[PARCELS_MAX]; /* lane after lane */
    /* Then a struct kept_node of each node, then the number of parcels of each own lane */
};

struct kept_node {
    enum can_port_state port;
    enum wire_state shown;
    uint64_t wire_dropped_told;
};

static struct kept_node *kept_nodes(const struct moment *moment)
{
    return (struct kept_node *)(uintptr_t)(moment + 1);
}

static uint64_t *lane_counts(const struct local_bus *bus, const struct moment *moment)
{
    return (uint64_t *)(uintptr_t)(kept_nodes(moment) + bus->config.max_nodes);
}

size_t local_bus_moment_size(const struct local_bus *bus)
{
    return sizeof(struct moment) + bus->config.max_nodes * sizeof(struct kept_node) +
           bus->places * bus->places * sizeof(uint64_t);
}

/* Whether writer and reader of a lane are the calling thread. The wire's place is the last. */
static bool is_own(const struct local_bus *bus, size_t own, size_t to, size_t from)
{
    size_t wire = bus->config.max_nodes;

    return to != from && (to < own || to == wire) && (from < own || from == wire);
}

static bool keep_lane(const struct lane *lane, struct moment *moment, uint64_t *count)
{
    uint32_t tail = atomic_load_explicit(&lane->ring.tail, memory_order_relaxed);

    *count = ring_count(&lane->ring);
    if (*count > PARCELS_MAX - moment->count) {
        return false;
    }
    for (uint32_t i = 0; i < *count; i++) {
        const struct parcel *slots = (const struct parcel *)(const void *)lane->ring.slots;

        moment->parcel[moment->count++] = slots[(tail + i) & lane->ring.mask];
    }
    return true;
}

bool local_bus_keep(const struct local_bus *bus, size_t own, void *memory)
{
    struct moment *moment = memory;
    uint64_t *count = lane_counts(bus, moment);
    bool good = true;

    moment->count = 0;
    moment->plugged_seen = bus->plugged_seen;
    moment->dropped_seen = bus->dropped_seen;
    if (bus->wire) {
        memcpy(moment->state, bus->state, bus->config.wire_nodes * sizeof *bus->state);
    }
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct node *node = &bus->nodes[n];

        kept_nodes(moment)[n] = (struct kept_node){.port = n < own ? node->port.state : CAN_PORT_UP,
                                                   .shown = node->shown,
                                                   .wire_dropped_told = node->wire_dropped_told};
    }
    for (size_t i = 0; good && i < bus->places * bus->places; i++) {
        if (is_own(bus, own, i / bus->places, i % bus->places)) {
            good = keep_lane(&bus->lanes[i], moment, &count[i]);
        }
    }
    return good;
}

void local_bus_back(struct local_bus *bus, size_t own, const void *memory)
{
    const struct moment *moment = memory;
    const uint64_t *count = lane_counts(bus, moment);
    const struct parcel *parcel = moment->parcel;

    bus->plugged_seen = moment->plugged_seen;
    bus->dropped_seen = moment->dropped_seen;
    if (bus->wire) {
        memcpy(bus->state, moment->state, bus->config.wire_nodes * sizeof *bus->state);
    }
    for (size_t n = 0; n < bus->config.max_nodes; n++) {
        const struct kept_node *kept = &kept_nodes(moment)[n];

        bus->nodes[n].shown = kept->shown;
        bus->nodes[n].wire_dropped_told = kept->wire_dropped_told;
        if (n < own) {
            bus->nodes[n].port.state = kept->port;
        }
    }
    for (size_t i = 0; i < bus->places * bus->places; i++) {
        struct ring *ring = &bus->lanes[i].ring;

        if (!is_own(bus, own, i / bus->places, i % bus->places)) {
            continue;
        }
        while (ring_front(ring)) {
            ring_drop(ring);
        }
        for (uint64_t k = 0; k < count[i]; k++) {
            ring_push(ring, parcel++);
        }
    }
}
