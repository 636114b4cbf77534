/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A file that is complete or not there at all: written under a random name in the same folder and
 * renamed at the end, so that a full disk or an interrupt leaves the previous file as it was. A
 * symbolic link of that name is replaced, not followed, and the file is never writable by others.
 * A pipe or a device of characters (a terminal, /dev/null) is written in place, also through a link
 * that belongs to this user or to root. Not RT-safe.
 */
#ifndef BASE_WHOLE_FILE_H
#define BASE_WHOLE_FILE_H

#include "base/error.h"

#include <stdbool.h>
#include <stdio.h>

enum { WHOLE_FILE_NAME = 48 };

struct whole_file {
    FILE *out; /* write here */
    const char *path;
    int folder;                    /* that of the path, as it was when the file was opened */
    char partial[WHOLE_FILE_NAME]; /* name in the folder until the file is whole */
    bool in_place;
};

/* Path must outlive the file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes the file and gives it its name, once its content is on the disk. With code, the error of
 * whoever produced the content, or when writing failed, the previous file stays instead. Returns
 * the first of these errors. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

#endif
