/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The real CAN interfaces of a rig. Before the buses are joined: sets the controllers that the rig
 * says to configure, and refuses those that run at another bit rate than it says. During the run:
 * asks each once a second, tells the ports its state, and repairs what it may repair:
 *
 * - configure: true. A controller that runs at another bit rate is set again; one that was removed
 *   and created anew is set and started; one in bus-off is restarted, at most
 *   INTERFACES_RESTARTS times in a minute, unless the kernel does it (restart_ms above 0). One that
 *   somebody has taken down stays down until somebody takes it up.
 * - configure: false. Another bit rate and bus-off are reported, nothing is changed.
 *
 * Virtual interfaces are left alone. From one thread, not the loop's; time is passed in. Not
 * RT-safe.
 */
#ifndef SIM_INTERFACES_H
#define SIM_INTERFACES_H

#include "canbus/interface.h"
#include "sim/buses.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { INTERFACES_RESTARTS = 10, INTERFACES_EVENT_TEXT = 256 };

/* One interface as the supervisor has last seen it. */
struct interface_watch {
    const char *name;
    const struct rig_bus *bus;
    struct can_state_box *box;
    bool seen; /* it was there at some time: index is that of the last one */
    struct link_info info;
    bool off;                                /* was in bus-off when last asked */
    bool mismatch;                           /* another bit rate, and told so */
    int64_t restart_ns[INTERFACES_RESTARTS]; /* of the last restarts, a ring */
    uint64_t restarts;                       /* ours; the kernel's are in info */
    bool limited;                            /* no more restarts for now, and told so */
    char event[INTERFACES_EVENT_TEXT];       /* "" = none waits */
};

struct interfaces {
    const struct interface_ops *ops;
    size_t count;
    struct interface_watch watch[RIG_BUSES_MAX];
    int64_t next_ns;
};

/* Sets or checks the interfaces of the buses, one name a bus. What does not exist or is down is
 * left to socketcan_open to refuse. ERROR_INPUT names bus, interface, both bit rates, and how to
 * mend it. */
enum error_code interfaces_prepare(const struct rig *rig, const char *const *interface,
                                   const struct interface_ops *ops, struct error *error);

/* Begins to watch; box has one for each bus. All of it is kept, not copied. */
void interfaces_init(struct interfaces *interfaces, const struct rig *rig,
                     const char *const *interface, struct can_state_box *box,
                     const struct interface_ops *ops);

/* Looks at the interfaces when a second has gone since the last time. */
void interfaces_watch(struct interfaces *interfaces, int64_t now_ns);

/* The next thing that was found or done, as a line; false when there is none. At most one for each
 * interface and look. */
bool interfaces_next_event(struct interfaces *interfaces, size_t *bus, char *text, size_t size);

/* Asks again and describes a bus's controller: state, settings, counters. False when its interface
 * has none. */
bool interfaces_describe(const struct interfaces *interfaces, size_t bus, char *text, size_t size);

#endif
