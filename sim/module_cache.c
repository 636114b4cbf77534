/* SPDX-License-Identifier: Apache-2.0 */
/* Finds and creates the cache folder. */
#include "sim/module_cache.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* False unless path is now a folder of this user. */
static bool folder_make(const char *path)
{
    struct stat status;

    if (mkdir(path, 0700) && errno != EEXIST) {
        return false;
    }
    return !stat(path, &status) && S_ISDIR(status.st_mode) && status.st_uid == geteuid();
}

static bool folder_make_below(const char *parent, const char *name, char *path, size_t size)
{
    int length = snprintf(path, size, "%s/%s", parent, name);

    return length > 0 && (size_t)length < size && folder_make(path);
}

bool module_cache_folder(char *path, size_t size)
{
    const char *service = getenv("CACHE_DIRECTORY"), *cache = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    char parent[4096];

    if (service && *service == '/') {
        return (size_t)snprintf(path, size, "%s", service) < size && folder_make(path);
    }
    if (cache && *cache == '/') {
        return folder_make(cache) && folder_make_below(cache, "coman-hil", path, size);
    }
    return home && *home == '/' && folder_make_below(home, ".cache", parent, sizeof parent) &&
           folder_make_below(parent, "coman-hil", path, size);
}
