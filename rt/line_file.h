/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A text file of the recorder's: written in whole lines, and ended rather than damaged when the disk
 * does not take them (see recorder.h for what is promised). One thread opens, writes and closes it;
 * what is marked may be read by another one. Not RT-safe.
 */
#ifndef RT_LINE_FILE_H
#define RT_LINE_FILE_H

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
    char *buffer; /* whole lines */
    size_t capacity, used;
    size_t taken;           /* of the buffer, by the system */
    int64_t size;           /* taken before the buffer */
    uint64_t lines;         /* in the file */
    uint64_t unwritten;     /* lines that were put and are not in the file */
    _Atomic uint64_t *beat; /* moves with everything that the system takes */
    atomic_bool moved;      /* any thread: it has another name now */
    atomic_bool ended;      /* any thread: nothing is written to it any more; error says why */
    struct error error;
};

/* Makes or empties directory/name and writes the title. longest: bytes of the longest line. A pipe
 * needs somebody who reads it. */
enum error_code line_file_open(struct line_file *file, const char *directory, const char *name,
                               const char *title, size_t longest, _Atomic uint64_t *beat,
                               struct arena *arena, struct error *error);

/* Takes one line, with its newline. */
void line_file_put(struct line_file *file, const char *line, size_t size);

/* Gives the system what was put. */
void line_file_flush(struct line_file *file);

/* Looks whether the file still has its name. */
void line_file_look(struct line_file *file);

/* In the place of a thread that was ended while it wrote: ends the file with what the system has
 * taken. */
void line_file_abandon(struct line_file *file);

/* Flushes and closes. */
void line_file_close(struct line_file *file);

/* Closes it, if it is open, and removes it, if it was opened; what is no regular file stays. */
void line_file_remove(struct line_file *file);

#endif
