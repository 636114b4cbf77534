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
    /* the command of VIEWER_CONTROL; value and count are as in control/parse.h */
    enum control_command control;
    double value;
    int64_t count;
    double from_s, to_s;    /* series: the range; seek: the time is from_s */
    int64_t points;         /* series: maximum number of rows */
    const char *token;      /* enter: the token */
    bool stay;              /* enter: stay connected after the end of the run */
    double rate_hz;         /* watch: states per second; 0 = none */
    bool trace, rows;       /* watch: send frames, send rows */
    const json_t *signals;  /* watch and series: array of strings; NULL = none */
    const char *bus, *data; /* send; the identifier is in count */
    bool extended, fd, brs;
    struct bus_frame frame;
};

/* Parses a message. An error names the found and the expected text. The caller must clear the
 * message, also after an error. */
enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error);
void viewer_message_clear(struct viewer_message *message);

#endif
