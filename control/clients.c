/* SPDX-License-Identifier: Apache-2.0 */
/* Serves the clients of the control socket: accepts connections, receives lines, sends answers,
 * disconnects clients. */
#include "control/private.h"

#include <errno.h>
#include <stdio.h>
#include <sys/socket.h>

/* Largest numbers of lines and of connections per turn, so that other clients are served too. */
enum { LINES_A_TURN = 32, ACCEPTS_A_TURN = 32 };

/* Keys of log lines. */
enum { KEY_CUT = 1, KEY_REFUSED };

void control_log(struct control *control, uint64_t key, const char *format, ...)
{
    struct control_event event = {.key = key};

    TEXT_FORMAT(event.text, format);
    /* If the ring is full, drop the event */
    (void)ring_push(&control->events, &event);
}

/* ---- out ---- */

/* Returns how many bytes of the outbox have not been sent. */
static size_t client_unsent(const struct control_client *client)
{
    return client->filled - client->sent;
}

void control_drop(struct control *control, struct control_client *client)
{
    if (client->socket < 0) {
        return;
    }
    close(client->socket);
    client->socket = -1;
    client->waiting = WAITING_NOT;
    control_request_clear(&client->request);
    control_forget(control, client);
}

/* Disconnects a client: sends as many bytes as the system accepts at once, then counts and logs the
 * event. */
static void client_disconnect(struct control *control, struct control_client *client,
                              uint64_t *counter, const char *reason)
{
    (*counter)++;
    control_log(control, KEY_CUT, "control: process %ld is disconnected: %s", (long)client->pid,
                reason);
    control_flush(control, client);
    control_drop(control, client);
}

/* Sends as many bytes of the outbox as the system accepts at once. */
void control_flush(struct control *control, struct control_client *client)
{
    while (client->socket >= 0 && client_unsent(client) > 0) {
        ssize_t sent = send(client->socket, client->outbox + client->sent, client_unsent(client),
                            MSG_NOSIGNAL | MSG_DONTWAIT);

        if (sent < 0 && errno == EINTR) {
            continue;
        }
        if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
            return;
        }
        if (sent <= 0) {
            control_drop(control, client);
            return;
        }
        client->sent += (size_t)sent;
        client->taken_ns = control->now_ns;
    }
    client->sent = client->filled = 0;
}

/* Returns a pointer to `size` free bytes at the end of the outbox. Moves the unsent bytes to the
 * front if needed. Returns NULL if the outbox is too full. */
char *control_room(struct control *control, struct control_client *client, size_t size)
{
    if (client_unsent(client) == 0) {
        client->taken_ns = control->now_ns;
    }
    if (client->filled + size > CONTROL_OUTBOX) {
        client->filled -= client->sent;
        memmove(client->outbox, client->outbox + client->sent, client->filled);
        client->sent = 0;
    }
    return client->filled + size > CONTROL_OUTBOX ? NULL : client->outbox + client->filled;
}

/* Appends text to the outbox. Drops the text if the outbox is too full. */
static void client_put_text(struct control *control, struct control_client *client,
                            const char *text)
{
    size_t size = strlen(text);
    char *to = control_room(control, client, size);

    if (to) {
        memcpy(to, text, size);
        client->filled += size;
    }
}

/* Appends an object as a line. If the outbox is too full, appends a short error instead. */
static void put_object(struct control *control, struct control_client *client, const json_t *object)
{
    const size_t flags = JSON_COMPACT | JSON_REAL_PRECISION(15);
    size_t size = json_dumpb(object, NULL, 0, flags);
    char *to = size > 0 ? control_room(control, client, size + 1) : NULL;

    if (!to || json_dumpb(object, to, size, flags) != size) {
        client_put_text(control, client,
                        "{\"id\":null,\"ok\":false,\"code\":\"memory\",\"error\":\"no room for the "
                        "answer\"}\n");
        return;
    }
    to[size] = '\n';
    client->filled += size + 1;
}

/* Sends an answer: id, "ok" and body. Takes ownership of body; NULL means out of memory. */
static void put_answer(struct control *control, struct control_client *client, const json_t *id,
                       bool ok, json_t *body)
{
    json_t *answer =
        json_pack("{s:o, s:b}", "id", id ? json_deep_copy(id) : json_null(), "ok", (int)ok);

    if (!body || json_object_update(answer, body)) {
        client_put_text(control, client,
                        "{\"id\":null,\"ok\":false,\"code\":\"memory\",\"error\":\"no memory for "
                        "the answer\"}\n");
    } else {
        put_object(control, client, answer);
    }
    json_decref(answer);
    json_decref(body);
    control_flush(control, client);
}

void control_answer(struct control *control, struct control_client *client, const json_t *id,
                    json_t *body)
{
    client->junk = 0;
    put_answer(control, client, id, true, body);
}

void control_refuse(struct control *control, struct control_client *client, const json_t *id,
                    const char *code, const char *text, json_t *body)
{
    json_t *refusal = body ? body : json_object();

    control->counters.refused_requests++;
    if (json_object_set_new(refusal, "code", json_string(code)) ||
        json_object_set_new(refusal, "error", control_text(text))) {
        json_decref(refusal);
        refusal = NULL;
    }
    put_answer(control, client, id, false, refusal);
}

/* ---- in ---- */

/* Refuses a line that is not a request. A client that sends too many such lines is disconnected. */
static void client_refuse_line(struct control *control, struct control_client *client,
                               const json_t *id, const struct error *error)
{
    control_refuse(control, client, id, error->code == ERROR_MEMORY ? "memory" : "input",
                   error->text, NULL);
    if (client->socket >= 0 && ++client->junk >= CONTROL_JUNK_MAX) {
        client_disconnect(control, client, &control->counters.cut_junk, error->text);
    }
}

/* Returns whether a line has only white space. */
static bool is_blank(const char *line, size_t size)
{
    while (size > 0 &&
           (line[size - 1] == ' ' || line[size - 1] == '\t' || line[size - 1] == '\r')) {
        size--;
    }
    return size == 0;
}

/* Parses a line and carries out its request. Skips blank lines. */
static void client_obey_line(struct control *control, struct control_client *client,
                             const char *line, size_t size)
{
    struct error error;

    client->line++;
    if (is_blank(line, size)) {
        return;
    }
    if (!client->counted) {
        client->counted = true;
        control->counters.clients++;
    }
    control->counters.requests++;
    if (control_parse(line, size, client->line, &client->request, &error)) {
        client_refuse_line(control, client, client->request.id, &error);
        control_request_clear(&client->request);
        return;
    }
    if (client == &control->client[CONTROL_CLIENTS] && client->request.command != CONTROL_PAUSE &&
        client->request.command != CONTROL_RESUME && client->request.command != CONTROL_STOP &&
        client->request.command != CONTROL_HELLO) {
        control_refuse(control, client, client->request.id, "busy",
                       "too many clients: this connection may only pause, resume and stop", NULL);
        control_request_clear(&client->request);
        return;
    }
    control_execute(control, client);
}

bool control_may_read(const struct control_client *client)
{
    return client->socket >= 0 && client->waiting == WAITING_NOT &&
           client_unsent(client) <= CONTROL_OUTBOX / 2;
}

/* Carries out one line of the inbox. Returns false if there is no complete line, or if the client
 * was disconnected. */
static bool client_next_line(struct control *control, struct control_client *client)
{
    char *end = memchr(client->inbox, '\n', client->received);
    size_t size = end ? (size_t)(end - client->inbox) : client->received;

    /* The last line needs no newline if the client has closed its sending side */
    if (!end && client->ended && client->received > 0) {
        client->received = 0;
        if (!client->skipping) {
            client_obey_line(control, client, client->inbox, size);
        }
        return false;
    }
    if (!end) {
        if (client->received == CONTROL_LINE) {
            /* Refuse a line longer than the inbox and skip its rest */
            struct error error;

            client->received = 0;
            client->skipping = true;
            error_set(&error, ERROR_INPUT, "line %llu: found more than %d bytes, expected fewer",
                      (unsigned long long)client->line + 1, CONTROL_LINE - 1);
            client_refuse_line(control, client, NULL, &error);
        }
        return false;
    }

    /* Carry out a complete line. The end of a line that was too long is skipped */
    if (client->skipping) {
        client->skipping = false;
        client->line++;
    } else {
        client_obey_line(control, client, client->inbox, size);
    }

    /* Move the bytes after the line to the front, if the client is still connected */
    if (client->socket >= 0) {
        client->received -= size + 1;
        memmove(client->inbox, end + 1, client->received);
    }
    return client->socket >= 0;
}

bool control_carry_out_requests(struct control *control, struct control_client *client)
{
    for (int i = 0; i < LINES_A_TURN; i++) {
        if (!control_may_read(client) || !client_next_line(control, client)) {
            return false;
        }
    }
    return true;
}

bool control_read_requests(struct control *control, struct control_client *client)
{
    if (client->received < CONTROL_LINE && !client->ended) {
        ssize_t count = recv(client->socket, client->inbox + client->received,
                             CONTROL_LINE - client->received, MSG_DONTWAIT);

        if (count > 0) {
            client->received += (size_t)count;
            client->last_byte_ns = control->now_ns;
            client->activity = ++control->activities;
        } else if (count == 0) {
            client->ended = true;
        } else if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
            control_drop(control, client);
            return false;
        }
    }
    return control_carry_out_requests(control, client);
}

/* Disconnects a client that has ended or is too slow. Called once per turn. */
void control_check(struct control *control, struct control_client *client)
{
    if (client->socket < 0) {
        return;
    }
    /* Timeout: the client does not read its answers, or does not complete its line */
    if (client_unsent(client) > 0 && control->now_ns - client->taken_ns > control->patience_ns) {
        client_disconnect(control, client, &control->counters.cut_slow,
                          "it does not drain its answers");
    } else if (control_may_read(client) && !client->ended && client->received > 0 &&
               !memchr(client->inbox, '\n', client->received) &&
               control->now_ns - client->last_byte_ns > control->patience_ns) {
        control_refuse(control, client, NULL, "input",
                       "found half a line and then nothing, expected its end", NULL);
        client_disconnect(control, client, &control->counters.cut_silent,
                          "it stopped in the middle of a line");
        /* The client has closed its sending side and has received everything */
    } else if (client_unsent(client) == 0 && client->ended && client->received == 0 &&
               client->waiting == WAITING_NOT && client->subscription.count == 0) {
        control_drop(control, client);
    }
}

/* ---- new connections ---- */

/* Returns whether a client is idle: no waiting request, no subscription, no unsent and no unread
 * bytes. */
static bool client_is_idle(const struct control_client *client)
{
    char byte;

    return client->waiting == WAITING_NOT && client->subscription.count == 0 &&
           client->received == 0 && client_unsent(client) == 0 &&
           recv(client->socket, &byte, 1, MSG_PEEK | MSG_DONTWAIT) <= 0;
}

/* Returns a place for a new client, or NULL. First choice: a free place. Then: the place of the
 * client that has been idle for the longest time, which is disconnected. Then: the last place, for
 * urgent commands. */
static struct control_client *control_find_place(struct control *control)
{
    struct control_client *last = &control->client[CONTROL_CLIENTS], *oldest = NULL;

    for (struct control_client *client = control->client; client < last; client++) {
        if (client->socket < 0) {
            return client;
        }
        if (client_is_idle(client) && (!oldest || client->activity < oldest->activity)) {
            oldest = client;
        }
    }
    if (!oldest && (last->socket < 0 || !client_is_idle(last))) {
        return last->socket < 0 ? last : NULL;
    }
    oldest = oldest ? oldest : last;
    control_refuse(control, oldest, NULL, "busy",
                   "this connection was idle, and another client takes its place", NULL);
    client_disconnect(control, oldest, &control->counters.cut_idle, "it was idle too long");
    return oldest;
}

/* Sends an error to a new connection and closes it. */
static void client_refuse_connection(struct control *control, int socket, pid_t pid,
                                     const char *code, const char *reason)
{
    char text[256];
    int size =
        snprintf(text, sizeof text, "{\"id\":null,\"ok\":false,\"code\":\"%s\",\"error\":\"%s\"}\n",
                 code, reason);

    (void)!send(socket, text, (size_t)size, MSG_NOSIGNAL | MSG_DONTWAIT);
    close(socket);
    control->counters.refused++;
    control_log(control, KEY_REFUSED, "control: process %ld is refused: %s", (long)pid, reason);
}

/* Accepts a connection of the owner or root, if there is a place. */
static void client_accept(struct control *control, int socket)
{
    struct control_client *client;
    pid_t pid;
    uid_t uid;

    if (!control_socket_peer(socket, &pid, &uid)) {
        client_refuse_connection(control, socket, pid, "owner",
                                 "this socket is for its owner and root");
    } else if (!(client = control_find_place(control))) {
        client_refuse_connection(control, socket, pid, "busy", "too many clients");
    } else {
        const struct control_client fresh = {
            .socket = socket,
            .pid = pid,
            .activity = ++control->activities,
            .inbox = client->inbox,
            .outbox = client->outbox,
            .subscription.signal = client->subscription.signal,
        };

        *client = fresh;
    }
}

/* Returns whether all places are taken, but a client has hung up. The next turns will free its
 * place. */
static bool control_is_about_to_free(const struct control *control)
{
    struct pollfd fd[CONTROL_CLIENTS];
    bool gone = false;

    for (size_t i = 0; i < CONTROL_CLIENTS; i++) {
        fd[i] = (struct pollfd){.fd = control->client[i].socket};
        if (fd[i].fd < 0) {
            return false;
        }
    }
    for (int i = poll(fd, CONTROL_CLIENTS, 0) > 0 ? CONTROL_CLIENTS : 0; i > 0; i--) {
        gone |= (fd[i - 1].revents & POLLHUP) != 0;
    }
    return gone;
}

bool control_accept(struct control *control)
{
    for (int i = 0; i < ACCEPTS_A_TURN && !control_is_about_to_free(control); i++) {
        int socket = accept4(control->socket.descriptor, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);

        if (socket < 0) {
            return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ||
                   errno == ECONNABORTED;
        }
        client_accept(control, socket);
    }
    return true;
}
