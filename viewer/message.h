/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads a message of a client: one of the page's own commands, or a request for the control socket.
 * docs/page.md has them all. Names of signals and buses are not looked up here. Not RT-safe.
 */
#ifndef VIEWER_MESSAGE_H
#define VIEWER_MESSAGE_H

#include "control/parse.h"
#include "base/error.h"
#include "canbus/frame.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

enum viewer_command {
    VIEWER_ENTER,   /* gives the token */
    VIEWER_WATCH,   /* says what to send, and how often */
    VIEWER_SEND,    /* puts a frame on a bus */
    VIEWER_SEEK,    /* of a recording: shows a time */
    VIEWER_SERIES,  /* asks for signals between two times */
    VIEWER_CONTROL, /* a request for the control socket */
};

struct viewer_message {
    json_t *root; /* owns what the pointers point to */
    const json_t *id;
    enum viewer_command command;
    bool harmless;                /* VIEWER_CONTROL: changes nothing */
    enum control_command control; /* of VIEWER_CONTROL, with its value and count as in
                                   * control/parse.h */
    double value;
    int64_t count;
    double from_s, to_s;    /* of series; the time of seek is from_s */
    int64_t points;         /* of series: rows at most */
    const char *token;      /* of enter */
    bool stay;              /* of enter: goes on when the run has ended */
    double rate_hz;         /* of watch; 0 = nothing */
    bool trace, rows;       /* of watch */
    const json_t *signals;  /* of watch and series: an array of strings; NULL = none */
    const char *bus, *data; /* of send, whose identifier is count */
    bool extended, fd, brs;
    struct bus_frame frame;
};

/* Parses a message; the error says what was found and what was expected. The message is to be
 * cleared in any case. */
enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error);
void viewer_message_clear(struct viewer_message *message);

#endif
