/* SPDX-License-Identifier: Apache-2.0 */
/* Finding and making the cache folder. */
#include "sim/module_cache.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* false unless path is now a folder of this user's */
static bool make(const char *path)
{
    struct stat status;

    if (mkdir(path, 0700) && errno != EEXIST) {
        return false;
    }
    return !stat(path, &status) && S_ISDIR(status.st_mode) && status.st_uid == geteuid();
}

static bool below(const char *parent, const char *name, char *path, size_t size)
{
    int length = snprintf(path, size, "%s/%s", parent, name);

    return length > 0 && (size_t)length < size && make(path);
}

bool cache_folder(char *path, size_t size)
{
    const char *service = getenv("CACHE_DIRECTORY"), *cache = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    char parent[4096];

    if (service && *service == '/') {
        return (size_t)snprintf(path, size, "%s", service) < size && make(path);
    }
    if (cache && *cache == '/') {
        return make(cache) && below(cache, "coman-hil", path, size);
    }
    return home && *home == '/' && below(home, ".cache", parent, sizeof parent) &&
           below(parent, "coman-hil", path, size);
}
