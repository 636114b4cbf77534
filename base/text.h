/* SPDX-License-Identifier: Apache-2.0 */
/* Strict parsing of text that people write: numbers, names and UTF-8. Also finds the nearest known
 * word for a misspelled one. Not RT-safe. */
#ifndef BASE_TEXT_H
#define BASE_TEXT_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Parses the whole text as a finite double in C notation. Refuses spaces, inf, nan and hexadecimal
 * numbers. If it returns false, *value is unchanged. */
bool text_to_double(const char *text, double *value);

/* Parses the whole text as an integer in [min, max], decimal or hexadecimal with 0x. If it returns
 * false, *value is unchanged. */
bool text_to_int(const char *text, int64_t min, int64_t max, int64_t *value);

/* Checks whether text is a valid name: 1 to 63 letters, digits, '_', '-' and '.', except "." and
 * "..". A valid name is safe in messages, command lines and file names. */
bool text_is_name(const char *text);

/* Returns the length in bytes of the first UTF-8 character of text. Reads at most `size` bytes. 0 =
 * invalid; overlong forms, surrogates and codes beyond Unicode are invalid. */
size_t text_utf8_length(const char *text, size_t size);

/* Replaces each byte that could control a terminal by '?'. These are control characters except tab,
 * C1 controls in UTF-8, and bytes that are not UTF-8. The length does not change. */
void text_make_printable(char *text);

/* Returns the index of the first of `count` structs, each of `stride` bytes, whose member at this
 * offset is `text`; -1 = none. TEXT_FIND names the member. TEXT_INDEX searches a list of texts. A
 * member is a pointer to a text, or NULL, and no array of characters: TEXT_IS_POINTER, which is 0,
 * does not compile with one. RT-safe. */
int text_find(const void *structs, size_t count, size_t stride, size_t offset, const char *text);

#define TEXT_IS_POINTER(member)                                                                    \
    _Generic((member), char ** : 0, const char ** : 0, const char *const * : 0, char *const * : 0)
#define TEXT_FIND(array, count, member, text)                                                      \
    text_find((array), (count), sizeof *(array),                                                   \
              offsetof(__typeof__(*(array)), member) + TEXT_IS_POINTER(&(array)->member), (text))
#define TEXT_INDEX(list, count, text) text_find((list), (count), sizeof *(list), 0, (text))

/* Returns the word nearest to `word` by edit distance; a swap of two letters is one edit. If no
 * word is near, returns the first one that begins with `word`, if `word` has at least three
 * letters. Else returns NULL. Near means a distance of at most 2 or a third of the length, if more.
 * `words` has `count` entries. */
const char *text_nearest(const char *word, const char *const *words, size_t count);

/* Does the same as text_nearest. The words are the first members (const char *) of `count` structs,
 * each of `size` bytes. */
const char *text_nearest_first(const char *word, const void *structs, size_t size, size_t count);

/* Formats the arguments after `format` of a variadic function into a character array. */
#define TEXT_FORMAT(text, format)                                                                  \
    do {                                                                                           \
        va_list arguments_;                                                                        \
        va_start(arguments_, format);                                                              \
        vsnprintf((text), sizeof(text), (format), arguments_);                                     \
        va_end(arguments_);                                                                        \
    } while (false)

#endif
