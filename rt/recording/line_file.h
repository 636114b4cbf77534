/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A file of the recorder that always ends with a whole line or record. When the disk refuses data
 * the file ends early and stays valid (recorder.h lists the guarantees). One thread opens, writes
 * and closes it. Another thread may read only the fields marked "any thread". Not RT-safe.
 */
#ifndef RT_RECORDING_LINE_FILE_H
#define RT_RECORDING_LINE_FILE_H

#include "base/arena.h"
#include "base/error.h"

#include <stdatomic.h>
#include <stdint.h>

enum { LINE_FILE_PATH = 4096 };

struct line_file {
    char path[LINE_FILE_PATH];
    int descriptor; /* -1 = the file has ended */
    bool regular;
    bool records; /* holds records, not lines; a partial record is always cut off */
    char *buffer; /* whole lines */
    size_t capacity, used;
    size_t taken;           /* bytes of the buffer already in the file */
    int64_t size;           /* bytes of the file before the buffer */
    uint64_t lines;         /* lines in the file */
    uint64_t unwritten;     /* lines accepted by line_file_put but missing in the file */
    _Atomic uint64_t *beat; /* counts successful writes */
    atomic_bool moved;      /* any thread: the file was renamed */
    atomic_bool ended;      /* any thread: no further writes; `error` has the reason */
    struct error error;
};

/* Creates or truncates directory/name and writes the title line. longest: bytes of the longest
 * line. ERROR_SYSTEM for a pipe without a reader, ERROR_INPUT for a symbolic link to a file. Memory
 * from arena. */
enum error_code line_file_open(struct line_file *file, const char *directory, const char *name,
                               const char *title, size_t longest, _Atomic uint64_t *beat,
                               struct arena *arena, struct error *error);

/* Appends one line with its newline, or one record. A full buffer is written to the file first. */
void line_file_put(struct line_file *file, const char *line, size_t size);

/* Writes the buffer to the file. */
void line_file_flush(struct line_file *file);

/* Checks whether the file still has its name. If it was removed, ends it. If it was renamed, sets
 * `moved`. */
void line_file_look(struct line_file *file);

/* Ends the file after its writing thread was cancelled. Keeps the bytes already written. */
void line_file_abandon(struct line_file *file);

/* Flushes and closes. */
void line_file_close(struct line_file *file);

/* Closes and removes the file; a pipe or device is not removed. */
void line_file_remove(struct line_file *file);

#endif
