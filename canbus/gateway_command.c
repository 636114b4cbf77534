/* SPDX-License-Identifier: Apache-2.0 */
/* Executes the requests of gateway clients: commands, frames to the buses, and STEP last. */
#include "canbus/gateway_private.h"

#include "canbus/lockstep.h"

#include <poll.h>
#include <stdio.h>

enum {
    /* Delay of frames after an "ok", because common clients expect this answer alone. */
    QUIET_MS = 20,
    /* Time without DONE after which clients are served again: a slow STEP, or a lost STEP or
     * DONE */
    STEP_MS = 200,
    /* Time after which a client that does not read is disconnected, while a STEP waits */
    BEHIND_MS = 2000,
    /* Most reads of each client before a STEP, GATEWAY_INBOX bytes each: more than its bus holds */
    DRAIN_ROUNDS = 256,
};

/* ---- frames ---- */

/* Checks whether a frame has the bus, identifier and length of a STEP. The simulator refuses a STEP
 * of another length without a DONE. */
static bool gateway_looks_like_step(const struct gateway_lockstep *lockstep, size_t bus,
                                    const struct bus_frame *frame)
{
    return bus == lockstep->bus && frame->len == LOCKSTEP_LENGTH &&
           frame->id == lockstep->step_id && !(frame->flags & (FRAME_EXTENDED | FRAME_REMOTE));
}

bool gateway_is_step(const struct gateway *gateway, size_t bus, const struct bus_frame *frame)
{
    const struct gateway_lockstep *lockstep = &gateway->config.lockstep;

    return lockstep->on && gateway_looks_like_step(lockstep, bus, frame);
}

bool gateway_is_done(const struct gateway *gateway, const struct bus_frame *frame)
{
    const struct gateway_lockstep *lockstep = &gateway->config.lockstep;

    return lockstep->on && frame->id == lockstep->done_id &&
           !(frame->flags & (FRAME_EXTENDED | FRAME_ERROR));
}

/* Queues an answer for a client. */
static void gateway_answer_client(struct gateway *gateway, struct gateway_client *client,
                                  const char *text)
{
    gateway_queue_text(gateway, client, text, strlen(text));
}

bool gateway_send_frame(struct gateway *gateway, struct gateway_client *client, size_t bus,
                        const struct bus_frame *request)
{
    struct bus_frame frame = *request;

    frame.time_ns = gateway->time_ns[bus];
    if (can_send(gateway->config.bus[bus].port, &frame, 1) != 1) {
        /* A full queue is not an error of the client, so it does not count as junk */
        gateway->counters.not_taken++;
        if (!client->is_slcan) {
            gateway_answer_client(gateway, client, "< error the bus refuses the frame >");
        }
        return false;
    }
    gateway->counters.to_bus++;
    gateway_forward_frame(gateway, bus, &frame, client);
    return true;
}

/* ---- commands ---- */

bool gateway_find_bus(const struct gateway *gateway, const char *name, size_t *bus)
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

/* Answers a wrong command with an error; a client that sends too many of them is disconnected. */
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

/* Rejects a command that names an unknown bus. In the answer, '?' replaces characters that would
 * end it or are not printable. */
static void gateway_reject_bus(struct gateway *gateway, struct gateway_client *client,
                               const char *name)
{
    char text[SOCKETCAND_BUS_MAX + 32];
    char shown[SOCKETCAND_BUS_MAX + 1] = "";

    for (size_t i = 0; i < SOCKETCAND_BUS_MAX && name[i]; i++) {
        const bool plain = name[i] > ' ' && name[i] < 0x7f && name[i] != '<' && name[i] != '>';

        shown[i] = plain ? name[i] : '?';
    }
    snprintf(text, sizeof text, "< error no such bus: %s >", shown);
    gateway_reject_command(gateway, client, text);
}

/* Opens the bus that a client names, or every bus. A client can open only once. */
static void gateway_open_bus(struct gateway *gateway, struct gateway_client *client,
                             const char *name)
{
    size_t bus = GATEWAY_EVERY_BUS;

    if (client->mode != CLIENT_NO_BUS) {
        gateway_reject_command(gateway, client, "< error a bus is open already >");
    } else if (strcmp(name, GATEWAY_ALL) != 0 && !gateway_find_bus(gateway, name, &bus)) {
        gateway_reject_bus(gateway, client, name);
    } else {
        client->bus = bus;
        client->mode = CLIENT_BCM;
        gateway_answer_client(gateway, client, "< ok >");
    }
}

/* Sends a client's frame to the named or opened bus. A STEP waits until gateway_release_step. */
static void gateway_take_frame(struct gateway *gateway, struct gateway_client *client,
                               const struct socketcand_request *request)
{
    size_t bus = client->bus;

    if ((bus == GATEWAY_EVERY_BUS) != (request->bus[0] != '\0')) {
        gateway_reject_command(gateway, client,
                               bus == GATEWAY_EVERY_BUS ? "< error the last word must be the bus >"
                                                        : "< error wrong arguments >");
        return;
    }
    if (bus == GATEWAY_EVERY_BUS && !gateway_find_bus(gateway, request->bus, &bus)) {
        gateway_reject_bus(gateway, client, request->bus);
        return;
    }
    if (gateway_is_step(gateway, bus, &request->frame)) {
        client->step = request->frame;
        client->step_waits = true;
        return;
    }
    /* Send a STEP without a lockstep clock as usual, and answer that no DONE will follow */
    const struct gateway_lockstep *lockstep = &gateway->config.lockstep;

    if (!lockstep->on && lockstep->done_id &&
        gateway_looks_like_step(lockstep, bus, &request->frame)) {
        gateway_answer_client(
            gateway, client,
            "< error STEP without effect: the clock of this run is not lockstep >");
    }
    gateway_send_frame(gateway, client, bus, &request->frame);
}

/* Answers "tell WORD" with a row for each line, and "ok". */
static void gateway_tell(struct gateway *gateway, struct gateway_client *client, const char *word)
{
    size_t size = 0;
    const char *line =
        gateway->config.tell ? gateway->config.tell(gateway->config.context, word, &size) : NULL;

    if (!line) {
        gateway_reject_command(gateway, client, "< error nothing to tell about this word >");
        return;
    }
    for (const char *end = line + size; line < end;) {
        const char *next = memchr(line, '\n', (size_t)(end - line));

        next = next ? next : end;
        gateway_answer_client(gateway, client, "\n< row ");
        gateway_queue_text(gateway, client, line, (size_t)(next - line));
        gateway_answer_client(gateway, client, " >");
        line = next + 1;
    }
    gateway_answer_client(gateway, client, "\n< ok >");
}

/* Executes one command of a client, "< ... >". */
static void gateway_execute_command(struct gateway *gateway, struct gateway_client *client,
                                    const char *text, size_t size)
{
    struct socketcand_request request;

    /* The client has read the last "ok", because it sends more: it may get frames now */
    client->quiet_until_ms = 0;

    /* Before a bus is open, only open and echo are valid */
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
        /* Send the answer at once and alone; frames follow later */
        client->mode = request.command == SOCKETCAND_RAWMODE ? CLIENT_RAW : CLIENT_BCM;
        client->quiet_until_ms = gateway_now_ms() + QUIET_MS;
        gateway_answer_client(gateway, client, "< ok >");
        gateway_flush_client(client);
        break;
    case SOCKETCAND_ECHO:
        gateway_answer_client(gateway, client, "< echo >");
        break;
    case SOCKETCAND_TELL:
        gateway_tell(gateway, client, request.bus);
        break;
    case SOCKETCAND_SEND:
        gateway_take_frame(gateway, client, &request);
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

void gateway_execute_inbox(struct gateway *gateway, struct gateway_client *client)
{
    size_t at = 0;
    bool complete = true;

    if (client->is_slcan) {
        gateway_slcan_execute_inbox(gateway, client);
        return;
    }
    /* Commands run one by one, up to a STEP; text between commands is skipped */
    while (client->socket >= 0 && !client->step_waits && !gateway_step_runs(gateway)) {
        const char *begin = memchr(client->inbox + at, '<', client->received - at), *end;

        if (!begin) {
            at = client->received;
            break;
        }
        at = (size_t)(begin - client->inbox);
        end = memchr(begin, '>', client->received - at);
        if (!end) {
            complete = false;
            break;
        }
        at = (size_t)(end - client->inbox) + 1;
        gateway_execute_command(gateway, client, begin, (size_t)(end - begin) + 1);
    }

    /* Keep an incomplete command, unless it is longer than the longest command */
    client->received -= at;
    memmove(client->inbox, client->inbox + at, client->received);
    if (!complete && client->received >= SOCKETCAND_TEXT_MAX) {
        gateway->counters.cut_junk++;
        gateway_close_client(client);
    }
}

/* ---- STEP ---- */

/* Reads every client until no data arrives or the next command is a STEP, at most DRAIN_ROUNDS
 * times. It repeats the reads, because a read acknowledges data, and the client's system then sends
 * bytes that Nagle's algorithm delayed. */
static void gateway_drain_clients(struct gateway *gateway)
{
    struct pollfd fd[GATEWAY_CLIENTS];

    for (int round = 0; round < DRAIN_ROUNDS; round++) {
        size_t readable = 0;

        for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
            const struct gateway_client *client = &gateway->client[i];

            fd[i] = (struct pollfd){.fd = client->step_waits ? -1 : client->socket, POLLIN, 0};
            readable += fd[i].fd >= 0;
        }
        if (!readable || poll(fd, GATEWAY_CLIENTS, 0) <= 0) {
            return;
        }
        for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
            if (fd[i].revents) {
                gateway_read_client(gateway, &gateway->client[i]);
            }
        }
    }
}

/* Checks whether a STEP must wait for a client to read: its outbox is more than half full. */
bool gateway_is_behind(const struct gateway_client *client)
{
    return client->socket >= 0 && client->mode == CLIENT_RAW &&
           client->waiting > GATEWAY_OUTBOX / 2;
}

/* Checks whether all clients have read most of their output. Disconnects a client that delays a
 * STEP for too long. */
static bool gateway_clients_keep_up(struct gateway *gateway)
{
    const int64_t now_ms = gateway_now_ms();
    bool all = true;

    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        struct gateway_client *client = &gateway->client[i];

        if (!gateway_is_behind(client)) {
            client->awaited_since_ms = 0;
        } else if (!client->awaited_since_ms) {
            client->awaited_since_ms = now_ms;
            all = false;
        } else if (now_ms - client->awaited_since_ms > BEHIND_MS) {
            gateway_cut_slow(gateway, client);
        } else {
            all = false;
        }
    }
    return all;
}

void gateway_release_step(struct gateway *gateway)
{
    struct gateway_client *client = NULL;

    for (size_t i = 0; i < GATEWAY_CLIENTS && !client; i++) {
        if (gateway->client[i].socket >= 0 && gateway->client[i].step_waits) {
            client = &gateway->client[i];
        }
    }
    if (!client || gateway_step_runs(gateway) || !gateway_clients_keep_up(gateway)) {
        return;
    }

    /* Execute the other clients' commands first; this may disconnect one of them, but not this
     * client */
    gateway_drain_clients(gateway);
    client->step_waits = false;
    atomic_store(&gateway->holds, gateway->config.hold_done);
    if (gateway_send_frame(gateway, client, gateway->config.lockstep.bus, &client->step)) {
        gateway->step_until_ms = gateway_now_ms() + STEP_MS;
    }
}
