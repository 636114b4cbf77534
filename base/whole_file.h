/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes files and folders that a person names, and protects against objects that another user may
 * have put in their place.
 *
 * A whole file is complete or does not exist. It is written under a random name in the same folder
 * and renamed at the end, so that a full disk or an interrupt leaves the previous file unchanged. A
 * symbolic link of this name is replaced, not followed. The file is never writable by others. A
 * pipe or a character device (a terminal, /dev/null) is written in place, also through a link of
 * this user or root; a pipe without a reader is an error. A file that this process has read
 * (base/input_file.h) is not overwritten. Not RT-safe.
 */
#ifndef BASE_WHOLE_FILE_H
#define BASE_WHOLE_FILE_H

#include "base/error.h"

#include <stdbool.h>
#include <stdio.h>

enum { WHOLE_FILE_NAME = 48 };

struct whole_file {
    FILE *out; /* stream to write to */
    const char *path;
    int folder;                    /* folder of the path when the file was opened */
    char partial[WHOLE_FILE_NAME]; /* temporary name in the folder */
    bool in_place;
};

/* Opens a file that becomes visible when it is complete. path must outlive the file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes the file and renames it after its content is on the disk. If code is an error of the
 * caller, or writing failed, the previous file stays. Returns the first of these errors. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

/* Checks whether whole_file_open would succeed, before long work, and changes nothing. Does not
 * check whether a pipe has a reader. */
enum error_code whole_file_probe(const char *path, struct error *error);

/* Opens a file that others read during writing, such as a log, under its final name. Removes an
 * existing file first, so that neither its owner nor a hard link shares the new one; refuses a
 * symbolic link to a file. Writes a pipe or a device in place, as above. The caller closes the
 * descriptor. */
enum error_code growing_file_open(const char *path, int *descriptor, struct error *error);

/* Declares a folder that this process will make or fill, and how many bytes of its path a person
 * gave. Below these bytes, the functions of this header follow no symbolic link, and refuse one
 * (ERROR_INPUT) in place of a folder. The last call counts. Call it before threads start. */
void folder_enclose(const char *path, size_t given);

/* Makes a folder that others can read but not write. An existing folder is used as it is, unless
 * the path is a symbolic link of another user (ERROR_INPUT). *made (may be NULL): the folder is
 * new. Its parent must exist. */
enum error_code folder_make(const char *path, bool *made, struct error *error);

/* Does the same and makes missing parents. */
enum error_code folder_make_all(const char *path, struct error *error);

#endif
