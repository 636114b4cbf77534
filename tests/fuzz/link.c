/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The kernel's answer about a network interface: whatever its attributes say, what is taken of them
 * has an end and a meaning.
 */
#include "canbus/link.h"

#include "canbus/interface.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct interface_settings settings = {.bitrate = 1000000};
    struct link_info info = {0};
    enum can_port_state state;
    int result;

    result = link_parse(data, size, &info); /* aligned as what malloc gives */
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
        fuzz_require(state <= CAN_PORT_STUCK, "state %d", (int)state);
    }
    return 0;
}
