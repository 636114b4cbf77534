/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the system gives to a real-time thread: a FIFO priority, locked memory, a processor of its
 * own, idle states that are left at once. Each is taken when it is allowed; when it is not, one warning says why and what would help.
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
    bool awake; /* /dev/cpu_dma_latency is held at 0 until the process ends */
    size_t count;
    char warning[REALTIME_WARNINGS_MAX][256];
};

/* Applies what it can to the calling thread, touches its stack, and reports the rest. That the idle
 * states could not be had is no warning: many machines have none that matter. */
void realtime_apply(const struct realtime_config *config, struct realtime_report *report);

/* Brings into memory what a loop uses beside its arena, for any clock: the calling thread's stack, and
 * the code and data of the program and its libraries, whose pages the system else maps at their first
 * use. */
void realtime_touch(void);

#endif
