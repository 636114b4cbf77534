/* SPDX-License-Identifier: Apache-2.0 */
/* Parses socketcand commands into words and requests, and formats frames. */
#include "canbus/socketcand.h"

#include "base/array.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

enum { WORDS_MAX = 72, WORD_MAX = 16, FLAG_BRS = 1, FLAG_ESI = 2 };

struct socketcand_words {
    size_t count;
    char word[WORDS_MAX][WORD_MAX + 1];
};

/* Splits size bytes of text into words; false = too many words, or one is too long. */
static bool socketcand_split_words(const char *text, size_t size, struct socketcand_words *words)
{
    size_t at = 0;

    words->count = 0;
    while (at < size) {
        size_t length = 0;

        while (at < size && isspace((unsigned char)text[at])) {
            at++;
        }
        while (at + length < size && !isspace((unsigned char)text[at + length])) {
            length++;
        }
        if (length == 0) {
            break;
        }
        if (words->count == WORDS_MAX || length > WORD_MAX ||
            memchr(text + at, '\0', length) != NULL) {
            return false;
        }
        memcpy(words->word[words->count], text + at, length);
        words->word[words->count++][length] = '\0';
        at += length;
    }
    return true;
}

/* Parses a hexadecimal number of at most `digits` digits. */
static bool socketcand_parse_hex(const char *word, size_t digits, uint32_t *value)
{
    size_t length = strlen(word);

    *value = 0;
    if (length == 0 || length > digits) {
        return false;
    }
    for (size_t i = 0; i < length; i++) {
        if (hex_value(word[i]) < 0) {
            return false;
        }
        *value = *value << 4 | (uint32_t)hex_value(word[i]);
    }
    return true;
}

/* Parses an identifier; 8 digits or a value above 7FF mean an extended one. */
static bool socketcand_parse_id(const char *word, struct bus_frame *frame)
{
    if (!socketcand_parse_hex(word, 8, &frame->id)) {
        return false;
    }
    if (strlen(word) == 8 || frame->id > 0x7ff) {
        frame->flags |= FRAME_EXTENDED;
    }
    return true;
}

/* Parses a decimal number of one or two digits. */
static bool socketcand_parse_decimal(const char *word, uint32_t *value)
{
    size_t length = strlen(word);

    *value = 0;
    for (size_t i = 0; i < length; i++) {
        if (!isdigit((unsigned char)word[i])) {
            return false;
        }
        *value = 10 * *value + (uint32_t)(word[i] - '0');
    }
    return length == 1 || length == 2;
}

/* Checks whether the words end here, optionally with a bus name, which is copied. */
static bool socketcand_parse_end(const struct socketcand_words *words, size_t at, char *bus)
{
    if (words->count == at + 1) {
        strcpy(bus, words->word[at]);
        return true;
    }
    return words->count == at;
}

/* Parses a length, that many data bytes, and an optional bus name, from word `first` on. */
static bool socketcand_parse_data(const struct socketcand_words *words, size_t first,
                                  struct bus_frame *frame, char *bus)
{
    uint32_t length, byte;

    if (words->count <= first || !socketcand_parse_decimal(words->word[first], &length) ||
        length > sizeof frame->data || words->count < first + 1 + length ||
        !socketcand_parse_end(words, first + 1 + length, bus)) {
        return false;
    }
    frame->len = (uint8_t)length;
    for (size_t i = 0; i < length; i++) {
        if (!socketcand_parse_hex(words->word[first + 1 + i], 2, &byte)) {
            return false;
        }
        frame->data[i] = (uint8_t)byte;
    }
    return true;
}

/* Parses the words behind "fdsend ID": flags, length and data of a CAN FD frame. */
static bool socketcand_parse_fd(const struct socketcand_words *words, struct bus_frame *frame,
                                char *bus)
{
    uint32_t flags;

    frame->flags |= FRAME_FD;
    if (!socketcand_parse_hex(words->word[2], 2, &flags) ||
        !socketcand_parse_data(words, 3, frame, bus)) {
        return false;
    }
    frame->flags |=
        (uint8_t)(((flags & FLAG_BRS) ? FRAME_BRS : 0) | ((flags & FLAG_ESI) ? FRAME_ESI : 0));
    return true;
}

/* Parses the word behind "sendrtr ID": the requested length of a remote frame. */
static bool socketcand_parse_remote(const struct socketcand_words *words, struct bus_frame *frame,
                                    char *bus)
{
    uint32_t length;

    frame->flags |= FRAME_REMOTE;
    /* A bus_frame does not hold the requested length */
    return socketcand_parse_decimal(words->word[2], &length) && length <= 8 &&
           socketcand_parse_end(words, 3, bus);
}

/* Parses send, fdsend and sendrtr into a frame. */
static enum socketcand_command socketcand_parse_send(const struct socketcand_words *words,
                                                     struct socketcand_request *request)
{
    struct bus_frame *frame = &request->frame;
    const char *name = words->word[0];
    bool good;

    if (words->count < 3 || !socketcand_parse_id(words->word[1], frame)) {
        return SOCKETCAND_MALFORMED;
    }
    good = strcmp(name, "send") == 0     ? socketcand_parse_data(words, 2, frame, request->bus)
           : strcmp(name, "fdsend") == 0 ? socketcand_parse_fd(words, frame, request->bus)
                                         : socketcand_parse_remote(words, frame, request->bus);
    return good && frame_valid(frame) ? SOCKETCAND_SEND : SOCKETCAND_MALFORMED;
}

/* Finds the command and parses its arguments. */
static enum socketcand_command socketcand_parse_words(const struct socketcand_words *words,
                                                      struct socketcand_request *request)
{
    static const char *const other[] = {"add",       "update",      "delete",      "subscribe",
                                        "filter",    "unsubscribe", "muxfilter",   "isotpmode",
                                        "isotpconf", "sendpdu",     "controlmode", "statistics"};
    const char *name = words->word[0];

    if (words->count == 0) {
        return SOCKETCAND_UNKNOWN;
    }
    /* Frames */
    if (strcmp(name, "send") == 0 || strcmp(name, "sendrtr") == 0 || strcmp(name, "fdsend") == 0) {
        return socketcand_parse_send(words, request);
    }

    /* Commands of a connection */
    if (strcmp(name, "open") == 0) {
        if (words->count != 2) {
            return SOCKETCAND_MALFORMED;
        }
        strcpy(request->bus, words->word[1]);
        return SOCKETCAND_OPEN;
    }
    if (strcmp(name, "rawmode") == 0) {
        return words->count == 1 ? SOCKETCAND_RAWMODE : SOCKETCAND_MALFORMED;
    }
    if (strcmp(name, "bcmmode") == 0) {
        return words->count == 1 ? SOCKETCAND_BCMMODE : SOCKETCAND_MALFORMED;
    }
    if (strcmp(name, "echo") == 0) {
        return words->count == 1 ? SOCKETCAND_ECHO : SOCKETCAND_MALFORMED;
    }

    /* Valid commands that the server does not support */
    for (size_t i = 0; i < ARRAY_COUNT(other); i++) {
        if (strcmp(name, other[i]) == 0) {
            return SOCKETCAND_OTHER;
        }
    }
    return SOCKETCAND_UNKNOWN;
}

void socketcand_parse(const char *text, size_t size, struct socketcand_request *request)
{
    struct socketcand_words words;

    memset(request, 0, sizeof *request);
    request->command = SOCKETCAND_UNKNOWN;
    if (size < 2 || text[0] != '<' || text[size - 1] != '>') {
        return;
    }
    request->command = SOCKETCAND_MALFORMED;
    if (socketcand_split_words(text + 1, size - 2, &words)) {
        request->command = socketcand_parse_words(&words, request);
    }
}

size_t socketcand_format(const struct bus_frame *frame, const char *bus,
                         char text[SOCKETCAND_TEXT_MAX])
{
    int digits = (frame->flags & FRAME_EXTENDED) ? 8 : 3;
    long long us = frame->time_ns / 1000, s = us / 1000000;
    size_t at;

    us %= 1000000;
    if (!frame_valid(frame) || (frame->flags & FRAME_ERROR) || frame->time_ns < 0) {
        text[0] = '\0';
        return 0;
    }

    /* Identifier, flags and time */
    if (frame->flags & FRAME_REMOTE) {
        at = (size_t)sprintf(text, "\n< rtr %0*X %lld.%06lld 0", digits, frame->id, s, us);
    } else if (frame->flags & FRAME_FD) {
        int flags = ((frame->flags & FRAME_BRS) ? FLAG_BRS : 0) |
                    ((frame->flags & FRAME_ESI) ? FLAG_ESI : 0);

        at = (size_t)sprintf(text, "\n< fdframe %0*X %02X %lld.%06lld ", digits, frame->id, flags,
                             s, us);
    } else {
        at = (size_t)sprintf(text, "\n< frame %0*X %lld.%06lld ", digits, frame->id, s, us);
    }

    /* Data and bus */
    for (size_t i = 0; i < frame->len && !(frame->flags & FRAME_REMOTE); i++) {
        hex_put(text + at, frame->data[i], 2);
        at += 2;
    }
    return at + (size_t)sprintf(text + at, "%s%.*s >", bus ? " " : "", SOCKETCAND_BUS_MAX,
                                bus ? bus : "");
}
