/* SPDX-License-Identifier: Apache-2.0 */
/* Writes downloaded firmware into files beside a recording. */
#include "app/cli/firmware.h"

#include "base/whole_file.h"

#include <stdio.h>

/* Writes the words of an image, low byte first. */
static enum error_code firmware_write_file(const char *path, const struct board_firmware *firmware,
                                           struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    for (size_t i = 0; i < firmware->words; i++) {
        putc(firmware->image[i] & 0xff, file.out);
        putc(firmware->image[i] >> 8, file.out);
    }
    return whole_file_close(&file, ERROR_NONE, error);
}

enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error)
{
    const struct boards_config *config = &simulator_configuration(simulator)->rig->boards;

    for (size_t i = 0; i < config->nboard; i++) {
        struct board_firmware firmware;
        char path[4096];
        int start, length;
        enum error_code code;

        if (!boards_firmware(simulator_boards(simulator), i, &firmware) || !firmware.image) {
            continue;
        }
        start = snprintf(path, sizeof path, "%s/firmware-", directory);
        length =
            snprintf(path, sizeof path, "%s/firmware-%s.bin", directory, config->board[i].name);
        if (length < 0 || (size_t)length >= sizeof path) {
            return error_set(error, ERROR_SYSTEM, "the name of %s is too long", directory);
        }

        /* A board's name may have a '/', a file's may not */
        for (char *c = path + start; *c; c++) {
            *c = *c == '/' ? '-' : *c;
        }
        code = firmware_write_file(path, &firmware, error);
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}
