/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What fuzz targets share. A target is a file with one LLVMFuzzerTestOneInput: it feeds the bytes
 * to the code under test and states with fuzz_require what must hold whatever they are. It keeps
 * nothing from one call to the next, so that an input alone repeats what it did.
 */
#ifndef TESTS_FUZZ_FUZZ_H
#define TESTS_FUZZ_FUZZ_H

#include "base/arena.h"

#include <stdint.h>
#include <stdio.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Ends the process with a message when the condition is false. */
#define fuzz_require(condition, ...)                                                               \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            fuzz_fail(__FILE__, __LINE__, #condition, __VA_ARGS__);                                \
        }                                                                                          \
    } while (0)

_Noreturn void fuzz_fail(const char *file, int line, const char *condition, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* How many inputs the code under test took and refused; a target that calls these is expected to
 * see both (tests/fuzz/replay.c). */
struct fuzz_tally {
    uint64_t taken, refused;
};
extern struct fuzz_tally fuzz_tally;

/* An empty arena; the same one each time. */
struct arena *fuzz_arena(size_t capacity);

/* Whether a message is "FILE:LINE:COLUMN: text" with a place that lies in a text of so many bytes,
 * on one line and printable. */
bool fuzz_has_place(const char *message, const char *file, size_t size);

/* Whether a message is not empty, on one line and free of control characters but tabs. */
bool fuzz_is_sentence(const char *message);

/* An input taken as numbers, one after the other; behind its end there are zeros. */
struct fuzz_bytes {
    const uint8_t *at;
    size_t left;
};

uint8_t fuzz_u8(struct fuzz_bytes *bytes);
uint16_t fuzz_u16(struct fuzz_bytes *bytes); /* little-endian, as the next */
uint32_t fuzz_u32(struct fuzz_bytes *bytes);
uint64_t fuzz_u64(struct fuzz_bytes *bytes);
void fuzz_copy(struct fuzz_bytes *bytes, void *to, size_t size);

/* From -scale to scale in steps of a 32768th; at the ends, now and then, what a broken sensor would
 * say: not a number, infinity, huge, tiny. */
double fuzz_real(struct fuzz_bytes *bytes, double scale);

/* A new frame, valid or not. */
struct bus_frame;
void fuzz_frame(struct fuzz_bytes *bytes, struct bus_frame *frame);

/* The text of a file in memory: stdio that writes, then the result. */
struct fuzz_text {
    FILE *file;
    char *text;
    size_t size;
};
FILE *fuzz_text_open(struct fuzz_text *text);
void fuzz_text_finish(struct fuzz_text *text); /* text and size are valid after it */
void fuzz_text_free(struct fuzz_text *text);

/* A folder of its own under /tmp, removed at the end of the process with all that lies in it. */
const char *fuzz_folder(void);

/* Writes FOLDER/NAME; subfolders are made. */
void fuzz_write_file(const char *name, const void *data, size_t size);

#endif
