/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port that injects faults. It wraps another port of any back end. While a rule is active, it
 * loses, corrupts, delays or duplicates frames in both directions. Closing it closes the other
 * port. Counters and state are copied from the other port, with two exceptions. Frames lost here
 * for lack of room or in FAULT_PORT_BUS_OFF count as dropped. In FAULT_PORT_BUS_OFF the state is
 * bus-off.
 *
 * STEP and DONE of lockstep do not exist on a real bus, so rules for all frames skip them. A rule
 * with their identifier applies to them, except FAULT_PORT_BUS_OFF, which would stop virtual time.
 *
 * Time is virtual; the owner sets it once per tick. The port's functions are RT-safe.
 */
#ifndef CANBUS_FAULT_PORT_H
#define CANBUS_FAULT_PORT_H

#include "canbus/port.h"

enum fault_port_kind {
    FAULT_PORT_LOSS,       /* with `probability`: the frame never arrives */
    FAULT_PORT_CORRUPTION, /* with `probability`: one data bit is inverted */
    FAULT_PORT_DUPLICATE,  /* with `probability`: the frame arrives twice in a row */
    FAULT_PORT_LATE,       /* the frame arrives delay_ns later */
    FAULT_PORT_BUS_OFF,    /* no traffic in either direction; the port's state is bus-off */
};

struct fault_port_rule {
    enum fault_port_kind kind;
    double probability;
    int64_t delay_ns;
    int64_t id;         /* identifier of the affected frames; -1 = all */
    const bool *active; /* whether the rule is active; read for every frame */
    const char *stream; /* name of its random stream */
};

enum { FAULT_PORT_EXEMPT = 2, FAULT_PORT_HELD = 4096 };

struct fault_port_config {
    struct can_port *port;
    const struct fault_port_rule *rule; /* copied; the rules' pointers are borrowed */
    size_t nrule;
    uint32_t exempt[FAULT_PORT_EXEMPT];
    size_t nexempt;
    uint64_t seed;
};

/* Creates the port in memory from arena. At most FAULT_PORT_HELD delayed frames wait; further
 * delayed frames are dropped and counted. Not RT-safe. */
enum error_code fault_port_create(const struct fault_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error);

/* Applies the rules to a frame that arrives without the port (local_bus_listen). Writes up to two
 * frames to out and returns their number; the port's next receive returns delayed ones. RT-safe. */
size_t fault_port_hear(struct can_port *port, const struct bus_frame *frame,
                       struct bus_frame out[2]);

/* Sets the virtual time of a port that fault_port_create made. RT-safe. */
void fault_port_time(struct can_port *port, int64_t time_ns);

#endif
