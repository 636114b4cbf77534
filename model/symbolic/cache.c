/* SPDX-License-Identifier: Apache-2.0 */
/* Seals of compiled modules, and the folders in which they are made. */
#include "model/symbolic/cache.h"

#include "base/hash.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define WORKSHOP "build-"

enum { CHUNK = 65536, ABANDONED_S = 60 };

/* ---- seals ---- */

/* The last bytes of a module in the cache. */
struct seal {
    char mark[8];
    uint64_t size; /* of what stands before */
    uint64_t hash; /* of that */
};

static const char seal_mark[8] = "hil-seal";

/* Hashes the first size bytes; false when there are fewer. */
static bool cache_hash_file(int descriptor, uint64_t size, uint64_t *hash)
{
    char chunk[CHUNK];

    *hash = HASH_START;
    while (size > 0) {
        ssize_t count = read(descriptor, chunk, size < CHUNK ? (size_t)size : CHUNK);

        if (count < 0 && errno == EINTR) {
            continue;
        }
        if (count <= 0) {
            return false;
        }
        *hash = hash_bytes(*hash, chunk, (size_t)count);
        size -= (uint64_t)count;
    }
    return true;
}

enum error_code cache_seal(const char *path, struct error *error)
{
    struct seal seal;
    struct stat status;
    enum error_code code = ERROR_NONE;
    int descriptor = open(path, O_RDWR | O_CLOEXEC);

    if (descriptor < 0) {
        return error_set_errno(error, errno, "%s", path);
    }
    errno = EIO; /* of what ends before its size */
    memcpy(seal.mark, seal_mark, sizeof seal.mark);
    if (fstat(descriptor, &status) ||
        !cache_hash_file(descriptor, seal.size = (uint64_t)status.st_size, &seal.hash) ||
        write(descriptor, &seal, sizeof seal) != (ssize_t)sizeof seal || fsync(descriptor)) {
        code = error_set_errno(error, errno, "%s", path);
    }
    close(descriptor);
    return code;
}

bool cache_is_whole(const char *path)
{
    int descriptor = open(path, O_RDONLY | O_CLOEXEC);
    struct seal seal;
    struct stat status;
    uint64_t size, hash;
    bool whole;

    if (descriptor < 0) {
        return false;
    }
    whole = !fstat(descriptor, &status) && S_ISREG(status.st_mode) &&
            status.st_size > (off_t)sizeof seal;
    size = whole ? (uint64_t)status.st_size - sizeof seal : 0;
    whole = whole && pread(descriptor, &seal, sizeof seal, (off_t)size) == (ssize_t)sizeof seal &&
            !memcmp(seal.mark, seal_mark, sizeof seal.mark) && seal.size == size &&
            cache_hash_file(descriptor, size, &hash) && hash == seal.hash;
    close(descriptor);
    return whole;
}

enum error_code cache_publish(const char *fresh, const char *folder, const char *library,
                              struct error *error)
{
    int descriptor;

    if (rename(fresh, library)) {
        return error_set_errno(error, errno, "%s", library);
    }
    /* A name that is lost with the power costs a build, no more */
    descriptor = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor >= 0) {
        (void)fsync(descriptor);
        close(descriptor);
    }
    return ERROR_NONE;
}

/* ---- workshops ---- */

/* Removes a folder of files; an empty one without memory. */
static void cache_remove_folder(const char *path)
{
    char file[CACHE_PATH + NAME_MAX + 2];
    const struct dirent *entry;
    DIR *listing;

    if (rmdir(path) == 0) {
        return;
    }
    listing = opendir(path);
    while (listing && (entry = readdir(listing))) {
        if (strcmp(entry->d_name, ".") && strcmp(entry->d_name, "..")) {
            snprintf(file, sizeof file, "%s/%s", path, entry->d_name);
            unlink(file);
        }
    }
    if (listing) {
        closedir(listing);
    }
    rmdir(path);
}

/* Whether the build that made it is dead: it holds the lock while it lives. One that is very young
 * may be about to be locked. */
static bool workshop_is_abandoned(const char *path)
{
    int descriptor = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    struct stat status;
    bool abandoned;

    if (descriptor < 0) {
        return false;
    }
    abandoned = !fstat(descriptor, &status) && time(NULL) - status.st_mtime >= ABANDONED_S &&
                !flock(descriptor, LOCK_EX | LOCK_NB);
    close(descriptor);
    return abandoned;
}

static bool ends_with(const char *name, const char *end)
{
    size_t length = strlen(name), rest = strlen(end);

    return length >= rest && !strcmp(name + length - rest, end);
}

/* Whoever locks a claim meanwhile notices that it has lost its name. */
static void remove_dead_claim(const char *path)
{
    int descriptor = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);

    if (descriptor >= 0 && !flock(descriptor, LOCK_EX | LOCK_NB)) {
        unlink(path);
    }
    if (descriptor >= 0) {
        close(descriptor);
    }
}

static void cache_sweep(const char *folder)
{
    char path[CACHE_PATH];
    DIR *listing = opendir(folder);
    const struct dirent *entry;

    while (listing && (entry = readdir(listing))) {
        int length = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);

        if (length < 0 || (size_t)length >= sizeof path) {
            continue;
        }
        if (!strncmp(entry->d_name, WORKSHOP, strlen(WORKSHOP)) && workshop_is_abandoned(path)) {
            cache_remove_folder(path);
        } else if (ends_with(entry->d_name, CACHE_CLAIM)) {
            remove_dead_claim(path);
        }
    }
    if (listing) {
        closedir(listing);
    }
}

enum error_code cache_open_workshop(struct cache_workshop *workshop, const char *folder,
                                    struct error *error)
{
    int length = snprintf(workshop->path, sizeof workshop->path, "%s/" WORKSHOP "XXXXXX", folder);

    workshop->descriptor = -1;
    cache_sweep(folder);
    if (length < 0 || (size_t)length >= sizeof workshop->path) {
        return error_set(error, ERROR_INPUT, "the folder name %s is too long", folder);
    }
    if (!mkdtemp(workshop->path)) {
        return error_set_errno(error, errno, "%s", workshop->path);
    }
    workshop->descriptor = open(workshop->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (workshop->descriptor < 0 || flock(workshop->descriptor, LOCK_EX | LOCK_NB)) {
        enum error_code code = error_set_errno(error, errno, "%s", workshop->path);

        cache_close_workshop(workshop);
        return code;
    }
    return ERROR_NONE;
}

void cache_close_workshop(struct cache_workshop *workshop)
{
    cache_remove_folder(workshop->path);
    if (workshop->descriptor >= 0) {
        close(workshop->descriptor);
    }
    workshop->descriptor = -1;
}

/* ---- claims ---- */

enum { CLAIM_ATTEMPTS = 8 };

/* Whether the open file still has its name: who had it before may have removed it. */
static bool claim_is_named(int descriptor, const char *path)
{
    struct stat mine, named;

    return !fstat(descriptor, &mine) && !stat(path, &named) && mine.st_dev == named.st_dev &&
           mine.st_ino == named.st_ino;
}

enum error_code cache_claim(const char *path, int *descriptor, struct error *error)
{
    for (int attempt = 0; attempt < CLAIM_ATTEMPTS; attempt++) {
        int file = open(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600), problem;

        *descriptor = -1;
        if (file < 0) {
            return error_set_errno(error, errno, "%s", path);
        }
        problem = flock(file, LOCK_EX | LOCK_NB) ? errno : 0;
        if (!problem && claim_is_named(file, path) && !ftruncate(file, 0)) {
            *descriptor = file;
            return ERROR_NONE;
        }
        close(file);
        if (problem) {
            return problem == EWOULDBLOCK ? ERROR_NONE
                                          : error_set_errno(error, problem, "%s", path);
        }
    }
    return ERROR_NONE;
}

bool cache_is_claimed(const char *path)
{
    int descriptor = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    bool claimed;

    if (descriptor < 0) {
        return false;
    }
    claimed = flock(descriptor, LOCK_SH | LOCK_NB) && errno == EWOULDBLOCK;
    close(descriptor);
    return claimed;
}
