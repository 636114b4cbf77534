/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port with a bad bus behind it: hands on what another port carries, of any back end, and while a
 * rule is active loses, spoils, delays or repeats frames of both directions. Who closes it closes the
 * other port. Counters and state are those of the other port (what a rule does to frames is no news
 * of the port), but for FAULT_PORT_BUS_OFF, which is.
 *
 * Frames that must not be lost because they are no traffic of a real bus (STEP and DONE of lockstep)
 * are named when the port is made; a rule that gives their identifier takes them all the same, but
 * for FAULT_PORT_BUS_OFF: they pass, for else virtual time would never reach its end.
 *
 * Time is virtual: the owner says what it is, once a tick.
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
    int64_t id;         /* of the frames meant; -1 = all */
    const bool *active; /* looked at for every frame */
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

/* Memory from arena. A frame that finds FAULT_PORT_HELD others waiting is lost and counted as
 * dropped. Not RT-safe. */
enum error_code fault_port_create(const struct fault_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error);

/* Now, virtual; of a port that fault_port_create made. RT-safe. */
void fault_port_time(struct can_port *port, int64_t time_ns);

#endif
