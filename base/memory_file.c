/* SPDX-License-Identifier: Apache-2.0 */
/* A stream into memory. */
#include "base/memory_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST = 4096 };

/* for count bytes and a zero */
static bool make_room(struct memory_file *memory, size_t count)
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

static ssize_t append(void *cookie, const char *bytes, size_t count)
{
    struct memory_file *memory = cookie;

    /* nothing more after what was lost: no holes */
    if (memory->failed || !make_room(memory, count)) {
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

    *memory = (struct memory_file){.text = calloc(FIRST, 1), .capacity = FIRST};
    file = memory->text ? fopencookie(memory, "w", (cookie_io_functions_t){.write = append}) : NULL;
    if (!file) {
        free(memory->text);
        memory->text = NULL;
    }
    return file;
}

enum error_code memory_file_close(FILE *file, struct memory_file *memory, const char *what,
                                  struct error *error)
{
    bool bad = ferror(file) != 0;

    bad = fclose(file) != 0 || bad || memory->failed;
    if (!bad) {
        return ERROR_NONE;
    }
    free(memory->text);
    memory->text = NULL;
    return error_set(error, ERROR_MEMORY, "no memory left for %s", what);
}
