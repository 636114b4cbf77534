/* SPDX-License-Identifier: Apache-2.0 */
/* Opens listening TCP sockets. */
#include "base/listen.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>

enum { BACKLOG = 64 };

enum error_code listen_at(const char *who, const char *host, uint16_t port, int *listener,
                          struct sockaddr_storage *bound, struct error *error)
{
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV,
                                   .ai_socktype = SOCK_STREAM};
    struct addrinfo *address;
    socklen_t length = sizeof *bound;
    char service[8];
    int one = 1, failed;

    host = host ? host : "127.0.0.1";
    snprintf(service, sizeof service, "%u", port);
    failed = getaddrinfo(host, service, &hints, &address);
    if (failed == EAI_MEMORY) {
        return error_set(error, ERROR_MEMORY, "%s: no memory to listen", who);
    }
    if (failed == EAI_SYSTEM) {
        return error_set_errno(error, errno, "%s: cannot listen at %.60s", who, host);
    }
    if (failed) {
        return error_set(error, ERROR_INPUT,
                         "%s: found host \"%.60s\", expected a numeric address, for example "
                         "127.0.0.1",
                         who, host);
    }
    *listener = socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    failed = *listener < 0 || setsockopt(*listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one) ||
             bind(*listener, address->ai_addr, address->ai_addrlen) || listen(*listener, BACKLOG) ||
             getsockname(*listener, (struct sockaddr *)bound, &length);
    freeaddrinfo(address);
    return failed ? error_set_errno(error, errno,
                                    "%s: cannot listen at %.60s port %u (0: any free one)", who,
                                    host, port)
                  : ERROR_NONE;
}

uint16_t listen_port(const struct sockaddr_storage *address)
{
    /* IPv4 and IPv6 addresses have the port at the same offset */
    return ntohs(((const struct sockaddr_in *)(const void *)address)->sin_port);
}
