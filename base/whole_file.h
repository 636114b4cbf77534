/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A file that is there whole or not at all: written as PATH.part and given its name at the end, so
 * that a full disk or an interrupt leaves what was there before. What is no regular file (a pipe, a
 * terminal) is written in place. Not RT-safe.
 */
#ifndef BASE_WHOLE_FILE_H
#define BASE_WHOLE_FILE_H

#include "base/error.h"

#include <stdbool.h>
#include <stdio.h>

enum { WHOLE_FILE_PATH = 4096 };

struct whole_file {
    FILE *out; /* write here */
    const char *path;
    char partial[WHOLE_FILE_PATH];
    bool in_place;
};

/* path must outlive the file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes it. code: of what was written; when that or the writing has failed nothing is left but
 * what was there before, and the first error is returned. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

#endif
