/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A stream into memory that reports when memory runs out. The C library's open_memstream counts
 * lost bytes as written, so a text with gaps looks complete. Here every write after the first lost
 * byte fails, and memory_file_close returns the error. Not RT-safe.
 */
#ifndef BASE_MEMORY_FILE_H
#define BASE_MEMORY_FILE_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct memory_file {
    char *text; /* on the heap, zero-terminated; the caller frees it after memory_file_close */
    size_t size, capacity;
    bool failed;
};

/* Opens a stream that appends to *memory. *memory must outlive the stream. Returns NULL if no
 * memory is left. */
FILE *memory_file_open(struct memory_file *memory);

/* Closes the stream. If output was lost, returns ERROR_MEMORY ("no memory left for WHAT") and sets
 * memory->text to NULL. `what` names the output in the message. */
enum error_code memory_file_close(FILE *file, struct memory_file *memory, const char *what,
                                  struct error *error);

#endif
