/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A file of the recorder: written in whole lines, or in whole records, and ended rather than
 * corrupted when the disk does not accept them (recorder.h says what is guaranteed). One thread
 * opens, writes and closes it; another may read what is marked. Not RT-safe.
 */
#ifndef RT_RECORDING_LINE_FILE_H
#define RT_RECORDING_LINE_FILE_H

#include "base/arena.h"
#include "base/error.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LINE_FILE_PATH = 4096 };

struct line_file {
    char path[LINE_FILE_PATH];
    int descriptor; /* -1 = ended */
    bool regular;
    bool records; /* it holds records, not lines: no part of one stays in the file */
    char *buffer; /* whole lines */
    size_t capacity, used;
    size_t taken;           /* bytes of the buffer that the system has accepted */
    int64_t size;           /* bytes accepted before the buffer */
    uint64_t lines;         /* in the file */
    uint64_t unwritten;     /* lines that were put and are not in the file */
    _Atomic uint64_t *beat; /* counts what the system accepts */
    atomic_bool moved;      /* any thread: the file was renamed */
    atomic_bool ended;      /* any thread: nothing is written any more; error has the reason */
    struct error error;
};

/* Creates or truncates directory/name and writes the title. longest: bytes of the longest line. A
 * pipe needs a reader: ERROR_SYSTEM. A symbolic link to a file is refused: ERROR_INPUT. Memory from
 * arena. */
enum error_code line_file_open(struct line_file *file, const char *directory, const char *name,
                               const char *title, size_t longest, _Atomic uint64_t *beat,
                               struct arena *arena, struct error *error);

/* Appends one line with its newline, or one record. A full buffer is written to the file first. */
void line_file_put(struct line_file *file, const char *line, size_t size);

/* Writes the buffer to the file. */
void line_file_flush(struct line_file *file);

/* Checks whether the file still exists under its name. */
void line_file_look(struct line_file *file);

/* Ends the file of a cancelled writing thread with what the system has accepted. */
void line_file_abandon(struct line_file *file);

/* Flushes and closes. */
void line_file_close(struct line_file *file);

/* Closes and removes the file; a pipe or device is not removed. */
void line_file_remove(struct line_file *file);

#endif
