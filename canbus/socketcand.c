/* SPDX-License-Identifier: Apache-2.0 */
/* Parses socketcand commands into words and requests, and formats frames. */
#include "canbus/socketcand.h"

#include "base/array.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS_MAX = 72, FLAG_BRS = 1, FLAG_ESI = 2 };

struct socketcand_words {
    size_t count;
    char *word[WORDS_MAX + 1];
    char text[SOCKETCAND_TEXT_MAX];
};

/* Splits size bytes of text into words; false = too many words, or the text is too long. */
static bool socketcand_split_words(const char *text, size_t size, struct socketcand_words *words)
{
    char *rest = words->text;

    words->count = 0;
    if (size >= sizeof words->text || memchr(text, '\0', size)) {
        return false;
    }
    memcpy(words->text, text, size);
    words->text[size] = '\0';
    while (words->count <= WORDS_MAX &&
           (words->word[words->count] = strtok_r(rest, " \t\n\v\f\r", &rest))) {
        words->count++;
    }
    return words->count <= WORDS_MAX;
}

/* Parses a hexadecimal number of at most `digits` digits. */
static bool socketcand_parse_hex(const char *word, size_t digits, uint32_t *value)
{
    size_t length = strlen(word);

    return length > 0 && length <= digits && hex_read(word, length, value);
}

/* Parses a decimal number of one or two digits. */
static bool socketcand_parse_decimal(const char *word, uint32_t *value)
{
    size_t length = strspn(word, "0123456789");

    *value = (uint32_t)strtoul(word, NULL, 10);
    return (length == 1 || length == 2) && !word[length];
}

/* Copies the name of a bus; false = it is too long. */
static bool socketcand_copy_bus(const char *word, char bus[SOCKETCAND_BUS_MAX + 1])
{
    return (size_t)snprintf(bus, SOCKETCAND_BUS_MAX + 1, "%s", word) <= SOCKETCAND_BUS_MAX;
}

/* Checks that the words end here, or after an optional bus name. Copies the bus name. */
static bool socketcand_parse_end(const struct socketcand_words *words, size_t at, char *bus)
{
    return words->count == at ||
           (words->count == at + 1 && socketcand_copy_bus(words->word[at], bus));
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

/* Parses send, fdsend and sendrtr into a frame. */
static enum socketcand_command socketcand_parse_send(const struct socketcand_words *words,
                                                     struct socketcand_request *request)
{
    struct bus_frame *frame = &request->frame;
    const char *name = words->word[0];
    uint32_t length;
    bool good;

    if (words->count < 3 || !socketcand_parse_hex(words->word[1], 8, &frame->id)) {
        return SOCKETCAND_MALFORMED;
    }
    /* 8 digits or a value above 7FF mean an extended identifier */
    if (strlen(words->word[1]) == 8 || frame->id > 0x7ff) {
        frame->flags |= FRAME_EXTENDED;
    }
    if (strcmp(name, "sendrtr") == 0) {
        /* The requested length, which a bus_frame does not hold */
        frame->flags |= FRAME_REMOTE;
        good = socketcand_parse_decimal(words->word[2], &length) && length <= 8 &&
               socketcand_parse_end(words, 3, request->bus);
    } else if (strcmp(name, "send") == 0) {
        good = socketcand_parse_data(words, 2, frame, request->bus);
    } else {
        good = socketcand_parse_fd(words, frame, request->bus);
    }
    return good && frame_valid(frame) ? SOCKETCAND_SEND : SOCKETCAND_MALFORMED;
}

/* Finds the command and parses its arguments. */
static enum socketcand_command socketcand_parse_words(const struct socketcand_words *words,
                                                      struct socketcand_request *request)
{
    /* Commands without arguments, and valid ones that the server does not support */
    static const struct {
        const char *name;
        enum socketcand_command command;
    } plain[] = {
        {"rawmode", SOCKETCAND_RAWMODE},   {"bcmmode", SOCKETCAND_BCMMODE},
        {"echo", SOCKETCAND_ECHO},         {"add", SOCKETCAND_OTHER},
        {"update", SOCKETCAND_OTHER},      {"delete", SOCKETCAND_OTHER},
        {"subscribe", SOCKETCAND_OTHER},   {"filter", SOCKETCAND_OTHER},
        {"unsubscribe", SOCKETCAND_OTHER}, {"muxfilter", SOCKETCAND_OTHER},
        {"isotpmode", SOCKETCAND_OTHER},   {"isotpconf", SOCKETCAND_OTHER},
        {"sendpdu", SOCKETCAND_OTHER},     {"controlmode", SOCKETCAND_OTHER},
        {"statistics", SOCKETCAND_OTHER},
    };
    const char *name = words->count ? words->word[0] : "";

    if (strcmp(name, "send") == 0 || strcmp(name, "sendrtr") == 0 || strcmp(name, "fdsend") == 0) {
        return socketcand_parse_send(words, request);
    }
    if (strcmp(name, "open") == 0 || strcmp(name, "tell") == 0) {
        return words->count != 2 || !socketcand_copy_bus(words->word[1], request->bus)
                   ? SOCKETCAND_MALFORMED
               : *name == 'o' ? SOCKETCAND_OPEN
                              : SOCKETCAND_TELL;
    }
    for (size_t i = 0; i < ARRAY_COUNT(plain); i++) {
        if (strcmp(name, plain[i].name) == 0) {
            return plain[i].command == SOCKETCAND_OTHER || words->count == 1 ? plain[i].command
                                                                             : SOCKETCAND_MALFORMED;
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
