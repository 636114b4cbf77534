/* SPDX-License-Identifier: Apache-2.0 */
/* Reads a recording. An index has the time and position of each row; cells are parsed on demand.
 * For the log of frames, marks store positions and traffic at regular times. */
#include "viewer/recorded.h"

#include "base/input_file.h"
#include "base/text.h"
#include "canbus/candump.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define TIME_MAX_S 9e9 /* seconds that fit into int64_t ns */

/* ---- a file ---- */

enum error_code recorded_file_open(const char *path, struct recorded_file *file,
                                   struct error *error)
{
    void *data = MAP_FAILED;
    size_t size;
    int descriptor;
    enum error_code code = input_file_open(path, &descriptor, &size, error);

    *file = (struct recorded_file){.data = NULL};
    if (code) {
        return code;
    }
    if (size > 0) {
        data = mmap(NULL, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    close(descriptor);
    if (size > 0 && data == MAP_FAILED) {
        return error_set_errno(error, errno, "cannot map %s", path);
    }
    file->data = size > 0 ? data : NULL;
    file->size = size;
    return ERROR_NONE;
}

void recorded_file_close(struct recorded_file *file)
{
    if (file->data) {
        munmap((void *)(uintptr_t)file->data, file->size);
    }
    *file = (struct recorded_file){.data = NULL};
}

/* ---- titles ---- */

/* Returns the end of the line that begins at an offset; NULL = the line has no end. */
static const char *table_line_end(const struct recorded_table *table, size_t at)
{
    return at < table->file.size ? memchr(table->file.data + at, '\n', table->file.size - at)
                                 : NULL;
}

/* Reads the titles after time_s; returns the offset of the rows, 0 = no titles. */
static size_t table_read_titles(struct recorded_table *table, struct arena *arena)
{
    const char *end = table_line_end(table, 0), *at = end ? table->file.data : NULL;

    if (!end || (size_t)(end - at) < 6 || memcmp(at, "time_s", 6) != 0) {
        return 0;
    }
    table->title = arena_alloc(arena, RECORDED_COLUMNS, sizeof *table->title);
    for (at += 6; table->title && at < end && *at == ','; table->ncolumn++) {
        const char *next = memchr(at + 1, ',', (size_t)(end - at - 1));
        char title[RECORDED_TITLE];
        size_t size;

        next = next ? next : end;
        size = (size_t)(next - at - 1);
        if (table->ncolumn == RECORDED_COLUMNS || size == 0 || size >= sizeof title) {
            return 0;
        }
        memcpy(title, at + 1, size);
        title[size] = '\0';
        table->title[table->ncolumn] = arena_strdup(arena, title);
        if (!table->title[table->ncolumn]) {
            return 0;
        }
        at = next;
    }
    return table->title && at == end ? (size_t)(end - table->file.data) + 1 : 0;
}

/* ---- rows ---- */

/* Parses the cell at an address, up to a comma or the line's end. Returns NAN for other text. */
static double table_parse_cell(const char *at)
{
    char *rest;
    double value;

    /* strtod would skip a line end and read the next line's number */
    if (*at == ',' || *at == '\n' || *at == ' ' || *at == '\r' || *at == '\t') {
        return NAN;
    }
    value = strtod(at, &rest);
    return rest > at && (*rest == ',' || *rest == '\n' || *rest == '\r') ? value : (double)NAN;
}

/* Appends a row to the index, which grows by doubling. */
static enum error_code table_add_row(struct recorded_table *table, size_t *capacity,
                                     struct recorded_row row, struct error *error)
{
    if (table->nrow == *capacity) {
        size_t larger = *capacity ? 2 * *capacity : 4096;
        struct recorded_row *rows = realloc(table->row, larger * sizeof *rows);

        if (!rows) {
            return error_set(error, ERROR_MEMORY, "no memory left for the rows of the recording");
        }
        table->row = rows;
        *capacity = larger;
    }
    table->row[table->nrow++] = row;
    return ERROR_NONE;
}

/* Indexes all rows by time; times must not decrease. */
static enum error_code table_read_rows(struct recorded_table *table, const char *path, size_t at,
                                       struct error *error)
{
    size_t capacity = 0, line = 2;
    const char *end;

    for (; (end = table_line_end(table, at)); at = (size_t)(end - table->file.data) + 1, line++) {
        const char *begin = table->file.data + at;
        const char *comma = memchr(begin, ',', (size_t)(end - begin));
        double time_s = table_parse_cell(begin);
        struct recorded_row row = {.at = (size_t)((comma ? comma : end) - table->file.data)};

        if (!(fabs(time_s) < TIME_MAX_S)) {
            return error_set(error, ERROR_INPUT, "%s:%zu: expected a time in seconds first", path,
                             line);
        }
        row.time_ns = llround(time_s * 1e9);
        if (table->nrow > 0 && row.time_ns < table->row[table->nrow - 1].time_ns) {
            return error_set(error, ERROR_INPUT,
                             "%s:%zu: found a time before that of the last row, expected them in "
                             "order",
                             path, line);
        }
        if (table_add_row(table, &capacity, row, error)) {
            return error->code;
        }
    }
    return table->nrow > 0
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s: found no row, expected a recording of at least one", path);
}

enum error_code recorded_table_open(const char *path, struct arena *arena,
                                    struct recorded_table *table, struct error *error)
{
    enum error_code code;
    size_t begin;

    *table = (struct recorded_table){.row = NULL};
    code = recorded_file_open(path, &table->file, error);
    if (code) {
        return code;
    }
    begin = table_read_titles(table, arena);
    if (begin == 0) {
        return error_set(error, ERROR_INPUT,
                         "%s:1: found no titles, expected those of a recording: time_s,...", path);
    }
    return table_read_rows(table, path, begin, error);
}

void recorded_table_close(struct recorded_table *table)
{
    recorded_file_close(&table->file);
    free(table->row);
    table->row = NULL;
    table->nrow = 0;
}

/* Finds the last of `count` rows at or before a time. Returns 0 if there is none. */
static size_t rows_find(const struct recorded_row *row, size_t count, int64_t time_ns)
{
    size_t low = 0, high = count;

    /* Rows before low are at or before the time; rows from high on are after it */
    while (low < high) {
        size_t middle = low + (high - low) / 2;

        if (row[middle].time_ns <= time_ns) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low > 0 ? low - 1 : 0;
}

size_t recorded_table_find(const struct recorded_table *table, int64_t time_ns)
{
    return rows_find(table->row, table->nrow, time_ns);
}

void recorded_table_read(const struct recorded_table *table, size_t row, size_t count,
                         const bool *wanted, double *value)
{
    const char *at = table->file.data + table->row[row].at;

    for (size_t i = 0; i < count; i++) {
        if (!wanted || wanted[i]) {
            value[i] = *at == ',' ? table_parse_cell(at + 1) : (double)NAN;
        }
        if (*at == ',') {
            for (at++; *at != ',' && *at != '\n'; at++) {
            }
        }
    }
}

/* Parses the line at *at and moves *at behind the line. Returns 1 for a frame, 0 at the end of the
 * log, -1 for other text. */
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
    const int bus = TEXT_INDEX(log->bus, log->nbus, name);

    return bus < 0 ? log->nbus : (size_t)bus;
}

/* Adds a mark: a time, the position of the log, and each bus's traffic up to there. Returns false
 * without memory. */
static bool log_add_mark(struct recorded_log *log, int64_t time_ns, size_t at,
                         const struct recorded_traffic *traffic)
{
    if (log->nmark == log->capacity) {
        size_t larger = log->capacity ? 2 * log->capacity : 1024;
        struct recorded_row *mark = realloc(log->mark, larger * sizeof *mark);
        struct recorded_traffic *counts =
            mark ? realloc(log->traffic, larger * (log->nbus + 1) * sizeof *counts) : NULL;

        log->mark = mark ? mark : log->mark;
        if (!counts) {
            return false;
        }
        log->traffic = counts;
        log->capacity = larger;
    }
    log->mark[log->nmark] = (struct recorded_row){time_ns, at};
    memcpy(&log->traffic[log->nmark * log->nbus], traffic, log->nbus * sizeof *traffic);
    log->nmark++;
    return true;
}

/* Reads each line once and sets the marks. traffic has nbus entries, all zero. */
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
    size_t at = log->nmark > 0 ? log->mark[rows_find(log->mark, log->nmark, time_ns)].at : 0,
           next = at, bus;
    struct bus_frame frame;

    while (recorded_log_next(log, &next, &bus, &frame) && frame.time_ns < time_ns) {
        at = next;
    }
    return at;
}

void recorded_log_count(const struct recorded_log *log, int64_t time_ns,
                        struct recorded_traffic *traffic)
{
    size_t mark = rows_find(log->mark, log->nmark, time_ns), at, bus;
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
