/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Configures and watches the SocketCAN interfaces of a rig. Before the buses are joined, configures
 * the CAN controllers if the rig requests it. Refuses controllers whose bit rate is not the rig's.
 * During the run, polls each controller once a second, passes its state to the port, and repairs it
 * as far as the rig allows:
 *
 * - configure: true. A controller with a wrong bit rate is configured again. A controller that was
 *   removed and created again is configured and started. A controller in bus-off is restarted, at
 *   most INTERFACES_RESTARTS times in a minute, unless the kernel restarts it (restart_ms above 0).
 *   A controller that was taken down stays down until a user brings it up.
 * - configure: false. A wrong bit rate and bus-off are reported; nothing is changed.
 *
 * Virtual interfaces are not changed. Call from one thread, not the loop's; time is passed in. Not
 * RT-safe.
 */
#ifndef SIM_INTERFACES_H
#define SIM_INTERFACES_H

#include "canbus/interface.h"
#include "sim/buses.h"

enum { INTERFACES_RESTARTS = 10, INTERFACES_EVENT_TEXT = 256 };

/* State of one interface at the last poll. */
struct interface_watch {
    const char *name;
    const struct rig_bus *bus;
    struct can_state_box *box;
    bool seen; /* the interface has existed; info.index is its last index */
    struct link_info info;
    bool off;                                /* was in bus-off at the last poll */
    bool mismatch;                           /* a wrong bit rate has been reported */
    int64_t restart_ns[INTERFACES_RESTARTS]; /* times of the last restarts, a ring */
    /* restarts by the simulator; info counts the kernel's */
    uint64_t restarts;
    bool limited;                      /* the restart limit has been reported */
    char event[INTERFACES_EVENT_TEXT]; /* pending event; "" = none */
};

struct interfaces {
    const struct interface_ops *ops;
    size_t count;
    struct interface_watch watch[RIG_BUSES_MAX];
    int64_t next_ns;
};

/* Configures or checks the interfaces of the buses; interface has one name per bus. socketcan_open
 * refuses missing interfaces and interfaces that are down. ERROR_INPUT names bus, interface, both
 * bit rates, and the remedy. */
enum error_code interfaces_prepare(const struct rig *rig, const char *const *interface,
                                   const struct interface_ops *ops, struct error *error);

/* Initializes the watch; box has one element per bus. All arguments are borrowed. */
void interfaces_init(struct interfaces *interfaces, const struct rig *rig,
                     const char *const *interface, struct can_state_box *box,
                     const struct interface_ops *ops);

/* Polls the interfaces if a second has passed since the last poll. */
void interfaces_watch(struct interfaces *interfaces, int64_t now_ns);

/* Writes the next event as a line for the log. Returns false if there is none. A poll makes at most
 * one event per interface. */
bool interfaces_next_event(struct interfaces *interfaces, size_t *bus, char *text, size_t size);

/* Polls the CAN controller of a bus and describes its state, settings and counters. Returns false
 * if the interface has no controller. */
bool interfaces_describe(const struct interfaces *interfaces, size_t bus, char *text, size_t size);

#endif
