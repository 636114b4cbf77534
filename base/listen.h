/* SPDX-License-Identifier: Apache-2.0 */
/* A listening TCP socket. Not RT-safe. */
#ifndef BASE_LISTEN_H
#define BASE_LISTEN_H

#include "base/error.h"

#include <stdint.h>
#include <sys/socket.h>

/* Listens at a numeric IPv4 or IPv6 address; the socket is non-blocking and not inherited. host
 * NULL = 127.0.0.1, port 0 = any free port. bound receives the address with its port. Messages
 * begin with who. ERROR_INPUT: not an address; ERROR_SYSTEM: refused, and the caller must still
 * close *listener if it is open. */
enum error_code listen_at(const char *who, const char *host, uint16_t port, int *listener,
                          struct sockaddr_storage *bound, struct error *error);

/* Returns the port of an address of either family. */
uint16_t listen_port(const struct sockaddr_storage *address);

#endif
