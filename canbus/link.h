/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Queries a network interface by one rtnetlink request. The equivalent ioctls start modprobe when a
 * privileged process asks for an unknown name. A port that waits for its interface to return does
 * exactly this.
 */
#ifndef CANBUS_LINK_H
#define CANBUS_LINK_H

#include <linux/can/netlink.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LINK_KIND_MAX = 16 };

/* A CAN controller as its driver reports it; missing values are 0. */
struct link_controller {
    enum can_state state;
    struct can_bittiming timing, data_timing; /* bit rate 0: not set; in data_timing also: no FD */
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
    char kind[LINK_KIND_MAX]; /* "can", "vcan", ...; "" = unknown to the kernel */
    struct link_controller controller;
};

/* Opens a descriptor for link_query; -1 with errno on failure. Not RT-safe. */
int link_open(void);

/* Queries an interface by its name (shorter than IFNAMSIZ). Returns 0 or an errno: ENODEV = no such
 * interface. It does one send and one receive without allocation. Not RT-safe: it waits for the
 * kernel's interface lock, which another process holds while it sets up an interface. */
int link_query(int descriptor, const char *name, struct link_info *info);

/* Parses an answer of size bytes, aligned to 4, and checks all its lengths. Returns 0 or an errno.
 * RT-safe. */
int link_parse(const void *answer, size_t size, struct link_info *info);

#endif
