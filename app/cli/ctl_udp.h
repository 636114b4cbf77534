/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rows of a subscription as UDP datagrams: an object of JSON a row, "timestamp" (virtual time, s)
 * and a number a signal by its name; what PlotJuggler's UDP server and others plot as it comes. Not
 * RT-safe.
 */
#ifndef APP_CLI_CTL_UDP_H
#define APP_CLI_CTL_UDP_H

#include "base/error.h"

#include <jansson.h>
#include <stdbool.h>

/* A socket to HOST:PORT, [ADDRESS]:PORT or PORT (of this machine), the caller's to close.
 * ERROR_INPUT, ERROR_SYSTEM. */
enum error_code ctl_udp_open(const char *to, int *descriptor, struct error *error);

/* Sends a row, as it comes over the control socket; answer: that of the subscription, with the
 * names. Who does not listen (yet) misses it. ERROR_INPUT when it is longer than a datagram. */
enum error_code ctl_udp_send(int descriptor, const json_t *answer, const json_t *row,
                             struct error *error);

#endif
