/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads a message of a client: a command of the page, or a request for the control socket.
 * docs/page.md lists all messages. Names of signals and buses are not checked here. Not RT-safe.
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
    VIEWER_ENTER,   /* passes the token */
    VIEWER_WATCH,   /* selects what to send, and how often */
    VIEWER_SEND,    /* sends a frame on a bus */
    VIEWER_SEEK,    /* for a recording: shows a time */
    VIEWER_SERIES,  /* requests signals between two times */
    VIEWER_CONTROL, /* a request for the control socket */
};

struct viewer_message {
    json_t *root; /* owns the memory of the pointers */
    const json_t *id;
    enum viewer_command command;
    bool harmless; /* VIEWER_CONTROL: the command only reads */
    /* of VIEWER_CONTROL; its value and count are as in control/parse.h */
    enum control_command control;
    double value;
    int64_t count;
    double from_s, to_s;    /* of series; from_s is also the time of seek */
    int64_t points;         /* of series: maximum number of rows */
    const char *token;      /* of enter */
    bool stay;              /* of enter: stay connected when the run has ended */
    double rate_hz;         /* of watch; 0 = nothing */
    bool trace, rows;       /* of watch */
    const json_t *signals;  /* of watch and series: array of strings; NULL = none */
    const char *bus, *data; /* of send; the identifier is in count */
    bool extended, fd, brs;
    struct bus_frame frame;
};

/* Parses a message; the error states the found and the expected text. The caller clears the
 * message even after an error. */
enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error);
void viewer_message_clear(struct viewer_message *message);

#endif
