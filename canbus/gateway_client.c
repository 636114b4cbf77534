/* SPDX-License-Identifier: Apache-2.0 */
/* Accepts, serves and closes the clients of the gateway. */
#include "canbus/gateway_private.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <time.h>

enum {
    OPEN_MS = 10000, /* time after which a client without a bus is disconnected */
    YIELD_MS = 1000, /* the same time, if another client needs the place */
};

int64_t gateway_now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ---- clients: out ---- */

void gateway_close_client(struct gateway_client *client)
{
    if (client->is_terminal) {
        gateway_slcan_reset(client);
    } else if (client->socket >= 0) {
        close(client->socket);
        client->socket = -1;
    }
}

void gateway_flush_client(struct gateway_client *client)
{
    while (client->socket >= 0 && client->waiting > 0) {
        ssize_t sent = client->is_terminal ? write(client->socket, client->outbox, client->waiting)
                                           : send(client->socket, client->outbox, client->waiting,
                                                  MSG_NOSIGNAL | MSG_DONTWAIT);

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

void gateway_cut_slow(struct gateway *gateway, struct gateway_client *client)
{
    const struct linger at_once = {.l_onoff = 1};

    /* Discard its output in the kernel too */
    setsockopt(client->socket, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    gateway->counters.cut_slow++;
    gateway_close_client(client);
}

void gateway_queue_text(struct gateway *gateway, struct gateway_client *client, const char *text,
                        size_t length)
{
    if (client->socket < 0) {
        return;
    }
    /* Flush a full outbox; disconnect a client that still does not read */
    if (client->waiting + length > GATEWAY_OUTBOX) {
        gateway_flush_client(client);
    }
    if (client->socket >= 0 && client->waiting + length > GATEWAY_OUTBOX) {
        gateway_cut_slow(gateway, client);
        return;
    }
    memcpy(client->outbox + client->waiting, text, length);
    client->waiting += length;
}

/* Checks whether a client receives a frame of a bus. A client with every bus gets only one DONE,
 * from the STEP's bus. */
static bool gateway_client_hears(const struct gateway *gateway, const struct gateway_client *client,
                                 size_t bus, const struct bus_frame *frame)
{
    if (client->socket < 0 || client->mode != CLIENT_RAW) {
        return false;
    }
    return client->bus == GATEWAY_EVERY_BUS
               ? bus == gateway->config.lockstep.bus || !gateway_is_done(gateway, frame)
               : client->bus == bus;
}

void gateway_forward_frame(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                           const struct gateway_client *from)
{
    /* Text of the frame without ([0]) and with ([1]) the bus name; formatted at the first use */
    char text[2][SOCKETCAND_TEXT_MAX], slcan[SLCAN_TEXT_MAX];
    size_t length[2] = {0, 0};

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct gateway_client *client = &gateway->client[i];
        const bool named = client->bus == GATEWAY_EVERY_BUS;
        size_t size;

        /* Skip the sender */
        if (client == from || !gateway_client_hears(gateway, client, bus, frame)) {
            continue;
        }
        if (!client->is_slcan && length[named] == 0) {
            length[named] =
                socketcand_format(frame, named ? gateway->config.bus[bus].name : NULL, text[named]);
        }
        /* Leave out frames that the client's protocol cannot express */
        size = client->is_slcan ? slcan_format(frame, client->slcan.stamps, slcan) : length[named];
        if (size > 0) {
            gateway_queue_text(gateway, client, client->is_slcan ? slcan : text[named], size);
            gateway->counters.to_client++;
        }
    }
}

/* ---- clients: in ---- */

void gateway_read_client(struct gateway *gateway, struct gateway_client *client)
{
    const size_t room = sizeof client->inbox - client->received;
    char *to = client->inbox + client->received;
    ssize_t count = !room                 ? 0
                    : client->is_terminal ? read(client->socket, to, room)
                                          : recv(client->socket, to, room, MSG_DONTWAIT);
    int one = 1;

    if (count > 0) {
        /* Acknowledge at once, because the client's system may delay its next command until then */
        if (!client->is_terminal) {
            setsockopt(client->socket, IPPROTO_TCP, TCP_QUICKACK, &one, sizeof one);
        }
        client->received += (size_t)count;
        gateway_execute_inbox(gateway, client);
    } else if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        gateway_close_client(client);
    }
}

/* ---- coming and going ---- */

/* Sends a client the reason of its disconnection. */
static void gateway_dismiss_client(struct gateway *gateway, struct gateway_client *client,
                                   const char *text)
{
    gateway_queue_text(gateway, client, text, strlen(text));
    gateway_flush_client(client);
    gateway_close_client(client);
}

void gateway_close_silent(struct gateway *gateway)
{
    const int64_t now_ms = gateway_now_ms();

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct gateway_client *client = &gateway->client[i];

        if (client->socket >= 0 && client->mode == CLIENT_NO_BUS &&
            now_ms - client->since_ms > OPEN_MS) {
            gateway->counters.cut_silent++;
            gateway_dismiss_client(gateway, client, "< error no bus was opened in time >");
        }
    }
}

/* Returns a free place; NULL = none. If all places are taken, disconnects the client that has been
 * without a bus for the longest time. */
static struct gateway_client *gateway_find_place(struct gateway *gateway)
{
    struct gateway_client *oldest = NULL;

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct gateway_client *client = &gateway->client[i];

        if (client->socket < 0) {
            return client;
        }
        if (client->mode == CLIENT_NO_BUS && (!oldest || client->since_ms < oldest->since_ms)) {
            oldest = client;
        }
    }
    if (!oldest || gateway_now_ms() - oldest->since_ms < YIELD_MS) {
        return NULL;
    }
    gateway->counters.cut_silent++;
    gateway_dismiss_client(gateway, oldest, "< error no bus was opened in time >");
    return oldest;
}

void gateway_accept_clients(struct gateway *gateway, int listener, int slcan)
{
    static const char full[] = "< error all places are taken >";
    int one = 1, socket;

    while ((socket = accept4(listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        struct gateway_client *client = gateway_find_place(gateway);

        /* No place; an slcan client cannot receive the reason */
        if (!client) {
            gateway->counters.refused++;
            if (slcan < 0) {
                (void)!send(socket, full, sizeof full - 1, MSG_NOSIGNAL | MSG_DONTWAIT);
            }
            close(socket);
            continue;
        }
        /* Send small messages at once. Greet a socketcand client; an slcan client already has its
         * bus */
        setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        *client = (struct gateway_client){
            .socket = socket, .outbox = client->outbox, .since_ms = gateway_now_ms()};
        gateway->counters.clients++;
        if (slcan < 0) {
            gateway_queue_text(gateway, client, "< hi >", strlen("< hi >"));
        } else {
            client->is_slcan = true;
            client->mode = CLIENT_BCM;
            client->bus = gateway->slcan_bus[slcan];
        }
    }
}
