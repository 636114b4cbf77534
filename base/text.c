/* SPDX-License-Identifier: Apache-2.0 */
/* Strict number reading and the nearest word. */
#include "base/text.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool text_to_double(const char *text, double *value)
{
    char *end;
    double parsed;

    /* strtod would also take spaces, inf, nan and hexadecimal */
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

bool text_is_name(const char *text)
{
    static const char letters[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    size_t length = strlen(text);

    return length > 0 && length <= LONGEST_WORD && strspn(text, letters) == length &&
           strcmp(text, ".") != 0 && strcmp(text, "..") != 0;
}

/* Levenshtein distance of two words of at most LONGEST_WORD letters */
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[LONGEST_WORD + 1], na = strlen(a), nb = strlen(b);

    for (size_t j = 0; j <= nb; j++) {
        row[j] = j;
    }
    for (size_t i = 1; i <= na; i++) {
        size_t diagonal = row[0];

        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);

            diagonal = row[j];
            best = row[j] + 1 < best ? row[j] + 1 : best;
            best = row[j - 1] + 1 < best ? row[j - 1] + 1 : best;
            row[j] = best;
        }
    }
    return row[nb];
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
            size_t distance = edit_distance(word, words[i]);

            if (distance < best) {
                best = distance;
                nearest = words[i];
            }
        }
    }
    return nearest;
}
