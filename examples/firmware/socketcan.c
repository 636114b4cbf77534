/* SPDX-License-Identifier: Apache-2.0 */
/*
 * SocketCAN without a kernel that has it: preloaded into a program (LD_PRELOAD), this library gives
 * it the buses of a run of coman-hil as CAN interfaces, through the run's gateway.
 *
 *   COMAN_HIL_GATEWAY=HOST:PORT LD_PRELOAD=./socketcan.so qemu-system-aarch64 ... if=left_hip
 *
 * A raw CAN socket becomes one end of a pair of local sockets, so that the program reads, writes
 * and polls it as it would a real one; a thread carries frames between the other ends and one
 * connection to the gateway, which has all buses. The name of an interface is that of a bus in the
 * rig. Classic data frames only; filters and other options are accepted and have no effect.
 *
 * Order in lockstep. What the program has written before a STEP, on any socket, is passed on before
 * it. DONE is handed over when the program has read all other frames of the STEP; and what comes
 * after it, as from another node, waits for the next STEP. So a program that acts between DONE and
 * STEP only is given the same in every run.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <linux/can.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
    SOCKETS = 16,
    NAME = IFNAMSIZ,
    TEXT = 65536,
    STEP_ID = 0x6f0,
    DONE_ID = 0x6ff,
};

struct can_socket {
    int program, ours; /* the ends of the pair */
    char bus[NAME];    /* "" = not bound */
};

static struct can_socket can_sockets[SOCKETS];
static int can_count, gateway_socket = -1;
static bool gateway_waits; /* after DONE, for the next STEP */
static char gateway_text[TEXT + 1];
static size_t gateway_used;
static pthread_mutex_t can_lock = PTHREAD_MUTEX_INITIALIZER;

static void die(const char *what)
{
    fprintf(stderr, "socketcan.so: %s: %s\n", what, errno ? strerror(errno) : "not as expected");
    _exit(EXIT_FAILURE);
}

/* ---- the gateway ---- */

static void gateway_put(const char *text)
{
    size_t left = strlen(text);

    while (left > 0) {
        ssize_t n = send(gateway_socket, text, left, MSG_NOSIGNAL);

        if (n < 0 && errno != EINTR) {
            _exit(EXIT_SUCCESS); /* the run has ended: there is nothing left to do */
        }
        text += n > 0 ? n : 0;
        left -= n > 0 ? (size_t)n : 0;
    }
}

/* Waits for an answer of the gateway that must be as said. */
static void gateway_expect(const char *answer)
{
    char text[64] = "";
    size_t used = 0;

    while (used + 1 < sizeof text && !strchr(text, '>')) {
        ssize_t n = recv(gateway_socket, text + used, 1, 0);

        if (n <= 0) {
            die("the gateway does not answer");
        }
        text[++used] = '\0';
    }
    if (!strstr(text, answer)) {
        errno = 0;
        die(text);
    }
}

static void gateway_connect(void)
{
    const char *place = getenv("COMAN_HIL_GATEWAY");
    const char *colon = place ? strrchr(place, ':') : NULL;
    struct sockaddr_in address = {.sin_family = AF_INET};
    char host[64];
    int one = 1;

    errno = 0;
    if (!colon) {
        die("COMAN_HIL_GATEWAY=HOST:PORT");
    }
    snprintf(host, sizeof host, "%.*s", (int)(colon - place), place);
    address.sin_port = htons((uint16_t)atoi(colon + 1));
    if (inet_pton(AF_INET, host, &address.sin_addr) != 1) {
        die("COMAN_HIL_GATEWAY: not a numeric address");
    }
    gateway_socket = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (gateway_socket < 0 ||
        connect(gateway_socket, (struct sockaddr *)&address, sizeof address)) {
        die("cannot connect to the gateway");
    }
    setsockopt(gateway_socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    gateway_expect("< hi >");
    gateway_put("< open all >");
    gateway_expect("< ok >");
    gateway_put("< rawmode >");
    gateway_expect("< ok >");
}

/* ---- from the program to the gateway ---- */

/* Passes on what the program has written to a socket; of a STEP only notes it. */
static void socket_forward(struct can_socket *from, struct can_frame *step, char *step_bus)
{
    struct canfd_frame frame; /* as long as the longest */

    while (recv(from->ours, &frame, sizeof frame, MSG_DONTWAIT) >= (ssize_t)CAN_MTU) {
        const uint32_t id = frame.can_id & CAN_EFF_MASK;
        char text[128];
        int used;

        if (frame.can_id == STEP_ID) {
            memcpy(step, &frame, CAN_MTU);
            memcpy(step_bus, from->bus, NAME);
            continue;
        }
        used =
            snprintf(text, sizeof text, frame.can_id & CAN_EFF_FLAG ? "< %s %08X %u" : "< %s %X %u",
                     frame.can_id & CAN_RTR_FLAG ? "sendrtr" : "send", id, frame.len);
        for (int i = 0; i < frame.len && i < 8 && !(frame.can_id & CAN_RTR_FLAG); i++) {
            used += snprintf(text + used, sizeof text - (size_t)used, " %02X", frame.data[i]);
        }
        snprintf(text + used, sizeof text - (size_t)used, " %s >", from->bus);
        gateway_put(text);
    }
}

static void sockets_forward(void)
{
    struct can_frame step = {0};
    char bus[NAME] = "", text[128];
    int used;

    /* All sockets once more when there is a STEP: what was written before it goes first */
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < can_count; i++) {
            socket_forward(&can_sockets[i], &step, bus);
        }
    }
    if (step.can_id == STEP_ID) {
        used = snprintf(text, sizeof text, "< send %X %u", STEP_ID, step.can_dlc);
        for (int i = 0; i < step.can_dlc && i < 8; i++) {
            used += snprintf(text + used, sizeof text - (size_t)used, " %02X", step.data[i]);
        }
        snprintf(text + used, sizeof text - (size_t)used, " %s >", bus);
        gateway_put(text);
        gateway_waits = false;
    }
}

/* ---- from the gateway to the program ---- */

/* Waits until the program has read every frame that it was given. */
static void sockets_settle(void)
{
    const struct timespec pause = {.tv_nsec = 5000};

    for (int i = 0; i < can_count; i++) {
        int unread = 0;

        while (ioctl(can_sockets[i].ours, SIOCOUTQ, &unread) == 0 && unread > 0) {
            nanosleep(&pause, NULL);
        }
    }
}

/* "< frame ID SECONDS DATA BUS >"; anything else is skipped. */
static void gateway_take(const char *line)
{
    struct can_frame frame = {0};
    char id[16], data[32] = "", bus[NAME] = "";
    unsigned byte;

    if (sscanf(line, "< frame %15s %*s %31s %15s >", id, data, bus) != 3) {
        /* Without data the name of the bus stands where they would */
        if (sscanf(line, "< frame %15s %*s %15s >", id, bus) != 2 || bus[0] == '\0') {
            return;
        }
        data[0] = '\0';
    } else if (strcmp(bus, ">") == 0) {
        snprintf(bus, sizeof bus, "%.15s", data);
        data[0] = '\0';
    }
    frame.can_id = (canid_t)strtoul(id, NULL, 16);
    frame.can_id |= strlen(id) == 8 ? CAN_EFF_FLAG : 0;
    for (; frame.can_dlc < 8 && sscanf(data + 2 * frame.can_dlc, "%2x", &byte) == 1;) {
        frame.data[frame.can_dlc++] = (uint8_t)byte;
    }
    if (frame.can_id == DONE_ID) {
        sockets_settle();
    }
    for (int i = 0; i < can_count; i++) {
        if (strcmp(can_sockets[i].bus, bus) == 0) {
            send(can_sockets[i].ours, &frame, CAN_MTU, MSG_NOSIGNAL);
        }
    }
    gateway_waits = frame.can_id == DONE_ID;
}

/* Takes the complete lines that have come, up to DONE. */
static void gateway_take_lines(void)
{
    char *from = gateway_text, *begin, *end;

    while (!gateway_waits && (begin = strchr(from, '<')) && (end = strchr(begin, '>'))) {
        from = end + 1;
        gateway_take(begin);
    }
    gateway_used -= (size_t)(from - gateway_text);
    memmove(gateway_text, from, gateway_used + 1);
}

/* Reads what has come; false at the end of the connection. */
static bool gateway_read(void)
{
    ssize_t n = recv(gateway_socket, gateway_text + gateway_used, TEXT - gateway_used, 0);

    if (n <= 0) {
        return false;
    }
    gateway_used += (size_t)n;
    gateway_text[gateway_used] = '\0';
    return true;
}

static void *carry(void *unused)
{
    (void)unused;
    for (;;) {
        struct pollfd fd[SOCKETS + 1] = {
            {.fd = gateway_socket, .events = gateway_used < TEXT ? POLLIN : 0}};
        int count;

        pthread_mutex_lock(&can_lock);
        count = can_count;
        for (int i = 0; i < count; i++) {
            fd[i + 1] = (struct pollfd){.fd = can_sockets[i].ours, .events = POLLIN};
        }
        pthread_mutex_unlock(&can_lock);
        poll(fd, (nfds_t)count + 1, 100); /* sockets may be added */
        if (fd[0].revents && gateway_used < TEXT && !gateway_read()) {
            _exit(EXIT_SUCCESS); /* the run has ended */
        }
        sockets_forward();
        gateway_take_lines();
    }
}

/* ---- what the program calls ---- */

static struct can_socket *socket_find(int fd)
{
    for (int i = 0; i < can_count; i++) {
        if (can_sockets[i].program == fd) {
            return &can_sockets[i];
        }
    }
    return NULL;
}

int socket(int domain, int type, int protocol)
{
    int (*real)(int, int, int) = (int (*)(int, int, int))dlsym(RTLD_NEXT, "socket");
    int ends[2];

    if (domain != PF_CAN) {
        return real(domain, type, protocol);
    }
    if ((type & 0xf) != SOCK_RAW || protocol != CAN_RAW || can_count == SOCKETS) {
        errno = EPROTONOSUPPORT;
        return -1;
    }
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | (type & ~0xf), 0, ends)) {
        return -1;
    }
    pthread_mutex_lock(&can_lock);
    can_sockets[can_count] = (struct can_socket){.program = ends[0], .ours = ends[1]};
    can_count++;
    pthread_mutex_unlock(&can_lock);
    return ends[0];
}

/* An interface's index is that of its socket, from 1. */
int ioctl(int fd, unsigned long request, ...)
{
    int (*real)(int, unsigned long, ...) =
        (int (*)(int, unsigned long, ...))dlsym(RTLD_NEXT, "ioctl");
    struct can_socket *socket = socket_find(fd);
    va_list more;
    void *argument;

    va_start(more, request);
    argument = va_arg(more, void *);
    va_end(more);
    if (!socket || (request != SIOCGIFINDEX && request != SIOCGIFMTU)) {
        return real(fd, request, argument);
    }
    if (request == SIOCGIFMTU) {
        ((struct ifreq *)argument)->ifr_mtu = CAN_MTU;
        return 0;
    }
    memcpy(socket->bus, ((struct ifreq *)argument)->ifr_name, NAME);
    socket->bus[NAME - 1] = '\0';
    ((struct ifreq *)argument)->ifr_ifindex = (int)(socket - can_sockets) + 1;
    return 0;
}

int bind(int fd, const struct sockaddr *address, socklen_t length)
{
    int (*real)(int, const struct sockaddr *, socklen_t) =
        (int (*)(int, const struct sockaddr *, socklen_t))dlsym(RTLD_NEXT, "bind");
    pthread_t thread;

    if (!socket_find(fd)) {
        return real(fd, address, length);
    }
    if (gateway_socket < 0) {
        gateway_connect();
        if (pthread_create(&thread, NULL, carry, NULL)) {
            die("cannot make a thread");
        }
    }
    return 0;
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t length)
{
    int (*real)(int, int, int, const void *, socklen_t) =
        (int (*)(int, int, int, const void *, socklen_t))dlsym(RTLD_NEXT, "setsockopt");

    return socket_find(fd) ? 0 : real(fd, level, name, value, length);
}
