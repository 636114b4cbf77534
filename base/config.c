/* SPDX-License-Identifier: Apache-2.0 */
/* Finds configuration files by name: in the working directory, in /etc, or in the program's
 * trees. */
#include "base/config.h"

#include "base/text.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { ENTRIES_MAX = 1024, ROOM = 64 };

#define LIST_ARENA ((size_t)16 << 20) /* bytes of reserved address space */

static const char suffix[] = ".yaml";
static const char *const kinds[CONFIG_KINDS] = {"rig",   "robot",    "scenario",
                                                "drive", "protocol", "validation"};
static const char *const folders[CONFIG_KINDS] = {"rigs",   "robots",    "scenarios",
                                                  "drives", "protocols", "validation"};

/* ---- the trees ---- */

void config_program_folder(char folder[PATH_MAX])
{
    ssize_t length = readlink("/proc/self/exe", folder, PATH_MAX - ROOM);
    char *slash;

    folder[length > 0 ? length : 0] = '\0';
    slash = strrchr(folder, '/');
    *(slash ? slash : folder) = '\0';
}

/* Fills in the trees in the order of precedence. */
static void config_find_trees(struct config_trees *trees)
{
    char *installed = trees->folder[1], *built = trees->folder[2], *slash;

    strcpy(trees->folder[0], "/etc/coman-hil");

    /* For a program PREFIX/bin/NAME: PREFIX/share/coman-hil, and the folder config beside NAME */
    config_program_folder(built);
    strcpy(installed, built);
    slash = strrchr(installed, '/');
    strcpy(slash ? slash : installed, slash ? "/share/coman-hil" : "");
    strcat(built, built[0] ? "/config" : "");
}

/* ---- one name ---- */

/* Checks whether a path exists and is not a directory. */
static bool path_is_file(const char *path)
{
    struct stat found;

    return stat(path, &found) == 0 && !S_ISDIR(found.st_mode);
}

/* Writes the path of a name in a tree. Returns false if this file does not exist. */
static bool config_try_path(enum config_kind kind, const char *tree, const char *name,
                            char path[PATH_MAX])
{
    int length = snprintf(path, PATH_MAX, "%s/%s/%s%s", tree, folders[kind], name, suffix);

    return tree[0] && length > 0 && length < PATH_MAX && path_is_file(path);
}

/* Checks whether two paths are the same file. */
static bool path_same_file(const char *a, const char *b)
{
    struct stat of_a, of_b;

    return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
           of_a.st_ino == of_b.st_ino;
}

/* Writes the existing name nearest to `name` into `buffer`. Returns NULL if no name is near. */
static const char *config_find_nearest(enum config_kind kind, const struct config_trees *trees,
                                       const char *name, char buffer[NAME_MAX + 1])
{
    const char *nearest = NULL, **names;
    struct config_entry *entries;
    struct arena arena;
    size_t count;

    if (arena_init(&arena, LIST_ARENA, NULL)) {
        return NULL;
    }
    if (config_list_in(kind, trees, &arena, &entries, &count, NULL) == ERROR_NONE &&
        (names = arena_alloc(&arena, count + 1, sizeof *names))) {
        for (size_t i = 0; i < count; i++) {
            names[i] = entries[i].name;
        }
        nearest = text_nearest(name, names, count);
    }
    if (nearest) {
        snprintf(buffer, NAME_MAX + 1, "%s", nearest);
    }
    arena_fini(&arena);
    return nearest ? buffer : NULL;
}

/* Refuses an unknown name. The error names the nearest name, or else the places that were
 * searched. */
static enum error_code config_refuse_name(enum config_kind kind, const struct config_trees *trees,
                                          const char *name, struct error *error)
{
    char buffer[NAME_MAX + 1], places[512] = "";
    const char *nearest = config_find_nearest(kind, trees, name, buffer);
    size_t used = 0;

    if (nearest) {
        return error_set(error, ERROR_INPUT,
                         "found no %s \"%.100s\", expected \"%.100s\" or another of coman-hil list",
                         kinds[kind], name, nearest);
    }
    for (int i = 0; i < CONFIG_TREES_MAX && used < sizeof places; i++) {
        /* Name only existing trees: a program is either installed or built, so it has one of the
         * two */
        if (trees->folder[i][0] && (i == 0 || access(trees->folder[i], F_OK) == 0)) {
            used += (size_t)snprintf(places + used, sizeof places - used, "%s%.150s/%s",
                                     used ? " or " : "", trees->folder[i], folders[kind]);
        }
    }
    return error_set(error, ERROR_INPUT,
                     "found no file \"%.100s\", nor %.100s.yaml in %s; coman-hil list has the %ss "
                     "that are there",
                     name, name, places, kinds[kind]);
}

/* Checks whether `name` is NAME.yaml, this file is missing, and a tree has the name NAME. */
static bool config_is_suffixed_name(enum config_kind kind, const struct config_trees *trees,
                                    const char *name, char bare[NAME_MAX + 1])
{
    size_t length = strlen(name), end = sizeof suffix - 1;
    char path[PATH_MAX];

    if (length <= end || length - end > NAME_MAX || strchr(name, '/') ||
        strcmp(name + length - end, suffix) != 0 || path_is_file(name)) {
        return false;
    }
    snprintf(bare, NAME_MAX + 1, "%.*s", (int)(length - end), name);
    for (int i = 0; i < CONFIG_TREES_MAX; i++) {
        if (config_try_path(kind, trees->folder[i], bare, path)) {
            return true;
        }
    }
    return false;
}

enum error_code config_locate_in(enum config_kind kind, const char *name,
                                 const struct config_trees *trees, char path[PATH_MAX],
                                 struct error *error)
{
    char bare[NAME_MAX + 1];

    if (strlen(name) >= PATH_MAX) {
        return error_set(error, ERROR_INPUT, "found a path of %zu characters, expected at most %d",
                         strlen(name), PATH_MAX - 1);
    }
    if (config_is_suffixed_name(kind, trees, name, bare)) {
        return error_set(error, ERROR_INPUT,
                         "found no file \"%.100s\" in this folder, expected one, or \"%.100s\" for "
                         "the %s of that name",
                         name, bare, kinds[kind]);
    }
    if (strpbrk(name, "/.") || path_is_file(name)) {
        strcpy(path, name);
        return ERROR_NONE;
    }
    for (int i = 0; i < CONFIG_TREES_MAX; i++) {
        if (config_try_path(kind, trees->folder[i], name, path)) {
            return ERROR_NONE;
        }
    }
    return config_refuse_name(kind, trees, name, error);
}

enum error_code config_locate(enum config_kind kind, const char *name, char path[PATH_MAX],
                              struct error *error)
{
    struct config_trees trees;

    config_find_trees(&trees);
    return config_locate_in(kind, name, &trees, path, error);
}

bool config_is_installed_in(const struct config_trees *trees, const char *file)
{
    const char *slash = strrchr(file, '/');
    char name[PATH_MAX], folder[PATH_MAX], tree[PATH_MAX];
    int length = snprintf(name, sizeof name, "%.*s", slash ? (int)(slash - file) + 1 : 1,
                          slash ? file : ".");

    if (length >= PATH_MAX || !realpath(name, folder)) {
        return false;
    }
    for (int i = 0; i < CONFIG_TREES_MAX; i++) {
        size_t size = trees->folder[i][0] && realpath(trees->folder[i], tree) ? strlen(tree) : 0;

        if (size > 0 && !strncmp(folder, tree, size) &&
            (folder[size] == '/' || folder[size] == '\0')) {
            return true;
        }
    }
    return false;
}

bool config_is_installed(const char *file)
{
    struct config_trees trees;

    config_find_trees(&trees);
    return config_is_installed_in(&trees, file);
}

enum error_code config_locate_from(enum config_kind kind, const char *name, const char *from,
                                   struct arena *arena, const char **path, struct error *error)
{
    struct config_trees trees;
    char found[PATH_MAX];

    config_find_trees(&trees);
    for (int i = 0; i < CONFIG_TREES_MAX; i++) {
        if (config_try_path(kind, trees.folder[i], name, found) && !path_same_file(found, from)) {
            *path = arena_strdup(arena, found);
            return *path ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory left for a path");
        }
    }
    return config_refuse_name(kind, &trees, name, error);
}

enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error)
{
    return config_locate_from(CONFIG_RIG, name, from, arena, path, error);
}

/* ---- all names ---- */

/* Adds the file NAME.yaml of a folder. Skips it if an earlier tree has NAME, or if NAME is not a
 * valid name. */
static enum error_code config_add_entry(const char *folder, const char *file, struct arena *arena,
                                        struct config_entry *entries, size_t *count)
{
    size_t length = strlen(file), end = sizeof suffix - 1;
    char name[NAME_MAX + 1], path[PATH_MAX];

    if (length <= end || strcmp(file + length - end, suffix) != 0) {
        return ERROR_NONE;
    }
    snprintf(name, sizeof name, "%.*s", (int)(length - end), file);
    if (!text_is_name(name) || strchr(name, '.') || TEXT_FIND(entries, *count, name, name) >= 0 ||
        (size_t)snprintf(path, sizeof path, "%s/%s", folder, file) >= sizeof path ||
        !path_is_file(path)) {
        return ERROR_NONE;
    }
    entries[*count] = (struct config_entry){arena_strdup(arena, name), arena_strdup(arena, path)};
    if (!entries[*count].name || !entries[*count].path) {
        return ERROR_MEMORY;
    }
    ++*count;
    return ERROR_NONE;
}

static int config_compare_entries(const void *a, const void *b)
{
    return strcmp(((const struct config_entry *)a)->name, ((const struct config_entry *)b)->name);
}

enum error_code config_list_in(enum config_kind kind, const struct config_trees *trees,
                               struct arena *arena, struct config_entry **entries, size_t *count,
                               struct error *error)
{
    struct config_entry *list = arena_alloc(arena, ENTRIES_MAX, sizeof *list);
    enum error_code code = list ? ERROR_NONE : ERROR_MEMORY;
    char folder[PATH_MAX + sizeof "/validation"];

    *count = 0;
    *entries = list;
    for (int i = 0; i < CONFIG_TREES_MAX && !code; i++) {
        if (trees->folder[i][0]) {
            snprintf(folder, sizeof folder, "%s/%s", trees->folder[i], folders[kind]);

            /* Add all names of a folder. A missing folder counts as empty. */
            DIR *directory = opendir(folder);
            struct dirent *file;

            code = ERROR_NONE;
            while (directory && !code && *count < ENTRIES_MAX && (file = readdir(directory))) {
                code = config_add_entry(folder, file->d_name, arena, list, count);
            }
            if (directory) {
                closedir(directory);
            }
        }
    }
    if (code) {
        return error_set(error, code, "no memory left for a list of %ss", kinds[kind]);
    }
    qsort(list, *count, sizeof *list, config_compare_entries);
    return ERROR_NONE;
}

enum error_code config_list(enum config_kind kind, struct arena *arena,
                            struct config_entry **entries, size_t *count, struct error *error)
{
    struct config_trees trees;

    config_find_trees(&trees);
    return config_list_in(kind, &trees, arena, entries, count, error);
}
