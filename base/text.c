/* SPDX-License-Identifier: Apache-2.0 */
/* Parses numbers strictly, checks UTF-8, and finds the nearest word. */
#include "base/text.h"

#include "base/array.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool text_to_double(const char *text, double *value)
{
    char *end;
    double parsed;

    /* Refuse spaces, inf, nan and hexadecimal numbers, which strtod accepts */
    if (*text == '\0' || strspn(text, "+-.0123456789eE") != strlen(text)) {
        return false;
    }
    errno = 0;
    parsed = strtod(text, &end);
    if (*end != '\0' || end == text || !isfinite(parsed)) {
        return false;
    }
    *value = parsed;
    return true;
}

bool text_to_int(const char *text, int64_t min, int64_t max, int64_t *value)
{
    const char *digits = text + (*text == '-' || *text == '+');
    bool hex = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    char *end;
    long long parsed;

    if (!isdigit((unsigned char)*digits)) {
        return false;
    }
    errno = 0;
    parsed = strtoll(text, &end, hex ? 16 : 10);
    if (*end != '\0' || errno == ERANGE || parsed < min || parsed > max) {
        return false;
    }
    *value = parsed;
    return true;
}

enum { LONGEST_WORD = 63 };

int text_find(const void *structs, size_t count, size_t stride, size_t offset, const char *text)
{
    for (size_t i = 0; i < count; i++) {
        const char *member = (const char *)structs + i * stride + offset;
        const char *own = *(const char *const *)(const void *)member;

        if (own && strcmp(own, text) == 0) {
            return (int)i;
        }
    }
    return -1;
}

bool text_is_name(const char *text)
{
    static const char letters[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    size_t length = strlen(text);

    return length > 0 && length <= LONGEST_WORD && strspn(text, letters) == length &&
           strcmp(text, ".") != 0 && strcmp(text, "..") != 0;
}

size_t text_utf8_length(const char *text, size_t size)
{
    /* For a length of 1 to 4 bytes: the bits of the first byte that encode the length, and the
     * lowest code with this length */
    static const struct {
        unsigned char mask, lead;
        uint32_t min;
    } form[] = {{0x80, 0x00, 0}, {0xe0, 0xc0, 0x80}, {0xf0, 0xe0, 0x800}, {0xf8, 0xf0, 0x10000}};
    const unsigned char *p = (const unsigned char *)text;

    for (size_t k = 0; k < ARRAY_COUNT(form) && k < size; k++) {
        uint32_t code = p[0] & (unsigned char)~form[k].mask;

        if ((p[0] & form[k].mask) != form[k].lead) {
            continue;
        }
        for (size_t i = 1; i <= k; i++) {
            if ((p[i] & 0xc0) != 0x80) {
                return 0;
            }
            code = code << 6 | (p[i] & 0x3f);
        }
        if (code < form[k].min || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) {
            return 0;
        }
        return k + 1;
    }
    return 0;
}

/* Returns the edit distance of two words: the least number of letters to insert, delete, replace,
 * or swap with a neighbor (optimal string alignment). Both words have at most LONGEST_WORD
 * letters. */
static size_t text_edit_distance(const char *a, const char *b)
{
    size_t rows[3][LONGEST_WORD + 1], na = strlen(a), nb = strlen(b);
    size_t *before = rows[0], *above = rows[1], *row = rows[2];

    /* Set the distances from the empty word to the first j letters of b */
    for (size_t j = 0; j <= nb; j++) {
        row[j] = j;
    }
    /* Fill the table row by row (dynamic programming); a swap needs the row before the previous
     * one */
    for (size_t i = 1; i <= na; i++) {
        size_t *spare = before;

        before = above;
        above = row;
        row = spare;
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            size_t best = above[j - 1] + (a[i - 1] != b[j - 1]);

            best = above[j] + 1 < best ? above[j] + 1 : best;
            best = row[j - 1] + 1 < best ? row[j - 1] + 1 : best;
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                best = before[j - 2] + 1 < best ? before[j - 2] + 1 : best;
            }
            row[j] = best;
        }
    }
    return row[nb];
}

/* Checks whether a character of `length` bytes is a control character. A tab is allowed. */
static bool text_is_control(const char *text, size_t length)
{
    unsigned char first = (unsigned char)text[0];

    if (length == 1) {
        return (first < 0x20 && first != '\t') || first == 0x7f;
    }
    return length == 2 && first == 0xc2 && (unsigned char)text[1] < 0xa0;
}

void text_make_printable(char *text)
{
    size_t rest = strlen(text);

    while (rest > 0) {
        size_t length = text_utf8_length(text, rest);

        if (length == 0 || text_is_control(text, length)) {
            length = length ? length : 1;
            memset(text, '?', length);
        }
        text += length;
        rest -= length;
    }
}

const char *text_nearest(const char *word, const char *const *words, size_t count)
{
    size_t length = strlen(word), limit = length / 3 > 2 ? length / 3 : 2, best = limit + 1;
    const char *nearest = NULL;

    if (length > LONGEST_WORD) {
        return NULL;
    }
    for (size_t i = 0; i < count; i++) {
        if (strlen(words[i]) <= LONGEST_WORD) {
            size_t distance = text_edit_distance(word, words[i]);

            if (distance < best) {
                best = distance;
                nearest = words[i];
            }
        }
    }
    for (size_t i = 0; i < count && !nearest && length > 2; i++) {
        nearest = strncmp(word, words[i], length) ? NULL : words[i];
    }
    return nearest;
}

const char *text_nearest_first(const char *word, const void *structs, size_t size, size_t count)
{
    const char *nearest = NULL;

    /* text_nearest is associative, so comparing pairs is enough */
    for (size_t i = 0; i < count; i++) {
        const char *one = *(const char *const *)((const char *)structs + i * size);

        nearest = text_nearest(word, (const char *[]){nearest ? nearest : one, one}, 2);
    }
    return nearest;
}
