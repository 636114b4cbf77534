/* SPDX-License-Identifier: Apache-2.0 */
/* Strict parsing of text that people write: whole-string numbers, names, UTF-8, and the nearest
 * known word. Not RT-safe. */
#ifndef BASE_TEXT_H
#define BASE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Reads the whole text as a finite double in C notation, without surrounding spaces, inf, nan or
 * hexadecimal. On false, *value is unchanged. */
bool text_to_double(const char *text, double *value);

/* Reads the whole text as a decimal or 0x-prefixed integer within [min, max]. On false, *value is
 * unchanged. */
bool text_to_int(const char *text, int64_t min, int64_t max, int64_t *value);

/* Checks whether text is a valid name: 1 to 63 letters, digits and _ - . except "." and "..". Such
 * a name is safe in messages, command lines and file names. */
bool text_is_name(const char *text);

/* Returns the length in bytes of the UTF-8 character at the beginning of text, at most size; 0 =
 * invalid. Overlong forms, surrogates and codes beyond Unicode are invalid. */
size_t text_utf8_length(const char *text, size_t size);

/* Replaces characters that could control a terminal by '?': control characters except tab, C1
 * controls in UTF-8, and bytes that are not UTF-8. The length stays. */
void text_make_printable(char *text);

/* Finds the nearest word by edit distance, where two swapped letters are one edit; else the first
 * word that begins with `word`, if it has at least three letters. Returns NULL when none is near
 * (distance above a third of the length, at least 2). words has count entries. */
const char *text_nearest(const char *word, const char *const *words, size_t count);

/* Does the same with the first members of count structs of a size. */
const char *text_nearest_first(const char *word, const void *structs, size_t size, size_t count);

#endif
