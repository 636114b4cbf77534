/* SPDX-License-Identifier: Apache-2.0 */
/* Executes the messages of clients. A request for the control socket is sent to the socket as a
 * line, over a connection of this client. The answer becomes a message. */
#include "viewer/private.h"

#include "control/socket.h"
#include "viewer/message.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

static bool control_link_open(struct viewer *viewer, struct viewer_client *client)
{
    struct error error;

    if (!viewer->config.control ||
        control_socket_connect(viewer->config.control, &client->control, &error)) {
        client->control = -1;
        return false;
    }
    fcntl(client->control, F_SETFL, O_NONBLOCK);
    client->line_size = 0;
    return true;
}

void control_link_close(struct viewer_client *client)
{
    if (client->control >= 0) {
        close(client->control);
        client->control = -1;
    }
}

static bool control_link_send(struct viewer_client *client, const char *text, size_t size)
{
    struct iovec part[2] = {{(void *)(uintptr_t)text, size}, {(char[]){'\n'}, 1}};
    const struct msghdr line = {.msg_iov = part, .msg_iovlen = 2};

    /* A partial send counts as a failure: the socket's buffer is much larger than a message */
    return client->control >= 0 &&
           sendmsg(client->control, &line, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)size + 1;
}

void control_link_read(struct viewer *viewer, struct viewer_client *client)
{
    ssize_t count = recv(client->control, client->line + client->line_size,
                         VIEWER_LINE - client->line_size, MSG_DONTWAIT);
    char *end;

    if (count <= 0) {
        if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
            control_link_close(client);
        }
        return;
    }
    client->line_size += (size_t)count;

    /* Each line is a message; the control socket sends no line longer than the buffer */
    while ((end = memchr(client->line, '\n', client->line_size))) {
        size_t size = (size_t)(end - client->line);

        client_send_message(viewer, client, WEBSOCKET_TEXT, client->line, size);
        client->line_size -= size + 1;
        memmove(client->line, end + 1, client->line_size);
    }
    if (client->line_size == VIEWER_LINE) {
        control_link_close(client);
    }
}

/* ---- answers ---- */

/* Answers a message with its id, ok, and the body. Takes ownership of the body; NULL = no
 * memory. */
static void client_answer(struct viewer *viewer, struct viewer_client *client,
                          const struct viewer_message *message, json_t *body)
{
    json_t *id = message->id ? json_deep_copy(message->id) : json_null();

    if (body &&
        (json_object_set_new(body, "id", id) || json_object_set_new(body, "ok", json_true()))) {
        json_decref(body);
        body = NULL;
    }
    client_send_object(viewer, client, body);
}

/* Refuses a message with a code and a sentence. */
static void client_refuse(struct viewer *viewer, struct viewer_client *client,
                          const struct viewer_message *message, const char *code, const char *text)
{
    json_t *id = message->id ? json_deep_copy(message->id) : json_null();

    client_send_object(viewer, client,
                       json_pack("{s:o, s:b, s:s, s:o}", "id", id, "ok", 0, "code", code, "error",
                                 control_text(text)));
}

/* ---- enter ---- */

/* Sends the description of the rig, with the rights of this client. */
static void client_send_hello(struct viewer *viewer, struct viewer_client *client)
{
    static const char control[] = "{\"right\":\"control\",", look[] = "{\"right\":\"look\",";
    bool may = client->right == RIGHT_CONTROL;
    const char *begin = may ? control : look;
    size_t first = strlen(begin), size = first + viewer->hello_size - 1;
    uint8_t *to = client_room(viewer, client, WEBSOCKET_HEADER + first);

    if (!to) {
        client_close(viewer, client);
        return;
    }
    /* Send one message in two parts: its start from the outbox, then the shared description without
     * its opening brace */
    client->filled += websocket_header(to, WEBSOCKET_TEXT, size);
    memcpy(client->outbox + client->filled, begin, first);
    client->filled += first;
    client->body = viewer->hello + 1;
    client->body_size = viewer->hello_size - 1;
    client_flush(viewer, client);
}

/* Accepts a client with a valid token, if a place is free. */
static void client_enter(struct viewer *viewer, struct viewer_client *client,
                         const struct viewer_message *message)
{
    enum viewer_right right = viewer_token_right(viewer, message->token);

    if (right == RIGHT_NONE) {
        viewer->counters.refused++;
        client_bye(viewer, client, WEBSOCKET_POLICY, "the token is wrong");
        return;
    }
    if (!viewer_give_place(viewer, client, right)) {
        viewer->counters.refused++;
        client_bye(viewer, client, WEBSOCKET_LATER, "too many pages look at this run");
        return;
    }
    client->stays = message->stay && !viewer->playback;
    viewer->counters.clients++;
    if (viewer->playback) {
        playback_begin(viewer, client);
    }
    client_send_hello(viewer, client);
}

/* ---- watch ---- */

/* Adds the signals that match a name or pattern. Returns false if none or too many match. */
static bool watch_add_signals(const struct viewer *viewer, const char *pattern,
                              struct viewer_watch *watch)
{
    const char *const *name = viewer->signal;
    size_t before = watch->nsignal;

    for (size_t i = 0; i < viewer->nsignal; i++) {
        if (control_matches(pattern, name[i])) {
            if (watch->nsignal == VIEWER_SIGNALS) {
                return false;
            }
            watch->signal[watch->nsignal++] = (uint16_t)i;
        }
    }
    return watch->nsignal > before;
}

/* Changes what a client watches: states, signals, frames, rows, and the rate. */
static void client_watch(struct viewer *viewer, struct viewer_client *client,
                         const struct viewer_message *message)
{
    const char *const *name = viewer->signal;
    struct viewer_watch watch = {.on = message->rate_hz > 0,
                                 .trace =
                                     message->trace && (viewer->config.ports || viewer->playback),
                                 .rows = message->rows,
                                 .due_ns = viewer->now_ns,
                                 .skipped = client->watch.skipped};
    json_t *chosen = json_array();

    watch.period_ns = watch.on ? (int64_t)(1e9 / message->rate_hz) : 0;
    for (size_t i = 0; i < json_array_size(message->signals); i++) {
        if (!watch_add_signals(viewer, json_string_value(json_array_get(message->signals, i)),
                               &watch)) {
            json_decref(chosen);
            client_refuse(viewer, client, message, "input",
                          "watch: a name or pattern has no signal, or there are more than 64");
            return;
        }
    }
    for (size_t i = 0; i < watch.nsignal; i++) {
        json_array_append_new(chosen, control_text(name[watch.signal[i]]));
    }

    /* Set the first row to send to a client. It is the next new row, or, if the client already
     * watched these signals, the first row that it has not received. */
    if (viewer->history && watch.rows) {
        if (!client->watch.rows || client->watch.nsignal == 0) {
            viewer_take_rows(viewer); /* rows in the stream are older than the request */
            client->row = history_end(viewer->history);
            client->rows_lost = viewer->rows_lost;
        }
        for (size_t i = watch.nsignal; i > 0; i--) {
            history_choose(viewer->history, watch.signal[i - 1]);
        }
    }
    client->watch = watch;
    client->traced = client->ntraced = client->trace_lost = 0;
    client->playback.traced_ns = INT64_MIN;

    /* The time of the last row before the client's next one; null = none */
    const bool begun =
        viewer->history && watch.rows && client->row > history_begin(viewer->history);

    client_answer(
        viewer, client, message,
        json_pack("{s:o, s:o}", "signals", chosen, "rows_after_s",
                  begun ? json_real((double)history_time(viewer->history, client->row - 1) * 1e-9)
                        : json_null()));
}

/* ---- send ---- */

/* Sends a client's frame on a bus. */
static void client_put_frame(struct viewer *viewer, struct viewer_client *client,
                             struct viewer_message *message)
{
    int bus = rig_find_bus(viewer->rig, message->bus);

    if (viewer->ended) {
        client_refuse(viewer, client, message, "ended", "the run is over");
        return;
    }
    if (bus < 0 || !viewer->config.ports) {
        client_refuse(viewer, client, message, "input", "send: there is no such bus");
        return;
    }
    message->frame.time_ns = viewer->frame_ns[bus];
    if (can_send(viewer->config.ports->port[bus], &message->frame, 1) != 1) {
        viewer->counters.frames_untaken++;
        client_refuse(viewer, client, message, "busy",
                      "send: the bus does not take the frame: its queue is full, it is down, or it "
                      "carries no such frames");
        return;
    }
    viewer->counters.frames_sent++;
    viewer_trace_frame(viewer, (size_t)bus, &message->frame, true);
    client_answer(viewer, client, message, json_object());
}

/* ---- recordings ---- */

/* Executes a message for a recording, or for the history of a run. */
static void client_play(struct viewer *viewer, struct viewer_client *client,
                        const struct viewer_message *message)
{
    struct error error;

    if (!viewer->playback && (message->command != VIEWER_SERIES || !viewer->history)) {
        client_refuse(viewer, client, message, "unavailable",
                      "this is no recording: it shows what happens now");
    } else if (message->command == VIEWER_SERIES) {
        if (!client_send_series(viewer, client, message, &error)) {
            client_refuse(viewer, client, message, "input", error.text);
        }
    } else if (!playback_obey(viewer, client, message, &error)) {
        client_refuse(viewer, client, message,
                      error.code == ERROR_UNSUPPORTED ? "unavailable" : "input", error.text);
    } else {
        client->watch.due_ns = viewer->now_ns;
        client_answer(viewer, client, message, json_object());
    }
}

/* ---- any message ---- */

/* Executes a valid message of a client with a token. */
static void client_carry_out(struct viewer *viewer, struct viewer_client *client,
                             struct viewer_message *message, const char *text, size_t size)
{
    if (viewer->playback &&
        (message->command == VIEWER_CONTROL || message->command == VIEWER_SEND)) {
        client_play(viewer, client, message);
        return;
    }
    if (client->right != RIGHT_CONTROL &&
        (message->command == VIEWER_SEND ||
         (message->command == VIEWER_CONTROL && !message->harmless))) {
        client_refuse(viewer, client, message, "right", "this page may look, and not control");
        return;
    }
    switch (message->command) {
    case VIEWER_WATCH:
        client_watch(viewer, client, message);
        break;
    case VIEWER_SEND:
        client_put_frame(viewer, client, message);
        break;
    case VIEWER_SEEK:
    case VIEWER_SERIES:
        client_play(viewer, client, message);
        break;
    case VIEWER_CONTROL:
        /* Pass a request to the control socket; connect first if needed */
        if (client->control < 0 && !control_link_open(viewer, client)) {
            client_refuse(viewer, client, message, "unavailable",
                          "this run has no control socket: start it without --control none");
        } else if (!control_link_send(client, text, size)) {
            control_link_close(client);
            client_refuse(viewer, client, message, "busy", "the control socket takes nothing");
        }
        break;
    case VIEWER_ENTER:
        client_refuse(viewer, client, message, "input", "enter: the token was given before");
        break;
    }
}

void viewer_obey(struct viewer *viewer, struct viewer_client *client, const char *text, size_t size)
{
    struct viewer_message message;
    struct error error;

    if (viewer_message_parse(text, size, &message, &error)) {
        /* Do not explain errors to a client without a token */
        if (client->right == RIGHT_NONE) {
            viewer->counters.cut_junk++;
            client_bye(viewer, client, WEBSOCKET_POLICY, "expected a token first");
        } else {
            client_refuse(viewer, client, &message, "input", error.text);
        }
    } else if (client->right != RIGHT_NONE) {
        client_carry_out(viewer, client, &message, text, size);
    } else if (message.command == VIEWER_ENTER) {
        client_enter(viewer, client, &message);
    } else {
        viewer->counters.cut_junk++;
        client_bye(viewer, client, WEBSOCKET_POLICY, "expected a token first");
    }
    viewer_message_clear(&message);
}
