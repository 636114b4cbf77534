/* SPDX-License-Identifier: Apache-2.0 */
/* Follows the nodes' controllers: error counters, the states that follow from them, bus-off and
 * recovery, plugs and bit rates. */
#include "canbus/wire/private.h"

/* Returns the state that follows from a node's error counters (ISO 11898-1: 96, 128 and 256). */
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

/* Takes a node off the bus: drops its queue and sets when its recovery begins. */
static void wire_enter_bus_off(struct wire *wire, size_t index, int64_t time_ns)
{
    struct wire_node *node = &wire->node[index];

    while (node->waiting) {
        wire_slot_free(wire, node, node->heap[--node->waiting]);
        wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
    }
    wire->pending &= ~WIRE_BIT(index);
    wire->off |= WIRE_BIT(index);
    node->runs = 0;
    node->recovery_ns =
        wire->config.restart_delay_ns < 0 ? WIRE_NEVER : time_ns + wire->config.restart_delay_ns;
    node->stats.bus_offs++;
    wire->stats.bus_offs++;
}

void wire_count_errors(struct wire *wire, size_t index, int64_t time_ns, int tec, int rec)
{
    struct wire_node *node = &wire->node[index];
    struct wire_node_stats *stats = &node->stats;
    enum wire_state before = stats->state;

    /* The counters; a received frame brings a passive receiver back below the limit at once */
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

    /* The state that follows from them */
    wire->counting &= ~WIRE_BIT(index);
    wire->counting |= stats->tec || stats->rec ? WIRE_BIT(index) : 0;
    stats->state = wire_node_state(node);
    if (stats->state == before) {
        return;
    }

    /* A change of state: bus-off, and an event */
    if (stats->state == WIRE_BUS_OFF) {
        wire_enter_bus_off(wire, index, time_ns);
    }
    wire_notify(wire, &(struct wire_event){.kind = WIRE_STATUS,
                                           .time_ns = time_ns,
                                           .node = index,
                                           .state = stats->state,
                                           .tec = stats->tec,
                                           .rec = stats->rec});
}

void wire_recover(struct wire *wire, size_t index, int64_t time_ns)
{
    struct wire_node_stats *stats = &wire->node[index].stats;

    wire->off &= ~WIRE_BIT(index);
    stats->tec = stats->rec = 0;
    wire_count_errors(wire, index, time_ns, 0, 0);
}

void wire_force_bus_off(struct wire *wire, size_t node)
{
    if (!(wire->off & WIRE_BIT(node))) {
        wire_count_errors(wire, node, wire->now_ns,
                          WIRE_BUS_OFF_FROM - (int)wire->node[node].stats.tec, 0);
    }
}

void wire_restart(struct wire *wire, size_t node)
{
    if (wire->off & WIRE_BIT(node) && wire->node[node].recovery_ns > wire->now_ns) {
        wire->node[node].recovery_ns = wire->now_ns;
    }
}

void wire_connect(struct wire *wire, size_t node, bool connected)
{
    if (connected && wire->unplugged & WIRE_BIT(node)) {
        wire->unplugged &= ~WIRE_BIT(node);
        /* It joins in after eleven recessive bits, which at time 0 have passed already */
        wire->node[node].hold_ns =
            wire->now_ns > 0 ? wire->now_ns + wire_bits_ns(wire, WIRE_RUN_BITS) : 0;
    } else if (!connected && !(wire->unplugged & WIRE_BIT(node))) {
        wire->unplugged |= WIRE_BIT(node);
        wire->node[node].void_ns = wire->now_ns;
    }
}

void wire_set_bitrate(struct wire *wire, size_t node, int64_t bitrate)
{
    const bool other = bitrate > 0 && bitrate != wire->config.bitrate;

    wire->node[node].bitrate = other ? bitrate : 0;
    wire->mismatched &= ~WIRE_BIT(node);
    wire->mismatched |= other ? WIRE_BIT(node) : 0;
}

int64_t wire_recovery_end(const struct wire *wire, const struct wire_node *node)
{
    int64_t from = node->recovery_ns > wire->recessive_ns ? node->recovery_ns : wire->recessive_ns;

    if (node->recovery_ns == WIRE_NEVER) {
        return WIRE_NEVER;
    }
    /* Runs of eleven recessive bits still to be seen */
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
