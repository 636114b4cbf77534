/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Files that a robot file names: meshes, and further files of MJCF. What a stranger wrote may name
 * files of its own folder and of the folders in it, and no other, also not by a symbolic link; the
 * user may trust the file. No name reaches a shell. Not RT-safe.
 */
#ifndef APP_IMPORT_PATH_H
#define APP_IMPORT_PATH_H

#include <limits.h>
#include <stdbool.h>

enum import_path { IMPORT_PATH_FOUND, IMPORT_PATH_MISSING, IMPORT_PATH_OUTSIDE };

/* Where a name leads that a file in the folder `from` has; both folders are absolute, without links
 * ("" for "/"). Without trust, what is outside `inside` is OUTSIDE whether it is there or not. Only
 * regular files are FOUND. */
enum import_path import_resolve_path(const char *inside, const char *from, const char *name,
                                     bool trust, char path[PATH_MAX]);

/* The folder of a file that is there, for import_resolve_path. */
bool import_find_folder(const char *file, char folder[PATH_MAX]);

#endif
