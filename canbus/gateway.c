/* SPDX-License-Identifier: Apache-2.0 */
/* One thread, one poll set: the listening socket, a descriptor to stop, the ports, the clients. */
#include "canbus/gateway.h"

#include "canbus/socketcand.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { BATCH = 64, TURNS = 64, BACKLOG = 64, IDLE_MS = 1000, POLL_MS = 1 };

/* A client that has just been told "ok" gets frames this much later: widespread clients expect the
 * answer to come alone. */
enum { QUIET_MS = 20 };

enum client_mode { CLIENT_NO_BUS, CLIENT_BCM, CLIENT_RAW };

struct client {
    int socket; /* -1 = free place */
    enum client_mode mode;
    size_t bus;
    unsigned junk;
    int64_t quiet_until_ms;
    size_t received; /* of inbox: a command that has not ended yet */
    char inbox[SOCKETCAND_TEXT_MAX];
    size_t waiting; /* of outbox */
    char *outbox;
};

struct gateway {
    struct gateway_config config;
    struct gateway_counters counters;
    int64_t *time_ns; /* of the newest frame of each bus, on its clock */
    int listener, stop_event;
    uint16_t port;
    pthread_t thread;
    struct client client[GATEWAY_CLIENTS];
};

static int64_t now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ---- clients: out ---- */

static void drop(struct client *client)
{
    if (client->socket >= 0) {
        close(client->socket);
        client->socket = -1;
    }
}

/* Gives the system what it takes */
static void flush(struct client *client)
{
    while (client->socket >= 0 && client->waiting > 0) {
        ssize_t sent =
            send(client->socket, client->outbox, client->waiting, MSG_NOSIGNAL | MSG_DONTWAIT);

        if (sent < 0 && errno == EINTR) {
            continue;
        }
        if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
            return;
        }
        if (sent <= 0) {
            drop(client);
            return;
        }
        client->waiting -= (size_t)sent;
        memmove(client->outbox, client->outbox + sent, client->waiting);
    }
}

static void put(struct gateway *gateway, struct client *client, const char *text, size_t length)
{
    if (client->socket < 0) {
        return;
    }
    if (client->waiting + length > GATEWAY_OUTBOX) {
        flush(client);
    }
    if (client->socket >= 0 && client->waiting + length > GATEWAY_OUTBOX) {
        const struct linger at_once = {.l_onoff = 1};

        /* What it did not take in all that time it does not get from the kernel either */
        setsockopt(client->socket, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
        gateway->counters.cut_slow++;
        drop(client);
        return;
    }
    memcpy(client->outbox + client->waiting, text, length);
    client->waiting += length;
}

static void answer(struct gateway *gateway, struct client *client, const char *text)
{
    put(gateway, client, text, strlen(text));
}

/* To the clients of a bus but for the one it came from */
static void publish(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                    const struct client *from)
{
    char text[SOCKETCAND_TEXT_MAX];
    size_t length = 0;

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct client *client = &gateway->client[i];

        if (client->socket < 0 || client == from || client->mode != CLIENT_RAW ||
            client->bus != bus) {
            continue;
        }
        if (length == 0) {
            length = socketcand_format(frame, text);
        }
        if (length > 0) {
            put(gateway, client, text, length);
            gateway->counters.to_client++;
        }
    }
}

/* ---- clients: in ---- */

static bool find_bus(const struct gateway *gateway, const char *name, size_t *bus)
{
    for (size_t i = 0; i < gateway->config.nbus; i++) {
        const struct gateway_bus *entry = &gateway->config.bus[i];

        if (strcmp(entry->name, name) == 0 || (entry->alias && strcmp(entry->alias, name) == 0)) {
            *bus = i;
            return true;
        }
    }
    return false;
}

static void complain(struct gateway *gateway, struct client *client, const char *text)
{
    answer(gateway, client, text);
    if (client->socket >= 0 && ++client->junk >= GATEWAY_JUNK_MAX) {
        gateway->counters.cut_junk++;
        flush(client);
        drop(client);
    }
}

static void open_bus(struct gateway *gateway, struct client *client, const char *name)
{
    if (client->mode != CLIENT_NO_BUS) {
        complain(gateway, client, "< error a bus is open already >");
    } else if (!find_bus(gateway, name, &client->bus)) {
        complain(gateway, client, "< error no such bus >");
    } else {
        client->mode = CLIENT_BCM;
        answer(gateway, client, "< ok >");
    }
}

static void send_frame(struct gateway *gateway, struct client *client,
                       const struct bus_frame *request)
{
    struct bus_frame frame = *request;

    frame.time_ns = gateway->time_ns[client->bus];
    if (can_send(gateway->config.bus[client->bus].port, &frame, 1) != 1) {
        /* A full queue: bad luck, not bad manners */
        gateway->counters.not_taken++;
        answer(gateway, client, "< error the bus refuses the frame >");
        return;
    }
    gateway->counters.to_bus++;
    publish(gateway, client->bus, &frame, client);
}

static void obey(struct gateway *gateway, struct client *client, const char *text, size_t size)
{
    struct socketcand_request request;

    socketcand_parse(text, size, &request);
    if (client->mode == CLIENT_NO_BUS && request.command != SOCKETCAND_OPEN &&
        request.command != SOCKETCAND_ECHO) {
        complain(gateway, client, "< error no bus is open >");
        return;
    }
    switch (request.command) {
    case SOCKETCAND_OPEN:
        open_bus(gateway, client, request.bus);
        break;
    case SOCKETCAND_RAWMODE:
    case SOCKETCAND_BCMMODE:
        client->mode = request.command == SOCKETCAND_RAWMODE ? CLIENT_RAW : CLIENT_BCM;
        client->quiet_until_ms = now_ms() + QUIET_MS;
        answer(gateway, client, "< ok >");
        flush(client);
        break;
    case SOCKETCAND_ECHO:
        answer(gateway, client, "< echo >");
        break;
    case SOCKETCAND_SEND:
        send_frame(gateway, client, &request.frame);
        break;
    case SOCKETCAND_OTHER:
        complain(gateway, client, "< error not offered here, use rawmode >");
        break;
    case SOCKETCAND_UNKNOWN:
        complain(gateway, client, "< error unknown command >");
        break;
    case SOCKETCAND_MALFORMED:
        complain(gateway, client, "< error wrong arguments >");
        break;
    }
}

/* Obeys every command that has come to its end; what stands between them is skipped */
static void obey_all(struct gateway *gateway, struct client *client)
{
    size_t at = 0;

    while (client->socket >= 0) {
        const char *begin = memchr(client->inbox + at, '<', client->received - at), *end;

        if (!begin) {
            at = client->received;
            break;
        }
        at = (size_t)(begin - client->inbox);
        end = memchr(begin, '>', client->received - at);
        if (!end) {
            break;
        }
        at = (size_t)(end - client->inbox) + 1;
        obey(gateway, client, begin, (size_t)(end - begin) + 1);
    }
    client->received -= at;
    memmove(client->inbox, client->inbox + at, client->received);
    if (client->received == sizeof client->inbox) {
        gateway->counters.cut_junk++;
        drop(client);
    }
}

static void hear(struct gateway *gateway, struct client *client)
{
    ssize_t count = recv(client->socket, client->inbox + client->received,
                         sizeof client->inbox - client->received, MSG_DONTWAIT);

    if (count > 0) {
        client->received += (size_t)count;
        obey_all(gateway, client);
    } else if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        drop(client);
    }
}

static struct client *free_place(struct gateway *gateway)
{
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        if (gateway->client[i].socket < 0) {
            return &gateway->client[i];
        }
    }
    return NULL;
}

/* Everybody who waits at the door */
static void welcome(struct gateway *gateway)
{
    int one = 1, socket;

    while ((socket = accept4(gateway->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        struct client *client = free_place(gateway);

        if (!client) {
            gateway->counters.refused++;
            close(socket);
            continue;
        }
        setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        *client = (struct client){.socket = socket, .outbox = client->outbox};
        gateway->counters.clients++;
        answer(gateway, client, "< hi >");
    }
}

/* ---- the thread ---- */

static void serve_bus(struct gateway *gateway, size_t bus)
{
    struct can_port *port = gateway->config.bus[bus].port;
    struct bus_frame frame[BATCH];
    size_t count = BATCH;

    for (int turn = 0; turn < TURNS && count == BATCH; turn++) {
        count = can_receive(port, frame, BATCH);
        for (size_t i = 0; i < count; i++) {
            gateway->time_ns[bus] = frame[i].time_ns;
            publish(gateway, bus, &frame[i], NULL);
        }
    }
}

enum { POLL_FIXED = 2, POLL_MAX = POLL_FIXED + GATEWAY_CLIENTS + GATEWAY_BUSES };

/* The descriptors to wait for, and for how long; clients first, then the ports that have one */
static size_t prepare(const struct gateway *gateway, struct pollfd fd[POLL_MAX], int *timeout_ms)
{
    size_t count = POLL_FIXED;

    *timeout_ms = IDLE_MS;
    fd[0] = (struct pollfd){.fd = gateway->stop_event, .events = POLLIN};
    fd[1] = (struct pollfd){.fd = gateway->listener, .events = POLLIN};
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        const struct client *client = &gateway->client[i];
        bool quiet = client->waiting > 0 && now_ms() < client->quiet_until_ms;

        fd[count++] =
            (struct pollfd){.fd = client->socket,
                            .events = (short)(POLLIN | (client->waiting && !quiet ? POLLOUT : 0))};
        if (client->socket >= 0 && quiet) {
            *timeout_ms = POLL_MS;
        }
    }
    for (size_t b = 0; b < gateway->config.nbus; b++) {
        struct can_port *port = gateway->config.bus[b].port;
        int descriptor = port->ops->descriptor(port);

        fd[count++] = (struct pollfd){.fd = descriptor, .events = POLLIN};
        if (descriptor < 0) {
            *timeout_ms = POLL_MS;
        }
    }
    return count;
}

static void *serve(void *context)
{
    struct gateway *gateway = context;
    struct pollfd fd[POLL_MAX];

    for (;;) {
        int timeout_ms;
        size_t count = prepare(gateway, fd, &timeout_ms);

        poll(fd, (nfds_t)count, timeout_ms);
        if (fd[0].revents) {
            return NULL;
        }
        for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
            struct client *client = &gateway->client[i];

            if (client->socket >= 0 && (fd[POLL_FIXED + i].revents & ~POLLOUT)) {
                hear(gateway, client);
            }
        }
        for (size_t b = 0; b < gateway->config.nbus; b++) {
            serve_bus(gateway, b);
        }
        for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
            struct client *client = &gateway->client[i];

            if (client->mode != CLIENT_RAW || now_ms() >= client->quiet_until_ms) {
                flush(client);
            }
        }
        if (fd[1].revents) {
            welcome(gateway);
        }
    }
}

/* ---- start and stop ---- */

static bool parse_host(const char *host, uint16_t port, struct sockaddr_storage *address,
                       socklen_t *length)
{
    struct sockaddr_in *v4 = (struct sockaddr_in *)address;
    struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)address;

    memset(address, 0, sizeof *address);
    if (inet_pton(AF_INET, host, &v4->sin_addr) == 1) {
        v4->sin_family = AF_INET;
        v4->sin_port = htons(port);
        *length = sizeof *v4;
        return true;
    }
    if (inet_pton(AF_INET6, host, &v6->sin6_addr) == 1) {
        v6->sin6_family = AF_INET6;
        v6->sin6_port = htons(port);
        *length = sizeof *v6;
        return true;
    }
    return false;
}

static enum error_code listen_at(struct gateway *gateway, const char *host, struct error *error)
{
    struct sockaddr_storage address;
    socklen_t length;
    int one = 1;

    if (!parse_host(host, gateway->config.port, &address, &length)) {
        return error_set(error, ERROR_INPUT,
                         "gateway: found host \"%.64s\", expected a numeric address, for example "
                         "127.0.0.1",
                         host);
    }
    gateway->listener =
        socket(address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, IPPROTO_TCP);
    if (gateway->listener < 0) {
        return error_set_errno(error, errno, "gateway: cannot open a socket");
    }
    setsockopt(gateway->listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(gateway->listener, (const struct sockaddr *)&address, length) ||
        listen(gateway->listener, BACKLOG)) {
        return error_set_errno(error, errno, "gateway: cannot listen at %.64s port %u", host,
                               gateway->config.port);
    }
    length = sizeof address;
    getsockname(gateway->listener, (struct sockaddr *)&address, &length);
    /* The port stands at the same place in both families */
    gateway->port = ntohs(((const struct sockaddr_in *)&address)->sin_port);
    return ERROR_NONE;
}

static void close_all(struct gateway *gateway)
{
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        drop(&gateway->client[i]);
    }
    if (gateway->listener >= 0) {
        close(gateway->listener);
    }
    if (gateway->stop_event >= 0) {
        close(gateway->stop_event);
    }
}

static enum error_code allocate(const struct gateway_config *config, struct arena *arena,
                                struct gateway **out, struct error *error)
{
    struct gateway *gateway = arena_alloc(arena, 1, sizeof *gateway);
    struct gateway_bus *bus = arena_alloc(arena, config->nbus, sizeof *bus);
    int64_t *time_ns = arena_alloc(arena, config->nbus, sizeof *time_ns);
    char *outbox = arena_alloc(arena, GATEWAY_CLIENTS, GATEWAY_OUTBOX);

    if (!gateway || !bus || !time_ns || !outbox) {
        return error_set(error, ERROR_MEMORY, "gateway: no memory");
    }
    for (size_t i = 0; i < config->nbus; i++) {
        bus[i] = config->bus[i];
    }
    *gateway =
        (struct gateway){.config = *config, .time_ns = time_ns, .listener = -1, .stop_event = -1};
    gateway->config.bus = bus;
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        gateway->client[i] =
            (struct client){.socket = -1, .outbox = outbox + i * (size_t)GATEWAY_OUTBOX};
    }
    *out = gateway;
    return ERROR_NONE;
}

static enum error_code check(const struct gateway_config *config, struct error *error)
{
    if (config->nbus > GATEWAY_BUSES) {
        return error_set(error, ERROR_INPUT, "gateway: found %zu buses, expected at most %d",
                         config->nbus, GATEWAY_BUSES);
    }
    for (size_t i = 0; i < config->nbus; i++) {
        if (strlen(config->bus[i].name) > SOCKETCAND_BUS_MAX) {
            return error_set(error, ERROR_INPUT,
                             "gateway: found bus name \"%.64s\", expected at most %d characters",
                             config->bus[i].name, SOCKETCAND_BUS_MAX);
        }
    }
    return ERROR_NONE;
}

static enum error_code start_thread(struct gateway *gateway, struct error *error)
{
    int reason;

    gateway->stop_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (gateway->stop_event < 0) {
        return error_set_errno(error, errno, "gateway: cannot create an event descriptor");
    }
    reason = pthread_create(&gateway->thread, NULL, serve, gateway);
    return reason ? error_set_errno(error, reason, "gateway: cannot start its thread") : ERROR_NONE;
}

enum error_code gateway_start(const struct gateway_config *config, struct arena *arena,
                              struct gateway **out, struct error *error)
{
    struct gateway *gateway = NULL;
    enum error_code code = check(config, error);

    if (!code) {
        code = allocate(config, arena, &gateway, error);
    }
    if (code) {
        return code;
    }
    code = listen_at(gateway, config->host ? config->host : "127.0.0.1", error);
    if (!code) {
        code = start_thread(gateway, error);
    }
    if (code) {
        close_all(gateway);
        return code;
    }
    *out = gateway;
    return ERROR_NONE;
}

uint16_t gateway_port(const struct gateway *gateway)
{
    return gateway->port;
}

void gateway_stop(struct gateway *gateway)
{
    uint64_t one = 1;

    if (!gateway) {
        return;
    }
    /* Cannot fail: the counter is zero */
    (void)!write(gateway->stop_event, &one, sizeof one);
    pthread_join(gateway->thread, NULL);
    close_all(gateway);
}

void gateway_counters(const struct gateway *gateway, struct gateway_counters *counters)
{
    *counters = gateway->counters;
}
