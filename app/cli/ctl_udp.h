/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sends rows of a subscription as UDP datagrams: a JSON object for each row, with "timestamp"
 * (virtual time, s) and the number of each signal under its name, which PlotJuggler's UDP server
 * and others plot as it comes. Not RT-safe.
 */
#ifndef APP_CLI_CTL_UDP_H
#define APP_CLI_CTL_UDP_H

#include "base/error.h"

#include <jansson.h>
#include <stdbool.h>

/* Opens a socket to HOST:PORT, [ADDRESS]:PORT or PORT (of this machine), which the caller closes.
 * ERROR_INPUT, ERROR_SYSTEM. */
enum error_code ctl_udp_open(const char *to, int *descriptor, struct error *error);

/* Sends a row as it came over the control socket; answer is that of the subscription, with the
 * signals' names. A receiver that does not listen yet misses it. ERROR_INPUT when the row is longer
 * than a datagram. */
enum error_code ctl_udp_send(int descriptor, const json_t *answer, const json_t *row,
                             struct error *error);

#endif
