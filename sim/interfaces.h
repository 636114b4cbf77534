/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The SocketCAN interfaces of a rig. Before the buses are joined: configures the CAN controllers
 * where the rig says so, and refuses those that run at another bit rate than it says. During the
 * run: polls each once a second, passes its state on to the port, and repairs what it may repair:
 *
 * - configure: true. A controller that runs at another bit rate is configured again; one that was
 *   removed and created anew is configured and started; one in bus-off is restarted, at most
 *   INTERFACES_RESTARTS times in a minute, unless the kernel does it (restart_ms above 0). One that
 *   was taken down stays down until somebody takes it up.
 * - configure: false. Another bit rate and bus-off are reported, nothing is changed.
 *
 * Virtual interfaces are left alone. From one thread, not the loop's; time is passed in. Not
 * RT-safe.
 */
#ifndef SIM_INTERFACES_H
#define SIM_INTERFACES_H

#include "canbus/interface.h"
#include "rig/rig.h"
#include "sim/buses.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { INTERFACES_RESTARTS = 10, INTERFACES_EVENT_TEXT = 256 };

/* One interface as it was when last polled. */
struct interface_watch {
    const char *name;
    const struct rig_bus *bus;
    struct can_state_box *box;
    bool seen; /* it has existed: info.index is that of the last one */
    struct link_info info;
    bool off;                                /* was in bus-off when last polled */
    bool mismatch;                           /* another bit rate, and reported */
    int64_t restart_ns[INTERFACES_RESTARTS]; /* of the last restarts, a ring */
    uint64_t restarts;                       /* ours; the kernel's are in info */
    bool limited;                            /* no more restarts for now, and reported */
    char event[INTERFACES_EVENT_TEXT];       /* "" = none waits */
};

struct interfaces {
    const struct interface_ops *ops;
    size_t count;
    struct interface_watch watch[RIG_BUSES_MAX];
    int64_t next_ns;
};

/* Configures or checks the interfaces of the buses, one name a bus. Those that do not exist or are
 * down are left to socketcan_open to refuse. ERROR_INPUT names bus, interface, both bit rates, and
 * the remedy. */
enum error_code interfaces_prepare(const struct rig *rig, const char *const *interface,
                                   const struct interface_ops *ops, struct error *error);

/* Begins to watch; box has one for each bus. All of it is borrowed. */
void interfaces_init(struct interfaces *interfaces, const struct rig *rig,
                     const char *const *interface, struct can_state_box *box,
                     const struct interface_ops *ops);

/* Polls the interfaces when a second has passed since the last time. */
void interfaces_watch(struct interfaces *interfaces, int64_t now_ns);

/* Takes the next event, as a line for the log; false = there is none. At most one for each
 * interface and poll. */
bool interfaces_next_event(struct interfaces *interfaces, size_t *bus, char *text, size_t size);

/* Polls and describes the CAN controller of a bus: state, settings, counters. False when its
 * interface has none. */
bool interfaces_describe(const struct interfaces *interfaces, size_t bus, char *text, size_t size);

#endif
