/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Escapes text for XML, HTML and SVG, as content or as an attribute's value in double quotes. For
 * any input, the document stays well-formed UTF-8 on one line. Not RT-safe.
 *
 *     &  <  >  "                                 their entities
 *     a line break, a tab                        a space
 *     other control characters, invalid UTF-8    ? for each byte
 */
#ifndef BASE_MARKUP_H
#define BASE_MARKUP_H

#include <stdio.h>

enum markup_flag {
    MARKUP_ASCII = 1,       /* each non-ASCII byte becomes ? */
    MARKUP_LINE_BREAKS = 2, /* a line break becomes &#10;, from which a reader restores it */
};

/* Writes escaped text; NULL = empty. */
void markup_put(FILE *out, const char *text);

/* Does the same as markup_put; `flags` is a bit mask of enum markup_flag. */
void markup_put_flags(FILE *out, const char *text, unsigned flags);

#endif
