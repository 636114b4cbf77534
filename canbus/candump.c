/* SPDX-License-Identifier: Apache-2.0 */
/* Reads and writes the log format of `candump -L`, and reads its printed format. Writes without
 * printf, so that the loop may write lines. Parses strictly. */
#include "canbus/candump.h"

#include "base/input_file.h"

#include <errno.h>
#include <string.h>

#define ID_ERROR_FLAG 0x20000000u /* marks the 8-digit identifier of an error frame */

enum {
    NAME_MAX_LENGTH = 15,
    SECONDS_DIGITS = 10,
    FD_FLAG_BRS = 1, /* bits of the digit behind ## */
    FD_FLAG_ESI = 2,
    FD_FLAG_FDF = 4, /* "this is FD", set by kernels from 6.1 on; redundant */
};

/* Writes a decimal number with at least `digits` digits, padded with leading zeros. */
static char *candump_put_decimal(char *at, uint64_t value, int digits)
{
    char reversed[20];
    int count = 0;

    do {
        reversed[count++] = (char)('0' + value % 10);
        value /= 10;
    } while (value || count < digits);
    while (count > 0) {
        *at++ = reversed[--count];
    }
    return at;
}

/* Writes identifier and data of a frame: "123#0102", "12345678#R8", "123##1...", and 2xxxxxxx
 * for errors. */
static char *candump_put_frame(char *at, const struct bus_frame *frame)
{
    size_t len = frame->len;

    /* Standard identifiers have 3 digits, extended ones 8 */
    if (frame->flags & FRAME_ERROR) {
        at = hex_put(at, frame->id | ID_ERROR_FLAG, 8);
    } else {
        at = hex_put(at, frame->id, (frame->flags & FRAME_EXTENDED) ? 8 : 3);
    }
    *at++ = '#';
    /* A remote frame has no data, only a requested length */
    if (frame->flags & FRAME_REMOTE) {
        *at++ = 'R';
        return len ? hex_put(at, frame->len, 1) : at;
    }
    /* CAN FD is marked by a second # and a digit of flags */
    if (frame->flags & FRAME_FD) {
        *at++ = '#';
        at = hex_put(at,
                     ((frame->flags & FRAME_BRS) ? FD_FLAG_BRS : 0) |
                         ((frame->flags & FRAME_ESI) ? FD_FLAG_ESI : 0),
                     1);
    }
    for (size_t i = 0; i < len && i < sizeof frame->data; i++) {
        at = hex_put(at, frame->data[i], 2);
    }
    return at;
}

size_t candump_format(const struct bus_frame *frame, const char *bus, char line[CANDUMP_LINE_MAX])
{
    const uint64_t us = frame->time_ns > 0 ? (uint64_t)frame->time_ns / 1000 : 0;
    char *at = line;

    /* Time in seconds and microseconds, interface name, frame */
    *at++ = '(';
    at = candump_put_decimal(at, us / 1000000, SECONDS_DIGITS);
    *at++ = '.';
    at = candump_put_decimal(at, us % 1000000, 6);
    *at++ = ')';
    *at++ = ' ';
    for (int i = 0; i < NAME_MAX_LENGTH && bus[i]; i++) {
        *at++ = bus[i];
    }
    *at++ = ' ';
    at = candump_put_frame(at, frame);
    *at++ = '\n';
    *at = '\0';
    return (size_t)(at - line);
}

/* A line under parsing; the first error stops it. */
struct candump_cursor {
    const char *text;
    size_t size, at;
    size_t fault_column; /* from 1 */
    char fault[160];
};

/* Records the error: what was found at a place and what was expected. Returns false, which the
 * caller returns too. */
static bool candump_reject(struct candump_cursor *cursor, size_t at, const char *expected)
{
    char found[24] = "the end of the line";

    if (at < cursor->size) {
        unsigned char c = (unsigned char)cursor->text[at];

        snprintf(found, sizeof found, c >= 0x20 && c < 0x7F ? "'%c'" : "byte 0x%02X", c);
    }
    cursor->fault_column = at + 1;
    snprintf(cursor->fault, sizeof cursor->fault, "found %s, expected %s", found, expected);
    return false;
}

static bool candump_next_is(const struct candump_cursor *cursor, char wanted)
{
    return cursor->at < cursor->size && cursor->text[cursor->at] == wanted;
}

/* Consumes the given character, or rejects another one. */
static bool candump_expect(struct candump_cursor *cursor, char wanted, const char *expected)
{
    if (!candump_next_is(cursor, wanted)) {
        return candump_reject(cursor, cursor->at, expected);
    }
    cursor->at++;
    return true;
}

static bool candump_is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Returns the value of the next hexadecimal digit without consuming it, or -1. */
static int candump_next_hex(const struct candump_cursor *cursor)
{
    return cursor->at < cursor->size ? hex_value(cursor->text[cursor->at]) : -1;
}

static void candump_skip_spaces(struct candump_cursor *cursor)
{
    while (candump_next_is(cursor, ' ')) {
        cursor->at++;
    }
}

/* Parses the time, "(seconds.microseconds) ", into nanoseconds. */
static bool candump_parse_time(struct candump_cursor *cursor, int64_t *time_ns)
{
    const int64_t max_seconds = INT64_MAX / 1000000000 - 1;
    const size_t start = cursor->at + 1;
    int64_t seconds = 0, us = 0;

    /* Seconds, as many digits as there are */
    if (!candump_expect(cursor, '(', "'(' before the time")) {
        return false;
    }
    while (cursor->at < cursor->size && candump_is_digit(cursor->text[cursor->at])) {
        seconds = seconds * 10 + (cursor->text[cursor->at] - '0');
        if (seconds > max_seconds) {
            return candump_reject(cursor, start, "a time of less than 292 years");
        }
        cursor->at++;
    }
    if (cursor->at == start) {
        return candump_reject(cursor, cursor->at, "the seconds of the time");
    }

    /* Microseconds, six digits */
    if (!candump_expect(cursor, '.', "'.' between seconds and microseconds")) {
        return false;
    }
    for (int i = 0; i < 6; i++, cursor->at++) {
        if (cursor->at >= cursor->size || !candump_is_digit(cursor->text[cursor->at])) {
            return candump_reject(cursor, cursor->at, "six digits of microseconds");
        }
        us = us * 10 + (cursor->text[cursor->at] - '0');
    }
    *time_ns = seconds * 1000000000 + us * 1000;
    return candump_expect(cursor, ')', "')' after six digits of microseconds") &&
           candump_expect(cursor, ' ', "a space after the time");
}

/* Parses the interface name, "name ". candump right-aligns the names of several interfaces, so
 * more spaces may come before. */
static bool candump_parse_name(struct candump_cursor *cursor, char bus[16])
{
    size_t length = 0;

    candump_skip_spaces(cursor);
    while (cursor->at < cursor->size && cursor->text[cursor->at] > ' ' &&
           cursor->text[cursor->at] < 0x7F) {
        if (length == NAME_MAX_LENGTH) {
            return candump_reject(cursor, cursor->at, "an interface name of at most 15 characters");
        }
        bus[length++] = cursor->text[cursor->at++];
    }
    bus[length] = '\0';
    if (!length) {
        return candump_reject(cursor, cursor->at, "the name of the interface");
    }
    return candump_expect(cursor, ' ', "a space after the name of the interface");
}

/* Parses the identifier: "123", "12345678" and, for error frames, "2000xxxx". */
static bool candump_parse_id(struct candump_cursor *cursor, struct bus_frame *frame)
{
    const size_t start = cursor->at;
    uint32_t id = 0;
    size_t digits;
    int value;

    /* The number of digits distinguishes standard from extended identifiers */
    while ((value = candump_next_hex(cursor)) >= 0 && cursor->at - start < 8) {
        id = id << 4 | (uint32_t)value;
        cursor->at++;
    }
    digits = cursor->at - start;
    if (digits != 3 && digits != 8) {
        return candump_reject(cursor, cursor->at, "an identifier of 3 or 8 hexadecimal digits");
    }

    /* Checks the range; a flag bit in an identifier of 8 digits marks an error frame */
    if (digits == 3) {
        if (id > 0x7FF) {
            return candump_reject(cursor, start, "a standard identifier of at most 7FF");
        }
    } else if (id & ID_ERROR_FLAG) {
        frame->flags = FRAME_ERROR;
        id &= ~ID_ERROR_FLAG;
    } else {
        frame->flags = FRAME_EXTENDED;
    }
    if (id > 0x1FFFFFFF) {
        return candump_reject(cursor, start,
                              "an extended identifier of at most 1FFFFFFF, or 2xxxxxxx for errors");
    }
    frame->id = id;
    return true;
}

/* Parses a data byte of two hexadecimal digits, if there is one. */
static bool candump_parse_byte(struct candump_cursor *cursor, struct bus_frame *frame)
{
    const int high = candump_next_hex(cursor);
    int low;

    if (high < 0) {
        return true;
    }
    cursor->at++;
    low = candump_next_hex(cursor);
    if (low < 0) {
        return candump_reject(cursor, cursor->at, "the second hexadecimal digit of a byte");
    }
    cursor->at++;
    frame->data[frame->len++] = (uint8_t)(high << 4 | low);
    return true;
}

/* Consumes a word if it stands next. */
static bool candump_take(struct candump_cursor *cursor, const char *word)
{
    const size_t length = strlen(word);

    if (cursor->size - cursor->at < length || memcmp(cursor->text + cursor->at, word, length)) {
        return false;
    }
    cursor->at += length;
    return true;
}

/* Parses the printed format behind an identifier: "[4]  DE AD BE EF", with two digits of an FD
 * frame; "[4]  remote request"; and "ERRORFRAME" behind an error frame's data. */
static bool candump_parse_printed(struct candump_cursor *cursor, struct bus_frame *frame)
{
    size_t digits = 0, length = 0;

    /* The length */
    candump_skip_spaces(cursor);
    if (!candump_expect(cursor, '[', "'[' before the length")) {
        return false;
    }
    for (; cursor->at < cursor->size && candump_is_digit(cursor->text[cursor->at]) && digits < 2;
         cursor->at++, digits++) {
        length = 10 * length + (size_t)(cursor->text[cursor->at] - '0');
    }
    if (digits == 0 || length > (digits == 2 ? 64 : 8)) {
        return candump_reject(cursor, cursor->at, "a length of 0 to 8, or 00 to 64");
    }
    frame->flags |= digits == 2 ? FRAME_FD : 0;
    if (!candump_expect(cursor, ']', "']' after the length")) {
        return false;
    }

    /* The data */
    candump_skip_spaces(cursor);
    if (candump_take(cursor, "remote request")) {
        frame->flags |= FRAME_REMOTE;
        frame->len = (uint8_t)length;
        return true;
    }
    for (size_t i = 0; i < length; i++) {
        const size_t before = frame->len;

        candump_skip_spaces(cursor);
        if (!candump_parse_byte(cursor, frame)) {
            return false;
        }
        if (frame->len == before) {
            return candump_reject(cursor, cursor->at, "as many bytes as the length says");
        }
    }
    candump_skip_spaces(cursor);
    if ((frame->flags & FRAME_ERROR) && candump_take(cursor, "ERRORFRAME")) {
        candump_skip_spaces(cursor);
    }
    return true;
}

/* Parses the text behind "R" of a remote frame: nothing, or the requested length. */
static bool candump_parse_remote(struct candump_cursor *cursor, struct bus_frame *frame)
{
    int len;

    if (frame->flags & FRAME_ERROR) {
        return candump_reject(cursor, cursor->at, "data: an error frame is no remote frame");
    }
    cursor->at++;
    frame->flags |= FRAME_REMOTE;
    if (cursor->at == cursor->size) {
        return true;
    }
    len = candump_next_hex(cursor);
    if (len < 0 || len > 8) {
        return candump_reject(cursor, cursor->at, "the length of the remote frame, 0 to 8");
    }
    frame->len = (uint8_t)len;
    cursor->at++;
    return true;
}

/* Parses the flags of a CAN FD frame: the digit behind "##". */
static bool candump_parse_fd_flags(struct candump_cursor *cursor, struct bus_frame *frame)
{
    int flags;

    if (frame->flags & FRAME_ERROR) {
        return candump_reject(cursor, cursor->at, "data: an error frame is no FD frame");
    }
    cursor->at++;
    flags = candump_next_hex(cursor);
    if (flags < 0 || flags > (FD_FLAG_BRS | FD_FLAG_ESI | FD_FLAG_FDF)) {
        return candump_reject(cursor, cursor->at, "the flags of the FD frame, 0 to 7");
    }
    frame->flags |= FRAME_FD;
    frame->flags |= (flags & FD_FLAG_BRS) ? FRAME_BRS : 0;
    frame->flags |= (flags & FD_FLAG_ESI) ? FRAME_ESI : 0;
    cursor->at++;
    return true;
}

/* Parses the data bytes up to the first character that is no digit. */
static bool candump_parse_data(struct candump_cursor *cursor, struct bus_frame *frame)
{
    const size_t max = (frame->flags & FRAME_FD) ? 64 : 8;

    while (candump_next_hex(cursor) >= 0) {
        if (frame->len == max) {
            return candump_reject(cursor, cursor->at,
                                  max == 8 ? "at most 8 bytes of data"
                                           : "at most 64 bytes of data");
        }
        if (!candump_parse_byte(cursor, frame)) {
            return false;
        }
    }
    return true;
}

/* Checks that the line ends and that the frame's length is legal. */
static bool candump_parse_end(struct candump_cursor *cursor, const struct bus_frame *frame)
{
    if (cursor->at != cursor->size) {
        return candump_reject(cursor, cursor->at, "hexadecimal data or the end of the line");
    }
    if (!frame_valid(frame)) {
        return candump_reject(cursor, cursor->at,
                              "more data: FD has 0-8, 12, 16, 20, 24, 32, 48 or 64 bytes");
    }
    return true;
}

/* Parses a frame from its identifier to the end of the line. */
static bool candump_parse_frame(struct candump_cursor *cursor, struct bus_frame *frame)
{
    if (!candump_parse_id(cursor, frame) ||
        !candump_expect(cursor, '#', "'#' after the identifier")) {
        return false;
    }
    if (candump_next_is(cursor, 'R') || candump_next_is(cursor, 'r')) {
        if (!candump_parse_remote(cursor, frame)) {
            return false;
        }
    } else {
        if (candump_next_is(cursor, '#') && !candump_parse_fd_flags(cursor, frame)) {
            return false;
        }
        if (!candump_parse_data(cursor, frame)) {
            return false;
        }
    }
    /* Direction from "candump -x": sent or received */
    if (!candump_take(cursor, " T")) {
        candump_take(cursor, " R");
    }
    return candump_parse_end(cursor, frame);
}

/* Parses a whole line, with or without its newline. On false, the cursor has the error. */
static bool candump_parse_line(struct candump_cursor *cursor, struct bus_frame *frame, char bus[16])
{
    if (cursor->size && cursor->text[cursor->size - 1] == '\n') {
        cursor->size--;
    }
    if (cursor->size && cursor->text[cursor->size - 1] == '\r') {
        cursor->size--;
    }
    memset(frame, 0, sizeof *frame);
    bus[0] = '\0';

    /* Printed lines begin with spaces. The length stands in brackets behind the name, which may
     * contain a bracket too */
    candump_skip_spaces(cursor);
    if (!candump_parse_time(cursor, &frame->time_ns) || !candump_parse_name(cursor, bus)) {
        return false;
    }
    if (memchr(cursor->text + cursor->at, '[', cursor->size - cursor->at)) {
        candump_skip_spaces(cursor);
        return candump_parse_id(cursor, frame) && candump_parse_printed(cursor, frame) &&
               candump_parse_end(cursor, frame);
    }
    return cursor->text[0] == ' ' ? candump_reject(cursor, 0, "'(' before the time")
                                  : candump_parse_frame(cursor, frame);
}

enum error_code candump_parse(const char *line, size_t size, struct bus_frame *frame, char bus[16],
                              struct error *error)
{
    struct candump_cursor cursor = {.text = line, .size = size};

    if (!candump_parse_line(&cursor, frame, bus)) {
        return error_set(error, ERROR_INPUT, "column %zu: %s", cursor.fault_column, cursor.fault);
    }
    return ERROR_NONE;
}

enum error_code candump_open(struct candump_reader *reader, const char *path, struct error *error)
{
    *reader = (struct candump_reader){.path = path};
    return input_file_stream(path, &reader->file, error);
}

/* Reads the next line; returns its size with the newline, 0 at the end of the file, and
 * CANDUMP_LINE_MAX + 1 if the line is longer than the buffer. */
static size_t candump_read_line(FILE *file, char line[CANDUMP_LINE_MAX])
{
    size_t size = 0;
    int c;

    while ((c = getc(file)) != EOF) {
        if (size == CANDUMP_LINE_MAX) {
            return CANDUMP_LINE_MAX + 1;
        }
        line[size++] = (char)c;
        if (c == '\n') {
            break;
        }
    }
    return size;
}

enum error_code candump_next(struct candump_reader *reader, struct bus_frame *frame, char bus[16],
                             bool *end, struct error *error)
{
    char line[CANDUMP_LINE_MAX];
    struct candump_cursor cursor = {.text = line, .size = candump_read_line(reader->file, line)};

    *end = false;
    if (ferror(reader->file)) {
        return error_set_errno(error, errno, "cannot read the log %s", reader->path);
    }
    if (!cursor.size) {
        *end = true;
        return ERROR_NONE;
    }
    reader->line++;
    if (cursor.size > CANDUMP_LINE_MAX) {
        return error_set(error, ERROR_INPUT, "%s:%d:%d: the line is longer than any frame",
                         reader->path, reader->line, CANDUMP_LINE_MAX + 1);
    }
    if (!candump_parse_line(&cursor, frame, bus)) {
        return error_set(error, ERROR_INPUT, "%s:%d:%zu: %s", reader->path, reader->line,
                         cursor.fault_column, cursor.fault);
    }
    return ERROR_NONE;
}

void candump_close(struct candump_reader *reader)
{
    if (reader->file) {
        fclose(reader->file);
    }
    reader->file = NULL;
}
