/* SPDX-License-Identifier: Apache-2.0 */
/* Private to canbus: a port on a raw SocketCAN socket, shared by its opening (socketcan_open.c),
 * its interface and reception (socketcan.c) and its sending (socketcan_send.c). */
#ifndef CANBUS_SOCKETCAN_PRIVATE_H
#define CANBUS_SOCKETCAN_PRIVATE_H

#include "base/array.h"
#include "canbus/link.h"
#include "canbus/port_private.h"

#include <errno.h>
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
    struct can_filter *filter; /* in the kernel's format, to set again on a new interface */
    size_t nfilter;
    int64_t last_ns;   /* time of the last frame received */
    uint32_t overflow; /* drop counter of the kernel, as last seen */
    bool full_batch;   /* the last read found as much as it could take */
    int64_t retry_ns;  /* no search for a lost interface before this time, CLOCK_MONOTONIC */
    struct canfd_frame raw[SOCKETCAN_BATCH];
    struct iovec vector[SOCKETCAN_BATCH];
    struct mmsghdr message[SOCKETCAN_BATCH];
    union ancillary ancillary[SOCKETCAN_BATCH];

    const struct can_state_box *controller;
    uint32_t post; /* the last post that was read from the box */

    /* Between the port and who seeks its interface */
    bool sought;
    atomic_bool lost;         /* the interface is gone and has not been found again */
    _Atomic uint32_t finding; /* number << 9 | FD possible << 8 | enum can_port_state */
    uint32_t finding_seen;

    /* The newest frame of each identifier that met a full queue, in the order of arrival */
    struct bus_frame held[SOCKETCAN_HELD_MAX];
    size_t nheld;
    int64_t full_since_ns; /* no frame has left since; 0 = the last attempt met no full queue */
    int64_t back_off_ns;   /* between attempts; 0 = none */
    int64_t attempt_ns;    /* no new attempt before this time */
};

extern const struct can_port_ops socketcan_ops;

static inline struct socketcan *socketcan_of_port(const struct can_port *port)
{
    return container_of(port, struct socketcan, port);
}

static inline int64_t socketcan_clock_ns(clockid_t clock)
{
    struct timespec now;

    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static inline bool socketcan_is_lost(const struct can_port *port)
{
    return port->state == CAN_PORT_DOWN || port->state == CAN_PORT_GONE;
}

/* Checks whether an errno of a socket means that its interface is down or gone. */
static inline bool socketcan_error_means_lost(int code)
{
    return code == ENETDOWN || code == ENODEV || code == ENXIO;
}

/* Sets the filters, which the kernel drops when an interface is removed, and binds. Returns 0 or
 * an errno. */
int socketcan_bind(const struct socketcan *can, int index);

/* socketcan.c: notes that the interface is down or gone; looks for it again. RT-safe, unless the
 * port looks for its interface itself (not sought). */
void socketcan_lose_interface(struct socketcan *can, int code);
void socketcan_find_interface(struct socketcan *can);

/* socketcan_send.c: notes that the interface's queue takes frames, or is a new one; sends the
 * held frames when an attempt is due, false = the queue is still full; implements
 * can_port_ops.send. RT-safe. */
void socketcan_note_queue_moving(struct socketcan *can);
bool socketcan_send_held(struct socketcan *can);
size_t socketcan_send(struct can_port *port, const struct bus_frame *frames, size_t count);

#endif
