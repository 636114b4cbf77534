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

/* Opens a regular file for reading. The caller closes the descriptor. *size is in bytes; `size` may
 * be NULL. Errors begin with the path: ERROR_INPUT (no such file, not a regular file),
 * ERROR_SYSTEM. */
enum error_code input_file_open(const char *path, int *descriptor, size_t *size,
                                struct error *error);

/* Does the same as input_file_open and makes a stream. The caller closes it. NULL after an
 * error. */
enum error_code input_file_stream(const char *path, FILE **file, struct error *error);

/* Reads a whole file of at most `most` bytes. A larger file is ERROR_INPUT, before any memory is
 * allocated. *text ends with a zero byte, and the caller frees it. *text is NULL after an error. */
enum error_code input_file_load(const char *path, size_t most, char **text, size_t *size,
                                struct error *error);

/* Checks an output to `path`, where `there` describes the present file. Refuses it (ERROR_INPUT) if
 * this process has read the same file, under any name. */
enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error);

#endif
