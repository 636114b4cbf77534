/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds rigs, robots, scenarios, drives and protocols by name (coman-hil run coman), and lists
 * them. A configuration tree has a folder for each kind (rigs, robots, ...) with files NAME.yaml.
 * There are up to three trees; the first one with a name wins: /etc/coman-hil;
 * PREFIX/share/coman-hil for a program in PREFIX/bin; and for a built but not installed program the
 * folder config beside it, a link to the source's. Not RT-safe.
 */
#ifndef BASE_CONFIG_H
#define BASE_CONFIG_H

#include "base/arena.h"

#include <limits.h>

enum config_kind {
    CONFIG_RIG,
    CONFIG_ROBOT,
    CONFIG_SCENARIO,
    CONFIG_DRIVE,
    CONFIG_PROTOCOL,   /* protocols of boards that a file describes */
    CONFIG_VALIDATION, /* measured test benches, in the folder `validation` */
    CONFIG_KINDS
};

enum { CONFIG_TREES_MAX = 3 };

/* Folders in order of precedence; "" = none. */
struct config_trees {
    char folder[CONFIG_TREES_MAX][PATH_MAX];
};

struct config_entry {
    const char *name, *path;
};

/* Finds the path of a file of one kind. A name with a slash or a dot is a path. A bare NAME is the
 * file NAME in the working directory if it exists, else NAME.yaml of the first tree that has it.
 * ERROR_INPUT names the nearest name, or the places searched. */
enum error_code config_locate(enum config_kind kind, const char *name, char path[PATH_MAX],
                              struct error *error);

/* Does the same as config_locate in the given trees, for tests. */
enum error_code config_locate_in(enum config_kind kind, const char *name,
                                 const struct config_trees *trees, char path[PATH_MAX],
                                 struct error *error);

/* Finds a file that the file `from` refers to. Works like config_locate, with two differences. It
 * never finds a file of the working directory. It never finds `from` itself, so that
 * /etc/coman-hil's coman.yaml can extend the installed coman.yaml. The path is in arena. */
enum error_code config_locate_from(enum config_kind kind, const char *name, const char *from,
                                   struct arena *arena, const char **path, struct error *error);

/* Does the same as config_locate_from for rigs. */
enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error);

/* Writes the folder of the running program, with room for 64 more bytes; "" if it is unknown. */
void config_program_folder(char folder[PATH_MAX]);

/* Checks whether a file is in one of the trees. A person who can write to a tree could also replace
 * the program. For a symbolic link, the place of the link counts, not its target. */
bool config_is_installed(const char *file);

/* Does the same as config_is_installed with the given trees, for tests. */
bool config_is_installed_in(const struct config_trees *trees, const char *file);

/* Lists all names of a kind in alphabetical order, each once. The entries are in arena. A missing
 * tree or folder counts as empty. Returns ERROR_MEMORY if no memory is left. */
enum error_code config_list(enum config_kind kind, struct arena *arena,
                            struct config_entry **entries, size_t *count, struct error *error);

/* Does the same as config_list with the given trees, for tests. */
enum error_code config_list_in(enum config_kind kind, const struct config_trees *trees,
                               struct arena *arena, struct config_entry **entries, size_t *count,
                               struct error *error);

#endif
