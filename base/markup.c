/* SPDX-License-Identifier: Apache-2.0 */
/* Escaping of text for markup. */
#include "base/markup.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Bytes of the UTF-8 character that at begins with, 0 when it begins with none that XML can hold.
 * at ends in a zero, which is no continuation byte. */
static size_t markup_character_bytes(const unsigned char *at)
{
    static const uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
    const size_t bytes = at[0] < 0x80 ? 1 : at[0] >> 5 == 6 ? 2 : at[0] >> 4 == 14 ? 3 : 4;
    uint32_t code;

    if (bytes == 1) {
        return at[0] >= 0x20 && at[0] != 0x7f;
    }
    if (bytes == 4 && at[0] >> 3 != 30) {
        return 0;
    }
    code = at[0] & (0x7fu >> bytes);
    for (size_t i = 1; i < bytes; i++) {
        if (at[i] >> 6 != 2) {
            return 0;
        }
        code = code << 6 | (at[i] & 0x3f);
    }
    /* Overlong forms, surrogates and what lies beyond Unicode are no characters */
    if (code < smallest[bytes] || (code >= 0xd800 && code <= 0xdfff) || code > 0x10ffff ||
        code == 0xfffe || code == 0xffff) {
        return 0;
    }
    return bytes;
}

/* Writes the entity or the space that stands for a character; false when it stands for itself. */
static bool markup_put_entity(FILE *out, unsigned char character, unsigned flags)
{
    switch (character) {
    case '&':
        fputs("&amp;", out);
        return true;
    case '<':
        fputs("&lt;", out);
        return true;
    case '>':
        fputs("&gt;", out);
        return true;
    case '"':
        fputs("&quot;", out);
        return true;
    case '\n':
        fputs(flags & MARKUP_LINE_BREAKS ? "&#10;" : " ", out);
        return true;
    case '\r':
    case '\t':
        putc(' ', out);
        return true;
    default:
        return false;
    }
}

void markup_put_flags(FILE *out, const char *text, unsigned flags)
{
    const unsigned char *at = (const unsigned char *)(text ? text : "");

    while (*at) {
        size_t bytes = flags & MARKUP_ASCII && *at >= 0x80 ? 0 : markup_character_bytes(at);

        if (markup_put_entity(out, *at, flags)) {
            at++;
        } else if (bytes == 0) {
            putc('?', out);
            at++;
        } else {
            fwrite(at, 1, bytes, out);
            at += bytes;
        }
    }
}

void markup_put(FILE *out, const char *text)
{
    markup_put_flags(out, text, 0);
}
