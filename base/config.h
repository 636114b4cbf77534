/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds rigs, robots, scenarios, drives and protocols by name (coman-hil run coman), and lists
 * them. A configuration tree has a folder for each kind (rigs, robots, ...) of files NAME.yaml.
 * There are up to three trees, of which the first that has a name wins: /etc/coman-hil,
 * PREFIX/share/coman-hil of a program in PREFIX/bin, and, of a program that was built and not
 * installed, the folder config beside it, a link to the one of the source. Not RT-safe.
 */
#ifndef BASE_CONFIG_H
#define BASE_CONFIG_H

#include "base/arena.h"
#include "base/error.h"

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

enum config_kind {
    CONFIG_RIG,
    CONFIG_ROBOT,
    CONFIG_SCENARIO,
    CONFIG_DRIVE,
    CONFIG_PROTOCOL, /* of boards that a file describes */
    CONFIG_KINDS
};

enum { CONFIG_TREES_MAX = 3 };

/* Folders, the first of which goes before the others; "" is none. */
struct config_trees {
    char folder[CONFIG_TREES_MAX][PATH_MAX];
};

struct config_entry {
    const char *name, *path;
};

/* Finds the path of one of a kind. A name with a slash or a dot is a path already; a bare name
 * NAME is the file of that name if there is one, else NAME.yaml of the first tree that has it.
 * ERROR_INPUT gives the nearest name, or the places that were searched. */
enum error_code config_locate(enum config_kind kind, const char *name, char path[PATH_MAX],
                              struct error *error);

/* The same with the trees given, for tests. */
enum error_code config_locate_in(enum config_kind kind, const char *name,
                                 const struct config_trees *trees, char path[PATH_MAX],
                                 struct error *error);

/* Finds what the file `from` names: as config_locate, but never a file of the working directory,
 * and not `from` itself, so that the coman.yaml of /etc/coman-hil may extend the installed one. The
 * path lives in arena. */
enum error_code config_locate_from(enum config_kind kind, const char *name, const char *from,
                                   struct arena *arena, const char **path, struct error *error);

/* Does the same for a rig, to extend or to run it. */
enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error);

/* Checks whether a file stands in one of the trees: whoever may put it there may also replace
 * the program. A link counts by where it stands, not by what it points to. */
bool config_is_installed(const char *file);

/* The same with the trees given, for tests. */
bool config_is_installed_in(const struct config_trees *trees, const char *file);

/* Lists all of a kind that can be given by name, in the order of their names, each once. The
 * entries live in arena. ERROR_MEMORY; a tree or folder that does not exist has none. */
enum error_code config_list(enum config_kind kind, struct arena *arena,
                            struct config_entry **entries, size_t *count, struct error *error);

/* The same with the trees given, for tests. */
enum error_code config_list_in(enum config_kind kind, const struct config_trees *trees,
                               struct arena *arena, struct config_entry **entries, size_t *count,
                               struct error *error);

#endif
