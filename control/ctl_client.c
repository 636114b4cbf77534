/* SPDX-License-Identifier: Apache-2.0 */
/* Connects to the control socket of a running simulator, sends requests and reads lines. */
#include "control/ctl_client.h"

#include "control/socket.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Chooses the path of the socket: the given path, else COMAN_HIL_CONTROL, else the socket of the
 * newest running simulator. */
static enum error_code ctl_choose_socket(struct ctl_client *client, const char *path,
                                         struct error *error)
{
    static char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE];
    const char *wanted = path ? path : getenv("COMAN_HIL_CONTROL");
    size_t count;

    if (wanted && wanted[0]) {
        snprintf(client->path, sizeof client->path, "%s", wanted);
        return ERROR_NONE;
    }
    count = control_socket_find(found);
    if (count == 0) {
        return error_set(error, ERROR_SYSTEM,
                         "found no running simulator of yours, expected one: start it with "
                         "\"coman-hil run RIG\", which says where its control socket is; --socket "
                         "PATH looks elsewhere, and the socket of a service is root's");
    }
    if (count > 1) {
        fprintf(stderr,
                "coman-hil ctl: %zu simulators run, this is the newest, %s; others with "
                "--socket PATH:",
                count, found[0]);
        for (size_t i = 1; i < count; i++) {
            fprintf(stderr, " %s", found[i]);
        }
        fputc('\n', stderr);
    }
    snprintf(client->path, sizeof client->path, "%s", found[0]);
    return ERROR_NONE;
}

enum error_code ctl_connect(struct ctl_client *client, const char *path, struct error *error)
{
    enum error_code code = ctl_choose_socket(client, path, error);

    client->socket = -1;
    client->received = client->read = 0;
    return code ? code : control_socket_connect(client->path, &client->socket, error);
}

enum error_code ctl_send(struct ctl_client *client, const json_t *object, struct error *error)
{
    char *line = json_dumps(object, JSON_COMPACT);
    size_t size = line ? strlen(line) : 0;
    enum error_code code = ERROR_NONE;

    if (!line) {
        return error_set(error, ERROR_MEMORY, "no memory for a request");
    }
    line[size] = '\n'; /* overwrites the terminating zero */
    for (size_t sent = 0; sent <= size && !code;) {
        ssize_t count = send(client->socket, line + sent, size + 1 - sent, MSG_NOSIGNAL);

        if (count > 0) {
            sent += (size_t)count;
        } else if (count < 0 && errno == EPIPE) {
            break; /* the server has refused the connection: read its reason */
        } else if (count == 0 || errno != EINTR || *client->interrupted) {
            code = error_set_errno(error, errno, "cannot write to %s", client->path);
        }
    }
    free(line);
    return code;
}

/* Returns the next complete line of the inbox, zero-terminated, or NULL if there is none. */
static char *ctl_take_line(struct ctl_client *client)
{
    char *begin = client->inbox + client->read;
    char *end = memchr(begin, '\n', client->received - client->read);

    if (!end) {
        return NULL;
    }
    *end = '\0';
    client->read = (size_t)(end - client->inbox) + 1;
    return begin;
}

/* Waits up to 100 ms for bytes. Returns whether there are bytes to read. Sets *heard to
 * CTL_INTERRUPTED after a signal, else to CTL_LINE. */
static bool wait_readable(struct ctl_client *client, enum ctl_line_status *heard)
{
    enum { SLICE_MS = 100 };
    struct pollfd fd = {.fd = client->socket, .events = POLLIN};
    /* A short wait, because poll does not notice a signal that arrived just before it */
    const int ready = poll(&fd, 1, SLICE_MS);

    if (*client->interrupted) {
        *heard = CTL_INTERRUPTED;
        return false;
    }
    *heard = CTL_LINE;
    return ready > 0;
}

enum ctl_line_status ctl_read_line(struct ctl_client *client, char **line, struct error *error)
{
    enum ctl_line_status heard = CTL_LINE;

    while (!(*line = ctl_take_line(client))) {
        ssize_t count;

        /* Move the beginning of the next line to the front of the inbox */
        client->received -= client->read;
        memmove(client->inbox, client->inbox + client->read, client->received);
        client->read = 0;
        if (client->received == sizeof client->inbox) {
            error_set(error, ERROR_INPUT, "%s sends lines that are too long", client->path);
            return CTL_FAILED;
        }

        /* Wait for more bytes; a signal ends the wait */
        if (!wait_readable(client, &heard)) {
            if (heard != CTL_LINE) {
                return heard;
            }
            continue;
        }
        count = recv(client->socket, client->inbox + client->received,
                     sizeof client->inbox - client->received, MSG_DONTWAIT);
        if (count == 0 || (count < 0 && errno == ECONNRESET)) {
            return CTL_END;
        }
        if (count < 0 && errno != EAGAIN && errno != EINTR) {
            error_set_errno(error, errno, "cannot read from %s", client->path);
            return CTL_FAILED;
        }
        client->received += count > 0 ? (size_t)count : 0;
    }
    return CTL_LINE;
}

void ctl_close(struct ctl_client *client)
{
    if (client->socket >= 0) {
        close(client->socket);
        client->socket = -1;
    }
}
