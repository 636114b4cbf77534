/* SPDX-License-Identifier: Apache-2.0 */
/* Reads and writes the log format of `candump -L`, and reads its printed format. Writes without
 * printf, so that the loop may write lines. */
#include "canbus/candump.h"

#include "base/input_file.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define ID_ERROR_FLAG 0x20000000u /* flag in the 8-digit identifier of an error frame */

enum {
    NAME_MAX_LENGTH = 15,
    SECONDS_DIGITS = 10,
    FD_FLAG_BRS = 1, /* bits of the flags digit behind "##" */
    FD_FLAG_ESI = 2,
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

/* State of the parser of a line. The first error ends parsing. */
struct candump_cursor {
    const char *text;
    size_t size, at;
    size_t fault_column; /* from 1 */
    char fault[160];
};

/* Stores an error: what was found at a column, and what was expected. Returns false, so that a
 * caller can return the result. */
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

/* Returns the next character without consuming it; '\0' at the end of the line. */
static char candump_next_char(const struct candump_cursor *cursor)
{
    return cursor->at < cursor->size ? cursor->text[cursor->at] : '\0';
}

/* Consumes a word if it is the next text. */
static bool candump_take(struct candump_cursor *cursor, const char *word)
{
    const size_t length = strlen(word);

    if (cursor->size - cursor->at < length || memcmp(cursor->text + cursor->at, word, length)) {
        return false;
    }
    cursor->at += length;
    return true;
}

/* Consumes a word. If other text is next, stores an error. */
static bool candump_expect(struct candump_cursor *cursor, const char *word, const char *expected)
{
    return candump_take(cursor, word) || candump_reject(cursor, cursor->at, expected);
}

static void candump_skip_spaces(struct candump_cursor *cursor)
{
    while (candump_next_char(cursor) == ' ') {
        cursor->at++;
    }
}

/* Consumes a decimal number of at most `most` digits. Returns the number of its digits. */
static size_t candump_take_decimal(struct candump_cursor *cursor, size_t most, int64_t *value)
{
    const size_t start = cursor->at;

    *value = 0;
    while (cursor->at - start < most && isdigit((unsigned char)candump_next_char(cursor))) {
        *value = *value * 10 + (cursor->text[cursor->at++] - '0');
    }
    return cursor->at - start;
}

/* Parses the time, "(seconds.fraction)", into nanoseconds. Tools write six or nine digits. */
static bool candump_parse_time(struct candump_cursor *cursor, int64_t *time_ns)
{
    int64_t seconds, ns;
    size_t digits;

    if (!candump_expect(cursor, "(", "'(' before the time")) {
        return false;
    }
    if (!candump_take_decimal(cursor, 18, &seconds)) {
        return candump_reject(cursor, cursor->at, "the seconds of the time");
    }
    if (seconds >= INT64_MAX / 1000000000) {
        return candump_reject(cursor, cursor->at, "a time of less than 292 years");
    }
    if (!candump_expect(cursor, ".", "'.' between seconds and their fraction")) {
        return false;
    }
    digits = candump_take_decimal(cursor, 9, &ns);
    if (!digits) {
        return candump_reject(cursor, cursor->at, "one to nine digits of a second's fraction");
    }
    for (; digits < 9; digits++) {
        ns *= 10;
    }
    *time_ns = seconds * 1000000000 + ns;
    return candump_expect(cursor, ")", "')' after at most nine digits of the fraction");
}

/* Parses the interface name. candump right-aligns the names of several interfaces with spaces. */
static bool candump_parse_name(struct candump_cursor *cursor, char bus[16])
{
    size_t length = 0;

    candump_skip_spaces(cursor);
    while (isgraph((unsigned char)candump_next_char(cursor))) {
        if (length == NAME_MAX_LENGTH) {
            return candump_reject(cursor, cursor->at, "an interface name of at most 15 characters");
        }
        bus[length++] = cursor->text[cursor->at++];
    }
    bus[length] = '\0';
    return length ? candump_expect(cursor, " ", "a space after the name of the interface")
                  : candump_reject(cursor, cursor->at, "the name of the interface");
}

/* Parses the identifier: "123", "12345678" and, for error frames, "2000xxxx". */
static bool candump_parse_id(struct candump_cursor *cursor, struct bus_frame *frame)
{
    const char *text = cursor->text + cursor->at;
    const size_t start = cursor->at;

    /* The number of digits distinguishes standard from extended identifiers */
    while (cursor->at - start < 8 && hex_value(candump_next_char(cursor)) >= 0) {
        cursor->at++;
    }
    if (cursor->at - start != 3 && cursor->at - start != 8) {
        return candump_reject(cursor, cursor->at, "an identifier of 3 or 8 hexadecimal digits");
    }
    hex_read(text, cursor->at - start, &frame->id);

    /* Checks the range; a flag bit in an identifier of 8 digits marks an error frame */
    if (cursor->at - start == 3) {
        return frame->id <= 0x7FF ||
               candump_reject(cursor, start, "a standard identifier of at most 7FF");
    }
    frame->flags = frame->id & ID_ERROR_FLAG ? FRAME_ERROR : FRAME_EXTENDED;
    frame->id &= ~ID_ERROR_FLAG;
    return frame->id <= 0x1FFFFFFF ||
           candump_reject(cursor, start,
                          "an extended identifier of at most 1FFFFFFF, or 2xxxxxxx for errors");
}

/* Parses a data byte, two hexadecimal digits. The caller has checked the first digit. */
static bool candump_parse_byte(struct candump_cursor *cursor, struct bus_frame *frame)
{
    const int high = hex_value(candump_next_char(cursor));
    int low;

    cursor->at++;
    low = hex_value(candump_next_char(cursor));
    if (low < 0) {
        return candump_reject(cursor, cursor->at, "the second hexadecimal digit of a byte");
    }
    cursor->at++;
    frame->data[frame->len++] = (uint8_t)(high << 4 | low);
    return true;
}

/* Parses the printed format behind an identifier: "[4] DE AD BE EF" or "[4] remote request". The
 * length of an FD frame has two digits. */
static bool candump_parse_printed(struct candump_cursor *cursor, struct bus_frame *frame)
{
    int64_t length;
    size_t digits;

    candump_skip_spaces(cursor);
    if (!candump_expect(cursor, "[", "'#' or a '[' before the length after the identifier")) {
        return false;
    }
    digits = candump_take_decimal(cursor, 2, &length);
    if (digits == 0 || length > (digits == 2 ? 64 : 8)) {
        return candump_reject(cursor, cursor->at, "a length of 0 to 8, or 00 to 64");
    }
    if (!candump_expect(cursor, "]", "']' after the length")) {
        return false;
    }
    candump_skip_spaces(cursor);
    if (candump_take(cursor, "remote request")) {
        frame->flags |= FRAME_REMOTE;
        frame->len = (uint8_t)length;
        return true;
    }
    frame->flags |= digits == 2 ? FRAME_FD : 0;
    while (frame->len < length) {
        candump_skip_spaces(cursor);
        if (hex_value(candump_next_char(cursor)) < 0) {
            return candump_reject(cursor, cursor->at, "as many bytes as the length says");
        }
        if (!candump_parse_byte(cursor, frame)) {
            return false;
        }
    }
    return true;
}

/* Parses the text behind "ID#". Classic frame: data. Remote frame: "R" and a length. CAN FD frame:
 * "#", flags and data. There may be a '.' between bytes. */
static bool candump_parse_data(struct candump_cursor *cursor, struct bus_frame *frame)
{
    size_t most = 8;

    if (candump_take(cursor, "R") || candump_take(cursor, "r")) {
        const int length = hex_value(candump_next_char(cursor));

        frame->flags |= FRAME_REMOTE;
        if (frame->flags & FRAME_ERROR || length > 8) {
            return candump_reject(cursor, cursor->at, "a remote frame of 0 to 8 bytes");
        }
        frame->len = length < 0 ? 0 : (uint8_t)length;
        cursor->at += length >= 0;
        return true;
    }
    if (candump_take(cursor, "#")) {
        const int flags = hex_value(candump_next_char(cursor));

        if (frame->flags & FRAME_ERROR || flags < 0) {
            return candump_reject(cursor, cursor->at, "the flags of an FD frame, one digit");
        }
        frame->flags |= FRAME_FD | (flags & FD_FLAG_BRS ? FRAME_BRS : 0) |
                        (flags & FD_FLAG_ESI ? FRAME_ESI : 0);
        cursor->at++;
        most = 64;
    }
    while (hex_value(candump_next_char(cursor)) >= 0 ||
           (frame->len > 0 && candump_take(cursor, "."))) {
        if (frame->len == most) {
            return candump_reject(cursor, cursor->at,
                                  most == 8 ? "at most 8 bytes of data"
                                            : "at most 64 bytes of data");
        }
        if (hex_value(candump_next_char(cursor)) >= 0 && !candump_parse_byte(cursor, frame)) {
            return false;
        }
    }
    /* Length codes above 8, "_9" to "_F", also mean 8 bytes */
    if (frame->len == 8 && most == 8 && candump_take(cursor, "_")) {
        cursor->at += hex_value(candump_next_char(cursor)) > 8;
    }
    return true;
}

/* Parses a whole line, with or without its newline; false = the cursor has the error. Skips text
 * after the frame and a space, such as a direction, ERRORFRAME, or the data as characters. */
static bool candump_parse_line(struct candump_cursor *cursor, struct bus_frame *frame, char bus[16])
{
    uint8_t rates = 0;

    while (cursor->size &&
           (cursor->text[cursor->size - 1] == '\n' || cursor->text[cursor->size - 1] == '\r')) {
        cursor->size--;
    }
    memset(frame, 0, sizeof *frame);
    bus[0] = '\0';
    candump_skip_spaces(cursor);
    if (!candump_parse_time(cursor, &frame->time_ns) || !candump_parse_name(cursor, bus)) {
        return false;
    }

    /* Consume the fields that `candump -x` prints before the identifier: "RX" or "TX", then the FD
     * flags 'B' and 'E', or '-' */
    candump_skip_spaces(cursor);
    if (candump_take(cursor, "RX ") || candump_take(cursor, "TX ")) {
        candump_skip_spaces(cursor);
        rates |= candump_take(cursor, "B ") ? FRAME_BRS : 0;
        candump_take(cursor, "- ");
        candump_skip_spaces(cursor);
        rates |= candump_take(cursor, "E ") ? FRAME_ESI : 0;
        candump_take(cursor, "- ");
        candump_skip_spaces(cursor);
    }

    if (!candump_parse_id(cursor, frame) ||
        !(candump_take(cursor, "#") ? candump_parse_data(cursor, frame)
                                    : candump_parse_printed(cursor, frame))) {
        return false;
    }
    if (cursor->at < cursor->size && !isspace((unsigned char)cursor->text[cursor->at])) {
        return candump_reject(cursor, cursor->at, "hexadecimal data or the end of the line");
    }
    /* Extend an FD frame to the next valid length, as can-utils do */
    if (frame->flags & FRAME_FD) {
        frame->flags |= rates;
        frame->len = frame_fd_length(frame->len);
    }
    return true;
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

enum error_code candump_next(struct candump_reader *reader, struct bus_frame *frame, char bus[16],
                             bool *end, struct error *error)
{
    char line[CANDUMP_LINE_MAX + 1];
    struct candump_cursor cursor;

    for (;;) {
        cursor = (struct candump_cursor){.text = line};

        /* Read the next line. Its size includes the newline; 0 = end of the file. For a longer line
         * than the buffer the size is CANDUMP_LINE_MAX + 1. */
        int c;

        while ((c = getc(reader->file)) != EOF) {
            if (cursor.size < CANDUMP_LINE_MAX) {
                line[cursor.size] = (char)c;
            }
            cursor.size += cursor.size <= CANDUMP_LINE_MAX;
            if (c == '\n') {
                break;
            }
        }
        *end = !cursor.size;
        if (ferror(reader->file)) {
            return error_set_errno(error, errno, "cannot read the log %s", reader->path);
        }
        if (*end) {
            return ERROR_NONE;
        }
        reader->line++;
        line[cursor.size < CANDUMP_LINE_MAX ? cursor.size : CANDUMP_LINE_MAX] = '\0';
        if (line[strspn(line, " ")] == '(') {
            break;
        }

        /* Count a line without a frame, such as a comment. For a DROPCOUNT line, also count the
         * lost frames. */
        static const char lost[] = "DROPCOUNT: dropped ";

        reader->skipped_line = reader->skipped++ ? reader->skipped_line : reader->line;
        if (cursor.size > sizeof lost && !memcmp(line, lost, sizeof lost - 1)) {
            reader->lost += strtoull(line + sizeof lost - 1, NULL, 10);
        }
    }
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

bool candump_skipped(const struct candump_reader *reader, char *text, size_t size)
{
    int at =
        snprintf(text, size, "%" PRIu64 " line%s without a frame skipped, the first is line %d",
                 reader->skipped, reader->skipped == 1 ? "" : "s", reader->skipped_line);

    if (reader->lost && at > 0 && (size_t)at < size) {
        snprintf(text + at, size - (size_t)at,
                 "; %" PRIu64 " frames were lost when it was written (DROPCOUNT)", reader->lost);
    }
    return reader->skipped > 0;
}

void candump_close(struct candump_reader *reader)
{
    if (reader->file) {
        fclose(reader->file);
    }
    reader->file = NULL;
}
