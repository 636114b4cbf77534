/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of the socketcand protocol in raw mode, between < and >. Pure functions; the server is
 * canbus/gateway.h. RT-safe. Data, remote and FD frames go both ways:
 *
 *     < send ID LENGTH B B ... >         < frame ID SECONDS.MICROSECONDS BBBB... >
 *     < sendrtr ID LENGTH >              < rtr ID SECONDS.MICROSECONDS LENGTH >
 *     < fdsend ID FLAGS LENGTH B ... >   < fdframe ID FLAGS SECONDS.MICROSECONDS BBBB... >
 *
 * Identifiers are hexadecimal; 8 digits or a value above 7FF mean 29 bits. FLAGS are those of
 * canfd_frame (1 = bit rate switch, 2 = error passive). LENGTH is decimal. The other commands are
 * open BUS, rawmode, bcmmode and echo.
 *
 * Our extension: on a connection with every bus, the bus name is the last word of all six, before
 * the >.
 */
#ifndef CANBUS_SOCKETCAND_H
#define CANBUS_SOCKETCAND_H

#include "canbus/frame.h"

enum socketcand_command {
    SOCKETCAND_OPEN,
    SOCKETCAND_RAWMODE,
    SOCKETCAND_BCMMODE,
    SOCKETCAND_ECHO,
    SOCKETCAND_SEND, /* send, sendrtr or fdsend */
    SOCKETCAND_TELL, /* ours: tell WORD */
    /* a valid command that the server does not support: add, subscribe, ... */
    SOCKETCAND_OTHER,
    SOCKETCAND_UNKNOWN,   /* not a socketcand command */
    SOCKETCAND_MALFORMED, /* a known command with wrong arguments */
};

/* The longest command and the longest answer, < and > included: FD with 64 bytes. */
enum { SOCKETCAND_TEXT_MAX = 288, SOCKETCAND_BUS_MAX = 16 };

struct socketcand_request {
    enum socketcand_command command;
    /* SOCKETCAND_OPEN: bus to open; SOCKETCAND_TELL: word; SOCKETCAND_SEND: "" = no bus in the
     * command */
    char bus[SOCKETCAND_BUS_MAX + 1];
    struct bus_frame frame; /* SOCKETCAND_SEND; a valid frame with time_ns 0 */
};

/* Parses size bytes of text, from < to >. */
void socketcand_parse(const char *text, size_t size, struct socketcand_request *request);

/* Writes a frame as the server sends it, with the bus name unless NULL. The text begins with a
 * newline, which clients skip. Reason: python-can 4 loses the character before a partly received
 * message, and reports an error for a newline at the end. Returns the length without the
 * terminating zero; 0 for error frames. The time is frame->time_ns. */
size_t socketcand_format(const struct bus_frame *frame, const char *bus,
                         char text[SOCKETCAND_TEXT_MAX]);

#endif
