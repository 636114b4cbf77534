/* SPDX-License-Identifier: Apache-2.0 */
/* Ports on raw SocketCAN sockets: one recvmmsg and one sendmmsg per tick and bus, all memory
 * preallocated. The socket stays open when its interface is lost. It is bound again when the
 * interface returns, and keeps its options and drop counter. When the interface's queue is full,
 * the port holds the newest frame of each identifier and sends it first at the next call. */
#include "canbus/link.h"
#include "canbus/port_private.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

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
    struct can_filter *filter; /* in the kernel's format; needed again for a new interface */
    size_t nfilter;
    int64_t last_ns;   /* time of the last frame received */
    uint32_t overflow; /* last value of the kernel's drop counter */
    bool full_batch;   /* the last read returned a full batch */
    int64_t retry_ns;  /* earliest next search for a lost interface, CLOCK_MONOTONIC */
    struct canfd_frame raw[SOCKETCAN_BATCH];
    struct iovec vector[SOCKETCAN_BATCH];
    struct mmsghdr message[SOCKETCAN_BATCH];
    union ancillary ancillary[SOCKETCAN_BATCH];

    const struct can_state_box *controller;
    uint32_t post; /* last post read from the box */

    /* Shared by the port and the thread that searches for its interface */
    bool sought;
    atomic_bool lost;         /* the interface is lost and not found yet */
    _Atomic uint32_t finding; /* number << 9 | FD possible << 8 | enum can_port_state */
    uint32_t finding_seen;

    /* Frames that the full queue refused: the newest one of each identifier, in order of arrival */
    struct bus_frame held[SOCKETCAN_HELD_MAX];
    size_t nheld;
    int64_t full_since_ns; /* time since when no frame has left; 0 = the queue was not full */
    int64_t back_off_ns;   /* interval between attempts; 0 = none */
    int64_t attempt_ns;    /* earliest next attempt */
};

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

static void socketcan_note_queue_moving(struct socketcan *can)
{
    can->full_since_ns = can->back_off_ns = can->attempt_ns = 0;
    if (can->port.state == CAN_PORT_STUCK) {
        can->port.state = CAN_PORT_UP;
    }
}

enum { RETRY_NS = 1000000000 };

/* ---- loss and return of the interface ---- */

static void socketcan_lose_interface(struct socketcan *can, int code)
{
    if (!socketcan_is_lost(&can->port)) {
        can->port.counters.down_events++;
        can->retry_ns = 0; /* search at once, because it may have returned */
        atomic_store(&can->lost, true);
    }
    can->port.state = code == ENETDOWN ? CAN_PORT_DOWN : CAN_PORT_GONE;

    /* Drop the held frames, because they will be too old */
    can->port.counters.tx_dropped += can->nheld;
    can->nheld = 0;
    socketcan_note_queue_moving(can);
}

static int socketcan_bind(const struct socketcan *can, int index)
{
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = index};

    if (setsockopt(can->socket, SOL_CAN_RAW, CAN_RAW_FILTER, can->filter,
                   (socklen_t)(can->nfilter * sizeof *can->filter)) ||
        bind(can->socket, (const struct sockaddr *)&address, sizeof address)) {
        return errno;
    }
    return 0;
}

/* Queries the interface and binds to it when it is up. Returns the port's new state. Waits for the
 * kernel's interface lock, which may take long. */
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

/* Sets the state of the found interface; sets up the socket when it is up. */
static void socketcan_use_interface(struct socketcan *can, enum can_port_state state, bool fd)
{
    socklen_t size = sizeof(int);
    int pending;

    can->port.state = state;
    if (state == CAN_PORT_UP) {
        /* Clear the socket's error from the loss */
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

static void socketcan_find_interface(struct socketcan *can)
{
    const uint32_t finding = atomic_load(&can->finding);
    int64_t now;
    bool fd = false;
    enum can_port_state state;

    /* If another thread searches for the interface, use its result */
    if (can->sought) {
        if (finding != can->finding_seen) {
            can->finding_seen = finding;
            socketcan_use_interface(can, (enum can_port_state)(finding & 0xff), finding >> 8 & 1);
        }
        return;
    }

    /* Otherwise search for it here, at most once a second */
    now = socketcan_clock_ns(CLOCK_MONOTONIC);
    if (now < can->retry_ns) {
        return;
    }
    can->retry_ns = now + RETRY_NS;
    state = socketcan_try_bind(can, &fd);
    socketcan_use_interface(can, state, fd);
}

enum {
    BACK_OFF_FIRST_NS = 10000000,
    BACK_OFF_LAST_NS = 1000000000,
};

/* ---- the interface's queue ---- */

/* Records that the interface's queue is full. This is normal for a short time. If the queue stays
 * full, no node acknowledges the frames. */
static void socketcan_note_queue_full(struct socketcan *can)
{
    const int64_t now = socketcan_clock_ns(CLOCK_MONOTONIC);

    can->port.counters.tx_queue_full++;
    if (!can->full_since_ns) {
        can->full_since_ns = now;
    }

    /* After SOCKETCAN_STUCK_NS the queue is stuck: try again with exponential back-off */
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

/* ---- batches ---- */

/* Converts a frame to the kernel's format. Returns its size. Unused data bytes are zero, because
 * peers can see them. */
static size_t socketcan_encode_frame(const struct bus_frame *frame, struct canfd_frame *raw)
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

/* Fills the batch with frames up to the first invalid one. Returns their number. */
static size_t socketcan_fill_batch(struct socketcan *can, const struct bus_frame *frames,
                                   size_t count)
{
    size_t size = 0;

    for (; size < count && size < SOCKETCAN_BATCH && port_may_send(&can->port, &frames[size]);
         size++) {
        can->vector[size] = (struct iovec){
            .iov_base = &can->raw[size],
            .iov_len = socketcan_encode_frame(&frames[size], &can->raw[size]),
        };
        can->message[size] = (struct mmsghdr){
            .msg_hdr = {.msg_iov = &can->vector[size], .msg_iovlen = 1},
        };
    }
    return size;
}

/* Sends frames until one fails. Returns the number of processed frames: the kernel accepted *taken
 * of them, the others are dropped. */
static size_t socketcan_transmit(struct socketcan *can, const struct bus_frame *frames,
                                 size_t count, size_t *taken)
{
    size_t at = 0;

    while (at < count) {
        const size_t size = socketcan_fill_batch(can, frames + at, count - at);

        /* Send a batch of `size` frames; `done` counts the frames that were sent or skipped */
        size_t done = 0;

        while (done < size) {
            const int sent =
                sendmmsg(can->socket, &can->message[done], (unsigned)(size - done), MSG_DONTWAIT);

            if (sent > 0) {
                for (int i = 0; i < sent; i++) {
                    port_count_sent(&can->port, &frames[at + done++]);
                }
                *taken += (size_t)sent;
                socketcan_note_queue_moving(can);
                /* || A frame that the device cannot carry is skipped */
            } else if (errno == EINVAL || errno == EMSGSIZE) {
                done++;
                can->port.counters.tx_dropped++;
            } else if (errno == ENOBUFS || errno == EAGAIN) {
                socketcan_note_queue_full(can);
                break;
            } else {
                if (socketcan_error_means_lost(errno)) {
                    socketcan_lose_interface(can, errno);
                }
                break;
            }
        }

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

/* ---- held frames ---- */

/* Holds a frame while the queue is full. It replaces an older held frame with the same identifier.
 * False = no room; the frame is dropped. */
static bool socketcan_hold_frame(struct socketcan *can, const struct bus_frame *frame)
{
    struct can_counters *counters = &can->port.counters;
    size_t i = 0;

    while (i < can->nheld &&
           !(can->held[i].id == frame->id &&
             !((can->held[i].flags ^ frame->flags) & (FRAME_EXTENDED | FRAME_REMOTE)))) {
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

static bool socketcan_send_held(struct socketcan *can)
{
    size_t done, taken = 0;

    if (!can->nheld) {
        return true;
    }
    if (can->attempt_ns && socketcan_clock_ns(CLOCK_MONOTONIC) < can->attempt_ns) {
        return false;
    }
    done = socketcan_transmit(can, can->held, can->nheld, &taken);
    if (socketcan_is_lost(&can->port)) {
        return false;
    }
    can->nheld -= done;
    memmove(can->held, can->held + done, can->nheld * sizeof *can->held);
    return can->nheld == 0;
}

static size_t socketcan_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct socketcan *can = socketcan_of_port(port);
    size_t accepted = 0, at = 0;

    if (socketcan_is_lost(port)) {
        socketcan_find_interface(can);
    }
    if (!socketcan_is_lost(port) && socketcan_send_held(can)) {
        at = socketcan_transmit(can, frames, count, &accepted);
    }

    /* Hold the frames that the full queue refused */
    for (; at < count && can->full_since_ns; at++) {
        accepted += socketcan_hold_frame(can, &frames[at]);
    }
    port->counters.tx_dropped += count - at;
    return accepted;
}

/* ---- reception ---- */

/* Converts a frame of size bytes from the kernel's format; false = not a valid frame. */
static bool socketcan_decode_frame(const struct canfd_frame *raw, size_t size,
                                   struct bus_frame *frame)
{
    /* The size distinguishes classic and FD frames */
    memset(frame, 0, sizeof *frame);
    if (size != CAN_MTU && size != CANFD_MTU) {
        return false;
    }
    if (size == CANFD_MTU) {
        frame->flags |= FRAME_FD;
        frame->flags |= (raw->flags & CANFD_BRS) ? FRAME_BRS : 0;
        frame->flags |= (raw->flags & CANFD_ESI) ? FRAME_ESI : 0;
    }

    /* The upper bits of the identifier give the type of the frame */
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

    /* A device may deliver an invalid length: copy at most a valid one */
    frame->len = raw->len;
    if (!frame_valid(frame)) {
        return false;
    }
    if (!(frame->flags & FRAME_REMOTE)) {
        memcpy(frame->data, raw->data, frame->len);
    }
    return true;
}

/* Counts the frames lost since the last value of the kernel's drop counter. Ignores older
 * values. */
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

/* Queries the drop counter for losses after the last frame. A frame carries only the losses before
 * it. The query is needed only when so many frames waited that the buffer may have been full. */
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

/* Receives all waiting frames, at most max; returns how many. */
static size_t socketcan_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct socketcan *can = socketcan_of_port(port);
    size_t count = 0;

    /* Search for a lost interface, then send the held frames */
    if (socketcan_is_lost(port)) {
        socketcan_find_interface(can);
    }
    if (!socketcan_is_lost(port)) {
        /* Update the state from another thread's query of the controller */
        const uint32_t post =
            can->controller ? atomic_load_explicit(&can->controller->post, memory_order_relaxed)
                            : 0;
        const enum can_port_state state = (enum can_port_state)(post & 0xff);

        if (post != can->post) {
            can->post = post;
            if (can->port.state != CAN_PORT_STUCK || state == CAN_PORT_BUS_OFF) {
                can->port.state = state;
            }
        }

        socketcan_send_held(can);
    }

    /* Read batches until one is not full */
    while (count < max) {
        const size_t wanted = max - count < SOCKETCAN_BATCH ? max - count : SOCKETCAN_BATCH;

        /* Read a batch by one recvmmsg; -1 with errno set = error */
        for (size_t i = 0; i < wanted; i++) {
            can->vector[i] =
                (struct iovec){.iov_base = &can->raw[i], .iov_len = sizeof can->raw[i]};
            can->message[i] = (struct mmsghdr){
                .msg_hdr = {.msg_iov = &can->vector[i],
                            .msg_iovlen = 1,
                            .msg_control = &can->ancillary[i],
                            .msg_controllen = sizeof can->ancillary[i]},
            };
        }
        const int got = recvmmsg(can->socket, can->message, (unsigned)wanted, MSG_DONTWAIT, NULL);

        int64_t now, to_monotonic;

        if (got < 0) {
            if (socketcan_error_means_lost(errno)) {
                socketcan_lose_interface(can, errno);
            }
            socketcan_query_overflow(can, false);
            break;
        }

        /* Convert the kernel's time of day to CLOCK_MONOTONIC */
        now = socketcan_clock_ns(CLOCK_MONOTONIC);
        to_monotonic = now - socketcan_clock_ns(CLOCK_REALTIME);
        for (int i = 0; i < got; i++) {
            struct bus_frame *frame = &frames[count];
            const bool whole = socketcan_decode_frame(&can->raw[i], can->message[i].msg_len, frame);

            frame->time_ns = now;
            socketcan_read_ancillary(can, &can->message[i].msg_hdr, to_monotonic, frame);

            /* Limit the time of a frame to the range from the last frame to now. The kernel uses
             * the time of day, and somebody may have set it while the frame waited. */
            frame->time_ns = frame->time_ns < now ? frame->time_ns : now;
            frame->time_ns = frame->time_ns > can->last_ns ? frame->time_ns : can->last_ns;
            can->last_ns = frame->time_ns;
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

static const struct can_port_ops socketcan_ops = {
    .name = "socketcan",
    .receive = socketcan_receive,
    .send = socketcan_send,
    .descriptor = socketcan_descriptor,
    .close = socketcan_close,
};

/* ---- opening, with a message of its own for each way to fail ---- */

enum { RECEIVE_BUFFER_DEFAULT = 4 << 20 };

/* Lists the CAN interfaces that exist, for a message: "can0, can1", or "none". */
static void socketcan_list_interfaces(int link, char *text, size_t size)
{
    struct if_nameindex *all = if_nameindex();
    size_t used = 0;

    snprintf(text, size, "none");
    for (const struct if_nameindex *i = all; i && i->if_index && used + IFNAMSIZ + 3 < size; i++) {
        struct link_info info;

        if (!link_query(link, i->if_name, &info) && info.type == ARPHRD_CAN) {
            used +=
                (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", i->if_name);
        }
    }
    if (all) {
        if_freenameindex(all);
    }
}

/* Checks that the interface fits the configuration. */
static enum error_code socketcan_check_interface(const struct socketcan *can, const char *name,
                                                 struct link_info *info, struct error *error)
{
    const int failure = link_query(can->link, name, info);

    /* The interface exists */
    if (failure == ENODEV) {
        char known[200];

        socketcan_list_interfaces(can->link, known, sizeof known);
        return error_set(error, ERROR_INPUT,
                         "no interface %s; CAN interfaces here: %s. Create a virtual one with "
                         "`ip link add dev %s type vcan && ip link set %s up`",
                         name, known, name, name);
    }
    if (failure) {
        return error_set_errno(error, failure, "cannot ask the kernel about interface %s", name);
    }

    /* It is a CAN interface, up, and supports FD if requested */
    if (info->type != ARPHRD_CAN) {
        return error_set(error, ERROR_INPUT, "interface %s is not a CAN interface", name);
    }
    if (!info->up) {
        return error_set(error, ERROR_SYSTEM,
                         "interface %s is down; bring it up with `ip link set %s up` (a real one "
                         "needs its bit rate first)",
                         name, name);
    }
    if (can->want_fd && info->mtu < CANFD_MTU) {
        return error_set(error, ERROR_INPUT,
                         "interface %s does not carry CAN FD (MTU %u, FD needs %d); a virtual one "
                         "gets it with `ip link set %s mtu %d` while it is down",
                         name, info->mtu, (int)CANFD_MTU, name, (int)CANFD_MTU);
    }
    return ERROR_NONE;
}

/* Converts the filters to the kernel's format; without filters, makes one that accepts
 * everything. */
static enum error_code socketcan_make_filters(struct socketcan *can,
                                              const struct socketcan_config *config,
                                              struct arena *arena, struct error *error)
{
    const size_t count = config->filter ? config->nfilter : 0;

    if (count > CAN_RAW_FILTER_MAX) {
        return error_set(error, ERROR_INPUT, "%zu filters on %s, expected at most %d", count,
                         config->interface, CAN_RAW_FILTER_MAX);
    }
    can->nfilter = count ? count : 1;
    can->filter = arena_alloc(arena, can->nfilter, sizeof *can->filter);
    if (!can->filter) {
        return error_set(error, ERROR_MEMORY, "no memory for the filters of %s", config->interface);
    }
    for (size_t i = 0; i < count; i++) {
        const struct frame_filter *from = &config->filter[i];

        can->filter[i].can_id = from->id | (from->extended ? CAN_EFF_FLAG : 0);
        can->filter[i].can_mask =
            (from->mask & (from->extended ? CAN_EFF_MASK : CAN_SFF_MASK)) | CAN_EFF_FLAG;
    }
    return ERROR_NONE;
}

static int socketcan_open_socket(void)
{
    return socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
}

/* Opens the descriptors and binds. On failure the caller closes them. */
static enum error_code socketcan_start(struct socketcan *can, const struct socketcan_config *config,
                                       struct error *error)
{
    struct link_info info;
    enum error_code code;
    int failure;

    can->socket = socketcan_open_socket();
    if (can->socket < 0) {
        /* Explain why no CAN socket could be opened */
        switch (errno) {
        case EAFNOSUPPORT:
        case EPROTONOSUPPORT:
            return error_set(
                error, ERROR_UNSUPPORTED,
                "this kernel has no CAN: raw CAN sockets are not available; load can and "
                "can_raw (`modprobe can-raw`), or keep the buses inside the process: run "
                "--transport local, with --task, or --gateway for other programs");
        case EPERM:
        case EACCES:
            return error_set(error, ERROR_SYSTEM,
                             "no permission to open a CAN socket; a container or service filter "
                             "forbids address family AF_CAN");
        default:
            return error_set_errno(error, errno, "cannot open a CAN socket");
        }
    }
    can->link = link_open();
    if (can->link < 0) {
        return error_set_errno(error, errno, "cannot open a netlink socket");
    }
    code = socketcan_check_interface(can, config->interface, &info, error);
    if (code) {
        return code;
    }

    /* Set the options of the socket: error frames, FD, own frames, drop counter, time stamps,
     * buffer */
    static const can_err_mask_t errors = CAN_ERR_MASK;
    static const int on = 1;
    const int bytes =
        config->receive_buffer_bytes ? config->receive_buffer_bytes : RECEIVE_BUFFER_DEFAULT;
    const struct {
        bool wanted;
        int level, option;
        const void *value;
        socklen_t size;
        const char *what;
    } option[] = {
        {true, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors, "the error filter"},
        {config->fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on, "FD frames"},
        {config->receive_own, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on,
         "reception of own frames"},
        {true, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on, "the drop counter"},
        {true, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on, "time stamps"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(option); i++) {
        if (option[i].wanted && setsockopt(can->socket, option[i].level, option[i].option,
                                           option[i].value, option[i].size)) {
            return error_set_errno(error, errno, "cannot set %s of the CAN socket", option[i].what);
        }
    }
    /* Enlarge the receive buffer; the default holds 278 frames. Exceed the system's limit if the
     * process has the right. */
    if (setsockopt(can->socket, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) &&
        setsockopt(can->socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes)) {
        return error_set_errno(error, errno, "cannot set the receive buffer of the CAN socket");
    }

    failure = socketcan_bind(can, info.index);
    return failure ? error_set_errno(error, failure, "cannot bind to %s", config->interface)
                   : ERROR_NONE;
}

static void socketcan_close_descriptor(int descriptor)
{
    if (descriptor >= 0) {
        close(descriptor);
    }
}

enum error_code socketcan_open(const struct socketcan_config *config, struct arena *arena,
                               struct can_port **port, struct error *error)
{
    const size_t length = strlen(config->interface);
    struct socketcan *can;
    struct timespec now;
    enum error_code code;

    if (!length || length >= IFNAMSIZ) {
        return error_set(error, ERROR_INPUT,
                         "interface name \"%.32s\" has %zu characters, expected 1 to %d",
                         config->interface, length, IFNAMSIZ - 1);
    }
    if (config->receive_buffer_bytes < 0) {
        return error_set(error, ERROR_INPUT, "receive buffer of %d bytes on %s",
                         config->receive_buffer_bytes, config->interface);
    }

    /* Allocate the port; nothing is open yet */
    can = arena_alloc(arena, 1, sizeof *can);
    if (!can || !(can->port.bus = arena_strdup(arena, config->interface))) {
        return error_set(error, ERROR_MEMORY, "no memory for the port of %s", config->interface);
    }
    can->socket = can->link = -1;
    can->want_fd = config->fd;
    can->controller = config->controller;
    can->sought = config->sought;
    code = socketcan_make_filters(can, config, arena, error);
    if (code) {
        return code;
    }

    /* Open the sockets */
    code = socketcan_start(can, config, error);
    if (code) {
        goto fail;
    }

    /* Times of frames start at the present time */
    can->port.ops = &socketcan_ops;
    can->port.fd = config->fd;
    can->port.state = CAN_PORT_UP;
    clock_gettime(CLOCK_MONOTONIC, &now);
    can->last_ns = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
    *port = &can->port;
    return ERROR_NONE;

fail:
    socketcan_close_descriptor(can->socket);
    socketcan_close_descriptor(can->link);
    return code;
}

bool socketcan_available(void)
{
    const int descriptor = socketcan_open_socket();

    socketcan_close_descriptor(descriptor);
    return descriptor >= 0;
}
