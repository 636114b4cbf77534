/* SPDX-License-Identifier: Apache-2.0 */
/* Escapes text for XML, HTML and SVG. */
#include "base/markup.h"

#include "base/text.h"

#include <string.h>

enum { UTF8_MAX = 4 /* longest character, bytes */ };

/* Returns the length in bytes of the first character of `text`; 0 = invalid in XML. */
static size_t markup_character_bytes(const char *text)
{
    const unsigned char first = (unsigned char)*text;

    /* XML excludes U+FFFE and U+FFFF, although their UTF-8 is valid */
    if (first < 0x20 || first == 0x7f || strncmp(text, "\xef\xbf\xbe", 3) == 0 ||
        strncmp(text, "\xef\xbf\xbf", 3) == 0) {
        return 0;
    }
    return text_utf8_length(text, strnlen(text, UTF8_MAX));
}

/* Writes the entity of a character, or a space in its place. Returns false if the character needs
 * no escape. */
static bool markup_put_entity(FILE *out, char character, unsigned flags)
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
    const char *at = text ? text : "";

    while (*at) {
        const bool ascii = (unsigned char)*at < 0x80;
        const size_t bytes = flags & MARKUP_ASCII && !ascii ? 0 : markup_character_bytes(at);

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
