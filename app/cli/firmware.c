/* SPDX-License-Identifier: Apache-2.0 */
/* Downloaded firmware as files beside a recording. */
#include "app/cli/firmware.h"

#include "boards/icub/loader.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

static bool firmware_put_words(const uint16_t *image, FILE *out)
{
    for (size_t i = 0; i < (size_t)ICUB_MEMORIES * ICUB_MEMORY_WORDS; i++) {
        putc(image[i] & 0xff, out);
        putc(image[i] >> 8, out);
    }
    return !ferror(out);
}

static enum error_code firmware_write_file(const char *path, const uint16_t *image,
                                           struct error *error)
{
    int descriptor = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666);
    FILE *out = descriptor < 0 ? NULL : fdopen(descriptor, "w");
    bool good;

    if (!out) {
        error_set_errno(error, errno, "cannot open %s", path);
        if (descriptor >= 0) {
            close(descriptor);
        }
        return error->code;
    }
    good = firmware_put_words(image, out);
    if (fclose(out) || !good) {
        int reason = errno;

        /* Half an image would be compared as a whole one */
        unlink(path);
        return error_set_errno(error, reason, "cannot write %s", path);
    }
    return ERROR_NONE;
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
        for (char *c = path + start; *c; c++) {
            *c = *c == '/' ? '-' : *c;
        }
        code = firmware_write_file(path, firmware.image, error);
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}
