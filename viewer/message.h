/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads a message of a client: one of the page's own commands, or a request for the control socket.
 * docs/page.md has them all. Names of signals and buses are not looked up here. Not RT-safe.
 */
#ifndef VIEWER_MESSAGE_H
#define VIEWER_MESSAGE_H

#include "base/error.h"
#include "canbus/frame.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

enum viewer_command {
    VIEWER_ENTER,   /* gives the token */
    VIEWER_WATCH,   /* says what to send, and how often */
    VIEWER_SEND,    /* puts a frame on a bus */
    VIEWER_CONTROL, /* a request for the control socket */
};

struct viewer_message {
    json_t *root; /* owns what the pointers point to */
    const json_t *id;
    enum viewer_command command;
    bool harmless;         /* VIEWER_CONTROL: changes nothing */
    const char *token;     /* of enter */
    double rate_hz;        /* of watch; 0 = nothing */
    bool trace;            /* of watch */
    const json_t *signals; /* of watch: an array of strings; NULL = none */
    const char *bus;       /* of send */
    struct bus_frame frame;
};

/* The error says what was found and what was expected; to be cleared in any case. */
enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error);
void viewer_message_clear(struct viewer_message *message);

#endif
