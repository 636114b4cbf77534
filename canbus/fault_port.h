/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that injects faults: it passes on the frames of another port of any back end, and while a
 * rule is active loses, corrupts, delays or duplicates frames of both directions. Closing it closes
 * the other port. Counters and state are those of the other port, except that frames lost here for
 * want of room or in FAULT_PORT_BUS_OFF count as dropped, and that the state then is bus-off.
 *
 * Frames that are no traffic of a real bus (STEP and DONE of lockstep) are exempt from rules for
 * all frames; a rule with their identifier hits them all the same. FAULT_PORT_BUS_OFF never does,
 * as virtual time would stop.
 *
 * Time is virtual: the owner sets it once a tick. The port's functions are RT-safe.
 */
#ifndef CANBUS_FAULT_PORT_H
#define CANBUS_FAULT_PORT_H

#include "canbus/port.h"

enum fault_port_kind {
    FAULT_PORT_LOSS,       /* with the probability: never arrives */
    FAULT_PORT_CORRUPTION, /* with the probability: one bit of the data is inverted */
    FAULT_PORT_DUPLICATE,  /* with the probability: comes again right after itself */
    FAULT_PORT_LATE,       /* comes delay_ns later */
    FAULT_PORT_BUS_OFF,    /* no traffic in either direction, and the port's state says so */
};

struct fault_port_rule {
    enum fault_port_kind kind;
    double probability;
    int64_t delay_ns;
    int64_t id;         /* identifier of the frames that it hits; -1 = all */
    const bool *active; /* read for every frame */
    const char *stream; /* name of its random numbers */
};

enum { FAULT_PORT_EXEMPT = 2, FAULT_PORT_HELD = 4096 };

struct fault_port_config {
    struct can_port *port;
    const struct fault_port_rule *rule; /* copied, but for what it points to */
    size_t nrule;
    uint32_t exempt[FAULT_PORT_EXEMPT];
    size_t nexempt;
    uint64_t seed;
};

/* Creates the port in memory from arena. A frame that finds FAULT_PORT_HELD others waiting is
 * lost and counted as dropped. Not RT-safe. */
enum error_code fault_port_create(const struct fault_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error);

/* Sets the virtual time of a port that fault_port_create made. RT-safe. */
void fault_port_time(struct can_port *port, int64_t time_ns);

#endif
