/* SPDX-License-Identifier: Apache-2.0 */
/* Resolves file names and keeps them within a folder. */
#include "app/import/path.h"

#include "base/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Checks whether a relative name leaves its folder at some point: "a/../../b" does, "a/../b" does
 * not. */
static bool path_climbs(const char *name)
{
    int depth = 0;

    for (const char *at = name; *at && depth >= 0;) {
        size_t length = strcspn(at, "/");

        if (length == 2 && at[0] == '.' && at[1] == '.') {
            depth--;
        } else if (length > 0 && !(length == 1 && at[0] == '.')) {
            depth++;
        }
        at += length + (at[length] == '/');
    }
    return depth < 0;
}

/* Returns the rest of an absolute path below a folder; NULL if the path is not below the folder. */
static const char *path_below(const char *folder, const char *path)
{
    size_t length = strlen(folder);

    return !strncmp(path, folder, length) && path[length] == '/' ? path + length + 1 : NULL;
}

bool import_find_folder(const char *file, char folder[PATH_MAX])
{
    if (!realpath(file, folder)) {
        return false;
    }
    *strrchr(folder, '/') = '\0';
    return true;
}

enum import_path import_resolve_path(const char *inside, const char *from, const char *name,
                                     bool trust, char path[PATH_MAX])
{
    int used = name[0] == '/' ? snprintf(path, PATH_MAX, "%s", name)
                              : snprintf(path, PATH_MAX, "%s/%s", from, name);
    const char *rest = path_below(inside, path);
    char real[PATH_MAX];
    struct stat status;

    /* Check the name first, so that errors reveal nothing about files outside */
    if (!trust && (!rest || path_climbs(rest))) {
        return IMPORT_PATH_OUTSIDE;
    }
    if (used >= PATH_MAX || !realpath(path, real)) {
        return IMPORT_PATH_MISSING;
    }

    /* Then check the target of symbolic links */
    if (!trust && !path_below(inside, real)) {
        return IMPORT_PATH_OUTSIDE;
    }
    return !stat(path, &status) && S_ISREG(status.st_mode) ? IMPORT_PATH_FOUND
                                                           : IMPORT_PATH_MISSING;
}

enum error_code import_find_own_file(const char *kind, const char *name, const char *expected,
                                     struct arena *arena, const char **path, const char **written,
                                     struct error *error)
{
    char real[PATH_MAX], copy[PATH_MAX];
    const char *own;

    if (!realpath(name, real)) {
        return error_set(error, ERROR_INPUT, "--%s: found \"%.200s\", expected %s", kind, name,
                         expected);
    }
    own = strrchr(real, '/') + 1;
    if (!text_is_name(own)) {
        return error_set(error, ERROR_INPUT,
                         "--%s: found \"%.200s\", expected letters, digits and _ - . only in the "
                         "name of a %s's file",
                         kind, own, kind);
    }
    snprintf(copy, sizeof copy, "../%ss/%s", kind, own);
    *path = arena_strdup(arena, real);
    *written = arena_strdup(arena, copy);
    return ERROR_NONE;
}
