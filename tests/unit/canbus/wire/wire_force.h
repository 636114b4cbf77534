/* SPDX-License-Identifier: Apache-2.0 */
/* What tests read and force in a wire behind its interface. */
#ifndef TESTS_UNIT_CANBUS_WIRE_WIRE_FORCE_H
#define TESTS_UNIT_CANBUS_WIRE_WIRE_FORCE_H

#include "canbus/wire/private.h"

static inline int64_t wire_now(const struct wire *wire)
{
    return wire->now_ns;
}

/* Puts a node into bus-off now, as after a short circuit. */
static inline void wire_force_bus_off(struct wire *wire, size_t node)
{
    if (!(wire->off & WIRE_BIT(node))) {
        wire_count_errors(wire, node, wire->now_ns,
                          WIRE_BUS_OFF_FROM - (int)wire->node[node].stats.tec, 0);
    }
}

#endif
