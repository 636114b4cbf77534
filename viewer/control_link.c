/* SPDX-License-Identifier: Apache-2.0 */
/* Connects a client to the control socket: its requests go there as lines, the answers come back
 * as messages. */
#include "viewer/private.h"

#include "control/socket.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

bool control_link_open(struct viewer *viewer, struct viewer_client *client)
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

bool control_link_send(struct viewer_client *client, const char *text, size_t size)
{
    struct iovec part[2] = {{(void *)(uintptr_t)text, size}, {(char[]){'\n'}, 1}};
    const struct msghdr line = {.msg_iov = part, .msg_iovlen = 2};

    /* All or nothing: the socket takes far more than a message, and is read at once */
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

    /* Each line is a message; a line longer than the buffer cannot come from our server */
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
