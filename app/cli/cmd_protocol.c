/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil protocol: what the boards speak. */
#include "app/cli/commands.h"

#include "app/cli/protocol_page.h"
#include "base/arena.h"
#include "base/config.h"
#include "base/count.h"
#include "base/options.h"
#include "base/text.h"
#include "boards/described/protocol.h"
#include "manual/protocol.h"

#include <string.h>

enum { MEMORY = 8 << 20 };

/* What a file describes: a path, or the name of one. */
static enum error_code print_described(const char *name, struct error *error)
{
    const struct described_protocol *protocol;
    struct arena arena = {.memory = NULL};
    char path[PATH_MAX];
    enum error_code code = config_locate(CONFIG_PROTOCOL, name, path, error);

    code = code ? code : arena_init(&arena, MEMORY, error);
    code = code ? code : described_load(path, &arena, &protocol, error);
    if (!code) {
        protocol_page_print_described(protocol, stdout);
    }
    arena_fini(&arena);
    return code;
}

int cmd_protocol(int argc, char **argv)
{
    static const char *const names[] = {[BOARD_ICUB] = "icub",
                                        [BOARD_FOC] = "foc",
                                        [BOARD_COMPACT] = "compact",
                                        [BOARD_CIA402] = "cia402",
                                        NULL};
    static const char *name;
    static const struct operand_spec operands[] = {
        {"PERSONALITY",
         "icub, foc, compact, cia402, or a protocol that a file describes: its name or the file",
         true, .value = &name, .words = names},
    };
    static const struct command_spec spec = {
        .name = "protocol",
        .summary = "Print every frame of a personality of boards: fields, units, ranges, answers, "
                   "faults.",
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_PROTOCOL,
    };
    const char *nearest;
    struct error error;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    for (int i = 0; names[i]; i++) {
        if (!strcmp(name, names[i])) {
            protocol_page_print((enum board_personality)i, stdout);
            return STATUS_OK;
        }
    }
    nearest = text_nearest(name, names, ARRAY_COUNT(names) - 1);
    if (nearest) {
        error_set(&error, ERROR_INPUT, "found unknown personality \"%.60s\", expected %s", name,
                  nearest);
        return options_fail(&spec, &error);
    }
    return print_described(name, &error) ? command_fail("protocol", &error) : STATUS_OK;
}
