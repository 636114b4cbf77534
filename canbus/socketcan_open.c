/* SPDX-License-Identifier: Apache-2.0 */
/* Opening a raw SocketCAN socket, with a message of its own for each way to fail. */
#include "base/array.h"
#include "canbus/socketcan_private.h"

#include <errno.h>
#include <linux/can/error.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

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

/* Checks that the interface can be used as the configuration asks. */
static enum error_code socketcan_check_interface(const struct socketcan *can, const char *name,
                                                 struct link_info *info, struct error *error)
{
    const int failure = link_query(can->link, name, info);

    /* There must be such an interface */
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

    /* It must be a CAN interface, up, and carry FD where that is wanted */
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

/* Translates the filters into the kernel's form; without any, makes one that everything passes. */
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

/* Enlarges the receive buffer, whose default holds 278 frames; exceeds the system's limit only
 * when allowed to. Returns 0 or -1 with errno set. */
static int socketcan_set_receive_buffer(int socket, int bytes)
{
    if (!bytes) {
        bytes = RECEIVE_BUFFER_DEFAULT;
    }
    if (!setsockopt(socket, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes)) {
        return 0;
    }
    return setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
}

/* Sets the options of the socket: error frames, FD, own frames, drop counter, time stamps,
 * buffer. */
static enum error_code socketcan_set_options(int socket, const struct socketcan_config *config,
                                             struct error *error)
{
    static const can_err_mask_t errors = CAN_ERR_MASK;
    static const int on = 1;
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
        if (option[i].wanted && setsockopt(socket, option[i].level, option[i].option,
                                           option[i].value, option[i].size)) {
            return error_set_errno(error, errno, "cannot set %s of the CAN socket", option[i].what);
        }
    }
    if (socketcan_set_receive_buffer(socket, config->receive_buffer_bytes)) {
        return error_set_errno(error, errno, "cannot set the receive buffer of the CAN socket");
    }
    return ERROR_NONE;
}

static int socketcan_open_socket(void)
{
    return socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
}

/* Explains why no CAN socket could be opened. */
static enum error_code socketcan_explain_no_socket(int code, struct error *error)
{
    switch (code) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
        return error_set(error, ERROR_UNSUPPORTED,
                         "this kernel has no CAN: raw CAN sockets are not available; load can and "
                         "can_raw (`modprobe can-raw`), or keep the buses inside the process: run "
                         "--transport local, with --task, or --gateway for other programs");
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
static enum error_code socketcan_start(struct socketcan *can, const struct socketcan_config *config,
                                       struct error *error)
{
    struct link_info info;
    enum error_code code;
    int failure;

    can->socket = socketcan_open_socket();
    if (can->socket < 0) {
        return socketcan_explain_no_socket(errno, error);
    }
    can->link = link_open();
    if (can->link < 0) {
        return error_set_errno(error, errno, "cannot open a netlink socket");
    }
    code = socketcan_check_interface(can, config->interface, &info, error);
    if (code) {
        return code;
    }
    code = socketcan_set_options(can->socket, config, error);
    if (code) {
        return code;
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

    /* The port, before anything is open */
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

    /* The sockets */
    code = socketcan_start(can, config, error);
    if (code) {
        goto fail;
    }

    /* Frames are given times from now on, never earlier */
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
