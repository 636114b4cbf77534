/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The WebSocket protocol, RFC 6455, the server's side: the answer to a key, and frames. A message
 * may come in fragments, control frames between them; it is at most as long as the caller has room
 * for. No memory is allocated. Not RT-safe by purpose: it runs in the viewer's thread.
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

/* A frame as it begins in a buffer. */
struct websocket_frame {
    bool final;
    enum websocket_opcode opcode;
    uint8_t *payload; /* in the buffer, unmasked */
    size_t size;
    size_t used; /* bytes of the whole frame */
};

/* Reads, and unmasks in place, the frame at data, whose payload may be at most max long. Returns 0
 * when it has not come as a whole, 1 when it has, or the status (above 1) to close with. */
int websocket_read(uint8_t *data, size_t size, size_t max, struct websocket_frame *frame);

/* Writes the header of a whole message of the server's; returns its length. */
size_t websocket_header(uint8_t header[WEBSOCKET_HEADER], enum websocket_opcode opcode,
                        size_t size);

#endif
