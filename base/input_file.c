/* SPDX-License-Identifier: Apache-2.0 */
/* Opens regular files for reading, and records which files were opened. */
#include "base/input_file.h"

#include "base/array.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

/* The last files that this process has read. A file that changed after the first read does not
 * count as read: either this process wrote it, or a new file reuses its inode. */
static struct {
    dev_t device;
    ino_t inode;
} inputs[256];
static size_t ninput;
static struct timespec first_read;
/* for threads that open files at the same time */
static pthread_mutex_t inputs_lock = PTHREAD_MUTEX_INITIALIZER;

enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error)
{
    const struct timespec *changed = &there->st_ctim;
    bool found = false;

    pthread_mutex_lock(&inputs_lock);
    for (size_t i = 0; i < ninput && i < ARRAY_COUNT(inputs); i++) {
        found |= inputs[i].device == there->st_dev && inputs[i].inode == there->st_ino;
    }
    found &= changed->tv_sec < first_read.tv_sec ||
             (changed->tv_sec == first_read.tv_sec && changed->tv_nsec < first_read.tv_nsec);
    pthread_mutex_unlock(&inputs_lock);
    return found ? error_set(error, ERROR_INPUT,
                             "%.200s: found a file, which is read here, expected another one to "
                             "write: an input is not overwritten",
                             path)
                 : ERROR_NONE;
}

enum error_code input_file_open(const char *path, int *descriptor, size_t *size,
                                struct error *error)
{
    /* O_NONBLOCK: opening a pipe must not wait. A pipe is refused below */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    enum error_code code = ERROR_NONE;
    struct stat status;

    if (fd < 0 && errno != ENXIO) {
        return error_set_file(error, errno, path, "cannot be read");
    }

    /* ENXIO: the path is a socket, or a device without hardware */
    if (fd >= 0 && fstat(fd, &status)) {
        code = error_set_file(error, errno, path, "cannot be read");
    } else if (fd < 0 || !S_ISREG(status.st_mode)) {
        code = error_set(error, ERROR_INPUT, "%.200s: found %s, expected a file", path,
                         fd >= 0 && S_ISDIR(status.st_mode) ? "a directory" : "no regular file");
    } else {
        /* Add a file to the files that this process has read */
        pthread_mutex_lock(&inputs_lock);
        if (ninput == 0) {
            clock_gettime(CLOCK_REALTIME_COARSE, &first_read); /* file systems use this clock */
        }
        inputs[ninput % ARRAY_COUNT(inputs)].device = status.st_dev;
        inputs[ninput++ % ARRAY_COUNT(inputs)].inode = status.st_ino;
        pthread_mutex_unlock(&inputs_lock);
    }
    if (code) {
        if (fd >= 0) {
            close(fd);
        }
        return code;
    }
    *descriptor = fd;
    if (size) {
        *size = (size_t)status.st_size;
    }
    return ERROR_NONE;
}

enum error_code input_file_stream(const char *path, FILE **file, struct error *error)
{
    int fd;
    enum error_code code = input_file_open(path, &fd, NULL, error);

    *file = code ? NULL : fdopen(fd, "r");
    if (!code && !*file) {
        code = error_set_file(error, errno, path, "cannot be read");
        close(fd);
    }
    return code;
}

/* Reads `size` bytes. Fewer bytes are an error: another process has shortened the file. */
static enum error_code input_read(int fd, const char *path, char *text, size_t size,
                                  struct error *error)
{
    for (size_t used = 0; used < size;) {
        ssize_t got = read(fd, text + used, size - used);

        if (got == 0 || (got < 0 && errno != EINTR)) {
            return error_set_file(error, got ? errno : EIO, path, "cannot be read");
        }
        used += got > 0 ? (size_t)got : 0;
    }
    text[size] = '\0';
    return ERROR_NONE;
}

enum error_code input_file_load(const char *path, size_t most, char **text, size_t *size,
                                struct error *error)
{
    int fd;
    enum error_code code = input_file_open(path, &fd, size, error);

    *text = NULL;
    if (code) {
        return code;
    }
    if (*size > most) {
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found more than %zu bytes, expected at most that", path, most);
    } else if (!(*text = malloc(*size + 1))) {
        code = error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", path);
    } else if ((code = input_read(fd, path, *text, *size, error))) {
        free(*text);
        *text = NULL;
    }
    close(fd);
    return code;
}
