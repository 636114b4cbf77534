/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the system gives to a real-time thread: a FIFO priority, locked memory, a processor of its
 * own. Each is taken when it is allowed; when it is not, one warning says why and what would help.
 * Not RT-safe: call it before the loop.
 */
#ifndef RT_REALTIME_H
#define RT_REALTIME_H

#include <stdbool.h>
#include <stddef.h>

struct realtime_config {
    int priority;     /* SCHED_FIFO priority of the calling thread, 1-99; 0 = leave it alone */
    bool lock_memory; /* mlockall, now and for what comes, page by page as it is touched */
    int cpu;          /* the calling thread stays on this processor; -1 = anywhere */
};

enum { REALTIME_WARNINGS_MAX = 4 };

struct realtime_report {
    bool fifo, locked, pinned;
    size_t count;
    char warning[REALTIME_WARNINGS_MAX][256];
};

/* Applies what it can to the calling thread, touches its stack, and reports the rest. */
void realtime_apply(const struct realtime_config *config, struct realtime_report *report);

#endif
