/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A file that is complete or not there at all: written as PATH.part and renamed at the end, so that
 * a full disk or an interrupt leaves the previous file as it was. What is no regular file (a pipe,
 * a terminal) is written in place. Not RT-safe.
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

/* Path must outlive the file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes the file and gives it its name. With code, the error of whoever produced the content, or
 * when writing failed, the previous file stays instead. Returns the first of these errors. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

#endif
