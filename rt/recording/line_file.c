/* SPDX-License-Identifier: Apache-2.0 */
/* Writes whole lines or records into a file. Ends the file if a write fails. */
#include "rt/recording/line_file.h"

#include "base/whole_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
    BUFFER = 64 * 1024,
    /* most bytes per write to a pipe, so that the beat shows the progress of a slow reader */
    PIECE = 4096,
};

/* ---- the end of a file ---- */

/* Returns the number of lines that end in a part of the buffer. In record mode the buffer holds at
 * most one record. */
static uint64_t line_file_count(const struct line_file *file, const char *text, size_t size)
{
    uint64_t count = 0;

    if (file->records) {
        return size > 0;
    }

    for (size_t i = 0; i < size; i++) {
        count += text[i] == '\n';
    }
    return count;
}

/* Counts the bytes of the buffer that are in the file, and cuts a partial line off the file. False
 * = a partial line or record remains. */
static bool line_file_cut(struct line_file *file)
{
    size_t whole = file->taken;
    bool clean;

    while (whole > 0 && !(file->records ? whole == file->used : file->buffer[whole - 1] == '\n')) {
        whole--;
    }
    clean = whole == file->taken ||
            (file->regular && ftruncate(file->descriptor, file->size + (off_t)whole) == 0);
    file->lines += line_file_count(file, file->buffer, whole);
    file->unwritten += line_file_count(file, file->buffer + whole, file->used - whole);
    file->used = file->taken = 0;
    return clean;
}

/* Closes the file for good; `error` is already set. */
static void line_file_end(struct line_file *file)
{
    close(file->descriptor);
    file->descriptor = -1;
    atomic_store(&file->ended, true);
}

/* Ends a file after a failed write; reason: its errno. */
static void line_file_end_failed(struct line_file *file, int reason)
{
    bool clean = line_file_cut(file);

    error_set_errno(&file->error, reason,
                    "cannot write %s: recording of it ends here%s, the run goes on", file->path,
                    clean           ? ""
                    : file->records ? " with half a record"
                                    : " with half a line");
    line_file_end(file);
}

/* ---- writing ---- */

void line_file_flush(struct line_file *file)
{
    while (file->descriptor >= 0 && file->taken < file->used) {
        size_t rest = file->used - file->taken;
        ssize_t count = write(file->descriptor, file->buffer + file->taken,
                              !file->regular && rest > PIECE ? PIECE : rest);

        if (count < 0 && errno != EINTR) {
            line_file_end_failed(file, errno);
        } else if (count > 0) {
            file->taken += (size_t)count;
            atomic_fetch_add_explicit(file->beat, 1, memory_order_relaxed);
        }
    }
    file->size += (int64_t)file->used;
    file->lines += line_file_count(file, file->buffer, file->used);
    file->used = file->taken = 0;
}

void line_file_put(struct line_file *file, const char *line, size_t size)
{
    if (file->used + size > file->capacity) {
        line_file_flush(file);
    }
    if (file->descriptor < 0) {
        file->unwritten++;
        return;
    }
    memcpy(file->buffer + file->used, line, size);
    file->used += size;
    /* Write a record at once, so that a cut never falls inside the buffer */
    if (file->records) {
        line_file_flush(file);
    }
}

void line_file_look(struct line_file *file)
{
    struct stat here, there;

    if (file->descriptor < 0 || !file->regular || fstat(file->descriptor, &here)) {
        return;
    }
    /* A file without links was removed. If the old name now refers to another file or none, it was
     * renamed */
    if (here.st_nlink == 0) {
        /* End a file that was removed: all its lines count as unwritten */
        line_file_cut(file);
        file->unwritten += file->lines;
        file->lines = 0;
        error_set(&file->error, ERROR_SYSTEM,
                  "%s was removed while it was written: recording of it ends here, the run goes on",
                  file->path);
        line_file_end(file);
    } else if (stat(file->path, &there)
                   ? errno == ENOENT
                   : there.st_ino != here.st_ino || there.st_dev != here.st_dev) {
        atomic_store(&file->moved, true);
    }
}

void line_file_abandon(struct line_file *file)
{
    if (file->descriptor < 0) {
        return;
    }
    if (file->regular) {
        off_t at = lseek(file->descriptor, 0, SEEK_CUR);

        file->taken = at > file->size ? (size_t)(at - file->size) : 0;
    }
    line_file_end_failed(file, ETIMEDOUT);
}

void line_file_close(struct line_file *file)
{
    line_file_flush(file);
    if (file->descriptor >= 0 && close(file->descriptor)) {
        error_set_errno(&file->error, errno, "cannot write %s to its end", file->path);
        atomic_store(&file->ended, true);
    }
    file->descriptor = -1;
}

void line_file_remove(struct line_file *file)
{
    if (file->descriptor >= 0) {
        close(file->descriptor);
    }
    file->descriptor = -1;
    if (file->regular) {
        unlink(file->path);
    }
}

/* ---- opening ---- */

enum error_code line_file_open(struct line_file *file, const char *directory, const char *name,
                               const char *title, size_t longest, _Atomic uint64_t *beat,
                               struct arena *arena, struct error *error)
{
    enum error_code code;
    struct stat info;

    memset(file, 0, sizeof *file);
    file->descriptor = -1;
    if ((size_t)snprintf(file->path, sizeof file->path, "%s/%s", directory, name) >=
        sizeof file->path) {
        return error_set(error, ERROR_INPUT,
                         "the name of the directory to record into is too long");
    }
    file->beat = beat;
    file->capacity = longest > BUFFER ? longest : BUFFER;
    file->buffer = arena_alloc(arena, file->capacity, 1);
    if (!file->buffer) {
        return error_set(error, ERROR_MEMORY, "no memory left for %s", file->path);
    }
    code = growing_file_open(file->path, &file->descriptor, error);
    if (code) {
        return code;
    }
    file->regular = fstat(file->descriptor, &info) == 0 && S_ISREG(info.st_mode);
    /* Write the whole title line */
    for (size_t length = strlen(title); (size_t)file->size < length;) {
        ssize_t count = write(file->descriptor, title + file->size, length - (size_t)file->size);

        if (count < 0 && errno != EINTR) {
            error_set_errno(error, errno, "cannot write %s", file->path);
            close(file->descriptor);
            file->descriptor = -1;
            return error->code;
        }
        file->size += count > 0 ? count : 0;
    }
    return ERROR_NONE;
}
