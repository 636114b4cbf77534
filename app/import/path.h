/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Resolves file names in a robot file: meshes, and included files of MJCF. An untrusted robot file
 * may only name files in its own folder and subfolders, also not others through symbolic links; the
 * user may trust the file. Names are never passed to a shell. Not RT-safe.
 */
#ifndef APP_IMPORT_PATH_H
#define APP_IMPORT_PATH_H

#include <limits.h>
#include <stdbool.h>

enum import_path { IMPORT_PATH_FOUND, IMPORT_PATH_MISSING, IMPORT_PATH_OUTSIDE };

/* Resolves a name from a file in the folder `from`. Both folders are absolute, without symbolic
 * links ("" for "/"). Without trust, a path outside `inside` is OUTSIDE, whether or not it exists.
 * Only regular files are FOUND. */
enum import_path import_resolve_path(const char *inside, const char *from, const char *name,
                                     bool trust, char path[PATH_MAX]);

/* Finds the folder of an existing file, absolute and without symbolic links; returns false with
 * errno on failure. */
bool import_find_folder(const char *file, char folder[PATH_MAX]);

#endif
