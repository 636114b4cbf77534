/* SPDX-License-Identifier: Apache-2.0 */
/* The clients of the gateway: their connections, commands and answers. */
#include "canbus/gateway_private.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* A client that has just been told "ok" gets frames this much later: widespread clients expect the
 * answer to come alone. */
enum { QUIET_MS = 20 };

int64_t gateway_now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ---- clients: out ---- */

void gateway_close_client(struct gateway_client *client)
{
    if (client->socket >= 0) {
        close(client->socket);
        client->socket = -1;
    }
}

void gateway_flush_client(struct gateway_client *client)
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
            gateway_close_client(client);
            return;
        }
        client->waiting -= (size_t)sent;
        memmove(client->outbox, client->outbox + sent, client->waiting);
    }
}

/* Puts text into the client's outbox; a client whose outbox stays full is disconnected. */
static void gateway_queue_text(struct gateway *gateway, struct gateway_client *client,
                               const char *text, size_t length)
{
    if (client->socket < 0) {
        return;
    }
    if (client->waiting + length > GATEWAY_OUTBOX) {
        gateway_flush_client(client);
    }
    if (client->socket >= 0 && client->waiting + length > GATEWAY_OUTBOX) {
        const struct linger at_once = {.l_onoff = 1};

        /* What waits for it in the kernel is discarded too */
        setsockopt(client->socket, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
        gateway->counters.cut_slow++;
        gateway_close_client(client);
        return;
    }
    memcpy(client->outbox + client->waiting, text, length);
    client->waiting += length;
}

static void gateway_answer_client(struct gateway *gateway, struct gateway_client *client,
                                  const char *text)
{
    gateway_queue_text(gateway, client, text, strlen(text));
}

void gateway_forward_frame(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                           const struct gateway_client *from)
{
    char text[SOCKETCAND_TEXT_MAX];
    size_t length = 0;

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct gateway_client *client = &gateway->client[i];

        if (client->socket < 0 || client == from || client->mode != CLIENT_RAW ||
            client->bus != bus) {
            continue;
        }
        if (length == 0) {
            length = socketcand_format(frame, text);
        }
        if (length > 0) {
            gateway_queue_text(gateway, client, text, length);
            gateway->counters.to_client++;
        }
    }
}

/* ---- clients: in ---- */

static bool gateway_find_bus(const struct gateway *gateway, const char *name, size_t *bus)
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

/* Answers a wrong command; a client that sends too many of them is disconnected. */
static void gateway_reject_command(struct gateway *gateway, struct gateway_client *client,
                                   const char *text)
{
    gateway_answer_client(gateway, client, text);
    if (client->socket >= 0 && ++client->junk >= GATEWAY_JUNK_MAX) {
        gateway->counters.cut_junk++;
        gateway_flush_client(client);
        gateway_close_client(client);
    }
}

static void gateway_open_bus(struct gateway *gateway, struct gateway_client *client,
                             const char *name)
{
    if (client->mode != CLIENT_NO_BUS) {
        gateway_reject_command(gateway, client, "< error a bus is open already >");
    } else if (!gateway_find_bus(gateway, name, &client->bus)) {
        gateway_reject_command(gateway, client, "< error no such bus >");
    } else {
        client->mode = CLIENT_BCM;
        gateway_answer_client(gateway, client, "< ok >");
    }
}

static void gateway_send_frame(struct gateway *gateway, struct gateway_client *client,
                               const struct bus_frame *request)
{
    struct bus_frame frame = *request;

    frame.time_ns = gateway->time_ns[client->bus];
    if (can_send(gateway->config.bus[client->bus].port, &frame, 1) != 1) {
        /* A full queue is no fault of the client: it does not count as junk */
        gateway->counters.not_taken++;
        gateway_answer_client(gateway, client, "< error the bus refuses the frame >");
        return;
    }
    gateway->counters.to_bus++;
    gateway_forward_frame(gateway, client->bus, &frame, client);
}

static void gateway_execute_command(struct gateway *gateway, struct gateway_client *client,
                                    const char *text, size_t size)
{
    struct socketcand_request request;

    /* Before a bus is open nothing but open and echo makes sense */
    socketcand_parse(text, size, &request);
    if (client->mode == CLIENT_NO_BUS && request.command != SOCKETCAND_OPEN &&
        request.command != SOCKETCAND_ECHO) {
        gateway_reject_command(gateway, client, "< error no bus is open >");
        return;
    }

    switch (request.command) {
    case SOCKETCAND_OPEN:
        gateway_open_bus(gateway, client, request.bus);
        break;
    case SOCKETCAND_RAWMODE:
    case SOCKETCAND_BCMMODE:
        /* The answer goes out at once and alone; frames follow later */
        client->mode = request.command == SOCKETCAND_RAWMODE ? CLIENT_RAW : CLIENT_BCM;
        client->quiet_until_ms = gateway_now_ms() + QUIET_MS;
        gateway_answer_client(gateway, client, "< ok >");
        gateway_flush_client(client);
        break;
    case SOCKETCAND_ECHO:
        gateway_answer_client(gateway, client, "< echo >");
        break;
    case SOCKETCAND_SEND:
        gateway_send_frame(gateway, client, &request.frame);
        break;
    case SOCKETCAND_OTHER:
        gateway_reject_command(gateway, client, "< error not offered here, use rawmode >");
        break;
    case SOCKETCAND_UNKNOWN:
        gateway_reject_command(gateway, client, "< error unknown command >");
        break;
    case SOCKETCAND_MALFORMED:
        gateway_reject_command(gateway, client, "< error wrong arguments >");
        break;
    }
}

/* Executes every complete command in the inbox; what stands between commands is skipped. */
static void gateway_execute_inbox(struct gateway *gateway, struct gateway_client *client)
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
        gateway_execute_command(gateway, client, begin, (size_t)(end - begin) + 1);
    }

    /* An incomplete command stays; one that fills the inbox will never end */
    client->received -= at;
    memmove(client->inbox, client->inbox + at, client->received);
    if (client->received == sizeof client->inbox) {
        gateway->counters.cut_junk++;
        gateway_close_client(client);
    }
}

void gateway_read_client(struct gateway *gateway, struct gateway_client *client)
{
    ssize_t count = recv(client->socket, client->inbox + client->received,
                         sizeof client->inbox - client->received, MSG_DONTWAIT);

    if (count > 0) {
        client->received += (size_t)count;
        gateway_execute_inbox(gateway, client);
    } else if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        gateway_close_client(client);
    }
}

static struct gateway_client *gateway_free_client(struct gateway *gateway)
{
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        if (gateway->client[i].socket < 0) {
            return &gateway->client[i];
        }
    }
    return NULL;
}

void gateway_accept_clients(struct gateway *gateway)
{
    int one = 1, socket;

    while ((socket = accept4(gateway->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        struct gateway_client *client = gateway_free_client(gateway);

        if (!client) {
            gateway->counters.refused++;
            close(socket);
            continue;
        }
        setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        *client = (struct gateway_client){.socket = socket, .outbox = client->outbox};
        gateway->counters.clients++;
        gateway_answer_client(gateway, client, "< hi >");
    }
}
