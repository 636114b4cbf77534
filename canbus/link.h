/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Network interfaces as the kernel describes them, by one rtnetlink request. The ioctls for the
 * same start modprobe whenever a privileged process asks for a name that does not exist, which is
 * what a port does while it waits for its interface to come back.
 */
#ifndef CANBUS_LINK_H
#define CANBUS_LINK_H

#include <linux/can/netlink.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LINK_KIND_MAX = 16 };

/* A CAN controller as its driver describes it; what the driver does not say is 0. */
struct link_controller {
    enum can_state state;
    struct can_bittiming timing, data_timing; /* bit rate 0: not set, no FD */
    struct can_clock clock;
    struct can_ctrlmode mode;
    uint32_t restart_ms;
    bool counts; /* the driver has error counters */
    struct can_berr_counter errors;
    struct can_device_stats stats;
};

struct link_info {
    int index;
    bool up;       /* administratively up */
    uint16_t type; /* ARPHRD_ of linux/if_arp.h */
    uint32_t mtu;
    uint32_t tx_queue;        /* frames */
    char kind[LINK_KIND_MAX]; /* "can", "vcan", ...; "" when the kernel names none */
    struct link_controller controller;
};

/* Opens a descriptor for link_query; -1 with errno on failure. Not RT-safe. */
int link_open(void);

/* Asks the kernel for the interface of a name (shorter than IFNAMSIZ). Returns 0 or an errno:
 * ENODEV when there is none. One send and one receive, which wait for the kernel's interface
 * lock only; no allocation. Not RT-safe: the lock is held for as long as another process sets up
 * an interface. */
int link_query(int descriptor, const char *name, struct link_info *info);

/* Parses an answer of size bytes, aligned to 4, and trusts none of its lengths. Returns 0 or an
 * errno. RT-safe. */
int link_parse(const void *answer, size_t size, struct link_info *info);

#endif
