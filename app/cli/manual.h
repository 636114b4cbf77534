/* SPDX-License-Identifier: Apache-2.0 */
/* Manuals (app/cli/manual/NAME.txt, in C as MANUAL_NAME of manual/NAME.h) with lists that the
 * program inserts. Not RT-safe. */
#ifndef APP_CLI_MANUAL_H
#define APP_CLI_MANUAL_H

#include <stddef.h>

/* Copies text with list in the place of the line "  @MARK@" (mark is "@MARK@"), which must be
 * there. list: lines with an end each, or "". Cut off at size. */
void manual_insert(char *out, size_t size, const char *text, const char *mark, const char *list);

#endif
