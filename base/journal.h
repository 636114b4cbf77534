/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Priorities of lines on standard error. systemd's journal reads a prefix such as "<4>" at the
 * beginning of a line (sd-daemon(3)). `journalctl -p warning` then shows only overruns, faults and
 * errors. Lines on a terminal or in a file have no prefix. Not RT-safe.
 */
#ifndef BASE_JOURNAL_H
#define BASE_JOURNAL_H

#include <stdbool.h>

/* The values are the priorities of syslog(3). */
enum journal_priority {
    JOURNAL_ERROR = 3,   /* the run ends, or a request is impossible */
    JOURNAL_WARNING = 4, /* deadlines, frames or boards are lost */
    JOURNAL_NOTICE = 5,  /* normal but important */
    JOURNAL_INFO = 6,
};

/* Returns the prefix of a line. It is "<3>" to "<6>" if standard error goes to the journal, else
 * "". */
const char *journal_prefix(enum journal_priority priority);

/* Returns the name of a priority: "error", "warning", "notice", "info". */
const char *journal_priority_name(enum journal_priority priority);

/* Checks whether a descriptor is the journal's stream. `stream` is the value of $JOURNAL_STREAM
 * ("DEVICE:INODE"); NULL = unset. */
bool journal_stream_is(const char *stream, int descriptor);

#endif
