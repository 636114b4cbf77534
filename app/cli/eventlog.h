/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rate-limited log lines for a terminal or a log: of lines with the same key the first few in a
 * second are printed, the others are counted and summed up in one line. As long as a flood lasts
 * there is only that line, after 2 s, 4 s, ... and finally every minute. However many keys there
 * are, at most a few hundred lines are printed in a second. Time is passed in. Not RT-safe.
 */
#ifndef APP_CLI_EVENTLOG_H
#define APP_CLI_EVENTLOG_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum {
    EVENTLOG_KEYS = 64, /* keys at a time; further ones share one entry */
    EVENTLOG_BURST = 5, /* lines of one key printed in the first window, of one second */
    EVENTLOG_TEXT = 256,
};

/* The lines of one key in the present window. */
struct eventlog_entry {
    bool used;
    uint64_t key;
    int64_t since_ns, window_ns;
    uint64_t lines, held;     /* printed and held back in this window */
    char last[EVENTLOG_TEXT]; /* the last line held back */
};

struct eventlog {
    FILE *out;
    const char *clear; /* printed before each line: "" or the sequence that wipes a status line */
    const char *(*prefix)(uint64_t key); /* printed after clear; NULL = nothing */
    uint64_t printed, held;
    struct eventlog_entry entry[EVENTLOG_KEYS + 1]; /* the last one is shared */
};

/* Prints or suppresses one line (text without newline). */
void eventlog_put(struct eventlog *log, int64_t now_ns, uint64_t key, const char *text);

/* Prints summaries of lines suppressed in windows that have ended; `all`: in every window. */
void eventlog_flush(struct eventlog *log, int64_t now_ns, bool all);

#endif
