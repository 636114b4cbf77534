/* SPDX-License-Identifier: Apache-2.0 */
/* Strict reading of what people write: whole-string numbers, names, UTF-8, and the nearest known
 * word. Not RT-safe. */
#ifndef BASE_TEXT_H
#define BASE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Reads the whole of text as a finite double in the C locale's notation; no spaces around it, no
 * inf or nan, no hexadecimal. False leaves *value alone. */
bool text_to_double(const char *text, double *value);

/* Reads the whole of text as a decimal or 0x-prefixed integer within [min, max]; false leaves
 * *value alone. */
bool text_to_int(const char *text, int64_t min, int64_t max, int64_t *value);

/* Checks whether text can be a name: 1 to 63 letters, digits and _ - . only, so that it may
 * stand in messages, on command lines and in file names; not "." or "..". */
bool text_is_name(const char *text);

/* Returns the bytes of the UTF-8 character that text begins with, at most size; 0 = none:
 * overlong forms, surrogates and codes beyond Unicode are no characters. */
size_t text_utf8_length(const char *text, size_t size);

/* Replaces by '?' what a terminal may obey instead of show: control characters but tab, C1 controls
 * in UTF-8 too, and bytes that are no UTF-8. The length stays. */
void text_make_printable(char *text);

/* Finds the word of the list that is nearest to `word` by edit distance, in which two swapped
 * letters are one edit, else the first that begins with it, from three letters on; NULL = none is
 * near enough to be worth naming (distance over a third of the length, at least 2). words has count
 * entries. */
const char *text_nearest(const char *word, const char *const *words, size_t count);

/* The same of the words that are the first members of count structs of a size. */
const char *text_nearest_first(const char *word, const void *structs, size_t size, size_t count);

#endif
