/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Raw SocketCAN sockets: one recvmmsg and one sendmmsg a tick and bus, everything preallocated. The
 * socket stays open when its interface goes; it is bound anew when the interface returns, and keeps
 * its options and drop counter.
 */
#include "canbus/socketcan_private.h"

#include <errno.h>
#include <linux/sock_diag.h>
#include <net/if_arp.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

enum {
    RETRY_NS = 1000000000,
    BACK_OFF_FIRST_NS = 10000000,
    BACK_OFF_LAST_NS = 1000000000,
};

static struct socketcan *socketcan_of(struct can_port *port)
{
    return (struct socketcan *)((char *)port - offsetof(struct socketcan, port));
}

static int64_t clock_ns(clockid_t clock)
{
    struct timespec now;

    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static bool port_is_lost(const struct can_port *port)
{
    return port->state == CAN_PORT_DOWN || port->state == CAN_PORT_GONE;
}

static bool error_means_lost(int code)
{
    return code == ENETDOWN || code == ENODEV || code == ENXIO;
}

/* The interface has taken a frame, or begins anew. */
static void queue_moves(struct socketcan *can)
{
    can->full_since_ns = can->back_off_ns = can->attempt_ns = 0;
    if (can->port.state == CAN_PORT_STUCK) {
        can->port.state = CAN_PORT_UP;
    }
}

/* A full queue is nothing unusual; one that stays full has nobody who takes the frames. */
static void queue_is_full(struct socketcan *can)
{
    const int64_t now = clock_ns(CLOCK_MONOTONIC);

    can->port.counters.tx_queue_full++;
    if (!can->full_since_ns) {
        can->full_since_ns = now;
    }
    if (now - can->full_since_ns < SOCKETCAN_STUCK_NS) {
        return;
    }
    can->back_off_ns = can->back_off_ns ? 2 * can->back_off_ns : BACK_OFF_FIRST_NS;
    if (can->back_off_ns > BACK_OFF_LAST_NS) {
        can->back_off_ns = BACK_OFF_LAST_NS;
    }
    can->attempt_ns = now + can->back_off_ns;
    if (can->port.state != CAN_PORT_BUS_OFF) {
        can->port.state = CAN_PORT_STUCK;
    }
}

static void port_lose(struct socketcan *can, int code)
{
    if (!port_is_lost(&can->port)) {
        can->port.counters.down_events++;
        can->retry_ns = 0; /* it may be back already */
        atomic_store(&can->lost, true);
    }
    can->port.state = code == ENETDOWN ? CAN_PORT_DOWN : CAN_PORT_GONE;
    /* What waited here will be old when it comes back */
    can->port.counters.tx_dropped += can->nheld;
    can->nheld = 0;
    queue_moves(can);
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

/* Asks for the interface and binds to it when it is up; how it is then. Waits for the kernel's
 * interface lock. */
static enum can_port_state seek(const struct socketcan *can, bool *fd)
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

static void take_up(struct socketcan *can, enum can_port_state state, bool fd)
{
    socklen_t size = sizeof(int);
    int pending;

    can->port.state = state;
    if (state == CAN_PORT_UP) {
        /* Takes away the error that the loss has left on the socket */
        getsockopt(can->socket, SOL_SOCKET, SO_ERROR, &pending, &size);
        can->port.fd = fd;
    }
}

void socketcan_seek(struct can_port *port)
{
    struct socketcan *can = socketcan_of(port);
    uint32_t number = (atomic_load(&can->finding) >> 9) + 1;
    enum can_port_state state;
    bool fd = false;

    if (!atomic_load(&can->lost)) {
        return;
    }
    state = seek(can, &fd);
    if (state == CAN_PORT_UP) {
        atomic_store(&can->lost, false);
    }
    atomic_store(&can->finding, number << 9 | (uint32_t)fd << 8 | state);
}

/* Looks for a lost interface, at most once a second, or at what was found by who looks for it, and goes
 * on with it when it is up. */
static void port_find(struct socketcan *can)
{
    const uint32_t finding = atomic_load(&can->finding);
    int64_t now;
    bool fd = false;
    enum can_port_state state;

    if (can->sought) {
        if (finding != can->finding_seen) {
            can->finding_seen = finding;
            take_up(can, (enum can_port_state)(finding & 0xff), finding >> 8 & 1);
        }
        return;
    }
    now = clock_ns(CLOCK_MONOTONIC);
    if (now < can->retry_ns) {
        return;
    }
    can->retry_ns = now + RETRY_NS;
    state = seek(can, &fd);
    take_up(can, state, fd);
}

/* From the kernel's frame of size bytes; false when it is not a frame. */
static bool decode(const struct canfd_frame *raw, size_t size, struct bus_frame *frame)
{
    memset(frame, 0, sizeof *frame);
    if (size != CAN_MTU && size != CANFD_MTU) {
        return false;
    }
    if (size == CANFD_MTU) {
        frame->flags |= FRAME_FD;
        frame->flags |= (raw->flags & CANFD_BRS) ? FRAME_BRS : 0;
        frame->flags |= (raw->flags & CANFD_ESI) ? FRAME_ESI : 0;
    }
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
    frame->len = raw->len;
    if (!frame_valid(frame)) {
        return false;
    }
    if (!(frame->flags & FRAME_REMOTE)) {
        memcpy(frame->data, raw->data, frame->len);
    }
    return true;
}

/* To the kernel's frame; returns its size. Bytes beyond the data are zero, as peers can see them. */
static size_t encode(const struct bus_frame *frame, struct canfd_frame *raw)
{
    memset(raw, 0, sizeof *raw);
    raw->can_id = frame->id;
    raw->can_id |= (frame->flags & FRAME_EXTENDED) ? CAN_EFF_FLAG : 0;
    raw->can_id |= (frame->flags & FRAME_REMOTE) ? CAN_RTR_FLAG : 0;
    raw->can_id |= (frame->flags & FRAME_ERROR) ? CAN_ERR_FLAG : 0;
    raw->len = frame->len;
    raw->flags |= (frame->flags & FRAME_BRS) ? CANFD_BRS : 0;
    raw->flags |= (frame->flags & FRAME_ESI) ? CANFD_ESI : 0;
    if (!(frame->flags & FRAME_REMOTE)) {
        memcpy(raw->data, frame->data, frame->len);
    }
    return (frame->flags & FRAME_FD) ? CANFD_MTU : CAN_MTU;
}

/* The counter as of some moment, which may be before the last one seen. */
static void count_overflow(struct socketcan *can, uint32_t overflow)
{
    const int32_t more = (int32_t)(overflow - can->overflow);

    if (more > 0) {
        can->port.counters.rx_dropped += (uint32_t)more;
        can->overflow = overflow;
    }
}

/* Reads the time stamp and the drop counter that came with a frame. */
static void read_ancillary(struct socketcan *can, struct msghdr *header, int64_t to_monotonic_ns,
                           struct bus_frame *frame)
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
            count_overflow(can, overflow);
        }
    }
}

/* A frame tells what was lost before it. What was lost behind the last one that waited is asked for,
 * when so much waited that there may have been no more room. */
static void ask_for_overflow(struct socketcan *can, bool full_batch)
{
    uint32_t memory[SK_MEMINFO_VARS] = {0};
    socklen_t size = sizeof memory;

    if (can->full_batch && !full_batch &&
        !getsockopt(can->socket, SOL_SOCKET, SO_MEMINFO, memory, &size) &&
        size > SK_MEMINFO_DROPS * sizeof *memory) {
        count_overflow(can, memory[SK_MEMINFO_DROPS]);
    }
    can->full_batch = full_batch;
}

/* The kernel stamps with the time of day. When that was set while the frame waited here, its stamp is
 * off by as much. */
static void mend_time(struct socketcan *can, int64_t now, struct bus_frame *frame)
{
    frame->time_ns = frame->time_ns < now ? frame->time_ns : now;
    frame->time_ns = frame->time_ns > can->last_ns ? frame->time_ns : can->last_ns;
    can->last_ns = frame->time_ns;
}

/* One recvmmsg of up to max frames (at most SOCKETCAN_BATCH). Returns the number of messages, or -1. */
static int read_batch(struct socketcan *can, size_t max)
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

/* What another thread has heard from the controller. */
static void follow_controller(struct socketcan *can)
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

/* Puts frames that the port may send, up to the first other one, into the batch; returns how many. */
static size_t fill_batch(struct socketcan *can, const struct bus_frame *frames, size_t count)
{
    size_t size = 0;

    for (; size < count && size < SOCKETCAN_BATCH && port_may_send(&can->port, &frames[size]);
         size++) {
        can->vector[size] = (struct iovec){
            .iov_base = &can->raw[size],
            .iov_len = encode(&frames[size], &can->raw[size]),
        };
        can->message[size] = (struct mmsghdr){
            .msg_hdr = {.msg_iov = &can->vector[size], .msg_iovlen = 1},
        };
    }
    return size;
}

/* Sends the batch that was made of size frames; returns how many are done with: taken by the kernel,
 * or such as the device cannot carry. */
static size_t send_batch(struct socketcan *can, const struct bus_frame *frames, size_t size,
                         size_t *taken)
{
    size_t slot = 0;

    while (slot < size) {
        const int sent =
            sendmmsg(can->socket, &can->message[slot], (unsigned)(size - slot), MSG_DONTWAIT);

        if (sent > 0) {
            for (int i = 0; i < sent; i++) {
                port_count_sent(&can->port, &frames[slot++]);
            }
            *taken += (size_t)sent;
            queue_moves(can);
        } else if (errno == EINVAL || errno == EMSGSIZE) {
            slot++;
            can->port.counters.tx_dropped++;
        } else if (errno == ENOBUFS || errno == EAGAIN) {
            queue_is_full(can);
            break;
        } else {
            if (error_means_lost(errno)) {
                port_lose(can, errno);
            }
            break;
        }
    }
    return slot;
}

/* Sends frames until one does not go; returns how many are done with: *taken of them by the kernel,
 * the others are dropped. */
static size_t transmit(struct socketcan *can, const struct bus_frame *frames, size_t count,
                       size_t *taken)
{
    size_t at = 0;

    while (at < count) {
        const size_t size = fill_batch(can, frames + at, count - at);
        const size_t done = send_batch(can, frames + at, size, taken);

        at += done;
        if (done < size) {
            break;
        }
        if (at < count && !port_may_send(&can->port, &frames[at])) {
            can->port.counters.tx_dropped++;
            at++;
        }
    }
    return at;
}

static bool same_identifier(const struct bus_frame *a, const struct bus_frame *b)
{
    return a->id == b->id && !((a->flags ^ b->flags) & (FRAME_EXTENDED | FRAME_REMOTE));
}

/* Keeps a frame that met a full queue, in the place of an older one of its identifier. */
static bool hold(struct socketcan *can, const struct bus_frame *frame)
{
    struct can_counters *counters = &can->port.counters;
    size_t i = 0;

    while (i < can->nheld && !same_identifier(&can->held[i], frame)) {
        i++;
    }
    if (!port_may_send(&can->port, frame) || i == SOCKETCAN_HELD_MAX) {
        counters->tx_dropped++;
        return false;
    }
    if (i < can->nheld) {
        counters->tx_dropped++;
    } else {
        can->nheld++;
    }
    can->held[i] = *frame;
    counters->tx_held++;
    return true;
}

/* Passes on what is held, when it is time for an attempt. False when the queue is still full. */
static bool release(struct socketcan *can)
{
    size_t done, taken = 0;

    if (!can->nheld) {
        return true;
    }
    if (can->attempt_ns && clock_ns(CLOCK_MONOTONIC) < can->attempt_ns) {
        return false;
    }
    done = transmit(can, can->held, can->nheld, &taken);
    if (port_is_lost(&can->port)) {
        return false;
    }
    can->nheld -= done;
    memmove(can->held, can->held + done, can->nheld * sizeof *can->held);
    return can->nheld == 0;
}

static size_t socketcan_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct socketcan *can = socketcan_of(port);
    size_t count = 0;

    if (port_is_lost(port)) {
        port_find(can);
    }
    if (!port_is_lost(port)) {
        follow_controller(can);
        release(can);
    }
    while (count < max) {
        const size_t wanted = max - count < SOCKETCAN_BATCH ? max - count : SOCKETCAN_BATCH;
        const int got = read_batch(can, wanted);
        int64_t now, to_monotonic;

        if (got < 0) {
            if (error_means_lost(errno)) {
                port_lose(can, errno);
            }
            ask_for_overflow(can, false);
            break;
        }
        now = clock_ns(CLOCK_MONOTONIC);
        to_monotonic = now - clock_ns(CLOCK_REALTIME);
        for (int i = 0; i < got; i++) {
            struct bus_frame *frame = &frames[count];
            const bool whole = decode(&can->raw[i], can->message[i].msg_len, frame);

            frame->time_ns = now;
            read_ancillary(can, &can->message[i].msg_hdr, to_monotonic, frame);
            mend_time(can, now, frame);
            if (!whole) {
                port->counters.rx_malformed++;
                continue;
            }
            port_count_received(port, frame);
            count++;
        }
        ask_for_overflow(can, (size_t)got == wanted);
        if ((size_t)got < wanted) {
            break;
        }
    }
    return count;
}

static size_t socketcan_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct socketcan *can = socketcan_of(port);
    size_t accepted = 0, at = 0;

    if (port_is_lost(port)) {
        port_find(can);
    }
    if (!port_is_lost(port) && release(can)) {
        at = transmit(can, frames, count, &accepted);
    }
    /* Behind a full queue */
    for (; at < count && can->full_since_ns; at++) {
        accepted += hold(can, &frames[at]);
    }
    port->counters.tx_dropped += count - at;
    return accepted;
}

static int socketcan_descriptor(const struct can_port *port)
{
    return ((const struct socketcan *)((const char *)port - offsetof(struct socketcan, port)))
        ->socket;
}

static void socketcan_close(struct can_port *port)
{
    struct socketcan *can = socketcan_of(port);

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
