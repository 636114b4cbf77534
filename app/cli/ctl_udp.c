/* SPDX-License-Identifier: Apache-2.0 */
/* Sends rows as UDP datagrams. */
#include "app/cli/ctl_udp.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Longest host name; payload of the longest UDP datagram over IPv4, bytes. */
enum { HOST_SIZE = 256, DATAGRAM_MAX = 65507 };

/* Splits HOST:PORT at the last colon, before which an IPv6 address stands in brackets; a port alone
 * means localhost. False when it is neither. */
static bool udp_split_address(const char *to, char host[HOST_SIZE], const char **port)
{
    const char *colon = strrchr(to, ':');
    size_t length = colon ? (size_t)(colon - to) : 0;

    *port = colon ? colon + 1 : to;
    if (!**port || length >= HOST_SIZE || (colon && length == 0)) {
        return false;
    }
    if (length > 2 && to[0] == '[' && to[length - 1] == ']') {
        snprintf(host, HOST_SIZE, "%.*s", (int)length - 2, to + 1);
    } else {
        snprintf(host, HOST_SIZE, "%.*s", colon ? (int)length : 9, colon ? to : "localhost");
    }
    return strspn(*port, "0123456789") == strlen(*port);
}

enum error_code ctl_udp_open(const char *to, int *descriptor, struct error *error)
{
    const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_DGRAM};
    struct addrinfo *found = NULL;
    char host[HOST_SIZE];
    const char *port;
    int reason;

    if (!udp_split_address(to, host, &port)) {
        return error_set(error, ERROR_INPUT,
                         "--udp: found \"%.100s\", expected HOST:PORT, as in localhost:9870", to);
    }
    reason = getaddrinfo(host, port, &hints, &found);
    if (reason) {
        return error_set(error, ERROR_INPUT, "--udp: %.100s: %s", to, gai_strerror(reason));
    }

    /* A connected socket needs no address for each datagram */
    *descriptor = socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (*descriptor < 0 || connect(*descriptor, found->ai_addr, found->ai_addrlen)) {
        error_set_errno(error, errno, "--udp: %.100s", to);
        if (*descriptor >= 0) {
            close(*descriptor);
        }
        freeaddrinfo(found);
        return ERROR_SYSTEM;
    }
    freeaddrinfo(found);
    return ERROR_NONE;
}

enum error_code ctl_udp_send(int descriptor, const json_t *answer, const json_t *row,
                             struct error *error)
{
    const json_t *names = json_object_get(answer, "signals");
    const json_t *values = json_object_get(row, "values");
    json_t *message = json_object();
    char *text;
    size_t size;

    json_object_set(message, "timestamp", json_object_get(row, "time_s"));
    for (size_t i = 0; i < json_array_size(names) && i < json_array_size(values); i++) {
        const char *name = json_string_value(json_array_get(names, i));

        if (name) {
            json_object_set(message, name, json_array_get(values, i));
        }
    }
    text = json_dumps(message, JSON_COMPACT | JSON_REAL_PRECISION(15));
    json_decref(message);
    if (!text) {
        return error_set(error, ERROR_MEMORY, "no memory for a datagram");
    }

    /* A failure to send is no error: nobody listens yet, or the queue is full, and the next row may
     * get through */
    size = strlen(text);
    if (size <= DATAGRAM_MAX) {
        (void)!send(descriptor, text, size, MSG_NOSIGNAL);
    }
    free(text);
    return size <= DATAGRAM_MAX
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "--udp: found a row of %zu bytes, expected one that fits into a "
                           "datagram of %d: subscribe to fewer signals",
                           size, DATAGRAM_MAX);
}
