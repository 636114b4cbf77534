/* SPDX-License-Identifier: Apache-2.0 */
/* Opens regular files for reading, and remembers which. */
#include "base/input_file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <search.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A file that was read, or written by this process, and the last name that it was opened by. */
struct input {
    dev_t device;
    ino_t inode;
    bool written;
    char *path;
};

/* All inputs of this process, a binary tree; threads may open files too. */
static void *inputs;
static pthread_mutex_t inputs_lock = PTHREAD_MUTEX_INITIALIZER;

/* Orders inputs by device and inode. */
static int input_compare(const void *a, const void *b)
{
    const struct input *x = a, *y = b;

    if (x->device != y->device) {
        return x->device < y->device ? -1 : 1;
    }
    return x->inode < y->inode ? -1 : x->inode > y->inode;
}

/* Returns whether the name of an input is still its own: a file that is gone may have left its
 * inode to another one. */
static bool input_is_there(const struct input *input)
{
    struct stat now;

    return !stat(input->path, &now) && now.st_dev == input->device && now.st_ino == input->inode;
}

/* Adds a file to the inputs, or gives one its new name; false = no memory. */
static bool input_remember(const char *path, const struct stat *status, bool written)
{
    struct input *input = malloc(sizeof *input), **found = NULL, old = {.path = NULL};
    char *name = strdup(path);

    if (!input || !name) {
        free(input);
        free(name);
        return false;
    }
    *input = (struct input){status->st_dev, status->st_ino, written, name};
    pthread_mutex_lock(&inputs_lock);
    found = tsearch(input, &inputs, input_compare);
    if (!found || *found != input) {
        /* What was written here stays so when it is read back */
        old = found && !((*found)->written && input_is_there(*found)) ? **found : *input;
        if (found && old.path != name) {
            **found = *input;
        }
        free(input);
    }
    pthread_mutex_unlock(&inputs_lock);
    free(old.path);
    return found != NULL;
}

void input_file_written(const char *path, const struct stat *status)
{
    input_remember(path, status, true);
}

enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error)
{
    const struct input key = {.device = there->st_dev, .inode = there->st_ino};
    enum error_code code = ERROR_NONE;
    struct input **found;

    pthread_mutex_lock(&inputs_lock);
    found = tfind(&key, &inputs, input_compare);
    if (found && !(*found)->written && input_is_there(*found)) {
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found the file %.200s, which is read here, expected another one "
                         "to write: an input is not overwritten",
                         path, (*found)->path);
    }
    pthread_mutex_unlock(&inputs_lock);
    return code;
}

enum error_code input_file_open(const char *path, int *descriptor, size_t *size,
                                struct error *error)
{
    /* O_NONBLOCK: a pipe must not hang the open; it is refused below */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    enum error_code code = ERROR_NONE;
    struct stat status;

    if (fd < 0 && errno != ENXIO) {
        return error_set_file(error, errno, path, "cannot be read");
    }

    /* ENXIO: a socket, or a device that is not there */
    if (fd >= 0 && fstat(fd, &status)) {
        code = error_set_file(error, errno, path, "cannot be read");
    } else if (fd < 0 || !S_ISREG(status.st_mode)) {
        code = error_set(error, ERROR_INPUT, "%.200s: found %s, expected a file", path,
                         fd >= 0 && S_ISDIR(status.st_mode) ? "a directory" : "no regular file");
    } else if (!input_remember(path, &status, false)) {
        code = error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", path);
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

/* Reads size bytes; fewer are an error, as the file has become shorter. */
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
