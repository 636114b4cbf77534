/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes files and folders that a person names. Protects against objects that another user has put
 * at the same path.
 *
 * A whole file is complete or does not exist. It is written under a random name in the same folder,
 * and renamed at the end. A full disk or an interrupt thus leaves the previous file unchanged. The
 * rename replaces a symbolic link of this name and does not follow it. Other users can never write
 * the file.
 *
 * A pipe or a character device (a terminal, /dev/null) is written in place. A symbolic link to it
 * is followed if the link belongs to this user or root. A pipe without a reader is an error. A file
 * that this process has read (base/input_file.h) is not overwritten. Not RT-safe.
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
    int folder;                    /* descriptor of the file's folder */
    char partial[WHOLE_FILE_NAME]; /* temporary name in this folder */
    bool in_place;
};

/* Opens a file that appears under its name when it is complete. `path` must outlive *file. */
enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error);

/* Closes the file, writes its content to the disk, and renames it. The previous file stays if
 * `code` is an error of the caller, or if writing failed. Returns the first of these errors. */
enum error_code whole_file_close(struct whole_file *file, enum error_code code,
                                 struct error *error);

/* Checks whether whole_file_open would succeed; call it before a long computation. Changes nothing.
 * Does not check whether a pipe has a reader. */
enum error_code whole_file_probe(const char *path, struct error *error);

/* Opens a file under its final name, for a file that others read while it grows, such as a log.
 * Removes an existing file first, so that its owner or a hard link cannot share the new file.
 * Refuses a symbolic link to a file. Writes a pipe or a device in place, like whole_file_open. The
 * caller closes the descriptor. */
enum error_code growing_file_open(const char *path, int *descriptor, struct error *error);

/* Declares a folder that this process will make or fill. `given`: number of leading bytes of its
 * path that a person gave. In the rest of the path and inside the folder, the functions of this
 * header follow no symbolic link. They refuse a link in place of a folder (ERROR_INPUT). A second
 * call replaces the first. Call it before threads start. */
void folder_enclose(const char *path, size_t given);

/* Makes a folder that others can read but not write. An existing folder is used unchanged. A
 * symbolic link of another user is ERROR_INPUT. The parent folder must exist. *made: true if the
 * folder is new; `made` may be NULL. */
enum error_code folder_make(const char *path, bool *made, struct error *error);

/* Does the same as folder_make, and makes missing parent folders. */
enum error_code folder_make_all(const char *path, struct error *error);

/* Removes a folder of this process with its contents, as far as possible. */
void folder_remove(const char *path);

#endif
