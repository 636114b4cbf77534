/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the frames of a controller and of external boards from a log in two passes: count, then
 * store. */
#include "sim/stimulus.h"

#include "base/text.h"
#include "boards/messages.h"
#include "canbus/candump.h"

#include <limits.h>
#include <string.h>
#include <sys/stat.h>

enum { STANDARD_IDS = 0x800, EXTENDED_IDS = 2048 };
enum { FRAMES_MAX = 1 << 23 /* an hour of two buses at 1 kHz */ };
/* three years: longer than any run, but before any wall-clock time since 1973 */
#define WALL_CLOCK_NS (INT64_C(100000000) * 1000000000)

struct stimulus_reader {
    const struct rig *rig;
    const char *const *interface;
    bool lockstep;
    char path[PATH_MAX];
    /* 1 = a board of the simulator sends this identifier on this bus */
    uint8_t sent[RIG_BUSES_MAX][STANDARD_IDS];
    /* 29-bit identifiers that boards send; bits of the mask are 0 here */
    struct {
        size_t bus;
        uint32_t id, mask;
    } extended[EXTENDED_IDS];
    size_t nextended;
    bool full; /* the boards send more identifiers than fit */
};

/* ---- origin of a frame ---- */

/* The bus whose messages stimulus_mark_sent marks. */
struct stimulus_marks {
    struct stimulus_reader *reader;
    size_t bus;
};

/* Marks the identifier of a message that the simulator's own boards send. */
static bool stimulus_mark_sent(void *context, const struct message *message)
{
    const struct stimulus_marks *marks = context;
    struct stimulus_reader *reader = marks->reader;
    const struct board_config *board = reader->rig->boards.board;

    if (message->from_host || (message->sender >= 0 && board[message->sender].external)) {
        return true;
    }
    if (!message->extended) {
        reader->sent[marks->bus][message->id % STANDARD_IDS] = 1;
    } else if (reader->nextended == EXTENDED_IDS) {
        reader->full = true;
        return false;
    } else {
        reader->extended[reader->nextended].bus = marks->bus;
        reader->extended[reader->nextended].id = message->id;
        reader->extended[reader->nextended++].mask = message->id_mask;
    }
    return true;
}

/* Checks whether a frame must be played, because a controller or an external board sent it. */
static bool stimulus_takes_frame(const struct stimulus_reader *reader, size_t bus,
                                 const struct bus_frame *frame)
{
    const struct loop_lockstep *lockstep = &reader->rig->lockstep;

    if (frame->flags & FRAME_ERROR) {
        return false;
    }
    /* A remote frame requests a board's data frame with the same identifier, so no board sent it */
    if (frame->flags & FRAME_REMOTE) {
        return true;
    }
    if (frame->flags & FRAME_EXTENDED) {
        for (size_t i = 0; i < reader->nextended; i++) {
            if (reader->extended[i].bus == bus &&
                (frame->id & ~reader->extended[i].mask) == reader->extended[i].id) {
                return false;
            }
        }
        return true;
    }
    if (frame->id == lockstep->step_id) {
        return reader->lockstep && bus == (size_t)lockstep->bus;
    }
    return frame->id != lockstep->done_id && !reader->sent[bus][frame->id % STANDARD_IDS];
}

/* ---- the log ---- */

/* Shifts a frame's time to the start of the run if the log begins with wall-clock time. Returns
 * ERROR_INPUT if the log is longer than any run. */
static enum error_code stimulus_place_frame(const struct stimulus_reader *reader, int line,
                                            bool first, struct stimulus *stimulus,
                                            struct bus_frame *frame, struct error *error)
{
    if (first) {
        stimulus->start_ns = frame->time_ns >= WALL_CLOCK_NS ? frame->time_ns : 0;
    }
    frame->time_ns -= stimulus->start_ns;
    return frame->time_ns < WALL_CLOCK_NS
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s:%d: found a time %.0f s after the start of the log, expected less "
                           "than %.0f s",
                           reader->path, line, (double)frame->time_ns * 1e-9,
                           (double)WALL_CLOCK_NS * 1e-9);
}

/* Counts a frame of a bus, and stores it if there is room; refuses a frame that is earlier than
 * the previous one. last_ns: times of the buses' last frames. */
static enum error_code stimulus_keep_frame(const struct stimulus_reader *reader, int line,
                                           size_t bus, const struct bus_frame *frame,
                                           int64_t last_ns[RIG_BUSES_MAX],
                                           struct stimulus *stimulus, struct error *error)
{
    if (stimulus->count[bus] && frame->time_ns < last_ns[bus]) {
        return error_set(
            error, ERROR_INPUT,
            "%s:%d: found a frame %.6f s earlier than the one before it on %s: the clock of the "
            "log stepped back; expected later times from this line on, in the same order: awk 'NR "
            ">= %d { $1 = sprintf(\"(%%.6f)\", substr($1, 2) + %.6f) } 1' makes them",
            reader->path, line, (double)(last_ns[bus] - frame->time_ns) * 1e-9,
            reader->rig->bus[bus].name, line, (double)(last_ns[bus] - frame->time_ns) * 1e-9);
    }
    last_ns[bus] = frame->time_ns;
    if (stimulus->frame[bus]) {
        stimulus->frame[bus][stimulus->count[bus]] = *frame;
    }
    stimulus->last_ns = frame->time_ns > stimulus->last_ns ? frame->time_ns : stimulus->last_ns;
    stimulus->count[bus]++;
    return ERROR_NONE;
}

/* Reads the log once: counts the frames of each bus, and stores them if there is room. */
static enum error_code stimulus_pass(const struct stimulus_reader *reader,
                                     struct stimulus *stimulus, struct error *error)
{
    struct candump_reader log;
    int64_t last_ns[RIG_BUSES_MAX];
    enum error_code code = candump_open(&log, reader->path, error);
    bool end = false;

    if (code) {
        return code;
    }
    memset(stimulus->count, 0, sizeof stimulus->count);
    stimulus->end_ns = stimulus->gap_ns = 0;
    while (!code) {
        struct bus_frame frame;
        char name[16];
        int bus;

        /* Assigns each frame to the bus whose interface or name the log gives */
        code = candump_next(&log, &frame, name, &end, error);
        if (code || end ||
            (code = stimulus_place_frame(reader, log.line, log.line == 1 + (int)log.skipped,
                                         stimulus, &frame, error))) {
            break;
        }
        bus = TEXT_INDEX(reader->interface, reader->rig->nbus, name);
        bus = bus < 0 ? rig_find_bus(reader->rig, name) : bus;
        if (bus < 0) {
            code = error_set(error, ERROR_INPUT,
                             "%s:%d: found a frame on %s, expected an interface or a bus of %s; "
                             "--bus NAME=%s says which it is",
                             reader->path, log.line, name, reader->rig->file, name);
        } else if (stimulus_takes_frame(reader, (size_t)bus, &frame)) {
            code = stimulus_keep_frame(reader, log.line, (size_t)bus, &frame, last_ns, stimulus,
                                       error);
        }
        if (frame.time_ns - stimulus->end_ns > stimulus->gap_ns) {
            stimulus->gap_ns = frame.time_ns - stimulus->end_ns;
            stimulus->gap_line = log.line;
        }
        stimulus->end_ns = frame.time_ns > stimulus->end_ns ? frame.time_ns : stimulus->end_ns;
    }
    candump_skipped(&log, stimulus->skipped, sizeof stimulus->skipped);
    stimulus->skipped[0] = log.skipped ? stimulus->skipped[0] : '\0';
    candump_close(&log);
    return code;
}

/* Checks that there is something to play, not too much, and a STEP if the clock is lockstep. */
static enum error_code stimulus_check_count(const struct stimulus_reader *reader,
                                            const struct stimulus *stimulus, struct error *error)
{
    size_t total = 0, steps = 0;

    for (size_t b = 0; b < reader->rig->nbus; b++) {
        total += stimulus->count[b];
        for (size_t i = 0; stimulus->frame[b] && i < stimulus->count[b] && !steps; i++) {
            steps =
                frame_has_standard_id(&stimulus->frame[b][i], &reader->rig->lockstep.step_id, 1);
        }
        if (total > FRAMES_MAX) {
            return error_set(error, ERROR_INPUT,
                             "%s: found more than %d frames to play, expected fewer", reader->path,
                             FRAMES_MAX);
        }
        if (b + 1 == reader->rig->nbus && total == 0) {
            return error_set(error, ERROR_INPUT,
                             "%s: found no frame of a controller, expected some%s%s", reader->path,
                             stimulus->skipped[0] ? "; " : "", stimulus->skipped);
        }
    }
    return !stimulus->frame[0] || !reader->lockstep || steps
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s: found no STEP frame, expected some with the lockstep clock; "
                           "--clock free plays what was recorded in real time",
                           reader->path);
}

enum error_code stimulus_load(const char *path, const struct rig *rig, const char *const *interface,
                              bool lockstep, struct arena *arena, struct stimulus *stimulus,
                              struct error *error)
{
    struct stimulus_reader *reader = arena_alloc(arena, 1, sizeof *reader);
    struct stat info;
    int size;

    if (!reader) {
        return error_set(error, ERROR_MEMORY, "no memory left for the frames to play");
    }
    *stimulus = (struct stimulus){.end_ns = 0};
    reader->rig = rig;
    reader->interface = interface;
    reader->lockstep = lockstep;
    size = snprintf(reader->path, sizeof reader->path, "%s%s", path,
                    stat(path, &info) == 0 && S_ISDIR(info.st_mode) ? "/candump.log" : "");
    if (size >= (int)sizeof reader->path) {
        return error_set(error, ERROR_INPUT, "the name of the log to play is too long");
    }
    for (size_t b = 0; b < rig->nbus; b++) {
        struct stimulus_marks marks = {reader, b};

        boards_messages(&rig->boards, (int)b, stimulus_mark_sent, &marks);
    }
    if (reader->full) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the boards send more than %d messages with 29-bit identifiers, which a "
                         "log to play cannot be told from",
                         EXTENDED_IDS);
    }

    /* Count the frames, allocate room, and read the frames */
    enum error_code code = stimulus_pass(reader, stimulus, error);

    code = code ? code : stimulus_check_count(reader, stimulus, error);
    for (size_t b = 0; !code && b < reader->rig->nbus; b++) {
        stimulus->frame[b] = arena_alloc(arena, stimulus->count[b] + 1, sizeof *stimulus->frame[b]);
        if (!stimulus->frame[b]) {
            return error_set(error, ERROR_MEMORY, "no memory left for the frames to play");
        }
    }
    code = code ? code : stimulus_pass(reader, stimulus, error);
    return code ? code : stimulus_check_count(reader, stimulus, error);
}
