/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Priorities of lines on standard error for systemd's journal, which reads a "<4>" at the beginning
 * of a line (sd-daemon(3)). `journalctl -p warning` thus shows overruns and faults only. On a
 * terminal and in files there is no prefix. Not RT-safe.
 */
#ifndef BASE_JOURNAL_H
#define BASE_JOURNAL_H

#include <stdbool.h>

/* The numbers are those of syslog(3). */
enum journal_priority {
    JOURNAL_ERROR = 3,   /* the run ends, or a request is impossible */
    JOURNAL_WARNING = 4, /* deadlines, frames or boards are lost */
    JOURNAL_NOTICE = 5,  /* normal, but noteworthy */
    JOURNAL_INFO = 6,
};

/* Returns the prefix of a line: "<3>" to "<6>" when standard error goes to the journal, else "". */
const char *journal_prefix(enum journal_priority priority);

/* Returns the name of a priority: "error", "warning", "notice", "info". */
const char *journal_priority_name(enum journal_priority priority);

/* Checks whether stream, the value of $JOURNAL_STREAM ("DEVICE:INODE", NULL = unset), is the file
 * of the descriptor. */
bool journal_stream_is(const char *stream, int descriptor);

#endif
