/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the priority prefixes of sd-daemon(3). */
#include "base/journal.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

bool journal_stream_is(const char *stream, int descriptor)
{
    unsigned long long device, inode;
    struct stat file;
    char rest;

    return stream && sscanf(stream, "%llu:%llu%c", &device, &inode, &rest) == 2 &&
           fstat(descriptor, &file) == 0 && device == file.st_dev && inode == file.st_ino;
}

const char *journal_prefix(enum journal_priority priority)
{
    static const char *const prefix[] = {
        [JOURNAL_ERROR] = "<3>",
        [JOURNAL_WARNING] = "<4>",
        [JOURNAL_NOTICE] = "<5>",
        [JOURNAL_INFO] = "<6>",
    };

    return journal_stream_is(getenv("JOURNAL_STREAM"), STDERR_FILENO) ? prefix[priority] : "";
}

const char *journal_priority_name(enum journal_priority priority)
{
    static const char *const name[] = {
        [JOURNAL_ERROR] = "error",
        [JOURNAL_WARNING] = "warning",
        [JOURNAL_NOTICE] = "notice",
        [JOURNAL_INFO] = "info",
    };

    return name[priority];
}
