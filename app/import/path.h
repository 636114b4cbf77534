/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Resolves file names in a robot file: meshes, and included MJCF files. An untrusted robot file may
 * only name files in its own folder and subfolders; symbolic links to other files are refused. The
 * user may trust the file. Names are never passed to a shell. Not RT-safe.
 */
#ifndef APP_IMPORT_PATH_H
#define APP_IMPORT_PATH_H

#include "base/arena.h"
#include "base/error.h"

#include <limits.h>
#include <stdbool.h>

enum import_path { IMPORT_PATH_FOUND, IMPORT_PATH_MISSING, IMPORT_PATH_OUTSIDE };

/* Resolves a file name relative to the folder `from`. Both folders are absolute, without symbolic
 * links ("" for "/"). Without trust, a path outside `inside` gives OUTSIDE, whether or not the file
 * exists. Only a regular file gives FOUND. */
enum import_path import_resolve_path(const char *inside, const char *from, const char *name,
                                     bool trust, char path[PATH_MAX]);

/* Finds a user's own file that an import copies. kind: "drive" or "protocol"; the copy is in the
 * folder of that kind. *path receives the absolute path, *written the name of the copy in a robot
 * or rig file; NULL = no memory. expected: for the error that the file is missing. */
enum error_code import_find_own_file(const char *kind, const char *name, const char *expected,
                                     struct arena *arena, const char **path, const char **written,
                                     struct error *error);

/* Finds the folder of an existing file, absolute and without symbolic links. Returns false and sets
 * errno on failure. */
bool import_find_folder(const char *file, char folder[PATH_MAX]);

#endif
