/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil protocol: prints what the boards speak. */
#include "app/cli/commands.h"

#include "app/cli/protocol_page.h"
#include "base/arena.h"
#include "base/config.h"
#include "base/array.h"
#include "base/options.h"
#include "base/text.h"
#include "boards/described/protocol.h"
#include "boards/protocol_list.h"
#include "manual/protocol.h"

#include <string.h>

enum { MEMORY = 8 << 20, NAMES_MAX = 16 };

/* Prints a protocol that a file describes; name is a path or a name of the catalogue. */
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

/* Lists the protocols that need no file in names, NULL at the end, and in help; returns their
 * number. */
static size_t list_names(const char *names[NAMES_MAX + 1], char *help, size_t size)
{
    const struct protocol *protocol;
    size_t count = 0, used = 0;

    for (size_t i = 0; count < NAMES_MAX && (protocol = protocol_at(i)); i++) {
        if (!protocol->needs_file) {
            names[count++] = protocol->name;
            used += used < size ? (size_t)snprintf(help + used, size - used, "%s, ", protocol->name)
                                : 0;
        }
    }
    if (used < size) {
        snprintf(help + used, size - used,
                 "or a protocol that a file describes: its name or the file");
    }
    names[count] = NULL;
    return count;
}

int cmd_protocol(int argc, char **argv)
{
    static const char *names[NAMES_MAX + 1], *name;
    static char help[240];
    static const struct operand_spec operands[] = {
        {"PERSONALITY", help, true, .value = &name, .words = names},
    };
    static const struct command_spec spec = {
        .name = "protocol",
        .summary = "Print every frame of a personality of boards: fields, units, ranges, answers, "
                   "faults.",
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_PROTOCOL,
    };
    const struct protocol *protocol;
    const char *nearest;
    struct error error;
    size_t count = list_names(names, help, sizeof help);
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* A protocol in C, or else one that a file describes, unless the name is nearly one of the
     * first */
    protocol = protocol_find(name);
    if (protocol && !protocol->needs_file) {
        protocol_page_print(protocol, stdout);
        return STATUS_OK;
    }
    nearest = text_nearest(name, names, count);
    if (nearest) {
        error_set(&error, ERROR_INPUT, "found unknown personality \"%.60s\", expected %s", name,
                  nearest);
        return options_fail(&spec, &error);
    }
    return print_described(name, &error) ? command_fail("protocol", &error) : STATUS_OK;
}
