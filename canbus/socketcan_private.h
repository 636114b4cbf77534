/* SPDX-License-Identifier: Apache-2.0 */
/* What opening a raw socket (socketcan_open.c) and using it (socketcan.c) share. */
#ifndef CANBUS_SOCKETCAN_PRIVATE_H
#define CANBUS_SOCKETCAN_PRIVATE_H

#include "canbus/link.h"
#include "canbus/port_private.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <time.h>

enum { SOCKETCAN_BATCH = 64 };

/* Room for the ancillary data of one frame: time stamp and drop counter. */
union ancillary {
    struct cmsghdr align;
    char space[CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
};

struct socketcan {
    struct can_port port;
    int socket;
    int link; /* descriptor for link_query */
    bool want_fd;
    struct can_filter *filter; /* as the kernel wants them; it forgets them with the interface */
    size_t nfilter;
    int64_t last_ns;   /* time of the last frame received */
    uint32_t overflow; /* drop counter of the kernel, as last seen */
    bool full_batch;   /* the last read found as much as it could take */
    int64_t retry_ns;  /* not before this time, CLOCK_MONOTONIC, look for a lost interface */
    struct canfd_frame raw[SOCKETCAN_BATCH];
    struct iovec vector[SOCKETCAN_BATCH];
    struct mmsghdr message[SOCKETCAN_BATCH];
    union ancillary ancillary[SOCKETCAN_BATCH];

    const struct can_state_box *controller;
    uint32_t post; /* the last one that was read from it */

    /* Between the port and who seeks its interface */
    bool sought;
    atomic_bool lost;         /* the interface, and nobody has found it again */
    _Atomic uint32_t finding; /* number << 9 | FD possible << 8 | enum can_port_state */
    uint32_t finding_seen;

    /* The newest frame of each identifier that met a full queue, in the order of arrival */
    struct bus_frame held[SOCKETCAN_HELD_MAX];
    size_t nheld;
    int64_t full_since_ns; /* no frame has left since; 0 = the last attempt met no full queue */
    int64_t back_off_ns;   /* between attempts; 0 = none */
    int64_t attempt_ns;    /* not before this time */
};

extern const struct can_port_ops socketcan_ops;

/* Sets the filters, which the kernel drops when an interface is removed, and binds. 0 or an errno. */
int socketcan_bind(const struct socketcan *can, int index);

#endif
