/* SPDX-License-Identifier: Apache-2.0 */
/* A listening TCP socket. Not RT-safe. */
#ifndef BASE_LISTEN_H
#define BASE_LISTEN_H

#include "base/error.h"

#include <stdint.h>
#include <sys/socket.h>

/* Listens at a numeric IPv4 or IPv6 address, without blocking and not inherited. host NULL =
 * 127.0.0.1, port 0 = any that is free; bound receives the address with its port. who begins the
 * messages. ERROR_INPUT: no address; ERROR_SYSTEM, when listener may be open all the same. */
enum error_code listen_at(const char *who, const char *host, uint16_t port, int *listener,
                          struct sockaddr_storage *bound, struct error *error);

/* Returns the port of an address of either family. */
uint16_t listen_port(const struct sockaddr_storage *address);

#endif
