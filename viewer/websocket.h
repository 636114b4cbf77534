/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The server's side of the WebSocket protocol, RFC 6455: the answer to a key, and frames. A message
 * may be fragmented, with control frames between the fragments. The caller sets the maximum length.
 * No memory is allocated. Not RT-safe: it runs only in the viewer's thread.
 */
#ifndef VIEWER_WEBSOCKET_H
#define VIEWER_WEBSOCKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum websocket_opcode {
    WEBSOCKET_CONTINUATION = 0,
    WEBSOCKET_TEXT = 1,
    WEBSOCKET_BINARY = 2,
    WEBSOCKET_CLOSE = 8,
    WEBSOCKET_PING = 9,
    WEBSOCKET_PONG = 10,
};

/* Why a connection is closed. */
enum websocket_status {
    WEBSOCKET_NORMAL = 1000,
    WEBSOCKET_AWAY = 1001,
    WEBSOCKET_PROTOCOL = 1002,
    WEBSOCKET_UNSUPPORTED = 1003,
    WEBSOCKET_POLICY = 1008,
    WEBSOCKET_TOO_BIG = 1009,
    WEBSOCKET_LATER = 1013,
};

enum { WEBSOCKET_ACCEPT = 29, WEBSOCKET_HEADER = 10, WEBSOCKET_CONTROL_MAX = 125 };

/* Computes the Sec-WebSocket-Accept for a key. */
void websocket_accept(const char *key, char accept[WEBSOCKET_ACCEPT]);

/* A frame in a buffer. */
struct websocket_frame {
    bool final;
    enum websocket_opcode opcode;
    uint8_t *payload; /* unmasked, in the buffer */
    size_t size;
    size_t used; /* length of the whole frame */
};

/* Reads the frame at `data` and unmasks it in place. Its payload may have at most `max` bytes.
 * Returns 0 if the frame is incomplete, 1 if it is complete, otherwise the status (above 1) of the
 * close message. */
int websocket_read(uint8_t *data, size_t size, size_t max, struct websocket_frame *frame);

/* Writes the header of a complete message of the server; returns its length. */
size_t websocket_header(uint8_t header[WEBSOCKET_HEADER], enum websocket_opcode opcode,
                        size_t size);

#endif
