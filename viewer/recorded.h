/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of a recording (rt/recording/recorder.h) for playing it back: rows of signals.csv and
 * poses.csv and frames of candump.log by their time, read where they are needed, so that a long
 * recording opens as fast as its lines can be counted. The files are mapped and must not be cut
 * short while they are open; what is appended later is not seen, and a line without its end, as a
 * run that was killed leaves it, counts as none. Times in ns, virtual. Not RT-safe.
 */
#ifndef VIEWER_RECORDED_H
#define VIEWER_RECORDED_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- a file ---- */

struct recorded_file {
    const char *data; /* NULL = not open, or empty */
    size_t size;
};

/* Maps a file. ERROR_INPUT for what is not there or no regular file; ERROR_SYSTEM. */
enum error_code recorded_file_open(const char *path, struct recorded_file *file,
                                   struct error *error);
void recorded_file_close(struct recorded_file *file); /* safe on a zeroed struct */

/* ---- rows ---- */

enum { RECORDED_COLUMNS = 8192, RECORDED_TITLE = 128 };

struct recorded_row {
    int64_t time_ns;
    size_t at; /* of its first cell behind the time, in the file */
};

struct recorded_table {
    struct recorded_file file;
    const char **title; /* of the columns behind time_s; from the arena */
    size_t ncolumn;
    struct recorded_row *row; /* in the order of time; on the heap */
    size_t nrow;
};

/* Opens titles and rows. A file without titles or without a row, or whose times do not grow, is
 * ERROR_INPUT with file:line; close in any case. */
enum error_code recorded_table_open(const char *path, struct arena *arena,
                                    struct recorded_table *table, struct error *error);
void recorded_table_close(struct recorded_table *table); /* safe on a zeroed struct */

/* Finds the last row at or before a time, or the first row. */
size_t recorded_table_find(const struct recorded_table *table, int64_t time_ns);

/* Reads the first count columns of a row; a cell that is missing or no number is NAN. The value
 * of a column that is not wanted (NULL = all are) stays as it was: finding a number's end takes
 * a tenth of the time of parsing it. */
void recorded_table_read(const struct recorded_table *table, size_t row, size_t count,
                         const bool *wanted, double *value);

/* ---- frames ---- */

#define RECORDED_MARK_NS INT64_C(100000000)

/* A mark in the log: where it goes on at a moment. */
struct recorded_mark {
    int64_t time_ns;
    size_t at;
};

struct recorded_traffic {
    uint64_t frames, bits;
};

struct recorded_log {
    struct recorded_file file;
    const char *const *bus; /* borrowed: names in the log */
    size_t nbus;
    int64_t first_ns, last_ns;
    struct recorded_mark *mark;       /* one every RECORDED_MARK_NS at least */
    struct recorded_traffic *traffic; /* at each mark, of each bus */
    size_t nmark, capacity;
    uint64_t strange; /* frames of other names */
};

/* Opens a log. ERROR_INPUT with file:line where a line is none of `candump -L`; close in any
 * case. */
enum error_code recorded_log_open(const char *path, const char *const *bus, size_t nbus,
                                  struct recorded_log *log, struct error *error);
void recorded_log_close(struct recorded_log *log); /* safe on a zeroed struct */

/* Finds where the frames at and after a time begin. */
size_t recorded_log_find(const struct recorded_log *log, int64_t time_ns);

/* Reads the next frame of a known bus from *at on, which moves behind it; false = the end. */
bool recorded_log_next(const struct recorded_log *log, size_t *at, size_t *bus,
                       struct bus_frame *frame);

/* Counts what each bus has carried up to a time: from the mark before it on, frame by frame.
 * traffic has nbus entries. */
void recorded_log_count(const struct recorded_log *log, int64_t time_ns,
                        struct recorded_traffic *traffic);

#endif
