/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How grave a line on standard error is, for systemd's journal: it reads the "<4>" that a line may
 * begin with, so that `journalctl -p warning` shows overruns and faults and leaves the rest out. On a
 * terminal and in files there is no such prefix. Not RT-safe.
 */
#ifndef BASE_JOURNAL_H
#define BASE_JOURNAL_H

#include <stdbool.h>

/* The numbers are those of syslog(3). */
enum journal_priority {
    JOURNAL_ERROR = 3,   /* the run ends, or does not do what it was told */
    JOURNAL_WARNING = 4, /* deadlines, frames or boards are lost */
    JOURNAL_NOTICE = 5,  /* normal, and worth a look */
    JOURNAL_INFO = 6,
};

/* What a line begins with: "<3>" to "<6>" when standard error goes to the journal, else "". */
const char *journal_prefix(enum journal_priority priority);

/* Whether stream, the value of $JOURNAL_STREAM ("DEVICE:INODE", NULL = unset), is this open file. */
bool journal_stream_is(const char *stream, int descriptor);

#endif
