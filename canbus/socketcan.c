/* SPDX-License-Identifier: Apache-2.0 */
/* Receives by raw SocketCAN sockets: one recvmmsg and one sendmmsg per tick and bus, all memory
 * preallocated. The socket stays open when its interface goes away; it is bound anew when the
 * interface returns, and keeps its options and drop counter. Sending is in socketcan_send.c. */
#include "canbus/socketcan_private.h"

#include <errno.h>
#include <linux/sock_diag.h>
#include <net/if_arp.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

enum { RETRY_NS = 1000000000 };

/* ---- lost and found interfaces ---- */

void socketcan_lose_interface(struct socketcan *can, int code)
{
    if (!socketcan_is_lost(&can->port)) {
        can->port.counters.down_events++;
        can->retry_ns = 0; /* it may be back already */
        atomic_store(&can->lost, true);
    }
    can->port.state = code == ENETDOWN ? CAN_PORT_DOWN : CAN_PORT_GONE;

    /* Held frames will be old when the interface comes back */
    can->port.counters.tx_dropped += can->nheld;
    can->nheld = 0;
    socketcan_note_queue_moving(can);
}

int socketcan_bind(const struct socketcan *can, int index)
{
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = index};

    if (setsockopt(can->socket, SOL_CAN_RAW, CAN_RAW_FILTER, can->filter,
                   (socklen_t)(can->nfilter * sizeof *can->filter)) ||
        bind(can->socket, (const struct sockaddr *)&address, sizeof address)) {
        return errno;
    }
    return 0;
}

/* Asks the kernel for the interface and binds to it when it is up; returns the port's new state.
 * Waits for the kernel's interface lock, which may take long. */
static enum can_port_state socketcan_try_bind(const struct socketcan *can, bool *fd)
{
    struct link_info info;

    if (link_query(can->link, can->port.bus, &info) || info.type != ARPHRD_CAN) {
        return CAN_PORT_GONE;
    }
    if (!info.up || socketcan_bind(can, info.index)) {
        return CAN_PORT_DOWN;
    }
    *fd = can->want_fd && info.mtu >= CANFD_MTU;
    return CAN_PORT_UP;
}

/* Takes over the state in which the interface was found; sets up the socket when it is up. */
static void socketcan_use_interface(struct socketcan *can, enum can_port_state state, bool fd)
{
    socklen_t size = sizeof(int);
    int pending;

    can->port.state = state;
    if (state == CAN_PORT_UP) {
        /* Clears the error that the loss has left on the socket */
        getsockopt(can->socket, SOL_SOCKET, SO_ERROR, &pending, &size);
        can->port.fd = fd;
    }
}

void socketcan_seek(struct can_port *port)
{
    struct socketcan *can = socketcan_of_port(port);
    uint32_t number = (atomic_load(&can->finding) >> 9) + 1;
    enum can_port_state state;
    bool fd = false;

    if (!atomic_load(&can->lost)) {
        return;
    }
    state = socketcan_try_bind(can, &fd);
    if (state == CAN_PORT_UP) {
        atomic_store(&can->lost, false);
    }
    atomic_store(&can->finding, number << 9 | (uint32_t)fd << 8 | state);
}

void socketcan_find_interface(struct socketcan *can)
{
    const uint32_t finding = atomic_load(&can->finding);
    int64_t now;
    bool fd = false;
    enum can_port_state state;

    /* Another thread looks for it: use its result */
    if (can->sought) {
        if (finding != can->finding_seen) {
            can->finding_seen = finding;
            socketcan_use_interface(can, (enum can_port_state)(finding & 0xff), finding >> 8 & 1);
        }
        return;
    }

    /* No other thread does: look for it here, at most once a second */
    now = socketcan_clock_ns(CLOCK_MONOTONIC);
    if (now < can->retry_ns) {
        return;
    }
    can->retry_ns = now + RETRY_NS;
    state = socketcan_try_bind(can, &fd);
    socketcan_use_interface(can, state, fd);
}

/* ---- reception ---- */

/* Converts a frame of size bytes from the kernel's format; false when it is not a frame. */
static bool socketcan_decode_frame(const struct canfd_frame *raw, size_t size,
                                   struct bus_frame *frame)
{
    /* The size says whether the frame is classic or FD */
    memset(frame, 0, sizeof *frame);
    if (size != CAN_MTU && size != CANFD_MTU) {
        return false;
    }
    if (size == CANFD_MTU) {
        frame->flags |= FRAME_FD;
        frame->flags |= (raw->flags & CANFD_BRS) ? FRAME_BRS : 0;
        frame->flags |= (raw->flags & CANFD_ESI) ? FRAME_ESI : 0;
    }

    /* The upper bits of the identifier say what it identifies */
    if (raw->can_id & CAN_ERR_FLAG) {
        frame->flags |= FRAME_ERROR;
        frame->id = raw->can_id & CAN_ERR_MASK;
    } else if (raw->can_id & CAN_EFF_FLAG) {
        frame->flags |= FRAME_EXTENDED;
        frame->id = raw->can_id & CAN_EFF_MASK;
    } else {
        frame->id = raw->can_id & CAN_SFF_MASK;
    }
    if (!(frame->flags & FRAME_ERROR) && (raw->can_id & CAN_RTR_FLAG)) {
        frame->flags |= FRAME_REMOTE;
    }

    /* Devices may deliver anything: nothing is copied beyond a legal length */
    frame->len = raw->len;
    if (!frame_valid(frame)) {
        return false;
    }
    if (!(frame->flags & FRAME_REMOTE)) {
        memcpy(frame->data, raw->data, frame->len);
    }
    return true;
}

/* Counts frames lost up to a value of the kernel's drop counter, which may be older than the last
 * one seen. */
static void socketcan_count_overflow(struct socketcan *can, uint32_t overflow)
{
    const int32_t more = (int32_t)(overflow - can->overflow);

    if (more > 0) {
        can->port.counters.rx_dropped += (uint32_t)more;
        can->overflow = overflow;
    }
}

/* Reads the time stamp and the drop counter that came with a frame. */
static void socketcan_read_ancillary(struct socketcan *can, struct msghdr *header,
                                     int64_t to_monotonic_ns, struct bus_frame *frame)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c; c = CMSG_NXTHDR(header, c)) {
        if (c->cmsg_level != SOL_SOCKET) {
            continue;
        }
        if (c->cmsg_type == SCM_TIMESTAMPNS && c->cmsg_len >= CMSG_LEN(sizeof(struct timespec))) {
            struct timespec stamp;

            memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
            frame->time_ns = (int64_t)stamp.tv_sec * 1000000000 + stamp.tv_nsec + to_monotonic_ns;
        } else if (c->cmsg_type == SO_RXQ_OVFL && c->cmsg_len >= CMSG_LEN(sizeof(uint32_t))) {
            uint32_t overflow;

            memcpy(&overflow, CMSG_DATA(c), sizeof overflow);
            socketcan_count_overflow(can, overflow);
        }
    }
}

/* A frame carries the number of those lost before it. Losses behind the last frame that waited are
 * queried, when so many waited that the buffer may have been full. */
static void socketcan_query_overflow(struct socketcan *can, bool full_batch)
{
    uint32_t memory[SK_MEMINFO_VARS] = {0};
    socklen_t size = sizeof memory;

    if (can->full_batch && !full_batch &&
        !getsockopt(can->socket, SOL_SOCKET, SO_MEMINFO, memory, &size) &&
        size > SK_MEMINFO_DROPS * sizeof *memory) {
        socketcan_count_overflow(can, memory[SK_MEMINFO_DROPS]);
    }
    can->full_batch = full_batch;
}

/* Limits the time of a frame to between the frame before and now: the kernel stamps with the time
 * of day, which may have been set while the frame waited. */
static void socketcan_limit_time(struct socketcan *can, int64_t now, struct bus_frame *frame)
{
    frame->time_ns = frame->time_ns < now ? frame->time_ns : now;
    frame->time_ns = frame->time_ns > can->last_ns ? frame->time_ns : can->last_ns;
    can->last_ns = frame->time_ns;
}

/* Reads up to max frames (at most SOCKETCAN_BATCH) by one recvmmsg; returns how many, or -1 with
 * errno set. */
static int socketcan_read_batch(struct socketcan *can, size_t max)
{
    for (size_t i = 0; i < max; i++) {
        can->vector[i] = (struct iovec){.iov_base = &can->raw[i], .iov_len = sizeof can->raw[i]};
        can->message[i] = (struct mmsghdr){
            .msg_hdr = {.msg_iov = &can->vector[i],
                        .msg_iovlen = 1,
                        .msg_control = &can->ancillary[i],
                        .msg_controllen = sizeof can->ancillary[i]},
        };
    }
    return recvmmsg(can->socket, can->message, (unsigned)max, MSG_DONTWAIT, NULL);
}

/* Takes over the state that another thread has read from the controller. */
static void socketcan_update_state(struct socketcan *can)
{
    const uint32_t post =
        can->controller ? atomic_load_explicit(&can->controller->post, memory_order_relaxed) : 0;
    const enum can_port_state state = (enum can_port_state)(post & 0xff);

    if (post == can->post) {
        return;
    }
    can->post = post;
    if (can->port.state != CAN_PORT_STUCK || state == CAN_PORT_BUS_OFF) {
        can->port.state = state;
    }
}

/* Receives all waiting frames, at most max; returns how many. */
static size_t socketcan_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct socketcan *can = socketcan_of_port(port);
    size_t count = 0;

    /* Finds a lost interface again, then sends the frames that wait for room in its queue */
    if (socketcan_is_lost(port)) {
        socketcan_find_interface(can);
    }
    if (!socketcan_is_lost(port)) {
        socketcan_update_state(can);
        socketcan_send_held(can);
    }

    /* Batch after batch until one is not full */
    while (count < max) {
        const size_t wanted = max - count < SOCKETCAN_BATCH ? max - count : SOCKETCAN_BATCH;
        const int got = socketcan_read_batch(can, wanted);
        int64_t now, to_monotonic;

        if (got < 0) {
            if (socketcan_error_means_lost(errno)) {
                socketcan_lose_interface(can, errno);
            }
            socketcan_query_overflow(can, false);
            break;
        }

        /* Time stamps of the kernel are in time of day, ours in CLOCK_MONOTONIC */
        now = socketcan_clock_ns(CLOCK_MONOTONIC);
        to_monotonic = now - socketcan_clock_ns(CLOCK_REALTIME);
        for (int i = 0; i < got; i++) {
            struct bus_frame *frame = &frames[count];
            const bool whole = socketcan_decode_frame(&can->raw[i], can->message[i].msg_len, frame);

            frame->time_ns = now;
            socketcan_read_ancillary(can, &can->message[i].msg_hdr, to_monotonic, frame);
            socketcan_limit_time(can, now, frame);
            if (!whole) {
                port->counters.rx_malformed++;
                continue;
            }
            port_count_received(port, frame);
            count++;
        }
        socketcan_query_overflow(can, (size_t)got == wanted);
        if ((size_t)got < wanted) {
            break;
        }
    }
    return count;
}

/* ---- the port ---- */

static int socketcan_descriptor(const struct can_port *port)
{
    return socketcan_of_port(port)->socket;
}

/* Closes both sockets. */
static void socketcan_close(struct can_port *port)
{
    struct socketcan *can = socketcan_of_port(port);

    close(can->socket);
    close(can->link);
    can->socket = can->link = -1;
}

const struct can_port_ops socketcan_ops = {
    .name = "socketcan",
    .receive = socketcan_receive,
    .send = socketcan_send,
    .descriptor = socketcan_descriptor,
    .close = socketcan_close,
};
