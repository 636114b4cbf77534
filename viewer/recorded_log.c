/* SPDX-License-Identifier: Apache-2.0 */
/* Finds the frames of a recording by time: marks in the log say where to begin. */
#include "viewer/recorded.h"

#include "canbus/candump.h"

#include <stdlib.h>
#include <string.h>

/* Parses the line at *at, which moves behind it. Returns 1; 0 at the end; -1 if it is no frame. */
static int log_read_line(const struct recorded_log *log, size_t *at, char name[16],
                         struct bus_frame *frame, struct error *error)
{
    const char *begin = log->file.data + *at;
    const char *end = *at < log->file.size ? memchr(begin, '\n', log->file.size - *at) : NULL;
    size_t size = end ? (size_t)(end - begin) : 0;

    if (!end) {
        return 0;
    }
    *at += size + 1;
    return candump_parse(begin, size, frame, name, error) ? -1 : 1;
}

/* Returns the index of a bus by its name in the log; nbus = none. */
static size_t log_find_bus(const struct recorded_log *log, const char *name)
{
    size_t bus = 0;

    while (bus < log->nbus && strcmp(log->bus[bus], name) != 0) {
        bus++;
    }
    return bus;
}

/* Adds a mark: where the log goes on at a time, and what each bus had carried. False = no
 * memory. */
static bool log_add_mark(struct recorded_log *log, int64_t time_ns, size_t at,
                         const struct recorded_traffic *traffic)
{
    if (log->nmark == log->capacity) {
        size_t larger = log->capacity ? 2 * log->capacity : 1024;
        struct recorded_mark *mark = realloc(log->mark, larger * sizeof *mark);
        struct recorded_traffic *counts =
            mark ? realloc(log->traffic, larger * (log->nbus + 1) * sizeof *counts) : NULL;

        log->mark = mark ? mark : log->mark;
        if (!counts) {
            return false;
        }
        log->traffic = counts;
        log->capacity = larger;
    }
    log->mark[log->nmark] = (struct recorded_mark){time_ns, at};
    memcpy(&log->traffic[log->nmark * log->nbus], traffic, log->nbus * sizeof *traffic);
    log->nmark++;
    return true;
}

/* Reads every line once and sets the marks. traffic has nbus entries, all zero. */
static enum error_code log_make_marks(struct recorded_log *log, const char *path,
                                      struct recorded_traffic *traffic, struct error *error)
{
    size_t at = 0, begin = 0, line = 0, bus;
    struct bus_frame frame;
    struct error reason;
    char name[16];
    int read;

    for (; (read = log_read_line(log, &at, name, &frame, &reason)); begin = at) {
        line++;
        if (read < 0) {
            return error_set(error, ERROR_INPUT, "%s:%zu: %s", path, line, reason.text);
        }
        if (line == 1) {
            log->first_ns = log->last_ns = frame.time_ns;
        }
        if ((line == 1 || frame.time_ns - log->mark[log->nmark - 1].time_ns >= RECORDED_MARK_NS) &&
            !log_add_mark(log, frame.time_ns, begin, traffic)) {
            return error_set(error, ERROR_MEMORY, "no memory left for the frames of the recording");
        }
        log->last_ns = frame.time_ns > log->last_ns ? frame.time_ns : log->last_ns;
        bus = log_find_bus(log, name);
        if (bus == log->nbus) {
            log->strange++;
        } else {
            traffic[bus].frames++;
            traffic[bus].bits += frame_bits(&frame);
        }
    }
    return ERROR_NONE;
}

enum error_code recorded_log_open(const char *path, const char *const *bus, size_t nbus,
                                  struct recorded_log *log, struct error *error)
{
    struct recorded_traffic *traffic = calloc(nbus + 1, sizeof *traffic);
    enum error_code code;

    *log = (struct recorded_log){.bus = bus, .nbus = nbus};
    code = traffic ? recorded_file_open(path, &log->file, error)
                   : error_set(error, ERROR_MEMORY, "no memory left for the recording");
    code = code ? code : log_make_marks(log, path, traffic, error);
    free(traffic);
    return code;
}

void recorded_log_close(struct recorded_log *log)
{
    recorded_file_close(&log->file);
    free(log->mark);
    free(log->traffic);
    log->mark = NULL;
    log->traffic = NULL;
    log->nmark = log->capacity = 0;
}

/* Finds the last mark at or before a time, or the first mark; 0 when there are none. */
static size_t log_find_mark(const struct recorded_log *log, int64_t time_ns)
{
    size_t low = 0, high = log->nmark;

    while (low < high) {
        size_t middle = low + (high - low) / 2;

        if (log->mark[middle].time_ns <= time_ns) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low > 0 ? low - 1 : 0;
}

bool recorded_log_next(const struct recorded_log *log, size_t *at, size_t *bus,
                       struct bus_frame *frame)
{
    struct error reason;
    char name[16];
    int read;

    while ((read = log_read_line(log, at, name, frame, &reason))) {
        *bus = read > 0 ? log_find_bus(log, name) : log->nbus;
        if (*bus < log->nbus) {
            return true;
        }
    }
    return false;
}

size_t recorded_log_find(const struct recorded_log *log, int64_t time_ns)
{
    size_t at = log->nmark > 0 ? log->mark[log_find_mark(log, time_ns)].at : 0, next = at, bus;
    struct bus_frame frame;

    while (recorded_log_next(log, &next, &bus, &frame) && frame.time_ns < time_ns) {
        at = next;
    }
    return at;
}

void recorded_log_count(const struct recorded_log *log, int64_t time_ns,
                        struct recorded_traffic *traffic)
{
    size_t mark = log_find_mark(log, time_ns), at, bus;
    struct bus_frame frame;

    memset(traffic, 0, log->nbus * sizeof *traffic);
    if (log->nmark == 0) {
        return;
    }
    memcpy(traffic, &log->traffic[mark * log->nbus], log->nbus * sizeof *traffic);
    at = log->mark[mark].at;
    while (recorded_log_next(log, &at, &bus, &frame) && frame.time_ns <= time_ns) {
        traffic[bus].frames++;
        traffic[bus].bits += frame_bits(&frame);
    }
}
