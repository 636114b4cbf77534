/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a browser may send to the page's server: a request of HTTP, then frames of a WebSocket, the
 * texts in them as messages. A request is refused or its strings end within it; a frame lies in the
 * bytes that were given and is no longer than allowed; a message is refused in a sentence, or what
 * it says is in range.
 */
#include "tests/fuzz/fuzz.h"
#include "viewer/message.h"
#include "viewer/http_request.h"
#include "viewer/viewer.h"
#include "viewer/websocket.h"

#include <stdlib.h>
#include <string.h>

enum { LONGEST = 4000 };

static void check_message(const char *text, size_t size)
{
    struct viewer_message message;
    struct error error = {0};

    if (viewer_message_parse(text, size, &message, &error)) {
        fuzz_require(fuzz_is_sentence(error.text), "%s", error.text);
        fuzz_tally.refused++;
    } else {
        fuzz_require(message.command != VIEWER_WATCH ||
                         (message.rate_hz >= 0 && message.rate_hz <= VIEWER_RATE_HZ),
                     "%g", message.rate_hz);
        fuzz_require(message.command != VIEWER_SEND || frame_valid(&message.frame), "%u",
                     message.frame.id);
        fuzz_require(message.command != VIEWER_ENTER || message.token, "no token");
        fuzz_require(!memchr(text, '\n', size), "two lines");
        fuzz_tally.taken++;
    }
    viewer_message_clear(&message);
}

static void check_frames(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size + 1), *at = copy;

    memcpy(copy, data, size);
    while (size > 0) {
        struct websocket_frame frame;
        int status = websocket_read(at, size, LONGEST, &frame);

        fuzz_require(status == 0 || status == 1 || status == WEBSOCKET_PROTOCOL ||
                         status == WEBSOCKET_TOO_BIG,
                     "%d", status);
        if (status != 1) {
            break;
        }
        fuzz_require(frame.used <= size && frame.size <= LONGEST && frame.payload >= at &&
                         frame.payload + frame.size == at + frame.used,
                     "%zu of %zu", frame.used, size);
        check_message((const char *)frame.payload, frame.size);
        at += frame.used;
        size -= frame.used;
    }
    free(copy);
}

static void check_string(const char *text)
{
    fuzz_require(memchr(text, '\0', REQUEST_TEXT), "no end");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct http_bound bound = {"127.0.0.1", 8080, .loopback = true};
    struct http_request request;
    size_t used;
    int status = http_request_parse((const char *)data, size, &request, &used);

    check_string(request.path);
    check_string(request.host);
    check_string(request.origin);
    check_string(request.authorization);
    check_string(request.key);
    fuzz_require(used <= size && used <= REQUEST_SIZE_MAX + 4U, "%zu", used);
    fuzz_require(status == 0 || status == 200 || (status >= 400 && status <= 505), "%d", status);
    if (status == 200) {
        fuzz_require(request.path[0] == '/', "%s", request.path);
        if (http_request_is_ours(&request, &bound)) {
            fuzz_require(strstr(request.host, "8080"), "%s", request.host);
        }
        if (request.upgrade) {
            char accept[WEBSOCKET_ACCEPT];

            websocket_accept(request.key, accept);
            check_frames(data + used, size - used);
        }
    } else {
        /* Bytes that are no request: a message, and frames */
        check_message((const char *)data, size);
        check_frames(data, size);
    }
    return 0;
}
