/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The kernel's answer about a network interface: whatever its attributes say, what is taken of them has
 * an end and a meaning.
 */
#include "canbus/link.h"

#include "canbus/interface.h"
#include "tests/fuzz/fuzz.h"

#include <errno.h>
#include <string.h>

enum { ANSWER_MAX = 8192 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct interface_settings settings = {.bitrate = 1000000};
    _Alignas(8) uint8_t answer[ANSWER_MAX];
    struct link_info info = {0};
    enum can_port_state state;
    int result;

    size = size < sizeof answer ? size : sizeof answer;
    /* at the end of the buffer, so that a sanitizer sees a read beyond the answer */
    memcpy(answer + (sizeof answer - size) / 4 * 4, data, size);
    result = link_parse(answer + (sizeof answer - size) / 4 * 4, size, &info);
    if (result) {
        fuzz_tally.refused++;
        return 0;
    }
    fuzz_tally.taken++;
    fuzz_require(memchr(info.kind, '\0', sizeof info.kind), "the kind does not end");
    fuzz_require(info.controller.state < CAN_STATE_MAX, "state %d", (int)info.controller.state);
    fuzz_require(fuzz_is_sentence(interface_state_name(info.controller.state)), "no name");
    fuzz_require(interface_kind(&info) <= INTERFACE_OTHER, "kind %d", (int)interface_kind(&info));
    if (interface_is_set(&info, &settings)) {
        fuzz_require(interface_bitrate_fits(info.controller.timing.bitrate, settings.bitrate),
                     "%u bit/s", info.controller.timing.bitrate);
    }
    if (interface_port_state(&info, &state)) {
        fuzz_require(state <= CAN_PORT_GONE, "state %d", (int)state);
    }
    return 0;
}
