/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An HTTP/1.1 request for the page, as a browser sends it: the request line and the few headers
 * that matter, each bounded. Whoever sends something else is answered with a status of RFC 9110.
 * Also who may ask: the Host has to be an address of this server, and the Origin, where there is
 * one, that of its own pages, so that no other site's page reaches it through a name that its owner
 * points to this machine (DNS rebinding). No memory is allocated. Not RT-safe by purpose: it runs
 * in the viewer's thread.
 */
#ifndef VIEWER_REQUEST_H
#define VIEWER_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { REQUEST_SIZE_MAX = 8192, REQUEST_TEXT = 160 };

/* Strings are empty where the request has none. */
struct http_request {
    char path[REQUEST_TEXT];
    char host[REQUEST_TEXT];
    char origin[REQUEST_TEXT];
    char authorization[REQUEST_TEXT];
    char key[REQUEST_TEXT]; /* Sec-WebSocket-Key */
    bool upgrade;           /* to a WebSocket, with all that RFC 6455, 4.2.1 asks for */
};

/* Reads a request from its first size bytes. Returns 0 when its end has not come yet, 200, or the
 * status to refuse it with; used is its length. */
int http_request_parse(const char *text, size_t size, struct http_request *request, size_t *used);

/* The address that a server is bound to. */
struct http_bound {
    char host[64]; /* numeric, without brackets */
    uint16_t port;
    bool loopback; /* reached from this machine only */
    bool any;      /* 0.0.0.0 or ::, all addresses of the machine */
};

/* Checks whether a request was sent to this server by one of its pages, or by no page at all. */
bool http_request_is_ours(const struct http_request *request, const struct http_bound *bound);

#endif
