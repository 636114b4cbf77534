/* SPDX-License-Identifier: Apache-2.0 */
/* Finds rig files: next to the caller, in /etc, or installed with the program. */
#include "rig/find.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char local_folder[] = "/etc/coman-hil/rigs";

/* PREFIX/share/coman-hil/rigs of a program in PREFIX/bin; "" when that is unknown. */
static void rig_installed_folder(char folder[PATH_MAX])
{
    static const char below[] = "/share/coman-hil/rigs";
    ssize_t length = readlink("/proc/self/exe", folder, PATH_MAX - sizeof below);
    char *slash;

    folder[length > 0 ? length : 0] = '\0';
    for (int level = 0; level < 2; level++) {
        slash = strrchr(folder, '/');
        if (!slash) {
            folder[0] = '\0';
            return;
        }
        *slash = '\0';
    }
    strcat(folder, below);
}

static bool rig_try_path(char path[PATH_MAX], const char *folder, const char *name)
{
    int length = snprintf(path, PATH_MAX, "%s/%s.yaml", folder, name);

    return folder[0] && length > 0 && length < PATH_MAX && access(path, F_OK) == 0;
}

static bool path_same_file(const char *a, const char *b)
{
    struct stat of_a, of_b;

    return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
           of_a.st_ino == of_b.st_ino;
}

enum error_code rig_locate_in(const char *name, const char *local, const char *installed,
                              char path[PATH_MAX], struct error *error)
{
    if (strlen(name) >= PATH_MAX) {
        return error_set(error, ERROR_INPUT, "found a path of %zu characters, expected at most %d",
                         strlen(name), PATH_MAX - 1);
    }
    if (strpbrk(name, "/.") || access(name, F_OK) == 0) {
        strcpy(path, name);
        return ERROR_NONE;
    }
    if (rig_try_path(path, local, name) || rig_try_path(path, installed, name)) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT, "found no file %.100s, nor %.100s.yaml in %.200s%s%.200s",
                     name, name, local, installed[0] ? " or " : "", installed);
}

enum error_code rig_locate(const char *name, char path[PATH_MAX], struct error *error)
{
    char installed[PATH_MAX];

    rig_installed_folder(installed);
    return rig_locate_in(name, local_folder, installed, path, error);
}

enum error_code rig_locate_from(const char *name, const char *from, struct arena *arena,
                                const char **path, struct error *error)
{
    char installed[PATH_MAX], found[PATH_MAX];

    rig_installed_folder(installed);
    if (!(rig_try_path(found, local_folder, name) && !path_same_file(found, from)) &&
        !(rig_try_path(found, installed, name) && !path_same_file(found, from))) {
        return error_set(error, ERROR_INPUT, "found no rig %.100s.yaml in %.200s%s%.200s", name,
                         local_folder, installed[0] ? " or " : "", installed);
    }
    *path = arena_strdup(arena, found);
    return *path ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory left for a path");
}
