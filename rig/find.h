/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds an installed rig by name: coman-hil run coman. Not RT-safe.
 */
#ifndef RIG_FIND_H
#define RIG_FIND_H

#include "base/arena.h"
#include "base/error.h"

#include <limits.h>

/* Finds the path of a rig. A name with a slash or a dot is a path already; a bare name NAME is
 * the file of that name if there is one, else rigs/NAME.yaml in /etc/coman-hil, else the one
 * installed with this program. ERROR_INPUT names the places searched. */
enum error_code rig_locate(const char *name, char path[PATH_MAX], struct error *error);

/* The same with the folders given, for tests; installed may be "". */
enum error_code rig_locate_in(const char *name, const char *local, const char *installed,
                              char path[PATH_MAX], struct error *error);

/* Finds the rig that the file `from` names, to extend or to run it: as rig_locate, but never a
 * file of the working directory, and not `from` itself, so that the coman.yaml of /etc/coman-hil
 * may extend the installed one. The path lives in arena. */
enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error);

#endif
