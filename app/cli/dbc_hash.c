/* SPDX-License-Identifier: Apache-2.0 */
/* Writes and hashes the DBC files of a rig in memory. */
#include "app/cli/cli.h"

#include "base/hash.h"
#include "rig/dbc.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { DIGITS = 16 }; /* digits of a hash */

enum error_code dbc_hash_write_text(const struct dbc *dbc, struct memory_file *text,
                                    struct error *error)
{
    FILE *file = memory_file_open(text);

    if (!file) {
        return error_set(error, ERROR_MEMORY, "no memory left for the DBC file");
    }
    /* Only the stream can fail, which memory_file_close reports */
    dbc_write(dbc, file, NULL);
    return memory_file_close(file, text, "the DBC file", error);
}

/* Hashes the text of a bus's DBC file. */
static enum error_code dbc_hash_bus(const struct rig *rig, size_t bus, struct arena *scratch,
                                    uint64_t *hash, struct error *error)
{
    struct memory_file text = {.text = NULL};
    struct dbc *dbc;
    enum error_code code = rig_dbc(rig, bus, scratch, &dbc, error);

    code = code ? code : dbc_hash_write_text(dbc, &text, error);
    if (!code) {
        *hash = hash_bytes(HASH_START, text.text, text.size);
    }
    free(text.text);
    return code;
}

enum error_code dbc_hash_rig(const struct rig *rig, struct arena *arena, const char **hashes,
                             struct error *error)
{
    size_t size = 1, used = 0;
    /* scratch memory, so that the databases do not stay beside the loop's data */
    struct arena scratch;
    enum error_code code = arena_init(&scratch, RIG_COMMAND_ARENA, error);
    char *text;

    for (size_t i = 0; i < rig->nbus; i++) {
        size += strlen(rig->bus[i].name) + DIGITS + 2;
    }
    text = arena_alloc(arena, size, 1);
    *hashes = text;
    if (!code && !text) {
        code = error_set(error, ERROR_MEMORY, "no memory left for the hashes of the DBC files");
    }
    for (size_t i = 0; i < rig->nbus && !code; i++) {
        uint64_t hash;

        code = dbc_hash_bus(rig, i, &scratch, &hash, error);
        if (!code) {
            used += (size_t)snprintf(text + used, size - used, "%s%s=%016" PRIx64, used ? " " : "",
                                     rig->bus[i].name, hash);
        } else if (code != ERROR_MEMORY) {
            /* `coman-hil dbc` cannot write this file either, so no client has it */
            code = ERROR_NONE;
        }
    }
    arena_fini(&scratch);
    return code;
}
