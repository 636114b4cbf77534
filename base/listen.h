/* SPDX-License-Identifier: Apache-2.0 */
/* A listening TCP socket. Not RT-safe. */
#ifndef BASE_LISTEN_H
#define BASE_LISTEN_H

#include "base/error.h"

#include <stdint.h>
#include <sys/socket.h>

/* Listens at a numeric IPv4 or IPv6 address. `host` NULL = 127.0.0.1; `port` 0 = any free port. The
 * socket is non-blocking and closed on exec. `bound` receives the address and its port. Messages
 * begin with `who`. ERROR_INPUT: `host` is not an address. ERROR_SYSTEM: the system refused a call;
 * the caller must close *listener if it is open. */
enum error_code listen_at(const char *who, const char *host, uint16_t port, int *listener,
                          struct sockaddr_storage *bound, struct error *error);

/* Returns the port of an IPv4 or IPv6 address. */
uint16_t listen_port(const struct sockaddr_storage *address);

#endif
