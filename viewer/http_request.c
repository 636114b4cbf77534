/* SPDX-License-Identifier: Apache-2.0 */
/* Parses HTTP requests: the part of RFC 9112 that the page needs. */
#include "viewer/http_request.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { LINE_LIMIT = 64 }; /* maximum number of header lines */

/* The headers that together request a WebSocket. */
struct upgrade_signs {
    bool upgrade, connection, version;
};

/* Checks whether a text has only printable ASCII characters. */
static bool text_is_visible(const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        if ((unsigned char)text[i] < 0x20 || (unsigned char)text[i] > 0x7e) {
            return false;
        }
    }
    return true;
}

/* Copies a value without surrounding blanks; returns false if it is too long. */
static bool request_copy_value(const char *from, size_t size, char to[REQUEST_TEXT])
{
    while (size > 0 && (*from == ' ' || *from == '\t')) {
        from++;
        size--;
    }
    while (size > 0 && (from[size - 1] == ' ' || from[size - 1] == '\t')) {
        size--;
    }
    if (size >= REQUEST_TEXT) {
        return false;
    }
    memcpy(to, from, size);
    to[size] = '\0';
    return true;
}

/* Checks whether a list such as "keep-alive, Upgrade" contains a word, in upper or lower case. */
static bool list_has_word(const char *list, const char *word)
{
    size_t size = strlen(word);

    for (const char *at = list; *at;) {
        size_t length;

        at += strspn(at, ", \t");
        length = strcspn(at, ", \t");
        if (length == size && strncasecmp(at, word, size) == 0) {
            return true;
        }
        at += length;
    }
    return false;
}

/* Parses the request line, "GET /path HTTP/1.1", and removes a query. Returns 200, or the status of
 * the refusal. */
static int request_read_first_line(const char *line, size_t size, struct http_request *request)
{
    static const char protocol[] = " HTTP/1.1";
    const size_t tail = sizeof protocol - 1;
    size_t length;

    if (!text_is_visible(line, size) || size < tail + 5) {
        return 400;
    }
    if (memcmp(line + size - tail, protocol, tail) != 0) {
        return 505;
    }
    if (memcmp(line, "GET ", 4) != 0) {
        return 405;
    }
    length = size - tail - 4;
    if (line[4] != '/' || memchr(line + 4, ' ', length)) {
        return 400;
    }
    if (length >= REQUEST_TEXT) {
        return 414;
    }
    memcpy(request->path, line + 4, length);
    request->path[length] = '\0';
    request->path[strcspn(request->path, "?")] = '\0';
    return 200;
}

/* Stores the value of a header that may occur only once. Returns the status. */
static int request_keep_once(const char *value, size_t size, char to[REQUEST_TEXT])
{
    return to[0] ? 400 : request_copy_value(value, size, to) ? 200 : 431;
}

/* Parses a header line. Returns 200, or the status of the refusal. */
static int request_read_header(const char *line, size_t size, struct http_request *request,
                               struct upgrade_signs *signs)
{
    const char *colon = memchr(line, ':', size);
    size_t name = colon ? (size_t)(colon - line) : 0, rest = colon ? size - name - 1 : 0;
    char word[REQUEST_TEXT];

    /* Refuse a name with blanks, and control characters: a zero byte would hide the rest */
    if (name == 0 || memchr(line, ' ', name) || memchr(line, '\t', name)) {
        return 400;
    }
    for (size_t i = 0; i < size; i++) {
        if (((unsigned char)line[i] < 0x20 && line[i] != '\t') || line[i] == 0x7f) {
            return 400;
        }
    }

#define IS(text) (name == sizeof text - 1 && strncasecmp(line, text, name) == 0)
    if (IS("Host")) {
        return request_keep_once(colon + 1, rest, request->host);
    }
    if (IS("Origin")) {
        return request_keep_once(colon + 1, rest, request->origin);
    }
    if (IS("Authorization")) {
        return request_keep_once(colon + 1, rest, request->authorization);
    }
    if (IS("Sec-WebSocket-Key")) {
        return request_keep_once(colon + 1, rest, request->key);
    }
    if (IS("Content-Length") || IS("Transfer-Encoding")) {
        return 413; /* a GET must not have a body */
    }

    /* Evaluate the headers that request a WebSocket; other headers may have any length */
    if (IS("Upgrade") || IS("Connection") || IS("Sec-WebSocket-Version")) {
        if (!request_copy_value(colon + 1, rest, word)) {
            return 431;
        }
        signs->upgrade = signs->upgrade || (IS("Upgrade") && list_has_word(word, "websocket"));
        signs->connection =
            signs->connection || (IS("Connection") && list_has_word(word, "upgrade"));
        signs->version = signs->version || (IS("Sec-WebSocket-Version") && strcmp(word, "13") == 0);
    }
#undef IS
    return 200;
}

/* Checks whether a key is 16 bytes in base64: 22 digits and "==". */
static bool is_websocket_key(const char *key)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

    return strlen(key) == 24 && strspn(key, digits) == 22 && strcmp(key + 22, "==") == 0;
}

/* Parses the lines of a complete request. Returns 200, or the status of the refusal. */
static int request_read_lines(const char *text, size_t size, struct http_request *request)
{
    struct upgrade_signs signs = {0};
    int status = 200;

    for (int line = 0; size > 0 && status == 200; line++) {
        const char *end = memchr(text, '\n', size);
        size_t length = end ? (size_t)(end - text) : size;

        if (length == 0 || text[length - 1] != '\r') {
            return 400;
        }
        status = line == 0           ? request_read_first_line(text, length - 1, request)
                 : line > LINE_LIMIT ? 431
                                     : request_read_header(text, length - 1, request, &signs);
        size -= end ? length + 1 : length;
        text += end ? length + 1 : length;
    }
    request->upgrade =
        signs.upgrade && signs.connection && signs.version && is_websocket_key(request->key);
    return status;
}

int http_request_parse(const char *text, size_t size, struct http_request *request, size_t *used)
{
    const char *end = memmem(text, size, "\r\n\r\n", 4);

    memset(request, 0, sizeof *request);
    *used = 0;
    if (!end) {
        return size >= REQUEST_SIZE_MAX ? 431 : 0;
    }
    *used = (size_t)(end - text) + 4;
    if (*used > REQUEST_SIZE_MAX) {
        return 431;
    }
    return request_read_lines(text, *used - 2, request);
}

/* ---- allowed senders ---- */

/* Splits "host:port" or "[host]:port"; the default port is 80. Returns false for other text. */
static bool split_host(const char *text, char host[REQUEST_TEXT], char port[REQUEST_TEXT])
{
    const char *colon = strrchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : strlen(text);

    snprintf(port, REQUEST_TEXT, "%s", colon ? colon + 1 : "80");
    if (length > 2 && text[0] == '[' && text[length - 1] == ']') {
        text++;
        length -= 2;
    } else if (memchr(text, ':', length)) {
        return false;
    }
    snprintf(host, REQUEST_TEXT, "%.*s", (int)length, text);
    return true;
}

/* Checks whether two numeric addresses are equal in any notation. */
static bool is_same_address(const char *a, const char *b)
{
    unsigned char one[16], other[16];

    if (inet_pton(AF_INET, a, one) == 1 && inet_pton(AF_INET, b, other) == 1) {
        return memcmp(one, other, 4) == 0;
    }
    return inet_pton(AF_INET6, a, one) == 1 && inet_pton(AF_INET6, b, other) == 1 &&
           memcmp(one, other, 16) == 0;
}

static bool is_numeric_address(const char *host)
{
    unsigned char address[16];

    return inet_pton(AF_INET, host, address) == 1 || inet_pton(AF_INET6, host, address) == 1;
}

bool http_request_is_ours(const struct http_request *request, const struct http_bound *bound)
{
    char host[REQUEST_TEXT], port[REQUEST_TEXT], expected[16], origin[REQUEST_TEXT + 8];

    snprintf(expected, sizeof expected, "%u", bound->port);
    if (!split_host(request->host, host, port) || strcmp(port, expected) != 0) {
        return false;
    }

    /* Accept only numeric addresses and localhost: an attacker can make any other name point to
     * this machine (DNS rebinding) */
    if (strcasecmp(host, "localhost") == 0
            ? !bound->loopback && !bound->any
            : !is_same_address(host, bound->host) && !(bound->any && is_numeric_address(host))) {
        return false;
    }
    snprintf(origin, sizeof origin, "http://%s", request->host);
    return request->origin[0] == '\0' || strcasecmp(request->origin, origin) == 0;
}
