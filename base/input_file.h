/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Opens files that a person names. Accepts only regular files: a pipe, a device or a socket is
 * refused at once, without waiting for a writer. No output of this process replaces a file that was
 * opened here (base/whole_file.h). Not RT-safe.
 */
#ifndef BASE_INPUT_FILE_H
#define BASE_INPUT_FILE_H

#include "base/error.h"

#include <stddef.h>
#include <stdio.h>
#include <sys/stat.h>

/* Opens a regular file for reading; the caller closes the descriptor. *size, in bytes, may be NULL.
 * Errors begin with the path: ERROR_INPUT (no such file, not a regular file), ERROR_SYSTEM. */
enum error_code input_file_open(const char *path, int *descriptor, size_t *size,
                                struct error *error);

/* Does the same and makes a stream, which the caller closes; NULL after an error. */
enum error_code input_file_stream(const char *path, FILE **file, struct error *error);

/* Reads a whole file of at most `most` bytes; a larger one is ERROR_INPUT before any memory is
 * allocated. *text has a zero byte at its end, and the caller frees it; NULL after an error. */
enum error_code input_file_load(const char *path, size_t most, char **text, size_t *size,
                                struct error *error);

/* Refuses (ERROR_INPUT) an output to `path` when this process has read the file there, by any
 * name. */
enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error);

#endif
