/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Text as a string of JSON, with its quotes: whatever the text is, the result is a string that
 * every reader takes. Bytes that are no UTF-8 become "?".
 */
#ifndef BASE_JSON_TEXT_H
#define BASE_JSON_TEXT_H

#include <stddef.h>
#include <stdio.h>

/* Room that a text of size bytes may need, with the quotes and a terminating zero. */
#define JSON_TEXT_ROOM(size) (6 * (size) + 3)

/* Writes a text as a JSON string into a buffer, with a zero; returns its length without that.
 * RT-safe. */
size_t json_text_quote(const char *text, char *to);

/* Writes a text as a JSON string into a stream. Not RT-safe. */
void json_text_put(const char *text, FILE *out);

#endif
