/* SPDX-License-Identifier: Apache-2.0 */
/* Serves the connections of the page's server: input, output, and disconnection. */
#include "viewer/private.h"

#include <errno.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

/* Maximum number of a client's frames and of new connections per turn, so that one client cannot
 * block the others. */
enum { FRAMES_A_TURN = 32, ACCEPTS_A_TURN = 8 };

#define SILENCE_NS (10 * CLOCK_SECOND) /* timeout for a request, and for the token */

/* Timeout without progress, of messages and of files. A busy browser reads a file in pieces. */
#define PATIENCE_NS (10 * CLOCK_SECOND)
#define FILE_PATIENCE_NS (120 * CLOCK_SECOND)

/* ---- out ---- */

size_t client_waiting(const struct viewer_client *client)
{
    return client->filled - client->sent + client->body_size;
}

void client_close(struct viewer *viewer, struct viewer_client *client)
{
    (void)viewer;
    if (client->socket >= 0) {
        close(client->socket);
        client->socket = -1;
        client->watch = (struct viewer_watch){.on = false};
        control_link_close(client);
    }
}

/* Sends some bytes. Returns the number sent; 0 = the socket is full; -1 = the connection is
 * lost. */
static ssize_t client_send_some(const struct viewer_client *client, const void *from, size_t size)
{
    for (;;) {
        ssize_t sent = send(client->socket, from, size, MSG_NOSIGNAL | MSG_DONTWAIT);

        if (sent >= 0 || (errno != EINTR && errno != EAGAIN && errno != EWOULDBLOCK)) {
            return sent;
        }
        if (errno != EINTR) {
            return 0;
        }
    }
}

/* Sends as much as the system accepts now: the outbox, then the body. */
void client_flush(struct viewer *viewer, struct viewer_client *client)
{
    while (client->socket >= 0 && client_waiting(client) > 0) {
        bool body = client->sent == client->filled;
        ssize_t sent = body ? client_send_some(client, client->body, client->body_size)
                            : client_send_some(client, client->outbox + client->sent,
                                               client->filled - client->sent);

        if (sent < 0) {
            client_close(viewer, client);
            return;
        }
        if (sent == 0) {
            return;
        }
        client->taken_ns = viewer->now_ns;
        if (body) {
            client->body = (const char *)client->body + sent;
            client->body_size -= (size_t)sent;
        } else {
            client->sent += (size_t)sent;
        }
    }
    client->sent = client->filled = 0;
}

uint8_t *client_room(struct viewer *viewer, struct viewer_client *client, size_t size)
{
    if (client_waiting(client) == 0) {
        client->taken_ns = viewer->now_ns;
    }
    /* No data may be added until the body is sent */
    if (client->body_size > 0) {
        return NULL;
    }
    if (client->filled + size > VIEWER_OUTBOX) {
        client->filled -= client->sent;
        memmove(client->outbox, client->outbox + client->sent, client->filled);
        client->sent = 0;
    }
    return client->filled + size > VIEWER_OUTBOX ? NULL : client->outbox + client->filled;
}

bool client_send_message(struct viewer *viewer, struct viewer_client *client,
                         enum websocket_opcode opcode, const void *data, size_t size)
{
    uint8_t *to = client_room(viewer, client, WEBSOCKET_HEADER + size);
    size_t header;

    if (!to) {
        return false;
    }
    header = websocket_header(to, opcode, size);
    memcpy(to + header, data, size);
    client->filled += header + size;
    client_flush(viewer, client);
    return true;
}

bool client_send_object(struct viewer *viewer, struct viewer_client *client, json_t *object)
{
    const size_t flags = JSON_COMPACT | JSON_REAL_PRECISION(9);
    size_t size = object ? json_dumpb(object, NULL, 0, flags) : 0;
    char *text = size > 0 ? (char *)client_room(viewer, client, WEBSOCKET_HEADER + size) : NULL;
    bool sent = false;

    /* Write the text behind space for the longest header, then move it to follow the actual
     * header */
    if (text && json_dumpb(object, text + WEBSOCKET_HEADER, size, flags) == size) {
        size_t header = websocket_header((uint8_t *)text, WEBSOCKET_TEXT, size);

        memmove(text + header, text + WEBSOCKET_HEADER, size);
        client->filled += header + size;
        sent = true;
    }
    json_decref(object);
    client_flush(viewer, client);
    return sent;
}

void client_bye(struct viewer *viewer, struct viewer_client *client, enum websocket_status status,
                const char *reason)
{
    uint8_t payload[WEBSOCKET_CONTROL_MAX];
    size_t size = strlen(reason);

    size = size > sizeof payload - 2 ? sizeof payload - 2 : size;
    payload[0] = (uint8_t)(status >> 8);
    payload[1] = (uint8_t)status;
    memcpy(payload + 2, reason, size);
    client_send_message(viewer, client, WEBSOCKET_CLOSE, payload, size + 2);
    client->mode = CLIENT_CLOSING;
    client->watch.on = false;
}

/* ---- in ---- */

/* Handles a complete frame: part of a message, or a control frame. Returns false if the caller must
 * not read more frames. */
static bool client_take_frame(struct viewer *viewer, struct viewer_client *client,
                              const struct websocket_frame *frame)
{
    switch (frame->opcode) {
    case WEBSOCKET_PING:
        client_send_message(viewer, client, WEBSOCKET_PONG, frame->payload, frame->size);
        return true;
    case WEBSOCKET_PONG:
        return true;
    case WEBSOCKET_CLOSE:
        client_bye(viewer, client, WEBSOCKET_NORMAL, "");
        return false;
    case WEBSOCKET_BINARY:
        client_bye(viewer, client, WEBSOCKET_UNSUPPORTED, "expected text");
        return false;
    default:
        break;
    }

    /* A fragment must continue a message, and no other message may come in between */
    if ((frame->opcode == WEBSOCKET_CONTINUATION) != client->fragmented) {
        viewer->counters.cut_junk++;
        client_bye(viewer, client, WEBSOCKET_PROTOCOL, "wrong order of fragments");
        return false;
    }
    if (client->gathered + frame->size > VIEWER_INBOX) {
        viewer->counters.cut_junk++;
        client_bye(viewer, client, WEBSOCKET_TOO_BIG, "the message is too long");
        return false;
    }
    memcpy(client->message + client->gathered, frame->payload, frame->size);
    client->gathered += frame->size;
    client->fragmented = !frame->final;
    if (frame->final) {
        size_t size = client->gathered;

        client->gathered = 0;
        viewer_obey(viewer, client, (const char *)client->message, size);
    }
    return client->socket >= 0 && client->mode == CLIENT_SOCKET;
}

/* Handles the frames in the inbox, at most FRAMES_A_TURN. */
static void client_take_frames(struct viewer *viewer, struct viewer_client *client)
{
    for (int i = 0; i < FRAMES_A_TURN && client->socket >= 0 && client->mode == CLIENT_SOCKET;
         i++) {
        struct websocket_frame frame;
        int status = websocket_read(client->inbox, client->received, VIEWER_INBOX - 16, &frame);

        if (status == 0) {
            return;
        }
        if (status > 1) {
            viewer->counters.cut_junk++;
            client_bye(viewer, client, (enum websocket_status)status,
                       status == WEBSOCKET_TOO_BIG ? "the message is too long" : "no WebSocket");
            return;
        }
        if (!client_take_frame(viewer, client, &frame)) {
            return;
        }
        client->received -= frame.used;
        memmove(client->inbox, client->inbox + frame.used, client->received);
    }
}

void client_read(struct viewer *viewer, struct viewer_client *client)
{
    ssize_t count = recv(client->socket, client->inbox + client->received,
                         VIEWER_INBOX - client->received, MSG_DONTWAIT);

    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        client_close(viewer, client);
        return;
    }
    client->received += count > 0 ? (size_t)count : 0;
    if (client->mode == CLIENT_CLOSING) {
        client->received = 0;
    }
    if (client->mode == CLIENT_HTTP) {
        struct http_request request;
        size_t used;
        int status =
            http_request_parse((const char *)client->inbox, client->received, &request, &used);

        /* Parse the HTTP request in the inbox and answer it */
        if (status != 0) {
            if (status == 200) {
                client->received -= used;
                memmove(client->inbox, client->inbox + used, client->received);
            } else {
                viewer->counters.cut_junk++;
            }
            viewer_respond(viewer, client, status, &request);
        }
    }
    if (client->mode == CLIENT_SOCKET) {
        client_take_frames(viewer, client);
    }
}

/* ---- ends ---- */

void client_check(struct viewer *viewer, struct viewer_client *client)
{
    bool silent = client->mode == CLIENT_HTTP ||
                  (client->mode == CLIENT_SOCKET && client->right == RIGHT_NONE);
    int64_t patience_ns =
        client->mode == CLIENT_CLOSING && client->body_size > 0 ? FILE_PATIENCE_NS : PATIENCE_NS;

    if (client->socket < 0) {
        return;
    }
    if (viewer->ended) {
        client_tell_end(viewer, client);
    }
    /* Disconnect a client that reads nothing, sends nothing, or has received its last message */
    if (client_waiting(client) > 0 && viewer->now_ns - client->taken_ns > patience_ns) {
        viewer->counters.cut_slow++;
        client_close(viewer, client);
    } else if (silent && viewer->now_ns - client->since_ns > SILENCE_NS) {
        viewer->counters.cut_silent++;
        client_close(viewer, client);
    } else if (client->mode == CLIENT_CLOSING && client_waiting(client) == 0) {
        shutdown(client->socket, SHUT_WR);
        if (viewer->now_ns - client->taken_ns > CLOCK_SECOND) {
            client_close(viewer, client);
        }
    } else if (client->mode == CLIENT_SOCKET && client->received > 0) {
        client_take_frames(viewer, client); /* frames left from the last turn */
    }
}

/* ---- places ---- */

/* Returns the source address of a connection; IPv4 as a mapped IPv6 address. */
static struct viewer_origin origin_of(const struct sockaddr_storage *address)
{
    struct viewer_origin origin = {{0}};

    if (address->ss_family == AF_INET6) {
        memcpy(origin.byte, &((const struct sockaddr_in6 *)address)->sin6_addr, 16);
    } else if (address->ss_family == AF_INET) {
        origin.byte[10] = origin.byte[11] = 0xff;
        memcpy(origin.byte + 12, &((const struct sockaddr_in *)address)->sin_addr, 4);
    }
    return origin;
}

/* Checks whether two origins are the same address. */
static bool origin_equal(const struct viewer_origin *a, const struct viewer_origin *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

/* Checks whether an address is 127.0.0.1 or ::1, which all programs and tunnels of this machine
 * share. */
static bool origin_is_shared(const struct viewer_origin *origin)
{
    static const struct viewer_origin own[] = {{{[10] = 0xff, [11] = 0xff, [12] = 127, [15] = 1}},
                                               {{[15] = 1}}};

    return origin_equal(origin, &own[0]) || origin_equal(origin, &own[1]);
}

/* Ranks connections for dropping, the highest rank first: 4 = no request yet, 3 = no token, 2 =
 * answered, 0 = has a valid token and is never dropped. */
static int client_idleness(const struct viewer_client *client)
{
    return client->mode == CLIENT_SOCKET ? (client->right == RIGHT_NONE ? 3 : 0)
           : client->mode == CLIENT_HTTP ? 4
           : client_waiting(client) == 0 ? 2
                                         : 1;
}

/* Finds the connection to drop first, from one address, or from all if origin is NULL. Returns NULL
 * if all connections have a valid token. */
static struct viewer_client *viewer_find_idlest(struct viewer *viewer,
                                                const struct viewer_origin *origin)
{
    struct viewer_client *found = NULL;

    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        struct viewer_client *client = &viewer->client[i];
        int idleness = client->socket < 0 ? 0 : client_idleness(client);

        if (idleness == 0 || (origin && !origin_equal(origin, &client->origin))) {
            continue;
        }
        if (!found || idleness > client_idleness(found) ||
            (idleness == client_idleness(found) && client->since_ns < found->since_ns)) {
            found = client;
        }
    }
    return found;
}

/* Counts the connections of an address without a token. */
static size_t viewer_count_asking(const struct viewer *viewer, const struct viewer_origin *origin)
{
    size_t count = 0;

    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        const struct viewer_client *client = &viewer->client[i];

        count += client->socket >= 0 && client_idleness(client) > 0 &&
                 origin_equal(origin, &client->origin);
    }
    return count;
}

bool viewer_give_place(struct viewer *viewer, struct viewer_client *client, enum viewer_right right)
{
    size_t entered = 0, looking = 0, of_one = 0;

    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        const struct viewer_client *other = &viewer->client[i];
        bool looks = other->right == RIGHT_LOOK;

        if (other->socket >= 0 && other->right != RIGHT_NONE) {
            entered++;
            looking += looks;
            of_one += looks && origin_equal(&other->origin, &client->origin);
        }
    }
    if (entered >= VIEWER_ENTERED ||
        (right == RIGHT_LOOK &&
         (looking >= VIEWER_LOOKING ||
          (of_one >= VIEWER_OF_ONE && !origin_is_shared(&client->origin))))) {
        return false;
    }
    client->right = right;
    return true;
}

/* ---- new connections ---- */

/* Makes a place for a connection from an address. Drops an idle connection if this address has too
 * many without a token, or if all places are used. Returns NULL if no place is free. */
static struct viewer_client *viewer_make_place(struct viewer *viewer,
                                               const struct viewer_origin *origin)
{
    struct viewer_client *idlest = NULL, *place = NULL;

    for (size_t i = 0; i < VIEWER_CLIENTS && !place; i++) {
        place = viewer->client[i].socket < 0 ? &viewer->client[i] : NULL;
    }

    if (viewer_count_asking(viewer, origin) >= VIEWER_ASKING) {
        idlest = viewer_find_idlest(viewer, origin);
    } else if (!place) {
        idlest = viewer_find_idlest(viewer, NULL);
    }
    if (idlest) {
        viewer->counters.cut_idle++;
        client_close(viewer, idlest);
        return idlest;
    }
    return place;
}

void viewer_accept_client(struct viewer *viewer)
{
    static const char busy[] = "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\n"
                               "Content-Length: 0\r\n\r\n";

    for (int i = 0; i < ACCEPTS_A_TURN; i++) {
        struct sockaddr_storage address = {.ss_family = AF_UNSPEC};
        socklen_t length = sizeof address;
        int socket = accept4(viewer->listener, (struct sockaddr *)&address, &length,
                             SOCK_NONBLOCK | SOCK_CLOEXEC);
        struct viewer_origin origin = origin_of(&address);
        struct viewer_client *client;

        if (socket < 0) {
            return;
        }
        /* Without a place, sends the browser an answer before closing */
        client = viewer_make_place(viewer, &origin);
        if (!client) {
            (void)!send(socket, busy, sizeof busy - 1, MSG_NOSIGNAL | MSG_DONTWAIT);
            close(socket);
            viewer->counters.refused++;
            continue;
        }
        /* Initializes a new client; its buffers belong to the place */
        *client = (struct viewer_client){
            .socket = socket,
            .origin = origin,
            .control = -1,
            .since_ns = viewer->now_ns,
            .taken_ns = viewer->now_ns,
            .inbox = client->inbox,
            .message = client->message,
            .outbox = client->outbox,
            .trace = client->trace,
            .line = client->line,
        };
    }
}
