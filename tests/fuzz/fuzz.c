/* SPDX-License-Identifier: Apache-2.0 */
/* What fuzz targets share; see the header. */
#include "tests/fuzz/fuzz.h"

#include "canbus/frame.h"

#include <ftw.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

struct fuzz_tally fuzz_tally;

void fuzz_fail(const char *file, int line, const char *condition, const char *format, ...)
{
    va_list arguments;

    fprintf(stderr, "%s:%d: not so: %s: ", file, line, condition);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    abort();
}

struct arena *fuzz_arena(size_t capacity)
{
    static struct arena arena;

    arena_fini(&arena);
    fuzz_require(arena_init(&arena, capacity, NULL) == ERROR_NONE, "no memory");
    return &arena;
}

bool fuzz_is_sentence(const char *message)
{
    if (!*message) {
        return false;
    }
    for (const char *at = message; *at; at++) {
        if (((unsigned char)*at < 0x20 && *at != '\t') || *at == 0x7f) {
            return false;
        }
    }
    return true;
}

bool fuzz_has_place(const char *message, const char *file, size_t size)
{
    const size_t length = strlen(file);
    unsigned long line, column;
    int end = 0;

    return fuzz_is_sentence(message) && strncmp(message, file, length) == 0 &&
           sscanf(message + length, ":%lu:%lu: %n", &line, &column, &end) == 2 && end > 0 &&
           message[length + (size_t)end] && line >= 1 && line <= size + 1 && column >= 1 &&
           column <= size + 1;
}

uint8_t fuzz_u8(struct fuzz_bytes *bytes)
{
    if (bytes->left == 0) {
        return 0;
    }
    bytes->left--;
    return *bytes->at++;
}

uint16_t fuzz_u16(struct fuzz_bytes *bytes)
{
    const uint16_t low = fuzz_u8(bytes);

    return (uint16_t)(low | fuzz_u8(bytes) << 8);
}

uint32_t fuzz_u32(struct fuzz_bytes *bytes)
{
    const uint32_t low = fuzz_u16(bytes);

    return low | (uint32_t)fuzz_u16(bytes) << 16;
}

uint64_t fuzz_u64(struct fuzz_bytes *bytes)
{
    const uint64_t low = fuzz_u32(bytes);

    return low | (uint64_t)fuzz_u32(bytes) << 32;
}

void fuzz_copy(struct fuzz_bytes *bytes, void *to, size_t size)
{
    const size_t count = size < bytes->left ? size : bytes->left;

    memset(to, 0, size);
    memcpy(to, bytes->at, count);
    bytes->at += count;
    bytes->left -= count;
}

double fuzz_real(struct fuzz_bytes *bytes, double scale)
{
    const int16_t number = (int16_t)fuzz_u16(bytes);

    switch (number) {
    case INT16_MIN:
        return (double)NAN;
    case INT16_MIN + 1:
        return -(double)INFINITY;
    case INT16_MIN + 2:
        return -1e300;
    case INT16_MIN + 3:
        return -0.0;
    case INT16_MAX:
        return (double)INFINITY;
    case INT16_MAX - 1:
        return 1e300;
    case INT16_MAX - 2:
        return 1e-310;
    default:
        return scale * number / 32768.0;
    }
}

void fuzz_frame(struct fuzz_bytes *bytes, struct bus_frame *frame)
{
    *frame = (struct bus_frame){.flags = fuzz_u8(bytes), .len = fuzz_u8(bytes)};
    frame->id = frame->flags & FRAME_EXTENDED ? fuzz_u32(bytes) : fuzz_u16(bytes);
    fuzz_copy(bytes, frame->data, frame->len < sizeof frame->data ? frame->len : 64);
}

FILE *fuzz_text_open(struct fuzz_text *text)
{
    *text = (struct fuzz_text){.file = NULL};
    text->file = open_memstream(&text->text, &text->size);
    fuzz_require(text->file, "no memory");
    return text->file;
}

void fuzz_text_finish(struct fuzz_text *text)
{
    fuzz_require(fclose(text->file) == 0, "no memory");
    text->file = NULL;
}

void fuzz_text_free(struct fuzz_text *text)
{
    free(text->text);
}

static char folder[] = "/tmp/hil-fuzz-XXXXXX";

static int remove_entry(const char *path, const struct stat *status, int type, struct FTW *at)
{
    (void)status, (void)type, (void)at;
    return remove(path);
}

static void remove_folder(void)
{
    nftw(folder, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

const char *fuzz_folder(void)
{
    static bool made;

    if (!made) {
        fuzz_require(mkdtemp(folder) && atexit(remove_folder) == 0, "no folder");
        made = true;
    }
    return folder;
}

void fuzz_write_file(const char *name, const void *data, size_t size)
{
    char path[256];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
    for (char *at = path + sizeof folder; (at = strchr(at, '/')); at++) {
        *at = '\0';
        mkdir(path, 0700);
        *at = '/';
    }
    file = fopen(path, "w");
    fuzz_require(file && fwrite(data, 1, size, file) == size && fclose(file) == 0,
                 "cannot write %s", path);
}
