/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Files that a person names to be read. Only a regular file is taken: a pipe, a device or a socket
 * is refused at once, without a wait for whoever would write into it. No output of the same process
 * replaces a file that was opened here (base/whole_file.h). Not RT-safe.
 */
#ifndef BASE_INPUT_FILE_H
#define BASE_INPUT_FILE_H

#include "base/error.h"

#include <stddef.h>
#include <stdio.h>
#include <sys/stat.h>

/* Opens a regular file for reading; the descriptor is the caller's to close. *size, in bytes, may
 * be NULL. Errors begin with the path: ERROR_INPUT (not there, no regular file), ERROR_SYSTEM. */
enum error_code input_file_open(const char *path, int *descriptor, size_t *size,
                                struct error *error);

/* The same as a stream, which is the caller's to close; NULL after an error. */
enum error_code input_file_stream(const char *path, FILE **file, struct error *error);

/* Reads a whole file of at most `most` bytes, more of which are ERROR_INPUT, before any memory is
 * taken. *text is the caller's to free, NULL after an error, and has a zero byte behind its end. */
enum error_code input_file_load(const char *path, size_t most, char **text, size_t *size,
                                struct error *error);

/* Refuses (ERROR_INPUT) what is to be written to `path` when the file there is one that this
 * process has read, by whatever name. */
enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error);

#endif
