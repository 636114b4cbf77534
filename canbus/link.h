/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the kernel says about a network interface, by one rtnetlink request. The ioctls that tell
 * the same would start modprobe when a privileged process asks for a name that is not there, every
 * time, and that is what a port does while it waits for its interface to come back.
 */
#ifndef CANBUS_LINK_H
#define CANBUS_LINK_H

#include <stdbool.h>
#include <stdint.h>

struct link_info {
    int index;
    bool up;       /* administratively up */
    uint16_t type; /* ARPHRD_ of linux/if_arp.h */
    uint32_t mtu;
};

/* A descriptor for link_query, or -1 with errno. Not RT-safe. */
int link_open(void);

/* Asks for the interface of a name (shorter than IFNAMSIZ). 0, or an errno: ENODEV when there is
 * none. One send and one receive that do not wait for anybody but the kernel's interface lock, no
 * allocation: may be called in the loop when an interface is lost, not in every tick. */
int link_query(int descriptor, const char *name, struct link_info *info);

#endif
