/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands of the socketcand protocol: whatever stands between < and >, a frame that is to be sent
 * is a legal one, the name of a bus ends, and a frame as the server writes it is one command with
 * the same contents when a client says it.
 */
#include "canbus/socketcand.h"

#include "tests/fuzz/fuzz.h"

#include <inttypes.h>
#include <string.h>

/* The server's text of a frame as the request that a client makes of the same frame. */
static void request_of(const struct bus_frame *frame, const char *bus, char *text, size_t size)
{
    const int digits = frame->flags & FRAME_EXTENDED ? 8 : 3;
    int at;

    if (frame->flags & FRAME_REMOTE) {
        snprintf(text, size, "< sendrtr %0*X 0 %s >", digits, frame->id, bus);
        return;
    }
    if (frame->flags & FRAME_FD) {
        at = snprintf(text, size, "< fdsend %0*X %X %d", digits, frame->id,
                      (frame->flags & FRAME_BRS ? 1u : 0u) | (frame->flags & FRAME_ESI ? 2u : 0u),
                      frame->len);
    } else {
        at = snprintf(text, size, "< send %0*X %d", digits, frame->id, frame->len);
    }
    for (int i = 0; i < frame->len; i++) {
        at += snprintf(text + at, size - (size_t)at, " %02x", frame->data[i]);
    }
    snprintf(text + at, size - (size_t)at, " %s >", bus);
}

static void check_format(const struct bus_frame *frame)
{
    char text[SOCKETCAND_TEXT_MAX];
    size_t size;

    memset(text, 0x55, sizeof text);
    size = socketcand_format(frame, frame->id % 2 ? "left_leg" : NULL, text);
    fuzz_require(size < sizeof text && strlen(text) == size, "%zu characters", size);
    fuzz_require(size == 0 ||
                     (text[0] == '\n' && text[1] == '<' && strcmp(text + size - 2, " >") == 0 &&
                      strchr(text, '>') == text + size - 1),
                 "%s", text);
    fuzz_require((size > 0) ==
                     (frame_valid(frame) && !(frame->flags & FRAME_ERROR) && frame->time_ns >= 0),
                 "id 0x%x flags 0x%x length %u", frame->id, frame->flags, frame->len);
}

static void check_request(const char *text, size_t size)
{
    struct socketcand_request request, again;
    char same[512];

    socketcand_parse(text, size, &request);
    fuzz_require(request.command <= SOCKETCAND_MALFORMED, "%d", (int)request.command);
    fuzz_require(memchr(request.bus, '\0', sizeof request.bus), "the name does not end");
    if (request.command != SOCKETCAND_SEND) {
        fuzz_tally.refused++;
        return;
    }
    fuzz_require(frame_valid(&request.frame) && !(request.frame.flags & FRAME_ERROR) &&
                     request.frame.time_ns == 0,
                 "%.*s", (int)size, text);
    request_of(&request.frame, request.bus, same, sizeof same);
    socketcand_parse(same, strlen(same), &again);
    fuzz_require(memcmp(&request, &again, sizeof request) == 0, "%s", same);
    fuzz_tally.taken++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes bytes = {data, size};
    struct bus_frame frame;

    check_request((const char *)data, size);
    frame.time_ns = 0;
    fuzz_frame(&bytes, &frame);
    frame.time_ns = (int64_t)fuzz_u64(&bytes);
    check_format(&frame);
    return 0;
}
