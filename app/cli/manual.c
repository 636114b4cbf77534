/* SPDX-License-Identifier: Apache-2.0 */
/* Inserts lists into manuals. */
#include "app/cli/manual.h"

#include <stdio.h>
#include <string.h>

void manual_insert(char *out, size_t size, const char *text, const char *mark, const char *list)
{
    const char *at = strstr(text, mark), *line = at, *rest = at + strlen(mark);
    size_t length = strlen(list);

    /* The mark's line goes, with its indent; the list's last line ends where the mark's did */
    while (line > text && line[-1] == ' ') {
        line--;
    }
    length -= length > 0 && list[length - 1] == '\n';
    snprintf(out, size, "%.*s%.*s%s", (int)(line - text), text, (int)length, list, rest);
}
