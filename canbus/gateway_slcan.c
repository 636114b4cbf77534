/* SPDX-License-Identifier: Apache-2.0 */
/* The gateway's slcan channels: each is a pseudo-terminal or a TCP port in front of one bus. */
#include "canbus/gateway_private.h"

#include "base/listen.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>

#define SLCAN_OK "\r"
#define SLCAN_BELL "\a"

/* Bits of the status (answer to F) that a simulated bus can set */
enum { STATUS_TX_FULL = 1 << 1, STATUS_OVERRUN = 1 << 3 };

/* ---- commands ---- */

/* Queues an answer for a client. */
static void gateway_slcan_answer(struct gateway *gateway, struct gateway_client *client,
                                 const char *text)
{
    gateway_queue_text(gateway, client, text, strlen(text));
}

/* Sends a client's frame and acknowledges it (z or Z), or answers with the bell. A STEP waits until
 * gateway_release_step. */
static void gateway_slcan_take_frame(struct gateway *gateway, struct gateway_client *client,
                                     const struct bus_frame *frame)
{
    bool taken = client->mode == CLIENT_RAW && !client->slcan.listens;

    if (taken && gateway_is_step(gateway, client->bus, frame)) {
        client->step = *frame;
        client->step_waits = true;
    } else if (taken) {
        taken = gateway_send_frame(gateway, client, client->bus, frame);
        client->slcan.status |= taken ? 0 : STATUS_TX_FULL;
    }
    gateway_slcan_answer(gateway, client,
                         !taken                          ? SLCAN_BELL
                         : frame->flags & FRAME_EXTENDED ? "Z" SLCAN_OK
                                                         : "z" SLCAN_OK);
}

/* Answers F with the status flags, two hexadecimal digits, and clears them. */
static void gateway_slcan_tell_status(struct gateway *gateway, struct gateway_client *client)
{
    char text[8];

    if (client->mode != CLIENT_RAW) {
        gateway_slcan_answer(gateway, client, SLCAN_BELL);
        return;
    }
    snprintf(text, sizeof text, "F%02X" SLCAN_OK, client->slcan.status & 0xffu);
    client->slcan.status = 0;
    gateway_slcan_answer(gateway, client, text);
}

/* Executes one command of a client and answers it with \r (done) or the bell (refused). */
static void gateway_slcan_execute(struct gateway *gateway, struct gateway_client *client,
                                  const char *text, size_t size)
{
    const struct gateway_bus *bus = &gateway->config.bus[client->bus];
    struct slcan_request request;
    bool fits;

    slcan_parse(text, size, &request);
    switch (request.command) {
    /* Commands of an open channel */
    case SLCAN_FRAME:
        gateway_slcan_take_frame(gateway, client, &request.frame);
        return;
    case SLCAN_STATUS:
        gateway_slcan_tell_status(gateway, client);
        return;

    /* Commands of a closed channel */
    case SLCAN_OPEN:
        /* Open for listening only, or also for sending */
        fits = client->mode != CLIENT_RAW && !client->slcan.refused;
        if (fits) {
            client->mode = CLIENT_RAW;
            client->slcan.listens = request.value;
        }
        gateway_slcan_answer(gateway, client, fits ? SLCAN_OK : SLCAN_BELL);
        return;
    case SLCAN_BIT_RATE:
    case SLCAN_DATA_RATE:
        /* Refuse a bit rate that differs from the bus's, and then also a later SLCAN_OPEN */
        fits = client->mode != CLIENT_RAW &&
               request.value ==
                   (request.command == SLCAN_DATA_RATE ? bus->data_bitrate : bus->bitrate);
        client->slcan.refused = client->mode != CLIENT_RAW && !fits;
        gateway_slcan_answer(gateway, client, fits ? SLCAN_OK : SLCAN_BELL);
        return;
    case SLCAN_TIME_STAMP:
        fits = client->mode != CLIENT_RAW;
        client->slcan.stamps = fits ? request.value : client->slcan.stamps;
        gateway_slcan_answer(gateway, client, fits ? SLCAN_OK : SLCAN_BELL);
        return;

    /* Commands at any time */
    case SLCAN_VERSION:
        gateway_slcan_answer(gateway, client, text[0] == 'V' ? "V1010" SLCAN_OK : "v0100" SLCAN_OK);
        return;
    case SLCAN_SERIAL:
        gateway_slcan_answer(gateway, client, "NHIL0" SLCAN_OK);
        return;
    case SLCAN_CLOSE:
        client->mode = CLIENT_BCM;
        gateway_slcan_answer(gateway, client, SLCAN_OK);
        return;
    case SLCAN_ACCEPTED:
        gateway_slcan_answer(gateway, client, SLCAN_OK);
        return;
    case SLCAN_WRONG:
        gateway_slcan_answer(gateway, client, SLCAN_BELL);
        return;
    }
}

void gateway_slcan_execute_inbox(struct gateway *gateway, struct gateway_client *client)
{
    size_t at = 0;

    /* Commands end with \r and run one by one, up to a STEP */
    while (client->socket >= 0 && !client->step_waits && !gateway_step_runs(gateway)) {
        const char *begin = client->inbox + at;
        const char *end = memchr(begin, '\r', client->received - at);

        if (!end) {
            break;
        }
        at += (size_t)(end - begin) + 1;
        while (begin < end && *begin == '\n') {
            begin++; /* terminals may send \r\n */
        }
        gateway_slcan_execute(gateway, client, begin, (size_t)(end - begin));
    }

    /* Discard a command beyond the longest one and answer with the bell */
    client->received -= at;
    memmove(client->inbox, client->inbox + at, client->received);
    if (client->received >= SLCAN_TEXT_MAX && !memchr(client->inbox, '\r', client->received)) {
        client->received = 0;
        gateway_slcan_answer(gateway, client, SLCAN_BELL);
    }
}

/* ---- lines ---- */

void gateway_slcan_reset(struct gateway_client *client)
{
    client->mode = CLIENT_BCM;
    client->slcan.status = STATUS_OVERRUN;
    client->slcan.stamps = client->slcan.listens = client->slcan.refused = false;
    client->waiting = client->received = 0;
    client->step_waits = false;
}

/* Checks whether a path is a link to a terminal; text receives its target. */
static bool slcan_read_link(const char *path, char text[64])
{
    static const char folder[] = "/dev/pts/";
    ssize_t length = readlink(path, text, 63);

    text[length > 0 ? length : 0] = '\0';
    return !strncmp(text, folder, sizeof folder - 1);
}

/* Makes the path a link to the named terminal. Replaces only a link that a killed run has left: its
 * target no longer exists, or is this terminal, which got the same number again. */
static enum error_code slcan_make_link(const char *path, const char *name, struct error *error)
{
    char left[64];

    if (slcan_read_link(path, left) && (!strcmp(left, name) || access(left, F_OK))) {
        unlink(path);
    }
    if (!symlink(name, path)) {
        return ERROR_NONE;
    }
    return errno == EEXIST
               ? error_set(error, ERROR_INPUT,
                           "slcan: found %.200s there already, expected a new name: only a link "
                           "to a terminal that is gone is replaced",
                           path)
               : error_set_errno(error, errno, "slcan: cannot make the link %.200s", path);
}

/* Opens a pseudo-terminal and links its slave end to the configured path. The gateway keeps the
 * slave open, so that the line exists before a client opens it and after it closes it. */
static enum error_code gateway_slcan_open_terminal(struct gateway *gateway, size_t index,
                                                   struct error *error)
{
    const struct gateway_slcan *slcan = &gateway->config.slcan[index];
    struct gateway_client *client = &gateway->client[index];
    int line = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC), other = -1;
    struct termios raw;
    char name[64];

    /* Both ends, in raw mode (no echo, no translation) */
    if (line < 0 || grantpt(line) || unlockpt(line) || ptsname_r(line, name, sizeof name)) {
        error_set_errno(error, errno, "slcan: cannot make a pseudo-terminal");
        goto fail;
    }
    other = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (other < 0 || tcgetattr(other, &raw)) {
        error_set_errno(error, errno, "slcan: cannot open %s", name);
        goto fail;
    }
    cfmakeraw(&raw);
    if (tcsetattr(other, TCSANOW, &raw)) {
        error_set_errno(error, errno, "slcan: cannot set %s", name);
        goto fail;
    }
    /* Make the link, and take a place among the clients */
    if (slcan_make_link(slcan->path, name, error)) {
        goto fail;
    }
    *client = (struct gateway_client){.socket = line,
                                      .other = other,
                                      .is_slcan = true,
                                      .is_terminal = true,
                                      .mode = CLIENT_BCM,
                                      .bus = gateway->slcan_bus[index],
                                      .outbox = client->outbox};
    return ERROR_NONE;

fail:
    if (line >= 0) {
        close(line);
    }
    if (other >= 0) {
        close(other);
    }
    return error->code;
}

enum error_code gateway_slcan_start(struct gateway *gateway, struct error *error)
{
    enum error_code code = ERROR_NONE;

    if (gateway->config.nslcan > GATEWAY_SLCAN) {
        return error_set(error, ERROR_INPUT, "slcan: found %zu channels, expected at most %d",
                         gateway->config.nslcan, GATEWAY_SLCAN);
    }
    for (size_t i = 0; i < gateway->config.nslcan && !code; i++) {
        const struct gateway_slcan *slcan = &gateway->config.slcan[i];
        struct sockaddr_storage bound;

        if (!gateway_find_bus(gateway, slcan->bus, &gateway->slcan_bus[i])) {
            /* The error about an unknown bus lists the known ones */
            char list[256] = "";

            for (size_t b = 0; b < gateway->config.nbus; b++) {
                size_t used = strlen(list);

                snprintf(list + used, sizeof list - used, "%s%s", b ? ", " : "",
                         gateway->config.bus[b].name);
            }
            return error_set(error, ERROR_INPUT,
                             "slcan: found no bus \"%.64s\", expected one of %s", slcan->bus, list);
        }
        code = slcan->path ? gateway_slcan_open_terminal(gateway, i, error)
                           : listen_at("gateway", slcan->host, slcan->port,
                                       &gateway->slcan_listener[i], &bound, error);
    }
    return code;
}

void gateway_slcan_stop(struct gateway *gateway)
{
    for (size_t i = 0; i < gateway->config.nslcan; i++) {
        struct gateway_client *client = &gateway->client[i];
        const char *path = gateway->config.slcan[i].path;
        char name[64], link[64];

        if (client->is_terminal) {
            /* Remove the link if it still points to this terminal */
            if (!ptsname_r(client->socket, name, sizeof name) && slcan_read_link(path, link) &&
                !strcmp(name, link)) {
                unlink(path);
            }
            close(client->other);
            close(client->socket);
            client->socket = -1;
            client->is_terminal = false;
        }
        if (gateway->slcan_listener[i] >= 0) {
            close(gateway->slcan_listener[i]);
            gateway->slcan_listener[i] = -1;
        }
    }
}
