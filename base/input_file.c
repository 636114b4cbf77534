/* SPDX-License-Identifier: Apache-2.0 */
/* Opens regular files for reading, and remembers which. */
#include "base/input_file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A file that was read, or written by this process, and the last name that it was opened by; none
 * when that is too long to be kept. */
struct input {
    dev_t device;
    ino_t inode;
    bool written;
    char path[232];
};

/* The last inputs of this process, in a ring without the heap: what opens a file holds nothing of
 * it when it is closed. Threads may open files too. */
enum { INPUTS_MAX = 1024 };
static struct input inputs[INPUTS_MAX];
static size_t ninput;
static pthread_mutex_t inputs_lock = PTHREAD_MUTEX_INITIALIZER;

/* Finds a file among the inputs, the newest first; NULL = it is none. */
static struct input *input_find(const struct stat *status)
{
    const size_t kept = ninput < INPUTS_MAX ? ninput : INPUTS_MAX;

    for (size_t i = 1; i <= kept; i++) {
        struct input *input = &inputs[(ninput - i) % INPUTS_MAX];

        if (input->device == status->st_dev && input->inode == status->st_ino) {
            return input;
        }
    }
    return NULL;
}

/* Returns whether the name of an input is still its own: a file that is gone may have left its
 * inode to another one. */
static bool input_is_there(const struct input *input)
{
    struct stat now;

    return !input->path[0] ||
           (!stat(input->path, &now) && now.st_dev == input->device && now.st_ino == input->inode);
}

/* Adds a file to the inputs, or gives one its new name. */
static void input_remember(const char *path, const struct stat *status, bool written)
{
    struct input *input;

    pthread_mutex_lock(&inputs_lock);
    input = input_find(status);
    /* What was written here stays so when it is read back */
    if (!input || !input->written || !input_is_there(input)) {
        if (!input) {
            input = &inputs[ninput++ % INPUTS_MAX];
        }
        *input = (struct input){status->st_dev, status->st_ino, written, ""};
        if (strlen(path) < sizeof input->path) {
            strcpy(input->path, path);
        }
    }
    pthread_mutex_unlock(&inputs_lock);
}

void input_file_written(const char *path, const struct stat *status)
{
    input_remember(path, status, true);
}

enum error_code input_file_check_output(const char *path, const struct stat *there,
                                        struct error *error)
{
    enum error_code code = ERROR_NONE;
    const struct input *found;

    pthread_mutex_lock(&inputs_lock);
    found = input_find(there);
    if (found && !found->written && input_is_there(found)) {
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found the file %.200s, which is read here, expected another one "
                         "to write: an input is not overwritten",
                         path, found->path[0] ? found->path : path);
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
    } else {
        input_remember(path, &status, false);
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
