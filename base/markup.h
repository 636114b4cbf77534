/* SPDX-License-Identifier: Apache-2.0 */
/* Text inside HTML and SVG. Not RT-safe. */
#ifndef BASE_MARKUP_H
#define BASE_MARKUP_H

#include <stdio.h>

/* Writes text with the characters escaped that markup keeps to itself; control characters, which XML
 * does not take at all, become spaces. NULL is nothing. */
void markup_put(FILE *out, const char *text);

#endif
