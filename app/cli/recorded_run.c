/* SPDX-License-Identifier: Apache-2.0 */
/* Compares the run of a stimulus with the recorded one, and stores downloaded firmware. */
#include "app/cli/cli.h"

#include "base/input_file.h"
#include "base/whole_file.h"

#include <inttypes.h>
#include <jansson.h>

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

        if (!boards_firmware(simulator_parts(simulator).boards, i, &firmware) || !firmware.image) {
            continue;
        }
        start = snprintf(path, sizeof path, "%s/firmware-", directory);
        length =
            snprintf(path, sizeof path, "%s/firmware-%s.bin", directory, config->board[i].name);
        if (length < 0 || (size_t)length >= sizeof path) {
            return error_set(error, ERROR_SYSTEM, "the name of %s is too long", directory);
        }

        /* A board's name may contain a '/', but a file name may not */
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

/* Largest number of ticks in a recording: 115 days at 1 kHz. */
#define TICKS_MOST INT64_C(10000000000)

/* Opens a regular file of a recording. Returns NULL if there is none. */
static FILE *recorded_run_open(const char *directory, const char *name)
{
    char path[PATH_MAX];
    int size = snprintf(path, sizeof path, "%s/%s", directory, name);
    struct error ignored;
    FILE *file;

    return size < (int)sizeof path && input_file_stream(path, &file, &ignored) == ERROR_NONE ? file
                                                                                             : NULL;
}

/* Checks whether an event is a request that has changed the robot's motion: a push, a tunable, or
 * a fault switched by hand. Pauses, speeds, and connections of clients are not. */
static bool recorded_run_is_request(const char *text)
{
    static const char *const others[] = {"process ", "paused ",     "resumed ",
                                         "speed ",   "as fast as ", "checkpoint "};
    const char *control = "control: ", *hand = strstr(text, " (by hand): ");

    if (strncmp(text, control, strlen(control)) != 0) {
        return strncmp(text, "fault ", 6) == 0 && hand;
    }
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        if (!strncmp(text + strlen(control), others[i], strlen(others[i]))) {
            return false;
        }
    }
    return true;
}

void recorded_run_read(const char *directory, struct recorded_run *run)
{
    FILE *summary = recorded_run_open(directory, RECORDER_SUMMARY);
    FILE *events = recorded_run_open(directory, "events.log");

    *run = (struct recorded_run){.ticks = 0};
    if (summary) {
        /* Read the number of ticks and the state hash of the summary */
        json_t *root = json_loadf(summary, JSON_REJECT_DUPLICATES, NULL);
        const char *hash = json_string_value(json_object_get(root, "state_hash"));
        json_int_t ticks = json_integer_value(json_object_get(root, "ticks"));

        if (hash && strlen(hash) < sizeof run->state_hash && ticks > 0 && ticks <= TICKS_MOST) {
            run->ticks = (uint64_t)ticks;
            snprintf(run->state_hash, sizeof run->state_hash, "%s", hash);
        }
        json_decref(root);

        fclose(summary);
    }
    if (events) {
        char line[RECORDER_EVENT_TEXT + 64];

        /* Count the requests among the events ("TIME PRIORITY TEXT" each), and store the first */
        while (fgets(line, sizeof line, events)) {
            char *priority, *text;

            line[strcspn(line, "\n")] = '\0';
            priority = strchr(line, ' ');
            text = priority ? strchr(priority + 1, ' ') : NULL;
            if (!text || !recorded_run_is_request(text + 1)) {
                continue;
            }
            if (run->requests++ == 0) {
                snprintf(run->first, sizeof run->first, "%.*s s %s", (int)(priority - line), line,
                         text + 1);
            }
        }
        fclose(events);
    }
}

void recorded_run_warn(const struct recorded_run *run, const char *directory, FILE *out)
{
    if (run->requests) {
        fprintf(out,
                "%swarning: %s/events.log has %zu request%s of \"coman-hil ctl\", the page or "
                "another client, which are in no frame and are not played; the first: %s\n",
                journal_prefix(JOURNAL_WARNING), directory, run->requests,
                run->requests > 1 ? "s" : "", run->first);
    }
}

void recorded_run_compare(const struct recorded_run *run, uint64_t ticks, uint64_t state_hash,
                          FILE *out)
{
    char hash[24];

    if (!run->ticks || run->ticks != ticks) {
        return;
    }
    snprintf(hash, sizeof hash, "%016" PRIx64, state_hash);
    if (!strcmp(hash, run->state_hash)) {
        fputs("recording: ended in the same state\n", out);
    } else {
        fprintf(out, "recording: ended in another state, %s: %s\n", run->state_hash,
                run->requests ? "its requests were not played"
                              : "the rig, the dynamics, a fault, the seed or another option is not "
                                "as it was");
    }
}
