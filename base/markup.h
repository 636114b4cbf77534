/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Text inside XML, HTML and SVG, as content or as an attribute's value between double quotes:
 * whatever the text is, the document stays well-formed UTF-8 on one line. Not RT-safe.
 *
 *     &  <  >  "                                 their entities
 *     a line break, a tab                        a space
 *     other control characters, invalid UTF-8    ? for each byte
 */
#ifndef BASE_MARKUP_H
#define BASE_MARKUP_H

#include <stdio.h>

enum markup_flag {
    MARKUP_ASCII = 1,       /* every byte that is not ASCII becomes ? */
    MARKUP_LINE_BREAKS = 2, /* a line break becomes &#10;, which a reader turns back into one */
};

/* Writes text escaped. NULL is the empty text. */
void markup_put(FILE *out, const char *text);

/* The same; flags are a sum of enum markup_flag. */
void markup_put_flags(FILE *out, const char *text, unsigned flags);

#endif
