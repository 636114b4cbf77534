/* SPDX-License-Identifier: Apache-2.0 */
/*
 * candump logs: a line is refused with a column inside it or means a legal frame whose text means
 * the same frame again; a file gives the same as its lines.
 */
#include "canbus/candump.h"

#include "tests/fuzz/fuzz.h"

#include <string.h>

static void check_frame(const struct bus_frame *frame, const char bus[16])
{
    char text[CANDUMP_LINE_MAX], bus_again[16];
    struct bus_frame again, written = *frame;
    struct error error;
    size_t size;

    fuzz_require(frame_valid(frame), "id 0x%x flags 0x%x length %u", frame->id, frame->flags,
                 frame->len);
    fuzz_require(frame->time_ns >= 0, "before time began");
    fuzz_require(bus[0] && memchr(bus, '\0', 16), "no name of a bus");
    size = candump_format(frame, bus, text);
    fuzz_require(size < CANDUMP_LINE_MAX && strlen(text) == size && text[size - 1] == '\n', "%s",
                 text);
    fuzz_require(candump_parse(text, size, &again, bus_again, &error) == ERROR_NONE, "%s: %s", text,
                 error.text);
    written.time_ns -= written.time_ns % 1000; /* a line has microseconds */
    fuzz_require(memcmp(&written, &again, sizeof again) == 0 && strcmp(bus, bus_again) == 0, "%s",
                 text);
}

static void check_line(const char *line, size_t size)
{
    struct bus_frame frame;
    struct error error = {0};
    unsigned column;
    char bus[16];

    if (candump_parse(line, size, &frame, bus, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_is_sentence(error.text) &&
                         sscanf(error.text, "column %u: ", &column) == 1 && column >= 1 &&
                         column <= size + 1,
                     "%s", error.text);
        fuzz_tally.refused++;
    } else {
        check_frame(&frame, bus);
        fuzz_tally.taken++;
    }
}

static void check_file(const char *text, size_t size)
{
    FILE *file = fmemopen((void *)(uintptr_t)text, size, "r");
    struct candump_reader reader = {.file = file, .path = "x.log"};
    struct error error = {0};
    struct bus_frame frame;
    char bus[16];
    bool end = false;

    fuzz_require(file, "no memory");
    while (!end && candump_next(&reader, &frame, bus, &end, &error) == ERROR_NONE) {
        if (!end) {
            check_frame(&frame, bus);
        }
    }
    fuzz_require(end || fuzz_has_place(error.text, "x.log", size), "%s", error.text);
    candump_close(&reader);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *text = (const char *)data, *newline = memchr(data, '\n', size);

    check_line(text, newline ? (size_t)(newline - text) + 1 : size);
    if (size > 0) {
        check_file(text, size);
    }
    return 0;
}
