/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Resolves the files that a robot file names: meshes, and further files of MJCF. A robot file from
 * a stranger may name files of its own folder and of the folders in it, and no other, also not by a
 * symbolic link; the user may trust the file. No name reaches a shell. Not RT-safe.
 */
#ifndef APP_IMPORT_PATH_H
#define APP_IMPORT_PATH_H

#include <limits.h>
#include <stdbool.h>

enum import_path { IMPORT_PATH_FOUND, IMPORT_PATH_MISSING, IMPORT_PATH_OUTSIDE };

/* Resolves a name that a file in the folder `from` contains; both folders are absolute, without
 * symbolic links ("" for "/"). Without trust, a path outside `inside` is OUTSIDE whether it is
 * there or not. Only regular files are FOUND. */
enum import_path import_resolve_path(const char *inside, const char *from, const char *name,
                                     bool trust, char path[PATH_MAX]);

/* Finds the folder of an existing file, absolute and without symbolic links; false with errno. */
bool import_find_folder(const char *file, char folder[PATH_MAX]);

#endif
