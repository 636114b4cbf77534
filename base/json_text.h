/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Quotes text as a JSON string. The result is valid for any input: bytes that are not UTF-8 become
 * "?".
 */
#ifndef BASE_JSON_TEXT_H
#define BASE_JSON_TEXT_H

#include <stddef.h>
#include <stdio.h>

/* Largest buffer for a text of size bytes, with quotes and terminating zero. */
#define JSON_TEXT_ROOM(size) (6 * (size) + 3)

/* Writes a text as a JSON string with terminating zero. Returns its length without the zero.
 * RT-safe. */
size_t json_text_quote(const char *text, char *to);

/* Writes a text as a JSON string into a stream. Not RT-safe. */
void json_text_put(const char *text, FILE *out);

#endif
