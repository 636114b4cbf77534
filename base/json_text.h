/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Quotes text as a JSON string. The result is valid for any input. A byte that is not UTF-8 becomes
 * "?".
 */
#ifndef BASE_JSON_TEXT_H
#define BASE_JSON_TEXT_H

#include <stddef.h>
#include <stdio.h>

/* Size of a buffer that is large enough for any text of `size` bytes, with quotes and final
 * zero. */
#define JSON_TEXT_ROOM(size) (6 * (size) + 3)

/* Writes text as a JSON string with a final zero. Returns its length without the zero. RT-safe. */
size_t json_text_quote(const char *text, char *to);

/* Writes text as a JSON string to a stream. Not RT-safe. */
void json_text_put(const char *text, FILE *out);

#endif
