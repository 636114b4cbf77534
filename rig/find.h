/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Where a rig is when it is called by its name: coman-hil run coman. Not RT-safe.
 */
#ifndef RIG_FIND_H
#define RIG_FIND_H

#include "base/arena.h"
#include "base/error.h"

#include <limits.h>

/* Writes the path of a rig. What has a slash or a dot in it is a path already; a bare name NAME is the
 * file of that name if there is one, else rigs/NAME.yaml in /etc/coman-hil, else the one that was
 * installed with this program. The error names the places looked at. */
enum error_code rig_locate(const char *name, char path[PATH_MAX], struct error *error);

/* The same with the folders given, for tests; installed may be "". */
enum error_code rig_locate_in(const char *name, const char *local, const char *installed,
                              char path[PATH_MAX], struct error *error);

/* The path of a rig that the file from calls by its bare name NAME, to extend or to run it: as
 * rig_locate, but never a file of the present folder, and not from itself, so that the coman.yaml of
 * /etc/coman-hil may extend the installed one. The path lives in arena. */
enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error);

#endif
