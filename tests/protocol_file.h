/* SPDX-License-Identifier: Apache-2.0 */
/* Loads a protocol of config/protocols, for tests without a rig. */
#ifndef TESTS_PROTOCOL_FILE_H
#define TESTS_PROTOCOL_FILE_H

#include "boards/described/protocol.h"
#include "tests/test.h"

/* Returns the protocol of a file; the memory is kept until the test ends. */
static inline const struct described_protocol *protocol_file(const char *name)
{
    static struct arena arena;
    const struct described_protocol *protocol = NULL;
    struct error error;
    char path[256];

    snprintf(path, sizeof path, "%s/config/protocols/%s.yaml", HIL_SOURCE_DIR, name);
    if ((!arena.memory && arena_init(&arena, 64u << 20, &error)) ||
        described_load(path, false, &arena, &protocol, &error)) {
        fail_msg("%s", error.text);
    }
    return protocol;
}

#endif
