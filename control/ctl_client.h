/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A client of the control socket, for `coman-hil ctl`: one connection that exchanges lines. Not
 * RT-safe.
 */
#ifndef CONTROL_CTL_CLIENT_H
#define CONTROL_CTL_CLIENT_H

#include "control/control.h"
#include "base/error.h"

#include <jansson.h>
#include <signal.h>

struct ctl_client {
    int socket;
    char path[256]; /* path of the socket */
    volatile sig_atomic_t *interrupted;
    size_t received, read;          /* bytes in inbox; the first `read` are consumed */
    char inbox[2 * CONTROL_OUTBOX]; /* a line is never longer than an outbox */
};

enum ctl_line_status { CTL_LINE, CTL_END, CTL_INTERRUPTED, CTL_FAILED };

/* Connects to `path`. If path is NULL, connects to the path in the environment variable
 * COMAN_HIL_CONTROL. Without either, connects to the newest running simulator, and prints a line on
 * stderr if there are several. */
enum error_code ctl_connect(struct ctl_client *client, const char *path, struct error *error);

/* Sends a JSON object as a line. */
enum error_code ctl_send(struct ctl_client *client, const json_t *object, struct error *error);

/* Reads the next line: zero-terminated, without its newline, valid until the next call. CTL_END:
 * the server has closed the connection. Only CTL_FAILED sets error. */
enum ctl_line_status ctl_read_line(struct ctl_client *client, char **line, struct error *error);

void ctl_close(struct ctl_client *client);

#endif
