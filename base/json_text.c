/* SPDX-License-Identifier: Apache-2.0 */
/* Escapes text for JSON. */
#include "base/json_text.h"

#include "base/text.h"

#include <string.h>

enum { UTF8_MAX = 4, ESCAPED_MAX = 8 };

/* Escapes the next character and moves *text behind it. Returns the number of bytes written. */
static size_t json_text_escape(const char **text, char to[ESCAPED_MAX])
{
    const char *at = *text;
    size_t bytes;

    if (*at == '"' || *at == '\\') {
        to[0] = '\\';
        to[1] = *at;
        *text += 1;
        return 2;
    }
    if ((unsigned char)*at < 0x20) {
        *text += 1;
        return (size_t)snprintf(to, ESCAPED_MAX, "\\u%04x", (unsigned)(unsigned char)*at);
    }
    bytes = text_utf8_length(at, strnlen(at, UTF8_MAX));
    if (bytes == 0) {
        to[0] = '?';
        *text += 1;
        return 1;
    }
    memcpy(to, at, bytes);
    *text += bytes;
    return bytes;
}

size_t json_text_quote(const char *text, char *to)
{
    char *at = to;

    *at++ = '"';
    while (*text) {
        char escaped[ESCAPED_MAX];
        size_t size = json_text_escape(&text, escaped);

        memcpy(at, escaped, size);
        at += size;
    }
    *at++ = '"';
    *at = '\0';
    return (size_t)(at - to);
}

void json_text_put(const char *text, FILE *out)
{
    putc('"', out);
    while (*text) {
        char escaped[ESCAPED_MAX];

        fwrite(escaped, 1, json_text_escape(&text, escaped), out);
    }
    putc('"', out);
}
