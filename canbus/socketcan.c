/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Raw SocketCAN sockets: one recvmmsg and one sendmmsg a tick and bus, everything preallocated. The
 * socket stays open when its interface goes; it is bound anew when the interface returns, and keeps
 * its options and drop counter.
 */
#include "canbus/link.h"
#include "canbus/port_private.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
    BATCH = 64,
    RECEIVE_BUFFER_DEFAULT = 4 << 20,
    RETRY_NS = 1000000000,
};

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
    uint32_t overflow; /* drop counter of the kernel, as last seen */
    int64_t retry_ns;  /* not before this time, CLOCK_MONOTONIC, look for a lost interface */
    struct canfd_frame raw[BATCH];
    struct iovec vector[BATCH];
    struct mmsghdr message[BATCH];
    union ancillary ancillary[BATCH];
    const struct bus_frame *source[BATCH]; /* while sending: what the messages were made from */
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

static void port_lose(struct socketcan *can, int code)
{
    if (!port_is_lost(&can->port)) {
        can->port.counters.down_events++;
        can->retry_ns = 0; /* it may be back already */
    }
    can->port.state = code == ENETDOWN ? CAN_PORT_DOWN : CAN_PORT_GONE;
}

/* Sets the filters, which the kernel drops when an interface is removed, and binds. 0 or an errno. */
static int bind_to(const struct socketcan *can, int index)
{
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = index};

    if (setsockopt(can->socket, SOL_CAN_RAW, CAN_RAW_FILTER, can->filter,
                   (socklen_t)(can->nfilter * sizeof *can->filter)) ||
        bind(can->socket, (const struct sockaddr *)&address, sizeof address)) {
        return errno;
    }
    return 0;
}

/* Looks for a lost interface, at most once a second, and goes on with it when it is up. */
static void port_find(struct socketcan *can)
{
    const int64_t now = clock_ns(CLOCK_MONOTONIC);
    struct link_info info;
    socklen_t size = sizeof(int);
    int pending;

    if (now < can->retry_ns) {
        return;
    }
    can->retry_ns = now + RETRY_NS;
    if (link_query(can->link, can->port.bus, &info) || info.type != ARPHRD_CAN) {
        can->port.state = CAN_PORT_GONE;
        return;
    }
    if (!info.up || bind_to(can, info.index)) {
        can->port.state = CAN_PORT_DOWN;
        return;
    }
    /* takes away the error that the loss has left on the socket */
    getsockopt(can->socket, SOL_SOCKET, SO_ERROR, &pending, &size);
    can->port.fd = can->want_fd && info.mtu >= CANFD_MTU;
    can->port.state = CAN_PORT_UP;
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
            can->port.counters.rx_dropped += overflow - can->overflow;
            can->overflow = overflow;
        }
    }
}

/* One recvmmsg of up to max frames (at most BATCH). Returns the number of messages, or -1. */
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

static size_t socketcan_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct socketcan *can = socketcan_of(port);
    size_t count = 0;

    if (port_is_lost(port)) {
        port_find(can);
    }
    while (count < max) {
        const size_t wanted = max - count < BATCH ? max - count : BATCH;
        const int got = read_batch(can, wanted);
        int64_t now, to_monotonic;

        if (got < 0) {
            if (error_means_lost(errno)) {
                port_lose(can, errno);
            }
            break;
        }
        now = clock_ns(CLOCK_MONOTONIC);
        to_monotonic = now - clock_ns(CLOCK_REALTIME);
        for (int i = 0; i < got; i++) {
            struct bus_frame *frame = &frames[count];
            const bool whole = decode(&can->raw[i], can->message[i].msg_len, frame);

            frame->time_ns = now;
            read_ancillary(can, &can->message[i].msg_hdr, to_monotonic, frame);
            if (!whole) {
                port->counters.rx_malformed++;
                continue;
            }
            port_count_received(port, frame);
            count++;
        }
        if ((size_t)got < wanted) {
            break;
        }
    }
    return count;
}

/* Puts the sendable ones of the next frames into the batch; returns how many frames it has looked
 * at and in *size how many are in the batch. */
static size_t fill_batch(struct socketcan *can, const struct bus_frame *frames, size_t count,
                         size_t *size)
{
    size_t looked = 0;

    *size = 0;
    for (; looked < count && *size < BATCH; looked++) {
        const size_t slot = *size;

        if (!port_may_send(&can->port, &frames[looked])) {
            can->port.counters.tx_dropped++;
            continue;
        }
        can->vector[slot] = (struct iovec){
            .iov_base = &can->raw[slot],
            .iov_len = encode(&frames[looked], &can->raw[slot]),
        };
        can->source[slot] = &frames[looked];
        can->message[slot] = (struct mmsghdr){
            .msg_hdr = {.msg_iov = &can->vector[slot], .msg_iovlen = 1},
        };
        (*size)++;
    }
    return looked;
}

/* Sends the batch of size frames; returns how many the kernel took. *stop: nothing more will go. */
static size_t send_batch(struct socketcan *can, size_t size, bool *stop)
{
    size_t slot = 0, accepted = 0;

    while (slot < size && !*stop) {
        const int sent =
            sendmmsg(can->socket, &can->message[slot], (unsigned)(size - slot), MSG_DONTWAIT);

        if (sent > 0) {
            for (int i = 0; i < sent; i++) {
                port_count_sent(&can->port, can->source[slot++]);
            }
            accepted += (size_t)sent;
            continue;
        }
        if (errno == EINVAL || errno == EMSGSIZE) {
            /* the device cannot carry this kind of frame; the others may pass */
            slot++;
            can->port.counters.tx_dropped++;
            continue;
        }
        if (errno == ENOBUFS || errno == EAGAIN) {
            can->port.counters.tx_queue_full++;
        } else if (error_means_lost(errno)) {
            port_lose(can, errno);
        }
        *stop = true;
    }
    can->port.counters.tx_dropped += size - slot;
    return accepted;
}

static size_t socketcan_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct socketcan *can = socketcan_of(port);
    size_t accepted = 0, at = 0;
    bool stop = false;

    if (port_is_lost(port)) {
        port_find(can);
        stop = port_is_lost(port);
    }
    while (at < count && !stop) {
        size_t size;

        at += fill_batch(can, frames + at, count - at, &size);
        accepted += send_batch(can, size, &stop);
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

static const struct can_port_ops socketcan_ops = {
    .name = "socketcan",
    .receive = socketcan_receive,
    .send = socketcan_send,
    .descriptor = socketcan_descriptor,
    .close = socketcan_close,
};

/* Names of the CAN interfaces that exist, for a message: "can0, can1", or "none". */
static void list_interfaces(int link, char *text, size_t size)
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

/* Checks that the interface can be used as the configuration asks. */
static enum error_code check_interface(const struct socketcan *can, const char *name,
                                       struct link_info *info, struct error *error)
{
    const int failure = link_query(can->link, name, info);

    if (failure == ENODEV) {
        char known[200];

        list_interfaces(can->link, known, sizeof known);
        return error_set(error, ERROR_INPUT,
                         "no interface %s; CAN interfaces here: %s. Create a virtual one with "
                         "`ip link add dev %s type vcan && ip link set %s up`",
                         name, known, name, name);
    }
    if (failure) {
        return error_set_errno(error, failure, "cannot ask the kernel about interface %s", name);
    }
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

static enum error_code set_option(int socket, int level, int option, const void *value,
                                  socklen_t size, const char *what, struct error *error)
{
    if (setsockopt(socket, level, option, value, size)) {
        return error_set_errno(error, errno, "cannot set %s of the CAN socket", what);
    }
    return ERROR_NONE;
}

/* Translates the filters; without any, one that everything passes. */
static enum error_code make_filters(struct socketcan *can, const struct socketcan_config *config,
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

/* More room than the 278 frames of the default; beyond the system's limit only when allowed. */
static enum error_code set_receive_buffer(int socket, int bytes, struct error *error)
{
    if (!bytes) {
        bytes = RECEIVE_BUFFER_DEFAULT;
    }
    if (!setsockopt(socket, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes)) {
        return ERROR_NONE;
    }
    return set_option(socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes, "the receive buffer",
                      error);
}

static enum error_code set_options(int socket, const struct socketcan_config *config,
                                   struct error *error)
{
    const can_err_mask_t errors = CAN_ERR_MASK;
    const int on = 1;
    enum error_code code;

    code = set_option(socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors,
                      "the error filter", error);
    if (!code && config->fd) {
        code =
            set_option(socket, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on, "FD frames", error);
    }
    if (!code && config->receive_own) {
        code = set_option(socket, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on,
                          "reception of own frames", error);
    }
    if (!code) {
        code =
            set_option(socket, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on, "the drop counter", error);
    }
    if (!code) {
        code = set_option(socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on, "time stamps", error);
    }
    return code ? code : set_receive_buffer(socket, config->receive_buffer_bytes, error);
}

static int open_socket(void)
{
    return socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
}

static enum error_code explain_no_socket(int code, struct error *error)
{
    switch (code) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
        return error_set(error, ERROR_UNSUPPORTED,
                         "this kernel has no CAN: raw CAN sockets are not available; load can and "
                         "can_raw (`modprobe can-raw`) or use a bus of kind local");
    case EPERM:
    case EACCES:
        return error_set(error, ERROR_SYSTEM,
                         "no permission to open a CAN socket; a container or service filter "
                         "forbids address family AF_CAN");
    default:
        return error_set_errno(error, code, "cannot open a CAN socket");
    }
}

/* Opens the descriptors and binds; what is open when it fails is closed by the caller. */
static enum error_code start(struct socketcan *can, const struct socketcan_config *config,
                             struct error *error)
{
    struct link_info info;
    enum error_code code;
    int failure;

    can->socket = open_socket();
    if (can->socket < 0) {
        return explain_no_socket(errno, error);
    }
    can->link = link_open();
    if (can->link < 0) {
        return error_set_errno(error, errno, "cannot open a netlink socket");
    }
    code = check_interface(can, config->interface, &info, error);
    if (!code) {
        code = set_options(can->socket, config, error);
    }
    if (code) {
        return code;
    }
    failure = bind_to(can, info.index);
    return failure ? error_set_errno(error, failure, "cannot bind to %s", config->interface)
                   : ERROR_NONE;
}

static void close_if_open(int descriptor)
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
    can = arena_alloc(arena, 1, sizeof *can);
    if (!can || !(can->port.bus = arena_strdup(arena, config->interface))) {
        return error_set(error, ERROR_MEMORY, "no memory for the port of %s", config->interface);
    }
    can->socket = can->link = -1;
    can->want_fd = config->fd;
    code = make_filters(can, config, arena, error);
    if (!code) {
        code = start(can, config, error);
    }
    if (code) {
        close_if_open(can->socket);
        close_if_open(can->link);
        return code;
    }
    can->port.ops = &socketcan_ops;
    can->port.fd = config->fd;
    can->port.state = CAN_PORT_UP;
    *port = &can->port;
    return ERROR_NONE;
}

bool socketcan_available(void)
{
    const int descriptor = open_socket();

    close_if_open(descriptor);
    return descriptor >= 0;
}

bool socketcan_interface_exists(const char *interface)
{
    const int link = link_open();
    struct link_info info;
    const bool exists = link >= 0 && !link_query(link, interface, &info);

    close_if_open(link);
    return exists;
}
