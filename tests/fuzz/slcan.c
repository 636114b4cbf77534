/* SPDX-License-Identifier: Apache-2.0 */
/* Commands of slcan: whatever stands before a carriage return, a frame that is to be sent is a
 * legal one, and is the same when it is written and read again (a remote frame has no data). */
#include "canbus/slcan.h"

#include "tests/fuzz/fuzz.h"

#include <string.h>

static void check_again(const struct bus_frame *frame, bool stamped)
{
    struct slcan_request request;
    char text[SLCAN_TEXT_MAX];
    size_t size;

    memset(text, 0x55, sizeof text);
    size = slcan_format(frame, stamped, text);
    fuzz_require(size < sizeof text && (size == 0 || strlen(text) == size), "%zu characters", size);
    if (size == 0) {
        return;
    }
    fuzz_require(text[size - 1] == '\r', "%s", text);
    slcan_parse(text, size - 1 - (stamped ? 4 : 0), &request);
    fuzz_require(request.command == SLCAN_FRAME && request.frame.id == frame->id &&
                     request.frame.len == frame->len &&
                     (frame->flags & FRAME_REMOTE ||
                      memcmp(request.frame.data, frame->data, frame->len) == 0),
                 "%s", text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes bytes = {data, size};
    struct slcan_request request;
    struct bus_frame frame;

    slcan_parse((const char *)data, size, &request);
    fuzz_require(request.command <= SLCAN_WRONG, "%d", (int)request.command);
    if (request.command == SLCAN_FRAME) {
        fuzz_require(frame_valid(&request.frame), "id 0x%x", request.frame.id);
        check_again(&request.frame, false);
        fuzz_tally.taken++;
    } else {
        fuzz_tally.refused++;
    }
    frame.time_ns = 0;
    fuzz_frame(&bytes, &frame);
    frame.time_ns = (int64_t)(fuzz_u64(&bytes) >> 1);
    if (frame_valid(&frame) && !(frame.flags & FRAME_ERROR)) {
        check_again(&frame, size % 2);
    }
    return 0;
}
