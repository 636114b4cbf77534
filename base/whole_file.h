/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Files and folders that a person asks for, and what a stranger may have put in their place.
 *
 * A whole file is one that is complete or not there at all: written under a random name in the same
 * folder and renamed at the end, so that a full disk or an interrupt leaves the previous file as it
 * was. A symbolic link of that name is replaced, not followed, and the file is never writable by
 * others. A pipe or a device of characters (a terminal, /dev/null) is written in place, also
 * through a link that belongs to this user or to root; a pipe that nobody reads is an error, not a
 * wait. A file that this process has read (base/input_file.h) is not written over. Not RT-safe.
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

/* Opens a file that becomes visible when it is complete. path must outlive the file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes the file and gives it its name, once its content is on the disk. With code, the error of
 * whoever produced the content, or when writing failed, the previous file stays instead. Returns
 * the first of these errors. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

/* Checks whether whole_file_open would succeed, before work that takes long, and leaves what is
 * there as it is. Whether somebody reads a pipe is left open. */
enum error_code whole_file_probe(const char *path, struct error *error);

/* Opens a file that others read while it is written, as a log: under its own name from the start.
 * A file of that name is removed first, so that neither its owner nor another name of it has a part
 * in the new one; a symbolic link to a file is refused. A pipe or a device is written in place, as
 * above. The descriptor is the caller's to close. */
enum error_code growing_file_open(const char *path, int *descriptor, struct error *error);

/* Declares a folder that this process is about to make or fill, and how many bytes of its path a
 * person gave. From there on, down to any folder and file below it, the functions of this header
 * follow no symbolic link, and refuse one (ERROR_INPUT) in place of a folder. Of several calls the
 * last one counts. Call it before threads begin. */
void folder_enclose(const char *path, size_t given);

/* Makes a folder that others can read and cannot write to; one that is there is taken as it is,
 * unless the path is a symbolic link of another user (ERROR_INPUT). *made, which may be NULL, is
 * whether it was not there. The folder above it must be there. */
enum error_code folder_make(const char *path, bool *made, struct error *error);

/* The same with all the folders above it. */
enum error_code folder_make_all(const char *path, struct error *error);

#endif
