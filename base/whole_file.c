/* SPDX-License-Identifier: Apache-2.0 */
/* Writes files under a temporary name until they are complete, opens files that grow, and makes
 * folders. */
#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

/* Returns the name of a path in its folder. */
static const char *whole_file_name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

/* Opens the folder of the path, so that nobody can replace it meanwhile. */
static enum error_code whole_file_open_folder(struct whole_file *file, struct error *error)
{
    size_t length = (size_t)(whole_file_name(file->path) - file->path);
    char folder[PATH_MAX] = ".";

    if (length >= sizeof folder) {
        return error_set(error, ERROR_INPUT, "the file's name %.40s... is too long", file->path);
    }
    if (length > 0) {
        memcpy(folder, file->path, length);
        folder[length] = '\0';
    }
    file->folder = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    return file->folder >= 0 ? ERROR_NONE
                             : error_set_errno(error, errno, "cannot write %s", file->path);
}

/* Creates a file with a random name, which nobody can have guessed; returns its descriptor, -1
 * with errno. */
static int whole_file_create(struct whole_file *file)
{
    for (;;) {
        uint64_t random;
        int descriptor;

        if (getrandom(&random, sizeof random, 0) != (ssize_t)sizeof random) {
            return -1;
        }
        snprintf(file->partial, sizeof file->partial, ".coman-hil-%016" PRIx64 ".part", random);
        descriptor = openat(file->folder, file->partial,
                            O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0664);
        if (descriptor >= 0 || errno != EEXIST) {
            return descriptor;
        }
    }
}

/* Opens a pipe or a character device; -1 with errno, also if it has become something else. */
static int whole_file_open_device(const struct whole_file *file, int flags)
{
    int descriptor =
        openat(file->folder, whole_file_name(file->path), O_WRONLY | O_CLOEXEC | flags);
    struct stat there;

    if (descriptor >= 0 &&
        (fstat(descriptor, &there) || !(S_ISFIFO(there.st_mode) || S_ISCHR(there.st_mode)))) {
        close(descriptor);
        errno = EINVAL;
        return -1;
    }
    return descriptor;
}

/* Checks whether a symbolic link was made by another user than this one and root. */
static bool whole_file_is_foreign(const struct stat *link)
{
    return S_ISLNK(link->st_mode) && link->st_uid != 0 && link->st_uid != geteuid();
}

/* Decides whether the path is written in place, and refuses what can be no file. */
static enum error_code whole_file_look(struct whole_file *file, struct error *error)
{
    const char *name = whole_file_name(file->path);
    struct stat there, link;
    bool found = fstatat(file->folder, name, &there, 0) == 0;

    if (!*name || (found && S_ISDIR(there.st_mode))) {
        return error_set_errno(error, EISDIR, "cannot write %s", file->path);
    }
    file->in_place = found && (S_ISFIFO(there.st_mode) || S_ISCHR(there.st_mode));
    if (file->in_place && !fstatat(file->folder, name, &link, AT_SYMLINK_NOFOLLOW) &&
        whole_file_is_foreign(&link)) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a symbolic link of another user, expected a file: what it "
                         "points to is not written",
                         file->path);
    }
    return ERROR_NONE;
}

/* Opens the folder and looks at what has the name now. */
static enum error_code whole_file_begin(struct whole_file *file, const char *path,
                                        struct error *error)
{
    enum error_code code;

    *file = (struct whole_file){.path = path};
    code = whole_file_open_folder(file, error);
    if (!code && (code = whole_file_look(file, error))) {
        close(file->folder);
    }
    return code;
}

enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error)
{
    enum error_code code = whole_file_begin(file, path, error);
    int descriptor;

    if (code) {
        return code;
    }
    descriptor = file->in_place ? whole_file_open_device(file, 0) : whole_file_create(file);
    file->out = descriptor >= 0 ? fdopen(descriptor, "w") : NULL;
    if (!file->out) {
        code = error_set_errno(error, errno, "cannot write %s", path);
        if (descriptor >= 0) {
            close(descriptor);
            unlinkat(file->folder, file->in_place ? "" : file->partial, 0);
        }
        close(file->folder);
    }
    return code;
}

enum error_code whole_file_close(struct whole_file *file, enum error_code code, struct error *error)
{
    bool failed = ferror(file->out) != 0;

    failed = fflush(file->out) != 0 || failed;
    /* Data reaches the disk before the name does, or a power cut could leave an empty file */
    failed = failed || (!file->in_place && !code && fsync(fileno(file->out)) != 0);
    failed = fclose(file->out) != 0 || failed;
    if (!failed && !code && !file->in_place) {
        failed =
            renameat(file->folder, file->partial, file->folder, whole_file_name(file->path)) != 0;
    }
    if (failed && !code) {
        code = error_set_errno(error, errno, "cannot write %s", file->path);
    }
    if (code && !file->in_place) {
        unlinkat(file->folder, file->partial, 0);
    }
    close(file->folder);
    return code;
}

/* ---- files that grow ---- */

/* Creates a file in place of an existing one; -1 with errno, ELOOP for a link. */
static int growing_file_create(const struct whole_file *file)
{
    const char *name = whole_file_name(file->path);
    struct stat there;

    if (!fstatat(file->folder, name, &there, AT_SYMLINK_NOFOLLOW)) {
        if (S_ISLNK(there.st_mode)) {
            errno = ELOOP;
            return -1;
        }
        if (unlinkat(file->folder, name, 0)) {
            return -1;
        }
    }
    return openat(file->folder, name, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0664);
}

enum error_code growing_file_open(const char *path, int *descriptor, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_begin(&file, path, error);

    if (code) {
        return code;
    }
    *descriptor = file.in_place ? whole_file_open_device(&file, O_NONBLOCK | O_NOCTTY)
                                : growing_file_create(&file);
    if (*descriptor >= 0) {
        fcntl(*descriptor, F_SETFL, fcntl(*descriptor, F_GETFL) & ~O_NONBLOCK);
    } else if (errno == ELOOP) {
        code = error_set(error, ERROR_INPUT,
                         "%s: found a symbolic link, expected a file: what it points to is not "
                         "overwritten",
                         path);
    } else if (errno == ENXIO) {
        code = error_set(error, ERROR_SYSTEM, "cannot open %s: a pipe that nobody reads", path);
    } else {
        code = error_set_errno(error, errno, "cannot open %s", path);
    }
    close(file.folder);
    return code;
}

/* ---- folders ---- */

enum error_code folder_make(const char *path, bool *made, struct error *error)
{
    struct stat there;
    bool fresh = mkdir(path, 0775) == 0;

    if (made) {
        *made = fresh;
    }
    if (!fresh && errno != EEXIST) {
        return error_set_errno(error, errno, "cannot make the directory %s", path);
    }
    if (!fresh && !lstat(path, &there) && whole_file_is_foreign(&there)) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a symbolic link of another user, expected a directory: nothing "
                         "is written where it points to",
                         path);
    }
    return ERROR_NONE;
}

enum error_code folder_make_all(const char *path, struct error *error)
{
    char part[PATH_MAX];
    size_t length = strlen(path);

    if (length == 0 || length >= sizeof part) {
        return error_set(error, ERROR_INPUT, "the name of the directory %.40s is %s", path,
                         length ? "too long" : "empty");
    }
    for (size_t i = 1; i < length; i++) {
        if (path[i] != '/' || path[i - 1] == '/') {
            continue;
        }
        memcpy(part, path, i);
        part[i] = '\0';
        if (mkdir(part, 0775) && errno != EEXIST) {
            return error_set_errno(error, errno, "cannot make the directory %s", part);
        }
    }
    return folder_make(path, NULL, error);
}
