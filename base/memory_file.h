/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A stream into memory that says so when memory runs out: as open_memstream, whose stream takes
 * what does not fit for written and shows no error, so that a text with holes looks whole. What is
 * written here fails from the first byte that found no memory, and memory_file_close says so. Not
 * RT-safe.
 */
#ifndef BASE_MEMORY_FILE_H
#define BASE_MEMORY_FILE_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct memory_file {
    char *text; /* of the heap, ends in a zero; the caller's to free, at any time after close */
    size_t size, capacity;
    bool failed;
};

/* A stream that appends to *memory, which must outlive it; NULL when there is no memory. */
FILE *memory_file_open(struct memory_file *memory);

/* Closes the stream. ERROR_MEMORY ("no memory left for WHAT") when not all that was written is in
 * memory->text, which then is NULL. what stands in the message. */
enum error_code memory_file_close(FILE *file, struct memory_file *memory, const char *what,
                                  struct error *error);

#endif
