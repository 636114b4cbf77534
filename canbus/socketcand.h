/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of the socketcand protocol in its raw mode: what stands between < and >. Pure functions;
 * the server is canbus/gateway.h. RT-safe. Data, remote and FD frames go both ways:
 *
 *     < send ID LENGTH B B ... >         < frame ID SECONDS.MICROSECONDS BBBB... >
 *     < sendrtr ID LENGTH >              < rtr ID SECONDS.MICROSECONDS LENGTH >
 *     < fdsend ID FLAGS LENGTH B ... >   < fdframe ID FLAGS SECONDS.MICROSECONDS BBBB... >
 *
 * Identifiers are hexadecimal, of 8 digits when they have 29 bits, or larger than 7FF; FLAGS are
 * those of canfd_frame (1 = bit rate switch, 2 = error passive); LENGTH is decimal. The other
 * commands are open BUS, rawmode, bcmmode and echo.
 *
 * An extension of ours: on a connection that has all buses the name of the bus is the last word of
 * all six, before the >.
 */
#ifndef CANBUS_SOCKETCAND_H
#define CANBUS_SOCKETCAND_H

#include "canbus/frame.h"

#include <stddef.h>

enum socketcand_command {
    SOCKETCAND_OPEN,
    SOCKETCAND_RAWMODE,
    SOCKETCAND_BCMMODE,
    SOCKETCAND_ECHO,
    SOCKETCAND_SEND,      /* any of the three */
    SOCKETCAND_OTHER,     /* a command of the protocol that is not offered: add, subscribe, ... */
    SOCKETCAND_UNKNOWN,   /* no command of the protocol */
    SOCKETCAND_MALFORMED, /* a known command with wrong arguments */
};

/* The longest command and the longest answer, < and > included: FD with 64 bytes. */
enum { SOCKETCAND_TEXT_MAX = 288, SOCKETCAND_BUS_MAX = 16 };

struct socketcand_request {
    enum socketcand_command command;
    char bus[SOCKETCAND_BUS_MAX + 1]; /* SOCKETCAND_OPEN; SOCKETCAND_SEND: "" = not named */
    struct bus_frame frame;           /* SOCKETCAND_SEND; valid, time_ns is 0 */
};

/* Parses size bytes of text, from < to >. */
void socketcand_parse(const char *text, size_t size, struct socketcand_request *request);

/* Writes a frame as the server sends it, with the name of its bus unless that is NULL. A newline
 * stands in front of it, which clients skip: one widespread client (python-can 4) loses the
 * character before what it has received in part, and complains of one at the end. Returns the
 * length without the terminating zero; 0 for error frames. Time is frame->time_ns. */
size_t socketcand_format(const struct bus_frame *frame, const char *bus,
                         char text[SOCKETCAND_TEXT_MAX]);

#endif
