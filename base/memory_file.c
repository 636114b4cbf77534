/* SPDX-License-Identifier: Apache-2.0 */
/* Implements a stdio stream into a buffer that grows. */
#include "base/memory_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_CAPACITY = 4096 };

/* Ensures room for `count` more bytes and a final zero. Returns false if no memory is left. */
static bool memory_file_reserve(struct memory_file *memory, size_t count)
{
    size_t capacity = memory->capacity;
    char *text;

    while (capacity - memory->size <= count) {
        capacity *= 2;
    }
    if (capacity == memory->capacity) {
        return true;
    }
    text = realloc(memory->text, capacity);
    if (text) {
        memory->text = text;
        memory->capacity = capacity;
    }
    return text != NULL;
}

/* Appends bytes; the write function of the stream. */
static ssize_t memory_file_append(void *cookie, const char *bytes, size_t count)
{
    struct memory_file *memory = cookie;

    /* After lost bytes append nothing more, so that the text has no gap */
    if (memory->failed || !memory_file_reserve(memory, count)) {
        memory->failed = true;
        errno = ENOMEM;
        return 0;
    }
    memcpy(memory->text + memory->size, bytes, count);
    memory->size += count;
    memory->text[memory->size] = '\0';
    return (ssize_t)count;
}

FILE *memory_file_open(struct memory_file *memory)
{
    FILE *file;

    *memory = (struct memory_file){.text = calloc(FIRST_CAPACITY, 1), .capacity = FIRST_CAPACITY};
    file = memory->text
               ? fopencookie(memory, "w", (cookie_io_functions_t){.write = memory_file_append})
               : NULL;
    if (!file) {
        free(memory->text);
        memory->text = NULL;
    }
    return file;
}

enum error_code memory_file_close(FILE *file, struct memory_file *memory, const char *what,
                                  struct error *error)
{
    const bool write_failed = ferror(file) != 0;
    const bool flush_failed = fclose(file) != 0;

    if (!write_failed && !flush_failed && !memory->failed) {
        return ERROR_NONE;
    }
    free(memory->text);
    memory->text = NULL;
    return error_set(error, ERROR_MEMORY, "no memory left for %s", what);
}
