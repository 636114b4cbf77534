/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads the files of a recording (rt/recording/recorder.h) for playback: rows of signals.csv and
 * poses.csv, and frames of candump.log, by time. Data are parsed on demand, so that opening a long
 * recording takes only the time to count its lines. The files are mapped and must not be truncated
 * while they are open. Data appended later are ignored. A last line without a line end, from a
 * killed run, is ignored too. Virtual times in ns. Not RT-safe.
 */
#ifndef VIEWER_RECORDED_H
#define VIEWER_RECORDED_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

/* ---- a file ---- */

struct recorded_file {
    const char *data; /* NULL = not open, or empty */
    size_t size;
};

/* Maps a file. ERROR_INPUT if it does not exist or is not a regular file; ERROR_SYSTEM. */
enum error_code recorded_file_open(const char *path, struct recorded_file *file,
                                   struct error *error);
void recorded_file_close(struct recorded_file *file); /* safe on a zeroed struct */

/* ---- rows ---- */

enum { RECORDED_COLUMNS = 8192, RECORDED_TITLE = 128 };

/* A row of a table, or a mark in a log: a time and a position in the file. */
struct recorded_row {
    int64_t time_ns;
    size_t at; /* file offset of the row's first cell after the time, or of the mark's line */
};

struct recorded_table {
    struct recorded_file file;
    const char **title; /* titles of the columns after time_s; in the arena */
    size_t ncolumn;
    struct recorded_row *row; /* ordered by time; on the heap */
    size_t nrow;
};

/* Opens a table and indexes its rows. Returns ERROR_INPUT with file:line if titles or rows are
 * missing, or if times do not increase. Close the table also after an error. */
enum error_code recorded_table_open(const char *path, struct arena *arena,
                                    struct recorded_table *table, struct error *error);
void recorded_table_close(struct recorded_table *table); /* safe on a zeroed struct */

/* Finds the last row at or before a time; the first row if there is none. */
size_t recorded_table_find(const struct recorded_table *table, int64_t time_ns);

/* Reads the first `count` columns of a row; a missing or invalid cell is NAN. wanted: the columns
 * to parse, NULL = all. Other columns keep their values, because skipping a number takes a tenth
 * of the time of parsing it. */
void recorded_table_read(const struct recorded_table *table, size_t row, size_t count,
                         const bool *wanted, double *value);

/* ---- frames ---- */

#define RECORDED_MARK_NS INT64_C(100000000)

struct recorded_traffic {
    uint64_t frames, bits;
};

struct recorded_log {
    struct recorded_file file;
    const char *const *bus; /* borrowed: names of the buses in the log */
    size_t nbus;
    int64_t first_ns, last_ns;
    struct recorded_row *mark;        /* at least one every RECORDED_MARK_NS */
    struct recorded_traffic *traffic; /* traffic of each bus at each mark */
    size_t nmark, capacity;
    uint64_t strange; /* number of frames whose bus is not in bus[] */
};

/* Opens a log. Returns ERROR_INPUT with file:line if a line is not in the format of `candump -L`.
 * Close the log also after an error. */
enum error_code recorded_log_open(const char *path, const char *const *bus, size_t nbus,
                                  struct recorded_log *log, struct error *error);
void recorded_log_close(struct recorded_log *log); /* safe on a zeroed struct */

/* Finds the position of the first frame at or after a time. */
size_t recorded_log_find(const struct recorded_log *log, int64_t time_ns);

/* Reads the next frame of a known bus at or after position *at, and moves *at behind the frame.
 * Returns false at the end. */
bool recorded_log_next(const struct recorded_log *log, size_t *at, size_t *bus,
                       struct bus_frame *frame);

/* Counts the traffic of each bus up to a time. It starts from the last mark before the time.
 * traffic has nbus entries. */
void recorded_log_count(const struct recorded_log *log, int64_t time_ns,
                        struct recorded_traffic *traffic);

#endif
