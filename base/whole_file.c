/* SPDX-License-Identifier: Apache-2.0 */
/* Writes files under a temporary name until they are complete. Opens files that grow. Makes
 * and removes folders. */
#include "base/whole_file.h"

#include "base/input_file.h"

#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <inttypes.h>
#include <limits.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

/* Returns the last component of a path. */
static const char *whole_file_name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

/* Below this folder no symbolic link is followed; "" = no such folder. */
static struct {
    char path[PATH_MAX];
    size_t given; /* leading bytes of the path that a person gave; links in them are followed */
} enclosure;

void folder_enclose(const char *path, size_t given)
{
    snprintf(enclosure.path, sizeof enclosure.path, "%s", path);
    enclosure.given = given;
}

/* Returns the number of leading bytes of a path in which symbolic links are followed. */
static size_t folder_given(const char *path)
{
    const size_t length = strlen(enclosure.path);
    const bool inside = length > 0 && !strncmp(path, enclosure.path, length) &&
                        (path[length] == '/' || path[length] == '\0');

    return inside ? enclosure.given : strlen(path);
}

/* Opens a folder. Follows links in the part of the path that a person gave. Opens the rest name by
 * name without following links. Returns -1 with errno; ENOTDIR for a link in the rest. */
static int folder_open(const char *path)
{
    enum { FOLDER = O_RDONLY | O_DIRECTORY | O_CLOEXEC };
    const size_t given = folder_given(path);
    char part[PATH_MAX], *rest = part + given, *name;
    int folder;

    if (strlen(path) >= sizeof part) {
        errno = ENAMETOOLONG;
        return -1;
    }
    snprintf(part, sizeof part, "%.*s", (int)given, path);
    folder = open(given > 0 ? part : ".", FOLDER);
    snprintf(rest, sizeof part - given, "%s", path + given);
    while (folder >= 0 && (name = strsep(&rest, "/"))) {
        int above = folder, reason;

        if (*name) {
            folder = openat(above, name, FOLDER | O_NOFOLLOW);
            reason = errno;
            close(above);
            errno = reason;
        }
    }
    return folder;
}

/* Writes the error of a folder that cannot be made or written. errno has the cause. */
static enum error_code folder_refuse(const char *path, const char *what, struct error *error)
{
    const int reason = errno;

    if (reason == ENOTDIR && folder_given(path) < strlen(path)) {
        return error_set(error, ERROR_INPUT,
                         "%.300s: found a symbolic link or a file, expected a directory: nothing "
                         "is written where a link below the given folder points to",
                         path);
    }
    return error_set_errno(error, reason, "cannot %s %.300s", what, path);
}

/* Opens the folder of the file, so that no other user can replace the folder before the rename. */
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
    file->folder = folder_open(folder);
    return file->folder >= 0 ? ERROR_NONE : folder_refuse(file->path, "write", error);
}

/* Creates a file with an unpredictable random name. Returns its descriptor, or -1 with errno. */
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

/* Opens a pipe or a character device without waiting. Returns -1 with errno: ENXIO for a pipe
 * without a reader. Also fails if another object has replaced the pipe or device. */
static int whole_file_open_device(const struct whole_file *file)
{
    int descriptor = openat(file->folder, whole_file_name(file->path),
                            O_WRONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    struct stat there;

    if (descriptor >= 0 &&
        (fstat(descriptor, &there) || !(S_ISFIFO(there.st_mode) || S_ISCHR(there.st_mode)))) {
        close(descriptor);
        errno = EINVAL;
        return -1;
    }
    if (descriptor >= 0) {
        fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL) & ~O_NONBLOCK);
    }
    return descriptor;
}

/* Writes the error of a file that cannot be opened. errno has the cause. */
static enum error_code whole_file_refuse(const char *path, struct error *error)
{
    return errno == ENXIO
               ? error_set(error, ERROR_SYSTEM, "cannot open %s: a pipe that nobody reads", path)
               : error_set_errno(error, errno, "cannot write %s", path);
}

/* Checks whether the owner of a symbolic link is neither this user nor root. */
static bool whole_file_is_foreign(const struct stat *link)
{
    return S_ISLNK(link->st_mode) && link->st_uid != 0 && link->st_uid != geteuid();
}

/* Decides whether to write the path in place. Refuses folders, sockets, block devices, files that
 * this process has read, and links of other users to a pipe or device. */
static enum error_code whole_file_look(struct whole_file *file, struct error *error)
{
    const char *name = whole_file_name(file->path);
    struct stat there, link;
    bool found = fstatat(file->folder, name, &there, 0) == 0;

    if (!*name || (found && S_ISDIR(there.st_mode))) {
        return error_set_errno(error, EISDIR, "cannot write %s", file->path);
    }
    if (found && S_ISREG(there.st_mode)) {
        return input_file_check_output(file->path, &there, error);
    }
    if (found && (S_ISSOCK(there.st_mode) || S_ISBLK(there.st_mode))) {
        return error_set(error, ERROR_INPUT, "%s: found a %s, expected a file", file->path,
                         S_ISSOCK(there.st_mode) ? "socket" : "block device");
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

/* Opens the folder of the path and checks the existing object of this name. */
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
    descriptor = file->in_place ? whole_file_open_device(file) : whole_file_create(file);
    file->out = descriptor >= 0 ? fdopen(descriptor, "w") : NULL;
    if (!file->out) {
        code = whole_file_refuse(path, error);
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
    /* Write the data to the disk before the rename, because a power cut could leave an empty
     * file */
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

enum error_code whole_file_probe(const char *path, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_begin(&file, path, error);
    int descriptor;

    if (code) {
        return code;
    }
    /* Do not open a pipe here: closing it again would send EOF to its reader */
    descriptor = file.in_place ? -1 : whole_file_create(&file);
    if (descriptor >= 0) {
        close(descriptor);
        unlinkat(file.folder, file.partial, 0);
    } else if (!file.in_place) {
        code = whole_file_refuse(path, error);
    }
    close(file.folder);
    return code;
}

/* ---- files that grow ---- */

/* Creates a file and removes an existing one first. Returns -1 with errno; ELOOP for a link. */
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
    *descriptor = file.in_place ? whole_file_open_device(&file) : growing_file_create(&file);
    if (*descriptor < 0) {
        code = errno == ELOOP ? error_set(error, ERROR_INPUT,
                                          "%s: found a symbolic link, expected a file: what it "
                                          "points to is not overwritten",
                                          path)
                              : whole_file_refuse(path, error);
    }
    close(file.folder);
    return code;
}

/* ---- folders ---- */

/* Makes a folder. Returns -1 with errno. */
static int folder_mkdir(const char *path)
{
    const char *name = whole_file_name(path);
    char above[PATH_MAX];
    int folder, made, reason;

    if (folder_given(path) == strlen(path) || (size_t)(name - path) >= sizeof above) {
        return mkdir(path, 0775);
    }
    snprintf(above, sizeof above, "%.*s", (int)(name - path), path);
    folder = folder_open(above);
    made = folder < 0 ? -1 : mkdirat(folder, name, 0775);
    reason = errno;
    if (folder >= 0) {
        close(folder);
    }
    errno = reason;
    return made;
}

enum error_code folder_make(const char *path, bool *made, struct error *error)
{
    struct stat there;
    bool fresh = folder_mkdir(path) == 0;
    int folder;

    if (made) {
        *made = fresh;
    }
    if (!fresh && errno != EEXIST) {
        return folder_refuse(path, "make the directory", error);
    }
    if (!fresh && !lstat(path, &there) && whole_file_is_foreign(&there)) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a symbolic link of another user, expected a directory: nothing "
                         "is written where it points to",
                         path);
    }
    if (!fresh && folder_given(path) < strlen(path)) {
        folder = folder_open(path);
        if (folder < 0) {
            return folder_refuse(path, "make the directory", error);
        }
        close(folder);
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
        if (folder_mkdir(part) && errno != EEXIST) {
            return folder_refuse(part, "make the directory", error);
        }
    }
    return folder_make(path, NULL, error);
}

/* A callback of nftw, which visits a folder after its entries. */
static int folder_remove_entry(const char *path, const struct stat *status, int kind,
                               struct FTW *where)
{
    (void)status;
    (void)kind;
    (void)where;
    return remove(path);
}

void folder_remove(const char *path)
{
    nftw(path, folder_remove_entry, 16, FTW_DEPTH | FTW_PHYS);
}
