/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parses a browser's HTTP/1.1 request: the request line and the relevant headers, each with a
 * maximum length. The server answers any other request with a status of RFC 9110.
 *
 * It also checks the sender. The Host must be an address of this server. The Origin, if present,
 * must be the origin of the server's own pages. A page of another site therefore cannot reach the
 * server through a name that points to this machine (DNS rebinding). No memory is allocated. Not
 * RT-safe: it runs only in the viewer's thread.
 */
#ifndef VIEWER_HTTP_REQUEST_H
#define VIEWER_HTTP_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { REQUEST_SIZE_MAX = 8192, REQUEST_TEXT = 160 };

/* Strings are empty if the request does not have them. */
struct http_request {
    char path[REQUEST_TEXT];
    char host[REQUEST_TEXT];
    char origin[REQUEST_TEXT];
    char authorization[REQUEST_TEXT];
    char key[REQUEST_TEXT]; /* Sec-WebSocket-Key */
    /* upgrade to a WebSocket, with all headers that RFC 6455, 4.2.1 requires */
    bool upgrade;
};

/* Parses a request from its first `size` bytes. Returns 0 if the request is incomplete, 200 if it
 * is valid, otherwise the HTTP status of the refusal. *used receives the length of the request. */
int http_request_parse(const char *text, size_t size, struct http_request *request, size_t *used);

/* The address that a server is bound to. */
struct http_bound {
    char host[64]; /* numeric, without brackets */
    uint16_t port;
    bool loopback; /* reachable only from this machine */
    bool any;      /* 0.0.0.0 or ::, all addresses of the machine */
};

/* Checks whether a request has the right Host, and comes from one of the server's pages or from a
 * program without an Origin. */
bool http_request_is_ours(const struct http_request *request, const struct http_bound *bound);

#endif
